//! Clearance of what was executed by dense sampling: another way of computing it than the certificate's.
//!
//! Nothing here comes from the crates `pcc-model`, `collision` or `trajectory`: kinematics and tendons are written down again
//! from `docs/robot.md`, distances are those of the balls from the chords between points of the backbone, and the motion is
//! looked at again and again between any two samples. What the sampling may miss is bounded and taken off the figure.

use toml::{Table, Value};

/// Chords that stand for one section's arc.
pub const CHORDS_PER_SECTION: usize = 64;
/// No point of the body moves farther than this between two looks at a motion, section lengths of 1 m: m.
const LARGEST_MOVE_M: f64 = 4e-4;
/// Below this bending angle, rad, sin θ/θ and (1 − cos θ)/θ² are taken from their series.
const SMALL_ANGLE_RAD: f64 = 1e-3;

/// A point or a direction, m.
type Vector = [f64; 3];
/// Rows of a rotation.
type Rotation = [[f64; 3]; 3];
/// `[ξ11, ξ12, ξ21, ξ22, ξ31, ξ32]`, rad.
pub type Configuration = [f64; 6];
/// Length changes of the nine tendons, m.
pub type Tendons = [f64; 9];

/// A ball that may move: base frame, m, m/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Its centre at `stamp_ns`.
    pub centre_m: Vector,
    /// Its radius.
    pub radius_m: f64,
    /// Its velocity.
    pub velocity_m_s: Vector,
    /// When its centre was there, ns of CLOCK_MONOTONIC.
    pub stamp_ns: i64,
}

impl Ball {
    /// One that stays where it is.
    #[must_use]
    pub fn resting(centre_m: Vector, radius_m: f64) -> Self {
        Self {
            centre_m,
            radius_m,
            velocity_m_s: [0.0; 3],
            stamp_ns: 0,
        }
    }

    /// Its centre at another instant, m.
    #[must_use]
    pub fn centre_at(&self, stamp_ns: i64) -> Vector {
        let elapsed_s = (stamp_ns - self.stamp_ns) as f64 * 1e-9;
        std::array::from_fn(|axis| self.centre_m[axis] + self.velocity_m_s[axis] * elapsed_s)
    }
}

/// What a robot file says of the body and of its tendons.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    section_lengths_m: [f64; 3],
    tube_radii_m: [f64; 3],
    /// Length change of each tendon, m, for a radian of each component.
    pub(crate) tendon_rows_m: [[f64; 6]; 9],
}

/// The configuration that nine tendon lengths mean.
#[derive(Clone, Copy, Debug)]
pub struct Explained {
    /// By least squares, rad.
    pub configuration: Configuration,
    /// Largest tendon length that it does not explain, m.
    pub residual_m: f64,
}

/// Least distance of a body from balls.
#[derive(Clone, Copy, Debug)]
pub struct Clearance {
    /// The least one found; infinite without balls. Negative: the body reaches into a ball. m.
    pub sampled_m: f64,
    /// The true one is at most so much smaller, m.
    pub error_m: f64,
    /// When the least one was found, ns of CLOCK_MONOTONIC.
    pub stamp_ns: i64,
}

impl Clearance {
    /// The true least clearance is at least this, m.
    #[must_use]
    pub fn at_least_m(&self) -> f64 {
        self.sampled_m - self.error_m
    }
}

impl Body {
    /// From the text of a robot file.
    ///
    /// # Panics
    /// Where it is not one with three sections and nine tendons.
    #[must_use]
    pub fn from_robot_file(text: &str) -> Self {
        let file: Table = text.parse().expect("a robot file is TOML");
        let lengths = file["section_lengths_m"].as_array().expect("lengths");
        let tendons = file["tendons"].as_array().expect("tendons");
        assert_eq!((lengths.len(), tendons.len()), (3, 9));
        Self {
            section_lengths_m: std::array::from_fn(|section| number(&lengths[section])),
            tube_radii_m: [number(&file["tube_radius_m"]); 3],
            tendon_rows_m: std::array::from_fn(|tendon| tendon_row(&tendons[tendon])),
        }
    }

    /// The same body with a thicker tube around each section, m.
    #[must_use]
    pub fn padded(&self, padding_m: &[f64; 3]) -> Self {
        let tube_radii_m = std::array::from_fn(|k| self.tube_radii_m[k] + padding_m[k]);
        Self {
            tube_radii_m,
            ..self.clone()
        }
    }

    /// Tendon length changes that a configuration means, m.
    #[must_use]
    pub fn tendons(&self, configuration: &Configuration) -> Tendons {
        let row = |row: &[f64; 6]| row.iter().zip(configuration).map(|(a, b)| a * b).sum();
        self.tendon_rows_m.each_ref().map(row)
    }

