//! A whole motion: knots joined by quintic segments.

use super::knot_hash::knot_hash;
use crate::{Knot, QuinticSegment, State};
use pcc_model::Configuration;

/// What is wrong with a list of knots.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TrajectoryError {
    /// Fewer than two knots.
    #[error("a trajectory needs at least 2 knots, got {0}")]
    TooFewKnots(usize),
    /// A number that is NaN or infinite.
    #[error("knot {0} has a number that is not finite")]
    NotFinite(usize),
    /// The first knot is not at time 0.
    #[error("the first knot must be at time 0 s, it is at {0} s")]
    StartTime(f64),
    /// Times that do not increase strictly.
    #[error("knot times must increase strictly, but knot {0} is not after the one before it")]
    TimeOrder(usize),
}

/// A motion: at least two finite knots, their times strictly increasing from 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    knots: Vec<Knot>,
    knot_hash: u64,
}

impl Trajectory {
    /// Takes knots as a motion.
    ///
    /// # Errors
    /// See [`TrajectoryError`]; the first fault found is named.
    pub fn new(knots: Vec<Knot>) -> Result<Self, TrajectoryError> {
        if knots.len() < 2 {
            return Err(TrajectoryError::TooFewKnots(knots.len()));
        }
        if let Some(index) = knots.iter().position(|knot| !knot.is_finite()) {
            return Err(TrajectoryError::NotFinite(index));
        }
        if knots[0].time != 0.0 {
            return Err(TrajectoryError::StartTime(knots[0].time));
        }
        if let Some(index) = knots
            .windows(2)
            .position(|pair| pair[1].time <= pair[0].time)
        {
            return Err(TrajectoryError::TimeOrder(index + 1));
        }
        Ok(Self {
            knot_hash: knot_hash(&knots),
            knots,
        })
    }

    /// Time of the last knot, s.
    pub fn duration(&self) -> f64 {
        self.knots[self.knots.len() - 1].time
    }

    /// The configuration in which it ends, rad.
    pub fn end(&self) -> Configuration {
        self.knots[self.knots.len() - 1].position
    }

    /// The knots, in order of time.
    pub fn knots(&self) -> &[Knot] {
        &self.knots
    }

    /// Hash of the knots: motions that are equal to the bit have equal hashes.
    pub fn knot_hash(&self) -> u64 {
        self.knot_hash
    }

    /// The knots, without a copy.
    pub(crate) fn into_knots(self) -> Vec<Knot> {
        self.knots
    }

    /// The quintic segments between the knots, in order of time.
    pub fn segments(&self) -> impl ExactSizeIterator<Item = QuinticSegment> + '_ {
        self.knots
            .windows(2)
            .map(|pair| QuinticSegment::between(&pair[0], &pair[1]))
    }

    /// The state `time` seconds after the start; at rest at the end points outside the motion.
    pub fn at(&self, time: f64) -> State {
        let mut hint = self.knots.partition_point(|knot| knot.time <= time);
        evaluate(&self.knots, &mut hint, time)
    }

    /// `count` positions at equal time steps, both ends included; empty for 0, the start alone for 1.
    pub fn sample(&self, count: usize) -> Vec<Configuration> {
        let step = self.duration() / count.saturating_sub(1).max(1) as f64;
        let last = self.knots.len() - 1;
        let mut next = 1;
        let mut segment = QuinticSegment::between(&self.knots[0], &self.knots[1]);
        let position = |i: usize| {
            let time = step * i as f64;
            if i + 1 == count && i > 0 {
                return self.knots[last].position;
            }
            while next < last && time >= self.knots[next].time {
                next += 1;
                segment = QuinticSegment::between(&self.knots[next - 1], &self.knots[next]);
            }
            segment.position(time - self.knots[next - 1].time)
        };
        (0..count).map(position).collect()
    }
}

/// The state of the motion through `knots` at `time` seconds, without allocating.
///
/// Before the first and after the last knot it is that knot's position at rest (also for a `time` that is NaN:
/// the first). `hint` is the index of the segment last used and is moved along: calls in order of time cost O(1)
/// amortised, a call at any other time is correct and costs O(distance).
///
/// # Panics
/// If `knots` is empty.
pub fn evaluate(knots: &[Knot], hint: &mut usize, time: f64) -> State {
    let last = knots.len() - 1;
    if time >= knots[last].time {
        *hint = last.saturating_sub(1);
        return at_end(knots, time);
    }
    if time.is_nan() || time < knots[0].time {
        *hint = 0;
        return State::resting(knots[0].position);
    }
    let mut segment = (*hint).min(last - 1);
    while time < knots[segment].time {
        segment -= 1;
    }
    while time >= knots[segment + 1].time {
        segment += 1;
    }
    *hint = segment;
    QuinticSegment::between(&knots[segment], &knots[segment + 1])
        .evaluate(time - knots[segment].time)
}

