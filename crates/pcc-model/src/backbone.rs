//! The whole backbone of one configuration: frames, points, Jacobians, exact distances.

use crate::arc::{Nearest, distance_to_circle, foot_arc_length};
use crate::section::{Coefficients, angular_derivatives, position, position_derivatives, rotation};
use crate::{Configuration, DOF, Point, SECTIONS};
use nalgebra::{Matrix3, SMatrix, Vector3};

/// A rigid frame in the base frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Its axes, as columns; the third is the backbone's tangent.
    pub rotation: Matrix3<f64>,
    /// Its origin.
    pub position: Point,
}

/// The backbone of one configuration.
#[derive(Clone, Copy, Debug)]
pub struct Backbone {
    frames: [Pose; SECTIONS + 1],
    arcs: [Arc; SECTIONS],
}

/// One section's bending pair, its length, curvature, bending direction, and end in its own base frame.
#[derive(Clone, Copy, Debug)]
struct Arc {
    x: f64,
    y: f64,
    length: f64,
    curvature: f64,
    direction: [f64; 2],
    end: Vector3<f64>,
    end_tangent: Vector3<f64>,
    angular: [Vector3<f64>; 2],
    linear: [Vector3<f64>; 2],
}

impl Arc {
    fn new(x: f64, y: f64, length: f64) -> (Self, Matrix3<f64>) {
        let theta = x.hypot(y);
        let coefficients = Coefficients::at(theta * theta);
        let turned = rotation(x, y, &coefficients);
        let direction = if theta > 0.0 {
            [y / theta, -x / theta]
        } else {
            [1.0, 0.0]
        };
        let arc = Self {
            x,
            y,
            length,
            curvature: theta / length,
            direction,
            end: position(x, y, length, &coefficients),
            end_tangent: turned.column(2).into(),
            angular: angular_derivatives(x, y, &coefficients),
            linear: position_derivatives(x, y, length, &coefficients),
        };
        (arc, turned)
    }

    /// Position and its derivatives at a fraction, in the section's base frame.
    fn at(&self, fraction: f64) -> (Vector3<f64>, [Vector3<f64>; 2]) {
        let (x, y, l) = (fraction * self.x, fraction * self.y, fraction * self.length);
        let c = Coefficients::at(x * x + y * y);
        (
            position(x, y, l, &c),
            position_derivatives(x, y, l, &c).map(|d| d * fraction),
        )
    }

    /// Nearest distance and fraction for a point in the section's base frame.
    fn nearest(&self, p: &Vector3<f64>) -> (f64, f64) {
        let beyond_end = (p - self.end).dot(&self.end_tangent) > 0.0;
        if p.z < 0.0 || beyond_end {
            let (to_base, to_end) = (p.norm_squared(), (p - self.end).norm_squared());
            return if to_base <= to_end {
                (to_base.sqrt(), 0.0)
            } else {
                (to_end.sqrt(), 1.0)
            };
        }
        let along = p.x * self.direction[0] + p.y * self.direction[1];
        let out = p.y * self.direction[0] - p.x * self.direction[1];
        let fraction = foot_arc_length(self.curvature, along, p.z) / self.length;
        (
            distance_to_circle(self.curvature, along, out, p.z),
            fraction.clamp(0.0, 1.0),
        )
    }
}

impl Backbone {
    pub(crate) fn new(lengths: &[f64; SECTIONS], shape: &Configuration) -> Self {
        let base = Pose {
            rotation: Matrix3::identity(),
            position: Point::zeros(),
        };
        let mut frames = [base; SECTIONS + 1];
        let arcs = std::array::from_fn(|i| {
            let (arc, turned) = Arc::new(shape[2 * i], shape[2 * i + 1], lengths[i]);
            let Pose { rotation, position } = frames[i];
            frames[i + 1] = Pose {
                rotation: rotation * turned,
                position: position + rotation * arc.end,
            };
            arc
        });
        Self { frames, arcs }
    }

    /// Frames of the base and of the end of each section.
    #[must_use]
    pub fn frames(&self) -> &[Pose; SECTIONS + 1] {
        &self.frames
    }

    /// Arc length of a section (0 to 2).
    #[must_use]
    pub fn section_length(&self, section: usize) -> f64 {
        self.arcs[section].length
    }

    /// Position of the tip.
    #[must_use]
    pub fn tip(&self) -> Point {
        self.frames[SECTIONS].position
    }

    /// Position at a fraction (0 to 1) of a section (0 to 2).
    #[must_use]
    pub fn point(&self, section: usize, fraction: f64) -> Point {
        let base = &self.frames[section];
        base.position + base.rotation * self.arcs[section].at(fraction).0
    }

    /// Jacobian ∂point/∂ζ at a fraction of a section: 3 × 6, length unit per radian, base frame.
    #[must_use]
    pub fn point_jacobian(&self, section: usize, fraction: f64) -> SMatrix<f64, 3, DOF> {
        let base = &self.frames[section];
        let (local, derivatives) = self.arcs[section].at(fraction);
        self.jacobian(section, base.position + base.rotation * local, derivatives)
    }

    /// Jacobian of the tip position: 3 × 6, base frame.
    #[must_use]
    pub fn tip_jacobian(&self) -> SMatrix<f64, 3, DOF> {
        self.jacobian(SECTIONS - 1, self.tip(), self.arcs[SECTIONS - 1].linear)
    }

    fn jacobian(
        &self,
        section: usize,
        point: Point,
        local: [Vector3<f64>; 2],
    ) -> SMatrix<f64, 3, DOF> {
        let mut jacobian = SMatrix::<f64, 3, DOF>::zeros();
        for i in 0..section {
            let rotation = &self.frames[i].rotation;
            let arm = point - self.frames[i + 1].position;
            for k in 0..2 {
                let moved = rotation * self.arcs[i].linear[k]
                    + (rotation * self.arcs[i].angular[k]).cross(&arm);
                jacobian.set_column(2 * i + k, &moved);
            }
        }
        for (k, derivative) in local.iter().enumerate() {
            jacobian.set_column(
                2 * section + k,
                &(self.frames[section].rotation * derivative),
            );
        }
        jacobian
    }

    /// Distance from a point (base frame) to the nearest point of a section; cheaper than [`Self::nearest`].
    #[must_use]
    pub fn distance(&self, section: usize, point: &Point) -> f64 {
        self.arcs[section].nearest(&self.local(section, point)).0
    }

    /// The point of a section nearest to a given one (base frame), exact for bending angles up to π.
    #[must_use]
    pub fn nearest(&self, section: usize, point: &Point) -> Nearest {
        let (distance, fraction) = self.arcs[section].nearest(&self.local(section, point));
        Nearest {
            distance,
            fraction,
            point: self.point(section, fraction),
        }
    }

    /// Distance from a section to a point, and its gradient with respect to ζ (envelope theorem: the foot stays).
    #[must_use]
    pub fn distance_gradient(&self, section: usize, point: &Point) -> (f64, Configuration) {
        let nearest = self.nearest(section, point);
        let away = (nearest.point - point) / nearest.distance.max(f64::MIN_POSITIVE);
        (
            nearest.distance,
            self.point_jacobian(section, nearest.fraction).transpose() * away,
        )
    }

    fn local(&self, section: usize, point: &Point) -> Vector3<f64> {
        let base = &self.frames[section];
        base.rotation.tr_mul(&(point - base.position))
    }
}