    /// The configuration that tendon lengths mean: the normal equations, by elimination.
    #[must_use]
    pub fn explain(&self, tendons_m: &Tendons) -> Explained {
        let mut system = [[0.0; 7]; 6];
        for (row, length) in self.tendon_rows_m.iter().zip(tendons_m) {
            for i in 0..6 {
                for j in 0..6 {
                    system[i][j] += row[i] * row[j];
                }
                system[i][6] += row[i] * length;
            }
        }
        let configuration = solve(system);
        let meant = self.tendons(&configuration);
        let errors = meant.iter().zip(tendons_m).map(|(a, b)| (a - b).abs());
        Explained {
            configuration,
            residual_m: errors.fold(0.0, f64::max),
        }
    }

    /// Points of the backbone from the base to the tip, [`CHORDS_PER_SECTION`] chords a section, m.
    #[must_use]
    pub fn backbone(&self, configuration: &Configuration) -> Vec<Vector> {
        let (mut origin, mut frame) = ([0.0; 3], IDENTITY);
        let mut points = vec![origin];
        for section in 0..3 {
            let bending = [configuration[2 * section], configuration[2 * section + 1]];
            let length = self.section_lengths_m[section];
            for chord in 1..=CHORDS_PER_SECTION {
                let fraction = chord as f64 / CHORDS_PER_SECTION as f64;
                let (place, _) = bent(scaled(bending, fraction), length * fraction);
                points.push(add(origin, turn(&frame, place)));
            }
            let (_, rotation) = bent(bending, length);
            origin = *points.last().expect("the base is there");
            frame = product(&frame, &rotation);
        }
        points
    }

    /// Where the tip is, m.
    #[must_use]
    pub fn tip(&self, configuration: &Configuration) -> Vector {
        *self.backbone(configuration).last().expect("it has points")
    }

    /// Distance of the tip that a configuration means from a point, m.
    #[must_use]
    pub fn tip_error(&self, configuration: &Configuration, point: &Vector) -> f64 {
        norm(subtract(self.tip(configuration), *point))
    }

    /// Least distance between the tube's surface and the balls' at an instant, m; infinite without balls.
    ///
    /// The true one differs by at most [`Body::chord_error_m`].
    #[must_use]
    pub fn clearance(&self, configuration: &Configuration, balls: &[Ball], stamp_ns: i64) -> f64 {
        let points = self.backbone(configuration);
        let mut least = f64::INFINITY;
        for ball in balls {
            let centre = ball.centre_at(stamp_ns);
            for (index, chord) in points.windows(2).enumerate() {
                let distance = distance_from_chord(centre, chord[0], chord[1]);
                let tube_m = self.tube_radii_m[index / CHORDS_PER_SECTION];
                least = least.min(distance - ball.radius_m - tube_m);
            }
        }
        least
    }

    /// How far an arc may stray from its chords, m: κh²/8 with chords of length h, for bending angles up to 2 rad.
    #[must_use]
    pub fn chord_error_m(&self) -> f64 {
        let longest = self.section_lengths_m.iter().copied().fold(0.0, f64::max);
        let chords = CHORDS_PER_SECTION as f64;
        2.0 * longest / (8.0 * chords * chords)
    }

    /// Least clearance over executed set-points and over straight lines (in configuration space) between neighbours.
    ///
    /// `balls`: what is there at an instant. Between two looks no point of the body moves farther than 0.4 mm, and half of that
    /// (with half of the fastest ball's way) is what may be missed.
    pub fn least_clearance<'a>(
        &self,
        setpoints: &[(i64, Tendons)],
        balls: impl Fn(i64) -> &'a [Ball],
    ) -> Clearance {
        let mut least = Clearance {
            sampled_m: f64::INFINITY,
            error_m: 0.5 * LARGEST_MOVE_M + self.chord_error_m(),
            stamp_ns: 0,
        };
        let shapes: Vec<Configuration> = setpoints
            .iter()
            .map(|(_, tendons)| self.explain(tendons).configuration)
            .collect();
        for index in 0..setpoints.len() {
            let next = (index + 1).min(setpoints.len() - 1);
            let ends = [setpoints[index].0, setpoints[next].0];
            let looks = self.looks_between(&shapes[index], &shapes[next], balls(ends[0]), ends);
            for look in 0..looks {
                let fraction = look as f64 / looks as f64;
                let stamp_ns = ends[0] + ((ends[1] - ends[0]) as f64 * fraction) as i64;
                let shape = between(&shapes[index], &shapes[next], fraction);
                let clearance = self.clearance(&shape, balls(stamp_ns), stamp_ns);
                if clearance.is_nan() || clearance < least.sampled_m {
                    (least.sampled_m, least.stamp_ns) = (clearance, stamp_ns);
                }
            }
        }
        least
    }

    /// Into how many parts a move is divided, so that body and balls come no nearer than [`LARGEST_MOVE_M`] to each other in one.
    fn looks_between(
        &self,
        from: &Configuration,
        to: &Configuration,
        balls: &[Ball],
        ends_ns: [i64; 2],
    ) -> usize {
        if balls.is_empty() {
            return 1;
        }
        let speed = |ball: &Ball| norm(ball.velocity_m_s);
        let fastest = balls.iter().map(speed).fold(0.0, f64::max);
        let elapsed_s = (ends_ns[1] - ends_ns[0]) as f64 * 1e-9;
        let most = self.largest_move_m(from, to) + fastest * elapsed_s;
        (most / LARGEST_MOVE_M).ceil().max(1.0) as usize
    }

    /// No point of the body is faster than this while the configuration changes at a rate, m/s: see `Body::largest_move_m`.
    #[must_use]
    pub fn speed_at_most_m_s(&self, rate_rad_s: &Configuration) -> f64 {
        self.largest_move_m(&[0.0; 6], rate_rad_s)
    }

    /// No point of the body moves farther than this on a straight line between two configurations, m: each bending that changes
    /// turns what lies beyond it, and is a rotation by at most its own change.
    fn largest_move_m(&self, from: &Configuration, to: &Configuration) -> f64 {
        let mut most = 0.0;
        for section in 0..3 {
            let beyond_m: f64 = self.section_lengths_m[section..].iter().sum();
            let change = [0, 1].map(|i| to[2 * section + i] - from[2 * section + i]);
            most += beyond_m * change[0].hypot(change[1]);
        }
        most
    }
}

