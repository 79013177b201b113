//! The whole backbone of one configuration: frames, points, Jacobians, exact distances.

use crate::arc::{Nearest, distance_to_circle, foot_arc_length, squared_distances_to_circle};
use crate::lanes::norms_squared;
use crate::section::Arc;
use crate::{Configuration, DOF, Point, SECTIONS};
use fearless_simd::f64x4;
use fearless_simd::prelude::*;
use nalgebra::{Matrix3, SMatrix, Vector3};
use std::f64::consts::{PI, TAU};

/// A rigid frame in the base frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// The frame's axes in the base frame, as columns; the third is the backbone's tangent.
    pub rotation: Matrix3<f64>,
    /// The frame's origin in the base frame.
    pub position: Point,
}

impl Pose {
    /// The frame at the end of a section that begins at this frame.
    fn then(&self, section: &Section) -> Self {
        Self {
            rotation: self.rotation * section.arc.rotation(),
            position: self.position + self.rotation * section.end,
        }
    }
}

/// The backbone of one configuration; plain data, nothing on the heap.
#[derive(Clone, Copy, Debug)]
pub struct Backbone {
    frames: [Pose; SECTIONS + 1],
    sections: [Section; SECTIONS],
}

/// One section, seen from its base frame.
#[derive(Clone, Copy, Debug)]
struct Section {
    arc: Arc,
    curvature: f64,
    /// Unit bending direction in the x–y plane; any where the section is straight.
    direction: [f64; 2],
    end: Vector3<f64>,
    end_tangent: Vector3<f64>,
}

impl Section {
    #[inline(always)]
    fn new(arc: Arc) -> Self {
        let direction = if arc.angle > 0.0 {
            let scale = 1.0 / arc.angle;
            [arc.y * scale, -arc.x * scale]
        } else {
            [1.0, 0.0]
        };
        Self {
            arc,
            curvature: arc.angle / arc.length,
            direction,
            end: arc.end(),
            end_tangent: arc.end_tangent(),
        }
    }

    /// Distance of a point in the section's base frame from the arc, and the fraction of the arc where it is nearest.
    fn nearest(&self, p: &Vector3<f64>) -> (f64, f64) {
        if let Some(nearest) = self.nearest_end(p) {
            return nearest;
        }
        let (along, out) = self.in_plane_and_out(p);
        let mut foot = foot_arc_length(self.curvature, along, p.z);
        if foot < 0.0 && self.arc.angle > PI {
            foot += TAU / self.curvature;
        }
        let distance = distance_to_circle(self.curvature, along, out, p.z);
        (distance, (foot / self.arc.length).clamp(0.0, 1.0))
    }

    /// Distance of a point in the section's base frame from the arc.
    fn distance(&self, p: &Vector3<f64>) -> f64 {
        if let Some((distance, _)) = self.nearest_end(p) {
            return distance;
        }
        let (along, out) = self.in_plane_and_out(p);
        distance_to_circle(self.curvature, along, out, p.z)
    }

    /// Distances of four points in the section's base frame from the arc, `p` axis by axis.
    #[inline(always)]
    fn distances<S: Simd>(&self, p: &[f64x4<S>; 3]) -> f64x4<S> {
        let [x, y, z] = *p;
        let (from_end, tangent) = (minus(p, &self.end), &self.end_tangent);
        let beyond_end = dot(&from_end, [tangent.x, tangent.y, tangent.z]);
        let (after_base, before_end) = (z.simd_ge(0.0), beyond_end.simd_le(0.0));
        let has_inner_foot = if self.arc.angle <= PI {
            after_base & before_end
        } else {
            after_base | before_end
        };
        let [dx, dy] = self.direction;
        let (along, out) = (x * dx + y * dy, y * dx - x * dy);
        let to_circle = squared_distances_to_circle(self.curvature, along, out, z);
        let to_ends = norms_squared(p).min(norms_squared(&from_end));
        has_inner_foot.select(to_circle, to_ends).sqrt()
    }

    /// Distance to an end of the arc and that end's fraction, where no inner point is nearest.
    ///
    /// The half-planes of the points after the base and before the end: up to half a turn the arc is in both of them,
    /// beyond it each of its points is in one.
    fn nearest_end(&self, p: &Vector3<f64>) -> Option<(f64, f64)> {
        let from_end = p - self.end;
        let (after_base, before_end) = (p.z >= 0.0, from_end.dot(&self.end_tangent) <= 0.0);
        let has_inner_foot = if self.arc.angle <= PI {
            after_base && before_end
        } else {
            after_base || before_end
        };
        if has_inner_foot {
            return None;
        }
        let (to_base, to_end) = (p.norm_squared(), from_end.norm_squared());
        Some(if to_base <= to_end {
            (to_base.sqrt(), 0.0)
        } else {
            (to_end.sqrt(), 1.0)
        })
    }

    fn in_plane_and_out(&self, p: &Vector3<f64>) -> (f64, f64) {
        let [x, y] = self.direction;
        (p.x * x + p.y * y, p.y * x - p.x * y)
    }
}

impl Backbone {
    /// The backbone of sections of these lengths in a configuration.
    #[must_use]
    pub fn new(lengths: &[f64; SECTIONS], configuration: &Configuration) -> Self {
        let base = Pose {
            rotation: Matrix3::identity(),
            position: Point::zeros(),
        };
        let [first, second, third] = Arc::of_sections(lengths, configuration);
        let [first, second, third] = [
            Section::new(first),
            Section::new(second),
            Section::new(third),
        ];
        let after_first = Pose {
            rotation: first.arc.rotation(),
            position: first.end,
        };
        let after_second = after_first.then(&second);
        Self {
            frames: [base, after_first, after_second, after_second.then(&third)],
            sections: [first, second, third],
        }
    }

