//! What replans show: judged from what was published and sent, by geometry and curves that share no code with what made them.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use client::ClientError;
use pcc_model::TendonLimits;
use shared_types::capacity::STAGES;
use shared_types::codes::{LoopState, MotionOutcome, Stage};
use shared_types::message::Cycle;
use tests::brute_force::{Ball, Body, Tendons};
use tests::judge::Verdict;
use tests::knots::{largest_bending_rad, least_clearance_m, limit_use, state_at, stops_between};
use tests::listener::{Heard, Published};
use tests::motion::raise;
use tests::replans::{ShortestStopThenGo, StopThenGo};

use super::fault_resets::Faults;

/// What came of a request.
pub(super) enum Answered {
    /// A motion of this id was published.
    Published(u32),
    /// Nothing was, for this cause.
    Refused(String),
}

/// A request and its answer.
pub(super) struct Asked {
    pub(super) seed: u64,
    /// When the goal was given to the client.
    pub(super) at: Instant,
    /// The same by the clock of the messages, nanoseconds.
    pub(super) mono_ns: i64,
    pub(super) answered: Answered,
    /// Time until the answer.
    pub(super) took: Duration,
    pub(super) stages_ns: [u64; STAGES],
    /// Whether its deadline cut its plan short.
    pub(super) is_truncated: bool,
}

/// A request whose motion was published.
pub(super) struct AskedMotion {
    pub(super) asked: Asked,
    /// Whether it found the robot in motion, by the cycle at that time.
    pub(super) in_motion: bool,
}

/// What replans showed.
#[derive(Default)]
pub(super) struct Figures {
    /// Requests in all.
    pub(super) requests: usize,
    /// Requests that found the robot in motion.
    pub(super) in_motion: usize,
    /// What was published, by id.
    pub(super) published: BTreeMap<u32, AskedMotion>,
    pub(super) faults: Faults,
    /// Motions of answers in motion that were not heard.
    pub(super) unheard: usize,

    /// From a request in motion to the first set-point of the motion that joins another, ms, infinite where it is refused or not begun, with the
    /// time at which it was asked for.
    pub(super) to_setpoint_ms: Vec<(Instant, f64)>,
    /// Replans that were begun: time until the first set-point and lead, ms, and the stages in words.
    pub(super) begun: Vec<(f64, f64, String)>,
    /// Refusals in motion by cause.
    pub(super) refusals: BTreeMap<String, usize>,
    /// Refusals at rest by cause: no replans.
    pub(super) refused_at_rest: BTreeMap<String, usize>,
    /// Scenes in which the robot had room, and those that were drawn for them.
    pub(super) scenes: usize,
    pub(super) scenes_drawn: u64,
    /// Motions that left another one.
    pub(super) joined: usize,
    /// Of these, motions whose switch the loop passed.
    pub(super) switched: usize,
    /// Why motions that left another one were not begun, as the controller says.
    pub(super) not_begun: Vec<String>,
    /// Motions of requests that found the robot in motion and that began at rest: it had come to rest meanwhile.
    pub(super) began_at_rest: usize,
    /// Motions that came too late for their switch and were planned again, as the daemon's log tells.
    pub(super) made_again: Vec<String>,
    /// Switches that were too near once the fastest motion was known, and chosen again before it was published, as the daemon's log tells.
    pub(super) chosen_again: BTreeMap<String, usize>,
    /// Ends of begun joined motions other than reached or joined by another.
    pub(super) ended_otherwise: Vec<String>,
    /// Begun joined motions that stand still between their begin and their end: each wins nothing.
    pub(super) stopped_between: usize,
    /// Largest difference at a switch, rad, rad/s, rad/s².
    pub(super) discontinuity: [f64; 3],
    limits_of_file: [f64; 3],
    /// Largest use of velocity, acceleration and jerk by knots of joined motions.
    pub(super) limits: [f64; 3],
    pub(super) largest_bending_rad: f64,
    /// Least clearance of joined motions and of executed set-points, m.
    pub(super) clearance_m: [f64; 2],
    /// (stop-then-go − joined) ÷ the shortest stop, by a lower bound of it unless that says that the motion is later.
    pub(super) won: Vec<f64>,
    /// The shortest stops that were solved for, between their lower bound and the planner's own, and what is won beside them.
    pub(super) stops_solved: Vec<String>,
    /// By how much replans may be later of which the linear program leaves open whether they are, ms.
    pub(super) left_open_ms: Vec<f64>,
    /// (stop-then-go − joined) ÷ the planner's own stop, by that stop.
    pub(super) won_by_own_stop: Vec<f64>,
    /// (stop-then-go from the request on − joined from the request on) ÷ the stop of the slowest tendon, where the motion was followed that is left.
    pub(super) won_from_the_request: Vec<f64>,
    /// Arrivals later than the shortest stop by a motion of a plan that its deadline cut short.
    pub(super) later_truncated: usize,
    /// Times of requests that found the robot in motion, ms: until the answer, and each stage by its name.
    pub(super) times_ms: BTreeMap<&'static str, Vec<f64>>,
    /// References without a motion.
    pub(super) without_reference: usize,
    /// What was sent to the robot and done by it.
    pub(super) sent: Verdict,
}