const IDENTITY: Rotation = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

fn number(value: &Value) -> f64 {
    let whole = value.as_integer().map(|whole| whole as f64);
    value.as_float().or(whole).expect("a number")
}

/// Δl = r Σ (ξ_k1 sin ψ − ξ_k2 cos ψ), over the sections up to the one that the tendon ends in.
fn tendon_row(tendon: &Value) -> [f64; 6] {
    let radius = number(&tendon["radius_m"]);
    let (sin, cos) = number(&tendon["angle_deg"]).to_radians().sin_cos();
    let sections = tendon["section"].as_integer().expect("a section") as usize;
    let mut row = [0.0; 6];
    for section in 0..sections {
        row[2 * section] = radius * sin;
        row[2 * section + 1] = -radius * cos;
    }
    row
}

/// Where a section bent by (a, b) ends in its base frame, and how its end is turned:
/// R = I + A ŵ + B ŵ², p = L (B b, −B a, A), w = (a, b, 0).
fn bent([a, b]: [f64; 2], length: f64) -> (Vector, Rotation) {
    let squared = a * a + b * b;
    let angle = squared.sqrt();
    let (first, second) = if angle < SMALL_ANGLE_RAD {
        (1.0 - squared / 6.0, 0.5 - squared / 24.0)
    } else {
        let half = (0.5 * angle).sin();
        (angle.sin() / angle, 2.0 * half * half / squared)
    };
    let hat = [[0.0, 0.0, b], [0.0, 0.0, -a], [-b, a, 0.0]];
    let square = product(&hat, &hat);
    let mut rotation = IDENTITY;
    for i in 0..3 {
        for j in 0..3 {
            rotation[i][j] += first * hat[i][j] + second * square[i][j];
        }
    }
    let place = [length * second * b, -length * second * a, length * first];
    (place, rotation)
}

fn product(left: &Rotation, right: &Rotation) -> Rotation {
    let mut result = [[0.0; 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            for k in 0..3 {
                result[i][j] += left[i][k] * right[k][j];
            }
        }
    }
    result
}

fn turn(rotation: &Rotation, v: Vector) -> Vector {
    rotation.map(|row| dot(row, v))
}

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn norm(v: Vector) -> f64 {
    dot(v, v).sqrt()
}

fn add(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

fn subtract(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn scaled(bending: [f64; 2], factor: f64) -> [f64; 2] {
    bending.map(|component| component * factor)
}

fn between(from: &Configuration, to: &Configuration, fraction: f64) -> Configuration {
    std::array::from_fn(|i| from[i] + fraction * (to[i] - from[i]))
}

fn distance_from_chord(point: Vector, begin: Vector, end: Vector) -> f64 {
    let along = subtract(end, begin);
    let offset = subtract(point, begin);
    let fraction = (dot(offset, along) / dot(along, along)).clamp(0.0, 1.0);
    norm(subtract(offset, along.map(|x| x * fraction)))
}

/// Gauss–Jordan with pivots; the last column is the right-hand side.
fn solve(mut system: [[f64; 7]; 6]) -> [f64; 6] {
    for column in 0..6 {
        let size = |row: usize| system[row][column].abs();
        let pivot = (column..6)
            .max_by(|a, b| size(*a).total_cmp(&size(*b)))
            .expect("rows are left");
        system.swap(column, pivot);
        let pivot_row = system[column];
        for row in (0..6).filter(|row| *row != column) {
            let factor = system[row][column] / pivot_row[column];
            for (value, pivot) in system[row].iter_mut().zip(pivot_row) {
                *value -= factor * pivot;
            }
        }
    }
    std::array::from_fn(|row| system[row][6] / system[row][row])
}

#[cfg(test)]
mod tests;
