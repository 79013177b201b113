//! That everything goes on after a disturbance: motions that are asked for, stopped and reached.

use std::thread;
use std::time::Duration;

use client::ClientError;
use shared_types::clock::mono_now_ns;
use shared_types::valid::PlanRequest;

use super::{Experiment, READY_WITHIN};
use crate::disturbance::Kind;
use crate::retries::without_numbers;
use crate::rounds::{goal_of, somewhere_near};
use crate::stack::{MoveError, Part};
use crate::supervision::{Reaction, Since, Watch};

/// Pause before a motion that was refused is asked for again.
const ASK_AGAIN: Duration = Duration::from_millis(200);
/// How often a motion is asked for until its round has failed.
const ASKED_AT_MOST: usize = 5;

impl Experiment<'_> {
    /// A motion of the daemon that was stopped or held, or has come after a killed one: it has to stop the motion for a ball.
    pub(super) fn prove_supervision(&mut self, kind: Kind) -> Result<(), String> {
        let request = self.motion_request(0.25);
        let goal = goal_of(&request).expect("it has one");
        let (id, _) = self.ask_until_taken(&request)?;
        let progress = self.stack.wait_for_progress(id, 0.1);
        progress.map_err(|error| format!("after {kind:?} of the daemon: {}", error.what))?;
        let shown_ns = mono_now_ns();
        self.show_ball_at(&goal)?;
        let watch = Watch {
            part: Part::Daemon,
            kind,
            since: Since::Scene,
            begun_ns: shown_ns,
            shown_ns,
            ended_ns: shown_ns,
        };
        thread::sleep(watch.patience());
        let reaction = self.listener.with(|heard| watch.judge(heard));
        self.survival.watched_anew.add(&watch, &reaction);
        if matches!(reaction, Reaction::NothingMoved) {
            let log = self.stack.process(Part::Daemon).log();
            let last: Vec<&str> = log.lines().rev().take(4).collect();
            let state = self.stack.controller_state();
            return Err(format!(
                "a motion after {kind:?} of the daemon had stopped before its ball came: {}, {}, {last:?}",
                state.state, state.fault
            ));
        }
        self.recover(mono_now_ns())
    }

    /// A whole motion: planned, executed, reached.
    pub(super) fn prove(&mut self) -> Result<(), String> {
        let asked = self.survival.asked_again.values().sum::<usize>();
        let request = self.motion_request(0.1);
        let (id, _) = self.ask_until_taken(&request)?;
        let end = match self.stack.wait_for_end(id) {
            Ok(end) => end,
            Err(MoveError::CutShort(why)) => {
                let why = format!("cut short: {why}");
                *self.survival.asked_again.entry(why.clone()).or_default() += 1;
                return Err(why);
            }
            Err(error) => return Err(error.to_string()),
        };
        let goal = goal_of(&request).expect("it has one");
        let body = self.stack.world.body();
        let tip = body.tip(&goal);
        let error = body.tip_error(&end.values.commanded_configuration_rad, &tip);
        self.survival.tip_error_m = self.survival.tip_error_m.max(error);
        if error > 0.01 {
            return Err(format!("ended {error:.4} m from its goal"));
        }
        if self.survival.asked_again.values().sum::<usize>() > asked {
            return Err("had to be asked for again".to_owned());
        }
        Ok(())
    }

    /// Has a request executed, and says its id and duration, s; every time that it has to be asked for again is counted.
    pub(super) fn ask_until_taken(&mut self, request: &PlanRequest) -> Result<(u32, f64), String> {
        let mut last = String::new();
        for _ in 0..ASKED_AT_MOST {
            let answer = self.stack.client.plan(request, READY_WITHIN);
            last = match answer {
                Ok(answer) => match (answer.report().trajectory_id, answer.selected()) {
                    (Some(id), Some(selected)) => return Ok((id, selected.summary.duration_s)),
                    _ => format!("{}: {}", answer.report().outcome, answer.report().reason),
                },
                Err(ClientError::ServerLost { .. }) => "the daemon went away".to_owned(),
                Err(error) => return Err(error.to_string()),
            };
            *self
                .survival
                .asked_again
                .entry(without_numbers(&last))
                .or_default() += 1;
            thread::sleep(ASK_AGAIN);
        }
        Err(format!("asked for {ASKED_AT_MOST} times: {last}"))
    }

    pub(super) fn motion_request(&mut self, bend_rad: f64) -> PlanRequest {
        let start = self.stack.commanded().into();
        somewhere_near(start, bend_rad, &mut self.rng)
    }
}