impl Figures {
    /// None yet, of a robot with these tendon limits.
    pub(super) fn of(limits: &TendonLimits) -> Self {
        Self {
            limits_of_file: [limits.velocity, limits.acceleration, limits.jerk],
            clearance_m: [f64::INFINITY; 2],
            ..Self::default()
        }
    }

    /// Takes in the requests of a scene, in motion or at rest by the cycle at their time.
    pub(super) fn look_at_requests(&mut self, asked: Vec<Asked>, heard: &Heard) {
        for asked in asked {
            let before = |cycle: &&Cycle| cycle.stamp_mono_ns <= asked.mono_ns;
            let in_motion = heard.cycles.iter().rev().find(before);
            let in_motion = in_motion.is_some_and(is_on_its_way);
            if in_motion {
                self.in_motion += 1;
                self.note_ms("answer", asked.took.as_secs_f64() * 1e3);
                for (stage, took_ms) in stages_ms(&asked.stages_ns) {
                    self.note_ms(stage, took_ms);
                }
            }
            match &asked.answered {
                Answered::Refused(cause) => {
                    let never = in_motion.then_some((asked.at, f64::INFINITY));
                    self.to_setpoint_ms.extend(never);
                    let refusals = match in_motion {
                        true => &mut self.refusals,
                        false => &mut self.refused_at_rest,
                    };
                    *refusals.entry(cause.clone()).or_default() += 1;
                }
                Answered::Published(id) => {
                    let id = *id;
                    let is_heard = motion_of(&heard.motions, id).is_some();
                    self.unheard += usize::from(in_motion && !is_heard);
                    self.published.insert(id, AskedMotion { asked, in_motion });
                }
            }
        }
    }

    fn note_ms(&mut self, name: &'static str, took_ms: f64) {
        self.times_ms.entry(name).or_default().push(took_ms);
    }

    /// Notes a replan that wins nothing: its motion joins none, or was not begun.
    pub(super) fn wins_nothing(&mut self) {
        self.won.push(0.0);
    }

