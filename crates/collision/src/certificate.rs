//! Certificates: a motion is free if the clearances at the ends of an interval exceed what can happen between them.
//!
//! A point of section k moves by at most Λ_k during an interval, so with clearances d_k(a) and d_k(b) at its ends no
//! contact is possible if d_k(a) + d_k(b) > Λ_k for every section. Else the interval is halved, to a depth;
//! what stays undecided counts as colliding.

use crate::bound::{Displacement, turns};
use crate::scene::Scene;
use pcc_model::{Configuration, Robot, SECTIONS};
use trajectory::{QuinticSegment, Trajectory};

/// Bisections of one curve segment or polyline edge.
const DEPTH: u32 = 10;

/// What is known of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// No contact is possible.
    Free,
    /// There is contact.
    Colliding {
        /// Where: the time of a trajectory (s), or the index and fraction of a polyline's edge.
        at: f64,
    },
    /// Too close to decide.
    Undecided {
        /// Where, as above.
        at: f64,
    },
}

impl Verdict {
    /// Whether the motion is certified.
    #[must_use]
    pub fn is_free(self) -> bool {
        self == Self::Free
    }
}

pub(crate) type Clearances = [f64; SECTIONS];

/// Whether two clearances leave no room for contact during a displacement.
pub(crate) fn is_covered(a: &Clearances, b: &Clearances, displacement: &Displacement) -> bool {
    (0..SECTIONS).all(|k| a[k] + b[k] > displacement.sections[k])
}

pub(crate) fn touches(clearances: &Clearances) -> bool {
    clearances.iter().any(|c| *c < 0.0)
}

struct Checker<'a> {
    robot: &'a Robot,
    scene: &'a Scene,
    tube_radius: f64,
}

impl Checker<'_> {
    fn clearances(&self, shape: &Configuration) -> Clearances {
        self.scene
            .section_clearances(&self.robot.backbone(shape), self.tube_radius)
    }

    fn edge(
        &self,
        ends: [&Configuration; 2],
        clear: [&Clearances; 2],
        span: [f64; 2],
        depth: u32,
    ) -> Verdict {
        if is_covered(
            clear[0],
            clear[1],
            &Displacement::of_edge(self.robot, ends[0], ends[1]),
        ) {
            return Verdict::Free;
        }
        let at = 0.5 * (span[0] + span[1]);
        if depth == 0 {
            return Verdict::Undecided { at };
        }
        let middle = ends[0].lerp(ends[1], 0.5);
        let between = self.clearances(&middle);
        if touches(&between) {
            return Verdict::Colliding { at };
        }
        match self.edge(
            [ends[0], &middle],
            [clear[0], &between],
            [span[0], at],
            depth - 1,
        ) {
            Verdict::Free => self.edge(
                [&middle, ends[1]],
                [&between, clear[1]],
                [at, span[1]],
                depth - 1,
            ),
            found => found,
        }
    }

    fn curve(
        &self,
        curve: &QuinticSegment,
        clear: [&Clearances; 2],
        span: [f64; 2],
        depth: u32,
    ) -> Verdict {
        if is_covered(clear[0], clear[1], &segment_displacement(self.robot, curve)) {
            return Verdict::Free;
        }
        let at = 0.5 * (span[0] + span[1]);
        if depth == 0 {
            return Verdict::Undecided { at };
        }
        let (first, second) = curve.halves();
        let between = self.clearances(&second.control[0]);
        if touches(&between) {
            return Verdict::Colliding { at };
        }
        match self.curve(&first, [clear[0], &between], [span[0], at], depth - 1) {
            Verdict::Free => self.curve(&second, [&between, clear[1]], [at, span[1]], depth - 1),
            found => found,
        }
    }

    /// A run of whole segments, `first..end`, decided together where it can be.
    fn run(&self, trajectory: &Trajectory, range: [usize; 2], clear: [&Clearances; 2]) -> Verdict {
        let [first, end] = range;
        let knots = trajectory.knots();
        if end - first == 1 {
            return self.curve(
                &QuinticSegment::between(&knots[first], &knots[end]),
                clear,
                [knots[first].time, knots[end].time],
                DEPTH,
            );
        }
        let total = (first..end).fold(Displacement::NONE, |sum, i| {
            sum + segment_displacement(
                self.robot,
                &QuinticSegment::between(&knots[i], &knots[i + 1]),
            )
        });
        if is_covered(clear[0], clear[1], &total) {
            return Verdict::Free;
        }
        let middle = usize::midpoint(first, end);
        let between = self.clearances(&knots[middle].position);
        if touches(&between) {
            return Verdict::Colliding {
                at: knots[middle].time,
            };
        }
        match self.run(trajectory, [first, middle], [clear[0], &between]) {
            Verdict::Free => self.run(trajectory, [middle, end], [&between, clear[1]]),
            found => found,
        }
    }
}

