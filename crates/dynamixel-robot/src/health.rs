//! What is wrong with the servos, by their answers.

use std::time::{Duration, Instant};

use shared_types::codes::MotorFault;

/// Time for which a tendon may be slack: a motion that gives way fast is no loss of tension.
const SLACK_FOR: Duration = Duration::from_millis(200);

/// The servos' answers so far, by the time of the driver's cycles.
pub(crate) struct Health {
    silent_after: Duration,
    /// Most that a cycle counts for: a driver that was held up could hear nobody.
    longest_cycle: Duration,
    /// When the cycle began, and the time that counts until then.
    cycle_began: Instant,
    looked_for: Duration,
    /// The time that counted when each servo was heard last, and when its tendon was tense.
    heard: Vec<Duration>,
    tense: Vec<Duration>,
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
    pub(crate) fn new(
        servos: usize,
        silent_after: Duration,
        longest_cycle: Duration,
        now: Instant,
    ) -> Self {
        Self {
            silent_after,
            longest_cycle,
            cycle_began: now,
            looked_for: Duration::ZERO,
            heard: vec![Duration::ZERO; servos],
            tense: vec![Duration::ZERO; servos],
            in_error: vec![false; servos],
            line_is_lost: false,
            watchdogs_have_tripped: false,
            homeless: false,
        }
    }

    /// Begins a cycle; returns whether the driver was held up for so long before that any servo may have lost its power meanwhile.
    pub(crate) fn begin_cycle(&mut self, now: Instant) -> bool {
        let elapsed = now - self.cycle_began;
        self.looked_for += elapsed.min(self.longest_cycle);
        self.cycle_began = now;
        elapsed > self.silent_after
    }

    /// A servo has answered; returns whether it was silent before.
    pub(crate) fn hear(&mut self, tendon: usize, is_in_error: bool, is_slack: bool) -> bool {
        let was_silent = self.looked_for - self.heard[tendon] > self.silent_after;
        self.heard[tendon] = self.looked_for;
        if !is_slack {
            self.tense[tendon] = self.looked_for;
        }
        self.in_error[tendon] |= is_in_error;
        was_silent
    }

    pub(crate) fn lose_line(&mut self) {
        self.line_is_lost = true;
    }

    pub(crate) fn line_is_lost(&self) -> bool {
        self.line_is_lost
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
    pub(crate) fn fault(&self) -> (MotorFault, Option<usize>) {
        let is_silent = |heard: &Duration| self.looked_for - *heard > self.silent_after;
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
        let is_slack = |tense: &Duration| self.looked_for - *tense > SLACK_FOR;
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
        let mut health = Health::new(2, 20 * MS, 100 * MS, begun);
        let begin = |health: &mut Health, ms: u32| health.begin_cycle(begun + ms * MS);
        begin(&mut health, 20);
        assert_eq!(health.fault(), (MotorFault::None, None));
        begin(&mut health, 21);
        assert!(health.hear(0, false, false), "it was silent");
        begin(&mut health, 22);
        assert!(!health.hear(0, false, false));
        assert_eq!(health.fault(), (MotorFault::Sensor, Some(1)));
        begin(&mut health, 43);
        assert_eq!(health.fault(), (MotorFault::Bus, None));
        for tendon in 0..2 {
            health.hear(tendon, false, false);
        }
        assert_eq!(health.fault(), (MotorFault::None, None));
        health.hear(1, true, false);
        health.hear(1, false, false);
        assert_eq!(health.fault(), (MotorFault::Motor, Some(1)));
        health.lose_line();
        assert_eq!(health.fault(), (MotorFault::Bus, None));
    }

    #[test]
    fn a_tendon_may_be_slack_for_a_moment() {
        let begun = Instant::now();
        let mut health = Health::new(1, 9_000 * MS, 9_000 * MS, begun);
        health.begin_cycle(begun + SLACK_FOR);
        health.hear(0, false, true);
        assert_eq!(health.fault().0, MotorFault::None);
        health.begin_cycle(begun + SLACK_FOR + MS);
        health.hear(0, false, true);
        assert_eq!(health.fault(), (MotorFault::Sensor, Some(0)));
        health.hear(0, false, false);
        assert_eq!(health.fault().0, MotorFault::None);
    }

    #[test]
    fn while_the_driver_is_held_up_no_servo_is_silent_for_longer_than_a_cycle() {
        let mut now = Instant::now();
        let mut health = Health::new(1, 20 * MS, 8 * MS, now);
        for _ in 0..2 {
            now += 500 * MS;
            assert!(health.begin_cycle(now));
            assert_eq!(health.fault(), (MotorFault::None, None));
        }
        now += 8 * MS;
        assert!(!health.begin_cycle(now));
        assert_eq!(health.fault(), (MotorFault::Bus, None), "three cycles");
    }
}
