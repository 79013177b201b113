//! A scene in 3D by parallel projection: bodies as shaded tubes, balls, tip paths, marks; what is nearer covers what is farther.

use super::canvas::{Area, Drawn, GREY, INK, font, svg};
use collision::Ball;
use pcc_model::{Configuration, Point, Robot, SECTIONS};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::f64::consts::TAU;
use std::ops::Range;

/// Side of a picture, pixels.
const SIDE: i32 = 560;
/// Room at each side, pixels.
const ROOM: f64 = 26.0;
/// Pieces of a section that are covered as a whole, and chords of a piece.
const PIECES: usize = 3;
const CHORDS: usize = 4;
/// A tube's layers, from its edge to its gloss: width and shift towards the light, as shares of the tube's width, and how much the
/// colour is darkened (negative) or lightened.
const LAYERS: [(f64, f64, f64); 4] = [
    (1.0, 0.0, -0.5),
    (0.86, 0.0, -0.1),
    (0.5, 0.1, 0.22),
    (0.16, 0.17, 0.6),
];
/// How much the sections are darkened, from the base.
const SECTION_SHADES: [f64; SECTIONS] = [-0.22, -0.08, 0.08];
const BALL: RGBColor = RGBColor(176, 180, 186);
/// Radius of the plate that the robot stands on, of a section length.
const PLATE: f64 = 0.45;

/// From where a scene is looked at, and how large.
#[derive(Clone, Copy)]
pub(crate) struct Camera {
    right: Point,
    up: Point,
    towards: Point,
    /// Middle of the picture, section lengths along `right` and `up`.
    middle: [f64; 2],
    /// Pixels of a section length.
    scale: f64,
}

impl Camera {
    /// Looks from this azimuth about the z axis, and this elevation, rad, at points with so much room around each.
    pub(crate) fn fitting(
        azimuth: f64,
        elevation: f64,
        points: impl IntoIterator<Item = (Point, f64)>,
    ) -> Self {
        let (sin, cos) = azimuth.sin_cos();
        let (rise, level) = elevation.sin_cos();
        let right = Point::new(-sin, cos, 0.0);
        let up = Point::new(-rise * cos, -rise * sin, level);
        let mut ends = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        let plate = (Point::zeros(), PLATE);
        for (point, room) in points.into_iter().chain([plate]) {
            for (ends, axis) in ends.iter_mut().zip([&right, &up]) {
                let at = axis.dot(&point);
                *ends = [ends[0].min(at - room), ends[1].max(at + room)];
            }
        }
        let size = ends.map(|[low, high]| high - low);
        Self {
            right,
            up,
            towards: Point::new(level * cos, level * sin, rise),
            middle: ends.map(|[low, high]| 0.5 * (low + high)),
            scale: (f64::from(SIDE) - 2.0 * ROOM) / size[0].max(size[1]),
        }
    }

    fn pixel(&self, point: &Point) -> (f64, f64) {
        let half = 0.5 * f64::from(SIDE);
        let x = half + self.scale * (self.right.dot(point) - self.middle[0]);
        let y = half - self.scale * (self.up.dot(point) - self.middle[1]);
        (x, y)
    }
}

/// Something that is drawn as a whole.
struct Piece {
    /// Larger is nearer.
    depth: f64,
    shape: Shape,
}

enum Shape {
    Stroke {
        points: Vec<(i32, i32)>,
        style: ShapeStyle,
    },
    Disc {
        centre: (i32, i32),
        radius: i32,
        colour: RGBColor,
    },
}

/// A scene that is being put together.
pub(crate) struct Scene3d<'a> {
    robot: &'a Robot,
    camera: Camera,
    pieces: Vec<Piece>,
    /// Start and target.
    marks: Vec<(Point, Mark)>,
}

#[derive(Clone, Copy)]
enum Mark {
    Diamond,
    Star,
}

impl<'a> Scene3d<'a> {
    /// An empty scene with a robot of this size.
    pub(crate) fn new(robot: &'a Robot, camera: Camera) -> Self {
        Self {
            robot,
            camera,
            pieces: Vec::new(),
            marks: Vec::new(),
        }
    }

