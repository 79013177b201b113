//! Stops and resets that a program knows of: what others order while it waits is not overruled by what it does next.

use crate::order::seconds;
use shared_types::message::ControllerState;

/// The orders from before the program began, those from before the controller was started, and the program's own.
#[derive(Clone, Copy, Debug)]
pub(crate) struct KnownOrders {
    /// The controller of the first state that was looked at.
    instance: Option<u64>,
    /// Orders are known until then, nanoseconds of `CLOCK_MONOTONIC`.
    until_ns: i64,
}

/// Why a program does not go on.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Overruled {
    #[error(
        "a stop or a reset that was not ordered here was given at {} (by somebody else, or by the daemon, which also stops what a daemon before it has published: see the logs)",
        seconds(*.at_ns)
    )]
    Ordered { at_ns: i64 },
    #[error("the controller was started anew at {}", seconds(*.at_ns))]
    Restarted { at_ns: i64 },
}

impl KnownOrders {
    /// All orders until now. To be noted before a program waits for anything.
    pub(crate) fn until(now_ns: i64) -> Self {
        Self {
            instance: None,
            until_ns: now_ns,
        }
    }

    /// Knows the program's own stop or reset, which was answered at `answered_ns`: the controller dates it before.
    pub(crate) fn add_own(&mut self, answered_ns: i64) {
        self.until_ns = self.until_ns.max(answered_ns);
    }

    /// Whether this is a state of the controller that was met first, or the first one.
    pub(crate) fn is_same_controller(&self, values: &ControllerState) -> bool {
        self.instance.is_none_or(|known| known == values.instance)
    }

    /// # Errors
    /// [`Overruled`] where a state tells of a stop, a reset or another start of the controller that is not known.
    pub(crate) fn check(&mut self, values: &ControllerState) -> Result<(), Overruled> {
        // A controller's own start is no order: it forgets requests just before it takes its time for its instance.
        let started_ns = i64::try_from(values.instance).unwrap_or(0);
        if !self.is_same_controller(values) {
            return Err(Overruled::Restarted { at_ns: started_ns });
        }
        self.instance = Some(values.instance);
        let at_ns = values.wanted_from_mono_ns;
        if at_ns > self.until_ns.max(started_ns) {
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
    fn orders_of_others_are_not_known_and_own_ones_are() {
        let mut known = KnownOrders::until(100);
        assert_eq!(known.check(&values(7, 100)), Ok(()));
        assert_eq!(known.check(&values(7, 150)), ordered(150));
        known.add_own(200);
        assert_eq!(known.check(&values(7, 150)), Ok(()));
        assert_eq!(known.check(&values(7, 201)), ordered(201));
        known.add_own(190);
        assert_eq!(known.check(&values(7, 201)), ordered(201));
        assert_eq!(known.check(&values(7, 200)), Ok(()));
    }

    #[test]
    fn an_order_that_the_first_state_seen_tells_of_is_not_taken_for_one_of_before() {
        assert_eq!(
            KnownOrders::until(100).check(&values(7, 150)),
            ordered(150),
            "a controller that was there"
        );
        let mut known = KnownOrders::until(100);
        assert_eq!(known.check(&values(130, 129)), Ok(()), "one that starts");
        assert_eq!(known.check(&values(130, 150)), ordered(150));
    }

    #[test]
    fn another_controller_is_told_from_an_order() {
        let mut known = KnownOrders::until(100);
        assert_eq!(known.check(&values(7, 100)), Ok(()));
        let another = values(1_500_000_000, 1_499_999_999);
        assert!(!known.is_same_controller(&another));
        let error = known.check(&another).unwrap_err();
        assert!(error.to_string().contains("anew at 1.500000000 s"));
        let error = known.check(&values(7, 1_500_000_000)).unwrap_err();
        assert!(error.to_string().contains("given at 1.500000000 s"));
    }
}