    /// Position of the tip in the base frame, the same bits as [`Self::tip`] of the whole backbone.
    #[must_use]
    pub fn tip_of(lengths: &[f64; SECTIONS], configuration: &Configuration) -> Point {
        let (mut rotation, mut tip) = (Matrix3::identity(), Point::zeros());
        for (i, length) in lengths.iter().enumerate() {
            let arc = Arc::new(configuration[2 * i], configuration[2 * i + 1], *length);
            tip += rotation * arc.end();
            if i + 1 < SECTIONS {
                rotation *= arc.rotation();
            }
        }
        tip
    }

    /// Frames of the base and of the end of each section.
    #[must_use]
    pub fn frames(&self) -> &[Pose; SECTIONS + 1] {
        &self.frames
    }

    /// Arc length of a section (0 to 2).
    #[must_use]
    pub fn section_length(&self, section: usize) -> f64 {
        self.sections[section].arc.length
    }

    /// Bending angle of a section (0 to 2), rad.
    #[must_use]
    pub fn bending_angle(&self, section: usize) -> f64 {
        self.sections[section].arc.angle
    }

    /// Position of the tip.
    #[must_use]
    pub fn tip(&self) -> Point {
        self.frames[SECTIONS].position
    }

    /// Position at a fraction (0 to 1) of a section (0 to 2).
    #[must_use]
    pub fn point(&self, section: usize, fraction: f64) -> Point {
        self.in_base(section, &self.sections[section].arc.part(fraction).end())
    }

    /// Position of the middle of a section (0 to 2); cheaper than [`Self::point`] at 0.5.
    #[must_use]
    pub fn middle(&self, section: usize) -> Point {
        self.in_base(section, &self.sections[section].arc.middle())
    }

    /// Jacobian ∂point/∂ζ at a fraction of a section: 3 × 6, length unit per radian, base frame.
    #[must_use]
    pub fn point_jacobian(&self, section: usize, fraction: f64) -> SMatrix<f64, 3, DOF> {
        let part = self.sections[section].arc.part(fraction);
        let own = part.end_derivatives().map(|d| d * fraction);
        self.jacobian(section, &self.in_base(section, &part.end()), &own)
    }

    /// Jacobian ∂tip/∂ζ: 3 × 6, length unit per radian, base frame.
    #[must_use]
    pub fn tip_jacobian(&self) -> SMatrix<f64, 3, DOF> {
        let last = SECTIONS - 1;
        let own = self.sections[last].arc.end_derivatives();
        self.jacobian(last, &self.tip(), &own)
    }

    /// Jacobian ∂point/∂ζ of a point (base frame) of a section; `own` are its derivatives in the base frame of that section.
    fn jacobian(
        &self,
        section: usize,
        point: &Point,
        own: &[Vector3<f64>; 2],
    ) -> SMatrix<f64, 3, DOF> {
        let mut jacobian = SMatrix::<f64, 3, DOF>::zeros();
        for i in 0..section {
            let rotation = &self.frames[i].rotation;
            let arm = point - self.frames[i + 1].position;
            let arc = &self.sections[i].arc;
            let (linear, angular) = (arc.end_derivatives(), arc.angular_derivatives());
            for k in 0..2 {
                let moved = rotation * linear[k] + (rotation * angular[k]).cross(&arm);
                jacobian.set_column(2 * i + k, &moved);
            }
        }
        for (k, derivative) in own.iter().enumerate() {
            jacobian.set_column(
                2 * section + k,
                &(self.frames[section].rotation * derivative),
            );
        }
        jacobian
    }

    /// Distance from a point (base frame) to a section, exact for bending angles below 2π.
    #[must_use]
    pub fn distance(&self, section: usize, point: &Point) -> f64 {
        self.sections[section].distance(&self.in_section(section, point))
    }

    /// Distances from four points (base frame, axis by axis, length unit) to a section, exact for bending angles below 2π; the same
    /// bits as [`Self::distance`].
    #[must_use]
    #[inline(always)]
    pub fn distances<S: Simd>(&self, section: usize, points: &[f64x4<S>; 3]) -> f64x4<S> {
        let Pose { rotation, position } = &self.frames[section];
        let away = minus(points, position);
        let x = dot(&away, [rotation.m11, rotation.m21, rotation.m31]);
        let y = dot(&away, [rotation.m12, rotation.m22, rotation.m32]);
        let z = dot(&away, [rotation.m13, rotation.m23, rotation.m33]);
        self.sections[section].distances(&[x, y, z])
    }

    /// The point of a section nearest to a given one (base frame), exact for bending angles below 2π.
    #[must_use]
    pub fn nearest(&self, section: usize, point: &Point) -> Nearest {
        let (distance, fraction) = self.sections[section].nearest(&self.in_section(section, point));
        Nearest {
            distance,
            fraction,
            point: self.point(section, fraction),
        }
    }

    fn in_section(&self, section: usize, point: &Point) -> Vector3<f64> {
        let frame = &self.frames[section];
        frame.rotation.tr_mul(&(point - frame.position))
    }

    fn in_base(&self, section: usize, local: &Vector3<f64>) -> Point {
        let frame = &self.frames[section];
        frame.position + frame.rotation * local
    }
}

// The functions below are written out: closures would not be compiled for the processor's vector instructions.

#[inline(always)]
fn minus<S: Simd>([x, y, z]: &[f64x4<S>; 3], by: &Vector3<f64>) -> [f64x4<S>; 3] {
    [*x - by.x, *y - by.y, *z - by.z]
}

#[inline(always)]
fn dot<S: Simd>([x, y, z]: &[f64x4<S>; 3], by: [f64; 3]) -> f64x4<S> {
    *x * by[0] + *y * by[1] + *z * by[2]
}