    /// The robot in a configuration.
    pub(crate) fn body(&mut self, configuration: &Configuration, colour: RGBColor) {
        let backbone = self.robot.backbone(configuration);
        for (section, shade) in SECTION_SHADES.into_iter().enumerate() {
            let width = 2.0 * self.robot.tube_radii[section] * self.camera.scale;
            for piece in 0..PIECES {
                let at = |chord| chord as f64 / (PIECES * CHORDS) as f64;
                let first = piece * CHORDS;
                let chords = first.saturating_sub(1)..=(first + CHORDS + 1).min(PIECES * CHORDS);
                let outline = first - chords.start();
                let points = chords.map(|chord| backbone.point(section, at(chord)));
                let points: Vec<Point> = points.collect();
                self.tube(
                    &points,
                    outline..outline + CHORDS + 1,
                    width,
                    shaded(colour, shade),
                );
            }
        }
        let tip = backbone.tip();
        let last = SECTIONS - 1;
        let radius = 0.43 * 2.0 * self.robot.tube_radii[last] * self.camera.scale;
        self.disc(&tip, radius, shaded(colour, 0.25), 0.02);
    }

    /// A piece of a tube through these points. The outline is of a part of them; what is within goes on to both sides and hides the seams.
    fn tube(&mut self, points: &[Point], outline: Range<usize>, width: f64, colour: RGBColor) {
        let depth = self.depth(&points[outline.clone()]);
        for (layer, (share, shift, shade)) in LAYERS.into_iter().enumerate() {
            let shift = shift * width;
            let pixel = |point: &Point| {
                let (x, y) = self.camera.pixel(point);
                whole((x - shift, y - shift))
            };
            let part = if layer == 0 {
                &points[outline.clone()]
            } else {
                points
            };
            let style = shaded(colour, shade).stroke_width((share * width).round() as u32);
            self.pieces.push(Piece {
                depth: depth + 1e-6 * layer as f64,
                shape: Shape::Stroke {
                    points: part.iter().map(pixel).collect(),
                    style,
                },
            });
        }
    }

    fn depth(&self, points: &[Point]) -> f64 {
        let depths = points.iter().map(|point| self.camera.towards.dot(point));
        depths.sum::<f64>() / points.len() as f64
    }

    /// A disc that faces the viewer, so much nearer than its centre.
    fn disc(&mut self, centre: &Point, radius: f64, colour: RGBColor, nearer: f64) {
        self.pieces.push(Piece {
            depth: self.camera.towards.dot(centre) + nearer,
            shape: Shape::Disc {
                centre: whole(self.camera.pixel(centre)),
                radius: radius.round() as i32,
                colour,
            },
        });
    }

    /// A ball, shaded.
    pub(crate) fn ball(&mut self, ball: &Ball) {
        let radius = ball.radius * self.camera.scale;
        let towards_light = self.camera.up - self.camera.right;
        for (layer, shade) in [-0.35, -0.1, 0.12, 0.35, 0.6].into_iter().enumerate() {
            let share = [1.0, 0.95, 0.74, 0.48, 0.2][layer];
            let shift = 0.3 * (1.0 - share) * ball.radius;
            let centre = ball.centre + shift * towards_light;
            self.disc(
                &centre,
                share * radius,
                shaded(BALL, shade),
                1e-4 * layer as f64,
            );
        }
    }

    /// A path of the tip.
    pub(crate) fn path(&mut self, points: &[Point], colour: RGBColor, width: u32) {
        for chord in points.windows(2) {
            let depth = self.depth(chord);
            let points = chord.iter().map(|point| whole(self.camera.pixel(point)));
            let points = points.collect();
            let style = colour.stroke_width(width);
            self.pieces.push(Piece {
                depth,
                shape: Shape::Stroke { points, style },
            });
        }
    }

    /// A dot.
    pub(crate) fn dot(&mut self, point: &Point, colour: RGBColor) {
        self.disc(point, 4.0, colour, 0.0);
    }

    /// A diamond where the tip begins, and a star where it is to go.
    pub(crate) fn ends(&mut self, start: &Point, target: &Point) {
        self.marks.push((*start, Mark::Diamond));
        self.marks.push((*target, Mark::Star));
    }