    /// Looks at motions and cycles that were heard in a scene.
    pub(super) fn look(&mut self, body: &Body, heard: &Heard, balls: &[Ball]) {
        for motion in &heard.motions {
            self.look_at_motion(body, motion, &heard.motions, balls);
        }
        for motion in heard.motions.iter().filter(|it| it.leaves.is_none()) {
            self.note_begin_at_rest(motion, heard);
        }
        for motion in heard.motions.iter().filter(|it| it.leaves.is_some()) {
            let asked = self.published.get(&motion.id).filter(|it| it.in_motion);
            let asked = asked.map(|it| (it.asked.at, it.asked.mono_ns, it.asked.stages_ns));
            let Some(first_ns) = first_followed(&heard.cycles, motion.id) else {
                let never = asked.map(|(at, ..)| (at, f64::INFINITY));
                self.to_setpoint_ms.extend(never);
                let result = heard
                    .results
                    .iter()
                    .find(|it| it.trajectory_id == motion.id);
                let reason = result.map(|it| it.reason.text().into_owned());
                let unheard = || "no result was heard".to_owned();
                self.not_begun.push(reason.unwrap_or_else(unheard));
                continue;
            };
            self.switched += 1;
            self.note_end(motion.id, heard);
            let ms = |from_ns: i64, to_ns: i64| (to_ns - from_ns) as f64 * 1e-6;
            let switch_ns = motion.begin_mono_ns;
            if let Some((at, mono_ns, stages_ns)) = asked {
                let took_ms = ms(mono_ns, first_ns);
                self.to_setpoint_ms.push((at, took_ms));
                let lead_ms = ms(mono_ns, switch_ns);
                self.begun.push((took_ms, lead_ms, stages_text(&stages_ns)));
                self.note_ms("lead, from the goal to the switch", lead_ms);
            }
            self.note_ms("switch to first set-point", ms(switch_ns, first_ns));
        }
        let setpoints: Vec<(i64, Tendons)> = heard
            .cycles
            .iter()
            .filter(|cycle| is_on_its_way(cycle))
            .map(|cycle| (cycle.stamp_mono_ns, cycle.setpoint_m))
            .collect();
        let executed = body.least_clearance(&setpoints, |_| balls).at_least_m();
        lower(&mut self.clearance_m[1], executed);
    }

    /// Counts the whole time until the first set-point where a request found the robot in motion and its motion begins at rest.
    fn note_begin_at_rest(&mut self, motion: &Published, heard: &Heard) {
        let asked = self.published.get(&motion.id);
        let Some(AskedMotion { asked, .. }) = asked.filter(|it| it.in_motion) else {
            return;
        };
        let first_ns = first_followed(&heard.cycles, motion.id);
        let took_ms = first_ns.map_or(f64::INFINITY, |first_ns| {
            (first_ns - asked.mono_ns) as f64 * 1e-6
        });
        self.to_setpoint_ms.push((asked.at, took_ms));
    }

    /// Notes how a begun motion ended where that is not as it was asked for.
    fn note_end(&mut self, id: u32, heard: &Heard) {
        let result = heard.results.iter().find(|it| it.trajectory_id == id);
        let outcome = result.and_then(|it| MotionOutcome::try_from(it.outcome).ok());
        if !matches!(
            outcome,
            Some(MotionOutcome::Reached | MotionOutcome::Joined)
        ) {
            let outcome = outcome.map_or("no result", MotionOutcome::text);
            self.ended_otherwise.push(format!("{id}: {outcome}"));
        }
    }

    fn look_at_motion(
        &mut self,
        body: &Body,
        motion: &Published,
        all: &[Published],
        balls: &[Ball],
    ) {
        let Some((left, at_s)) = motion.leaves else {
            return;
        };
        self.joined += 1;
        let before = motion_of(all, left).and_then(|left| state_at(&left.knots, at_s));
        let first = motion.knots.first().map(|knot| knot.values);
        for (order, figure) in self.discontinuity.iter_mut().enumerate() {
            let difference = match (before, first) {
                (Some(before), Some(first)) => (0..6)
                    .map(|i| (before[order][i] - first[order][i]).abs())
                    .fold(0.0, f64::max),
                _ => f64::NAN,
            };
            raise(figure, difference);
        }
        let used = limit_use(body, &motion.knots, &self.limits_of_file);
        for (figure, used) in self.limits.iter_mut().zip(used) {
            raise(figure, used);
        }
        raise(
            &mut self.largest_bending_rad,
            largest_bending_rad(&motion.knots),
        );
        let clearance = least_clearance_m(body, &motion.knots, balls) - body.chord_error_m();
        lower(&mut self.clearance_m[0], clearance);
    }