/// Displacement during a curve segment: its duration times the largest derivative control value of each pair.
pub(crate) fn segment_displacement(robot: &Robot, segment: &QuinticSegment) -> Displacement {
    let mut largest = [0.0_f64; SECTIONS];
    for pair in segment.control.windows(2) {
        for (l, t) in largest.iter_mut().zip(turns(&(pair[1] - pair[0]))) {
            *l = l.max(5.0 * t);
        }
    }
    Displacement::of_turns(robot, largest)
}

/// Certifies a straight move in configuration space, with at most `depth` bisections.
#[must_use]
pub fn certify_edge(
    robot: &Robot,
    scene: &Scene,
    a: &Configuration,
    b: &Configuration,
    depth: u32,
) -> Verdict {
    if scene.is_empty() {
        return Verdict::Free;
    }
    let checker = Checker {
        robot,
        scene,
        tube_radius: robot.tube_radius,
    };
    let clear = [checker.clearances(a), checker.clearances(b)];
    if let Some(end) = clear.iter().position(touches) {
        return Verdict::Colliding { at: end as f64 };
    }
    checker.edge([a, b], [&clear[0], &clear[1]], [0.0, 1.0], depth)
}

/// Certifies a polyline in configuration space; places are edge index + fraction.
#[must_use]
pub fn certify_polyline(robot: &Robot, scene: &Scene, points: &[Configuration]) -> Verdict {
    if scene.is_empty() || points.is_empty() {
        return Verdict::Free;
    }
    let checker = Checker {
        robot,
        scene,
        tube_radius: robot.tube_radius,
    };
    let mut before = checker.clearances(&points[0]);
    if touches(&before) {
        return Verdict::Colliding { at: 0.0 };
    }
    for (i, edge) in points.windows(2).enumerate() {
        let after = checker.clearances(&edge[1]);
        let (begin, end) = (i as f64, i as f64 + 1.0);
        if touches(&after) {
            return Verdict::Colliding { at: end };
        }
        let verdict = checker.edge([&edge[0], &edge[1]], [&before, &after], [begin, end], DEPTH);
        if !verdict.is_free() {
            return verdict;
        }
        before = after;
    }
    Verdict::Free
}

/// Certifies the executed curve from `from_time` (s) to its end, for a tube grown by `growth`.
///
/// The segment that holds `from_time` is checked from its beginning.
#[must_use]
pub fn certify_trajectory(
    robot: &Robot,
    scene: &Scene,
    trajectory: &Trajectory,
    from_time: f64,
    growth: f64,
) -> Verdict {
    if scene.is_empty() {
        return Verdict::Free;
    }
    let knots = trajectory.knots();
    let checker = Checker {
        robot,
        scene,
        tube_radius: robot.tube_radius + growth,
    };
    let last = knots.len() - 1;
    let first = knots
        .partition_point(|k| k.time <= from_time)
        .saturating_sub(1)
        .min(last - 1);
    let clear = [
        checker.clearances(&knots[first].position),
        checker.clearances(&knots[last].position),
    ];
    for (clearances, at) in clear.iter().zip([knots[first].time, knots[last].time]) {
        if touches(clearances) {
            return Verdict::Colliding { at };
        }
    }
    checker.run(trajectory, [first, last], [&clear[0], &clear[1]])
}
