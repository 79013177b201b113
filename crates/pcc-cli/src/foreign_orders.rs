//! Stops and resets that somebody else has ordered while a program waits: it does not overrule them by what it does next.

use crate::order::seconds;
use shared_types::message::ControllerState;

/// Tells stops and resets of others from those that do not count: orders from before the program or the controller began, and the
/// program's own.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ForeignOrders {
    /// The instance of the controller that published the first state checked.
    instance: Option<u64>,
    /// Orders up to this time do not count, nanoseconds of `CLOCK_MONOTONIC`.
    ignored_until_ns: i64,
}

/// Why a program does not go on: somebody else has given an order.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Overruled {
    #[error(
        "a stop or a reset that was not ordered here was given at {} (by somebody else, or by the daemon, which also stops what a daemon before it has published: see the logs)",
        seconds(*.at_ns)
    )]
    Ordered { at_ns: i64 },
    #[error("the controller was started anew at {}", seconds(*.at_ns))]
    Restarted { at_ns: i64 },
    #[error("the goal is not pursued any more: {reason}")]
    GoalEnded { reason: String },
}

impl ForeignOrders {
    /// Counts orders after `now_ns` (nanoseconds of `CLOCK_MONOTONIC`), the time before a program waits for anything.
    pub(crate) fn since(now_ns: i64) -> Self {
        Self {
            instance: None,
            ignored_until_ns: now_ns,
        }
    }

    /// Ignores the program's own stop or reset, which was answered at `answered_ns`: the controller dates it before.
    pub(crate) fn ignore_own(&mut self, answered_ns: i64) {
        self.ignored_until_ns = self.ignored_until_ns.max(answered_ns);
    }

    /// Whether a state is of the controller that published the first state checked; true before any was.
    pub(crate) fn is_same_controller(&self, values: &ControllerState) -> bool {
        self.instance.is_none_or(|known| known == values.instance)
    }

    /// Looks for orders of others in a state of the controller.
    ///
    /// # Errors
    /// [`Overruled`] where somebody else has ordered a stop or a reset, or the controller was started anew.
    pub(crate) fn check(&mut self, values: &ControllerState) -> Result<(), Overruled> {
        // A controller's own start is no order: it forgets requests just before it takes its time for its instance.
        let started_ns = i64::try_from(values.instance).unwrap_or(0);
        if !self.is_same_controller(values) {
            return Err(Overruled::Restarted { at_ns: started_ns });
        }
        self.instance = Some(values.instance);
        let at_ns = values.wanted_from_mono_ns;
        if at_ns > self.ignored_until_ns.max(started_ns) {
            return Err(Overruled::Ordered { at_ns });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(instance: u64, wanted_from_mono_ns: i64) -> ControllerState {
        ControllerState {
            instance,
            wanted_from_mono_ns,
            ..ControllerState::ZEROED
        }
    }

    fn ordered(at_ns: i64) -> Result<(), Overruled> {
        Err(Overruled::Ordered { at_ns })
    }

    #[test]
    fn orders_of_others_count_and_own_ones_do_not() {
        let mut orders = ForeignOrders::since(100);
        assert_eq!(orders.check(&values(7, 100)), Ok(()));
        assert_eq!(orders.check(&values(7, 150)), ordered(150));
        orders.ignore_own(200);
        assert_eq!(orders.check(&values(7, 150)), Ok(()));
        assert_eq!(orders.check(&values(7, 201)), ordered(201));
        orders.ignore_own(190);
        assert_eq!(orders.check(&values(7, 201)), ordered(201));
        assert_eq!(orders.check(&values(7, 200)), Ok(()));
    }

    #[test]
    fn an_order_that_the_first_state_seen_tells_of_is_not_taken_for_one_of_before() {
        assert_eq!(
            ForeignOrders::since(100).check(&values(7, 150)),
            ordered(150),
            "a controller that was there"
        );
        let mut orders = ForeignOrders::since(100);
        assert_eq!(orders.check(&values(130, 129)), Ok(()), "one that starts");
        assert_eq!(orders.check(&values(130, 150)), ordered(150));
    }

    #[test]
    fn another_controller_is_told_from_an_order() {
        let mut orders = ForeignOrders::since(100);
        assert_eq!(orders.check(&values(7, 100)), Ok(()));
        let another = values(1_500_000_000, 1_499_999_999);
        assert!(!orders.is_same_controller(&another));
        let error = orders.check(&another).unwrap_err();
        assert!(error.to_string().contains("anew at 1.500000000 s"));
        let error = orders.check(&values(7, 1_500_000_000)).unwrap_err();
        assert!(error.to_string().contains("given at 1.500000000 s"));
    }
}
