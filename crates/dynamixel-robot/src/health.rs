//! What is wrong with the servos, by their answers.

use std::time::{Duration, Instant};

use shared_types::codes::MotorFault;

/// Time for which a tendon may be slack: a motion that gives way fast is no loss of tension.
const SLACK_FOR: Duration = Duration::from_millis(200);

/// Times of silence, and what each of them means.
#[derive(Clone, Copy)]
pub(crate) struct Patience {
    /// Time without an answer after which a servo is silent.
    pub(crate) silent_after: Duration,
    /// Time without an answer after which a servo may have lost its power, or its watchdog may have stopped it.
    pub(crate) marks_after: Duration,
    /// Most that a cycle counts for: a driver that was held up could hear nobody.
    pub(crate) longest_cycle: Duration,
}

/// The servos' answers so far, by the time of the driver's cycles.
pub(crate) struct Health {
    patience: Patience,
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
    pub(crate) fn new(servos: usize, patience: Patience, now: Instant) -> Self {
        Self {
            patience,
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

    /// Begins a cycle; returns whether the driver was held up for so long before that the mark and the watchdog of every servo are to be read.
    pub(crate) fn begin_cycle(&mut self, now: Instant) -> bool {
        let elapsed = now - self.cycle_began;
        self.looked_for += elapsed.min(self.patience.longest_cycle);
        self.cycle_began = now;
        elapsed > self.patience.marks_after
    }

    /// A servo has answered; returns whether it had not for so long that its mark and its watchdog are to be read.
    pub(crate) fn hear(&mut self, tendon: usize, is_in_error: bool, is_slack: bool) -> bool {
        let was_unheard = self.looked_for - self.heard[tendon] > self.patience.marks_after;
        self.heard[tendon] = self.looked_for;
        if !is_slack {
            self.tense[tendon] = self.looked_for;
        }
        self.in_error[tendon] |= is_in_error;
        was_unheard
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
        let Patience { silent_after, .. } = self.patience;
        let is_silent = |heard: &Duration| self.looked_for - *heard > silent_after;
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
        // A reply that is lost says nothing of a tendon.
        let slack_for = SLACK_FOR.max(silent_after);
        let is_slack = |tense: &Duration| self.looked_for - *tense > slack_for;
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

    fn health(
        servos: usize,
        silent_after: Duration,
        longest_cycle: Duration,
        now: Instant,
    ) -> Health {
        let patience = Patience {
            silent_after,
            marks_after: silent_after,
            longest_cycle,
        };
        Health::new(servos, patience, now)
    }

    #[test]
    fn the_worst_is_told_first_and_what_passes_is_forgotten() {
        let begun = Instant::now();
        let mut health = health(2, 20 * MS, 100 * MS, begun);
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
        let mut health = health(1, 20 * MS, 9_000 * MS, begun);
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
    fn a_lost_reply_on_a_slow_line_is_no_slack_tendon() {
        let mut now = Instant::now();
        // Nine servos of which one is read in each cycle of 12.5 ms.
        let mut health = health(1, 337 * MS, 25 * MS, now);
        for cycle in 1..=17 {
            now += MS * 25 / 2;
            health.begin_cycle(now);
            assert_eq!(health.fault(), (MotorFault::None, None), "{cycle}");
        }
    }

    #[test]
    fn a_servo_that_was_unheard_for_longer_than_its_watchdog_is_looked_at() {
        let begun = Instant::now();
        let patience = Patience {
            silent_after: 50 * MS,
            marks_after: 20 * MS,
            longest_cycle: 100 * MS,
        };
        let mut health = Health::new(1, patience, begun);
        health.begin_cycle(begun + 20 * MS);
        assert!(!health.hear(0, false, false));
        health.begin_cycle(begun + 41 * MS);
        assert_eq!(health.fault().0, MotorFault::None);
        assert!(health.hear(0, false, false));
    }

    #[test]
    fn while_the_driver_is_held_up_no_servo_is_silent_for_longer_than_a_cycle() {
        let mut now = Instant::now();
        let mut health = health(1, 20 * MS, 8 * MS, now);
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