    pub(crate) fn svg(mut self) -> anyhow::Result<String> {
        let side = SIDE.unsigned_abs();
        self.pieces.sort_by(|a, b| a.depth.total_cmp(&b.depth));
        svg((side, side), |area| {
            self.draw_floor(area)?;
            for piece in &self.pieces {
                match &piece.shape {
                    Shape::Stroke { points, style } => {
                        area.draw(&PathElement::new(points.clone(), *style))?;
                    }
                    Shape::Disc {
                        centre,
                        radius,
                        colour,
                    } => area.draw(&Circle::new(*centre, *radius, colour.filled()))?,
                }
            }
            for (point, mark) in &self.marks {
                draw_mark(area, self.camera.pixel(point), *mark)?;
            }
            Ok(())
        })
    }

    /// The plate under the robot, and a length of one section along x and y.
    fn draw_floor(&self, area: &Area) -> Drawn {
        let at = |x, y| whole(self.camera.pixel(&Point::new(x, y, 0.0)));
        let edge = (0..48).map(|index| {
            let (sin, cos) = (TAU * f64::from(index) / 48.0).sin_cos();
            at(PLATE * cos, PLATE * sin)
        });
        area.draw(&Polygon::new(edge.collect::<Vec<_>>(), GREY.mix(0.35)))?;
        for (end, name) in [((1.0, 0.0), "x"), ((0.0, 1.0), "y")] {
            let tip = at(end.0, end.1);
            let line = [at(0.0, 0.0), tip];
            area.draw(&PathElement::new(line, GREY.stroke_width(2)))?;
            let style = font(18).pos(Pos::new(HPos::Center, VPos::Center));
            let beyond = at(1.12 * end.0, 1.12 * end.1);
            area.draw(&Text::new(name, beyond, style))?;
        }
        Ok(())
    }
}

fn draw_mark(area: &Area, (x, y): (f64, f64), mark: Mark) -> Drawn {
    let (corners, inner, colour) = match mark {
        Mark::Diamond => (4, 1.0, RGBColor(31, 105, 178)),
        Mark::Star => (10, 0.42, RGBColor(222, 60, 50)),
    };
    let corner = |index: i32| {
        let radius = if index % 2 == 0 { 13.0 } else { 13.0 * inner };
        let (sin, cos) = (TAU * f64::from(index) / f64::from(corners)).sin_cos();
        whole((x + radius * sin, y - radius * cos))
    };
    let mut outline: Vec<(i32, i32)> = (0..corners).map(corner).collect();
    area.draw(&Polygon::new(outline.clone(), colour))?;
    outline.extend(outline.first().copied());
    area.draw(&PathElement::new(outline, INK.stroke_width(1)))?;
    Ok(())
}

fn whole((x, y): (f64, f64)) -> (i32, i32) {
    (x.round() as i32, y.round() as i32)
}

/// A colour, darkened (below 0) towards black or lightened towards white.
fn shaded(RGBColor(red, green, blue): RGBColor, shade: f64) -> RGBColor {
    let end = if shade < 0.0 { 0.0 } else { 255.0 };
    let part = |part: u8| (f64::from(part) + shade.abs() * (end - f64::from(part))).round() as u8;
    RGBColor(part(red), part(green), part(blue))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_nearer_to_the_viewer_is_drawn_later_and_points_lie_where_they_are_looked_at() {
        let camera = Camera::fitting(0.0, 0.0, [(Point::new(0.0, 0.0, 2.0), 1.0)]);
        let [near, far] = [1.0, -1.0].map(|x| camera.towards.dot(&Point::new(x, 0.0, 0.0)));
        assert!(near > far);
        let (left, low) = camera.pixel(&Point::new(0.0, -0.5, 0.0));
        let (right, high) = camera.pixel(&Point::new(0.0, 0.5, 1.0));
        assert!(left < right && high < low);
    }

    #[test]
    fn shades_go_to_black_and_white() {
        let colour = RGBColor(10, 100, 200);
        assert_eq!(shaded(colour, 0.0), colour);
        assert_eq!(shaded(colour, -1.0), RGBColor(0, 0, 0));
        assert_eq!(shaded(colour, 1.0), RGBColor(255, 255, 255));
    }
}