/// The state at the last knot's time, and at rest there after it.
fn at_end(knots: &[Knot], time: f64) -> State {
    let end = &knots[knots.len() - 1];
    if time > end.time || knots.len() < 2 {
        return State::resting(end.position);
    }
    let segment = QuinticSegment::between(&knots[knots.len() - 2], end);
    segment.evaluate(segment.duration)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(count: usize) -> Vec<Knot> {
        (0..count)
            .map(|i| {
                let time = 0.1 * i as f64;
                let phase = Configuration::from_fn(|row, _| time * (1.0 + row as f64));
                let slope = Configuration::from_fn(|row, _| 1.0 + row as f64);
                Knot {
                    time,
                    position: phase.map(f64::sin),
                    velocity: phase.map(f64::cos).component_mul(&slope),
                    acceleration: -phase
                        .map(f64::sin)
                        .component_mul(&slope)
                        .component_mul(&slope),
                }
            })
            .collect()
    }

    #[test]
    fn faults_are_named() {
        let error = |knots: Vec<Knot>| Trajectory::new(knots).unwrap_err();
        assert_eq!(error(vec![]), TrajectoryError::TooFewKnots(0));
        assert_eq!(error(wave(1)), TrajectoryError::TooFewKnots(1));
        let mut knots = wave(4);
        knots[2].velocity[3] = f64::NAN;
        assert_eq!(error(knots), TrajectoryError::NotFinite(2));
        assert_eq!(
            error(wave(4)[1..].to_vec()),
            TrajectoryError::StartTime(0.1)
        );
        let mut knots = wave(4);
        knots[3].time = knots[2].time;
        assert_eq!(error(knots), TrajectoryError::TimeOrder(3));
    }

    #[test]
    fn any_hint_gives_the_same_state() {
        let knots = wave(20);
        for i in 0..400 {
            let time = -0.1 + 0.0055 * f64::from(i);
            let expected = evaluate(&knots, &mut 0, time);
            for start in [0, 7, 18, 19, 1000] {
                let mut hint = start;
                assert_eq!(evaluate(&knots, &mut hint, time), expected);
                assert!(hint < 19);
            }
        }
    }

    #[test]
    fn outside_the_motion_it_rests_at_the_ends() {
        let knots = wave(5);
        for (time, end) in [
            (-1.0, 0),
            (f64::NAN, 0),
            (0.4 + 1e-9, 4),
            (f64::INFINITY, 4),
            (f64::NEG_INFINITY, 0),
        ] {
            assert_eq!(
                evaluate(&knots, &mut 2, time),
                State::resting(knots[end].position)
            );
        }
        let single = &knots[..1];
        assert_eq!(
            evaluate(single, &mut 0, 0.0),
            State::resting(knots[0].position)
        );
    }

    #[test]
    fn it_follows_the_wave_and_is_twice_differentiable() {
        let motion = Trajectory::new(wave(30)).unwrap();
        for knot in &motion.knots()[1..29] {
            let [before, after] = [-1e-9, 1e-9].map(|d| motion.at(knot.time + d));
            assert!((before.position - after.position).amax() < 1e-7);
            assert!((before.velocity - after.velocity).amax() < 1e-6);
            assert!((before.acceleration - after.acceleration).amax() < 1e-5);
        }
        let state = motion.at(1.234);
        assert!((state.position[5] - (1.234f64 * 6.0).sin()).abs() < 1e-5);
        assert_eq!(motion.segments().len(), 29);
    }

    #[test]
    fn samples_include_both_ends() {
        let motion = Trajectory::new(wave(9)).unwrap();
        let positions = motion.sample(64);
        assert_eq!(positions.len(), 64);
        assert_eq!(positions[0], motion.knots()[0].position);
        assert_eq!(positions[63], motion.knots()[8].position);
        assert!(motion.sample(0).is_empty());
    }
}
