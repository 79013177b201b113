//! What a sequence of set-points did, from the set-points alone.

use pcc_model::{Configuration, TendonLimits};
use tests::motion::{largest, raise};
use trajectory::Knot;

use crate::safe::on_path::on_curve;

/// A cycle as it was sent.
#[derive(Clone, Copy)]
pub(super) struct Sent {
    /// Its stamp, ns.
    pub(super) stamp_ns: i64,
    pub(super) position: [f64; 9],
    pub(super) velocity: [f64; 9],
    pub(super) acceleration: [f64; 9],
    pub(super) configuration: Configuration,
    /// Path time that was published, s.
    pub(super) path_time_s: f64,
}

/// Largest uses of the limits (1: at the limit), and the largest distance from the path.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Figures {
    pub(super) cycles: usize,
    pub(super) velocity: f64,
    pub(super) acceleration: f64,
    /// Differences of positions ÷ time.
    pub(super) step: f64,
    /// Differences of velocities ÷ time.
    pub(super) velocity_step: f64,
    /// Second divided differences of positions, × 2.
    pub(super) second_difference: f64,
    /// Distance of the commanded configuration from the path at the path time published, rad.
    pub(super) off_path_rad: f64,
    /// The most by which path time ran ahead of the clock, or backwards, in a cycle, s.
    pub(super) ahead_s: f64,
}

/// Takes in set-points one after the other; `cap_s` is the furthest that the path time goes on in a cycle.
pub(super) struct Judge<'a> {
    pub(super) limits: TendonLimits,
    pub(super) knots: &'a [Knot],
    pub(super) cap_s: f64,
    pub(super) figures: Figures,
    before: Option<Sent>,
    /// Velocities by differences over the cycle before, and that cycle's length, s.
    slope: Option<([f64; 9], f64)>,
}

impl<'a> Judge<'a> {
    pub(super) fn new(limits: TendonLimits, knots: &'a [Knot], cap_s: f64) -> Self {
        Self {
            limits,
            knots,
            cap_s,
            figures: Figures::default(),
            before: None,
            slope: None,
        }
    }

    pub(super) fn take(&mut self, sent: &Sent) {
        let (limits, figures) = (self.limits, &mut self.figures);
        figures.cycles += 1;
        raise(
            &mut figures.velocity,
            largest(&sent.velocity) / limits.velocity,
        );
        raise(
            &mut figures.acceleration,
            largest(&sent.acceleration) / limits.acceleration,
        );
        let on_path = on_curve(self.knots, sent.path_time_s);
        raise(
            &mut figures.off_path_rad,
            (sent.configuration - on_path).norm(),
        );
        if let Some(before) = self.before.replace(*sent) {
            let elapsed_s = ((sent.stamp_ns - before.stamp_ns) as f64 * 1e-9).min(self.cap_s);
            let passed_s = sent.path_time_s - before.path_time_s;
            raise(&mut figures.ahead_s, (passed_s - elapsed_s).max(-passed_s));
            let slope = divided(&sent.position, &before.position, elapsed_s);
            raise(&mut figures.step, largest(&slope) / limits.velocity);
            let changes = divided(&sent.velocity, &before.velocity, elapsed_s);
            raise(
                &mut figures.velocity_step,
                largest(&changes) / limits.acceleration,
            );
            if let Some((earlier, earlier_s)) = self.slope.replace((slope, elapsed_s)) {
                let second = divided(&slope, &earlier, 0.5 * (elapsed_s + earlier_s));
                raise(
                    &mut figures.second_difference,
                    largest(&second) / limits.acceleration,
                );
            }
        }
    }
}

impl Figures {
    pub(super) fn merge(&mut self, other: &Self) {
        self.cycles += other.cycles;
        raise(&mut self.velocity, other.velocity);
        raise(&mut self.acceleration, other.acceleration);
        raise(&mut self.step, other.step);
        raise(&mut self.velocity_step, other.velocity_step);
        raise(&mut self.second_difference, other.second_difference);
        raise(&mut self.off_path_rad, other.off_path_rad);
        raise(&mut self.ahead_s, other.ahead_s);
    }
}

fn divided(after: &[f64; 9], before: &[f64; 9], elapsed_s: f64) -> [f64; 9] {
    std::array::from_fn(|i| (after[i] - before[i]) / elapsed_s)
}