    /// Compares a joined motion that was begun with stopping first: by a lower bound of every stop, and where it is later than that, by the
    /// earlier of two that keep acceleration and jerk limits, the shortest stop and the planner's own. Returns whether it is later than that, too.
    pub(super) fn compare(
        &mut self,
        motion: &Published,
        reference: &StopThenGo,
        is_truncated: bool,
        by_the_shortest_stop: impl FnOnce() -> Result<ShortestStopThenGo, ClientError>,
    ) -> Result<bool, ClientError> {
        let Some(go_s) = reference.go_s else {
            self.without_reference += 1;
            return Ok(false);
        };
        let duration_s = motion.knots.last().map_or(f64::NAN, |knot| knot.time_s);
        let share = |stop_s: f64| (stop_s + go_s - duration_s) / stop_s;
        let mut won = share(reference.least_stop_s);
        if is_later(&won) {
            let shortest = by_the_shortest_stop()?;
            let [least_s, shortest_s] = shortest.stop_s;
            let own_s = reference.own_stop_s + go_s;
            let go_s = shortest.go_s.unwrap_or(f64::INFINITY);
            let won_s = |stop_s: f64| own_s.min(stop_s + go_s) - duration_s;
            won = won_s(shortest_s) / shortest_s;
            if is_later(&(won_s(least_s) / shortest_s)) && !is_later(&won) {
                self.left_open_ms.push(-1e3 * won_s(least_s));
            }
            self.stops_solved.push(format!(
                "stop {:.5}, {shortest_s:.5}, {:.5} s: won {:.3} ms",
                reference.least_stop_s,
                reference.own_stop_s,
                1e3 * won_s(shortest_s)
            ));
        }
        if stops_between(&motion.knots).count > 0 {
            self.stopped_between += 1;
            won = won.min(0.0);
        }
        self.later_truncated += usize::from(is_truncated && is_later(&won));
        self.won.push(won);
        self.won_by_own_stop.push(share(reference.own_stop_s));
        Ok(is_later(&won))
    }

    /// Compares a joined motion that begins so long after its request with a stop at the request by the least time that a tendon takes, and a
    /// motion from there that is known at once.
    pub(super) fn compare_from_the_request(
        &mut self,
        motion: &Published,
        reference: &StopThenGo,
        lead_s: f64,
    ) {
        if let (Some(go_s), Some(last)) = (reference.go_s, motion.knots.last()) {
            let stop_s = reference.least_stop_s;
            let won_s = stop_s + go_s - lead_s - last.time_s;
            self.won_from_the_request.push(won_s / stop_s);
        }
    }
}

/// The time of each stage of a plan by its name, ms.
pub(super) fn stages_ms(stages_ns: &[u64; STAGES]) -> impl Iterator<Item = (&'static str, f64)> {
    let took_ms = |stage: &Stage| stages_ns[stage.code() as usize] as f64 * 1e-6;
    Stage::ALL
        .iter()
        .map(move |stage| (stage.text(), took_ms(stage)))
}

/// The time of each stage of a plan in words, ms.
pub(super) fn stages_text(stages_ns: &[u64; STAGES]) -> String {
    let stages = stages_ms(stages_ns).map(|(name, took_ms)| format!("{name} {took_ms:.2}"));
    stages.collect::<Vec<_>>().join(", ")
}

/// Whether a motion that won this share of the shortest stop arrived later than after stopping, by more than rounding.
pub(super) fn is_later(won: &f64) -> bool {
    *won < -1e-6
}

pub(super) fn lower(figure: &mut f64, value: f64) {
    if value.is_nan() || value < *figure {
        *figure = value;
    }
}

/// Whether a motion is followed in a cycle, or braked on.
pub(super) fn is_on_its_way(cycle: &Cycle) -> bool {
    let moving = [LoopState::Executing, LoopState::Stopping].map(LoopState::code);
    moving.contains(&cycle.state)
}

/// Stamp of the first cycle that follows a motion, nanoseconds.
pub(super) fn first_followed(cycles: &[Cycle], id: u32) -> Option<i64> {
    let first = cycles.iter().find(|cycle| cycle.trajectory_id == id)?;
    Some(first.stamp_mono_ns)
}

/// The motion with this id.
pub(super) fn motion_of(motions: &[Published], id: u32) -> Option<&Published> {
    motions.iter().rev().find(|motion| motion.id == id)
}

/// The value below which this share of all lies.
pub(super) fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let index = (share * sorted.len() as f64) as usize;
    let last = sorted.len().saturating_sub(1);
    sorted.get(index.min(last)).copied().unwrap_or(f64::NAN)
}
