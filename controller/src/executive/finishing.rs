//! Motions that end: they go back to the loop's owner with how they ended.

use super::Executive;
use super::ending::{EndedMotion, Ending, StopOrigin};
use super::motion::Motion;

impl Executive {
    /// Gives a motion that is over back to the loop's owner.
    pub(super) fn note_end(&mut self, motion: Motion, ending: Ending, path_time_s: f64) {
        self.finished.push(EndedMotion {
            motion,
            ending,
            path_time_s,
            stamp_ns: self.now_ns,
        });
    }

    /// Begins to brake for `origin`; where it brakes already, the first origin stays.
    pub(super) fn note_stop(&mut self, origin: StopOrigin) {
        self.stop_origin.get_or_insert(origin);
    }

    /// Ends the motion that is followed where it is, or sets aside the one that waits for its begin, and one that was about to be
    /// joined.
    pub(super) fn break_off(&mut self, origin: StopOrigin) {
        self.give_up_join(origin);
        let Some(motion) = self.motion.take() else {
            return;
        };
        if self.is_moving() {
            self.note_end(motion, Ending::Stopped(origin), self.pace.time_s);
        } else {
            self.note_end(motion, Ending::SetAside(origin), 0.0);
        }
    }

    /// Ends the motion where the robot has come to rest on it: at its end, or where it was stopped.
    pub(super) fn end_at_rest(&mut self) {
        let origin = self.stop_origin.take();
        if let Some(motion) = self.motion.take() {
            let time_s = self.pace.time_s;
            let ending = match origin {
                Some(origin) if time_s < motion.duration_s() => Ending::Stopped(origin),
                _ => Ending::Reached,
            };
            self.note_end(motion, ending, time_s);
        }
    }
}
