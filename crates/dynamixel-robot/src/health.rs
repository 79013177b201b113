//! What is wrong with the servos, by their answers.

use std::time::{Duration, Instant};

use shared_types::codes::MotorFault;

/// Time for which a tendon may be slack: a motion that gives way fast is no loss of tension.
const SLACK_FOR: Duration = Duration::from_millis(200);

/// The servos' answers so far.
pub(crate) struct Health {
    silent_after: Duration,
    heard: Vec<Instant>,
    tense: Vec<Instant>,
    in_error: Vec<bool>,
    /// Whether the line takes nothing any more.
    line_is_lost: bool,
    /// Whether the servos' watchdogs have stopped them.
    watchdogs_have_tripped: bool,
    /// Whether a servo has forgotten its home.
    homeless: bool,
}

impl Health {
    /// Servos that have all answered now.
    pub(crate) fn new(servos: usize, silent_after: Duration, now: Instant) -> Self {
        Self {
            silent_after,
            heard: vec![now; servos],
            tense: vec![now; servos],
            in_error: vec![false; servos],
            line_is_lost: false,
            watchdogs_have_tripped: false,
            homeless: false,
        }
    }

    /// A servo has answered; returns whether it was silent before.
    pub(crate) fn hear(
        &mut self,
        now: Instant,
        tendon: usize,
        is_in_error: bool,
        is_slack: bool,
    ) -> bool {
        let was_silent = now - self.heard[tendon] > self.silent_after;
        self.heard[tendon] = now;
        if !is_slack {
            self.tense[tendon] = now;
        }
        self.in_error[tendon] |= is_in_error;
        was_silent
    }

    pub(crate) fn lose_line(&mut self) {
        self.line_is_lost = true;
    }

    /// A servo heard nothing for longer than its watchdog bears.
    pub(crate) fn trip_watchdogs(&mut self) {
        self.watchdogs_have_tripped = true;
    }

    pub(crate) fn watchdogs_have_tripped(&self) -> bool {
        self.watchdogs_have_tripped
    }

    pub(crate) fn lose_home(&mut self) {
        self.homeless = true;
    }

    /// The worst that is wrong, and the tendon that it is about.
    pub(crate) fn fault(&self, now: Instant) -> (MotorFault, Option<usize>) {
        let is_silent = |heard: &Instant| now - *heard > self.silent_after;
        let is_lost = self.line_is_lost || self.watchdogs_have_tripped;
        if is_lost || self.heard.iter().all(is_silent) {
            return (MotorFault::Bus, None);
        }
        if let Some(tendon) = self.in_error.iter().position(|it| *it) {
            return (MotorFault::Motor, Some(tendon));
        }
        if self.homeless {
            return (MotorFault::Motor, None);
        }
        let is_slack = |tense: &Instant| now - *tense > SLACK_FOR;
        let missing = self.heard.iter().position(is_silent);
        let missing = missing.or_else(|| self.tense.iter().position(is_slack));
        match missing {
            Some(tendon) => (MotorFault::Sensor, Some(tendon)),
            None => (MotorFault::None, None),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    #[test]
    fn the_worst_is_told_first_and_what_passes_is_forgotten() {
        let begun = Instant::now();
        let at = |ms: u32| begun + ms * MS;
        let mut health = Health::new(2, 20 * MS, begun);
        assert_eq!(health.fault(at(20)), (MotorFault::None, None));
        assert!(health.hear(at(21), 0, false, false), "it was silent");
        assert!(!health.hear(at(22), 0, false, false));
        assert_eq!(health.fault(at(22)), (MotorFault::Sensor, Some(1)));
        assert_eq!(health.fault(at(43)), (MotorFault::Bus, None));
        for tendon in 0..2 {
            health.hear(at(43), tendon, false, false);
        }
        assert_eq!(health.fault(at(43)), (MotorFault::None, None));
        health.hear(at(44), 1, true, false);
        health.hear(at(45), 1, false, false);
        assert_eq!(health.fault(at(45)), (MotorFault::Motor, Some(1)));
        health.lose_line();
        assert_eq!(health.fault(at(45)), (MotorFault::Bus, None));
    }

    #[test]
    fn a_tendon_may_be_slack_for_a_moment() {
        let begun = Instant::now();
        let mut health = Health::new(1, 9_000 * MS, begun);
        health.hear(begun + SLACK_FOR, 0, false, true);
        assert_eq!(health.fault(begun + SLACK_FOR).0, MotorFault::None);
        let later = begun + SLACK_FOR + MS;
        health.hear(later, 0, false, true);
        assert_eq!(health.fault(later), (MotorFault::Sensor, Some(0)));
        health.hear(later, 0, false, false);
        assert_eq!(health.fault(later).0, MotorFault::None);
    }
}
