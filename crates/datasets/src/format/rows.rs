//! The rows of a data set from its arrays, each checked.

use super::columns::{integers, reals, rows_of};
use super::error::DatasetError;
use crate::archive::error::ArchiveError;
use crate::archive::reader::ArchiveReader;
use crate::row::{Check, Row, Split};
use collision::{Ball, MAX_EXTENT};
use pcc_model::{Configuration, DOF, Point, SECTIONS};
use planning::WAYPOINTS;

/// Arrays of one whole number a row.
const INDICES: [&str; 4] = [
    "target_indices",
    "start_indices",
    "ik_indices",
    "split_indices",
];

/// Most that a section of any robot bends, rad, and what rounding to f32 may add to it.
const MOST_BENDING_RAD: f64 = std::f64::consts::PI + 1e-5;

/// The sizes of a set's arrays, which fit each other.
pub(super) struct Shapes {
    pub(super) rows: usize,
    balls: usize,
    has_radii: bool,
    has_checks: bool,
}

impl Shapes {
    /// Compares the shapes of all arrays; no value is read.
    pub(super) fn check(archive: &ArchiveReader) -> Result<Self, ArchiveError> {
        let (rows, balls) = (
            rows_of(archive, "paths")?,
            rows_of(archive, "obstacle_centres")?,
        );
        archive.expect_shape("paths", &[rows, WAYPOINTS, DOF])?;
        archive.expect_shape("target_tips", &[rows, 3])?;
        for array in INDICES {
            archive.expect_shape(array, &[rows])?;
        }
        archive.expect_shape("obstacle_centres", &[balls, 3])?;
        archive.expect_shape("obstacle_offsets", &[rows.saturating_add(1)])?;
        let has_radii = archive.has("obstacle_radii");
        if has_radii {
            archive.expect_shape("obstacle_radii", &[balls])?;
        }
        let has_checks = archive.has("clearances") || archive.has("certified");
        if has_checks {
            archive.expect_shape("clearances", &[rows])?;
            archive.expect_shape("certified", &[rows])?;
        }
        Ok(Self {
            rows,
            balls,
            has_radii,
            has_checks,
        })
    }
}

/// Reads all rows.
pub(super) fn read_rows(
    archive: &mut ArchiveReader,
    shapes: &Shapes,
    sphere_radius: f64,
) -> Result<Vec<Row>, DatasetError> {
    let columns = Columns::read(archive, shapes, sphere_radius)?;
    let row = |i: usize| {
        columns.row(i).map_err(|reason| DatasetError::Row {
            path: archive.path().into(),
            row: i,
            reason,
        })
    };
    (0..shapes.rows).map(row).collect()
}

/// All arrays of a set.
struct Columns {
    paths: Vec<f32>,
    tips: Vec<f32>,
    /// Values of the arrays that [`INDICES`] names.
    indices: [Vec<i64>; 4],
    obstacles: Obstacles,
    /// Clearances, and whether each path is certified.
    checks: Option<(Vec<f32>, Vec<i64>)>,
}

impl Columns {
    fn read(
        archive: &mut ArchiveReader,
        shapes: &Shapes,
        sphere_radius: f64,
    ) -> Result<Self, ArchiveError> {
        let [targets, starts, ends, splits] = INDICES.map(|array| integers(archive, array));
        Ok(Self {
            paths: reals(archive, "paths")?,
            tips: reals(archive, "target_tips")?,
            indices: [targets?, starts?, ends?, splits?],
            obstacles: Obstacles::read(archive, shapes, sphere_radius)?,
            checks: match shapes.has_checks {
                true => Some((
                    reals(archive, "clearances")?,
                    integers(archive, "certified")?,
                )),
                false => None,
            },
        })
    }

    /// A row, or what is wrong with it.
    fn row(&self, i: usize) -> Result<Row, String> {
        let [targets, starts, ends, splits] = &self.indices;
        Ok(Row {
            path: read_path(&self.paths[i * WAYPOINTS * DOF..][..WAYPOINTS * DOF])?,
            target_tip: read_tip(&self.tips[3 * i..][..3])?,
            target_index: index(INDICES[0], targets[i])?,
            start_index: index(INDICES[1], starts[i])?,
            ik_index: index(INDICES[2], ends[i])?,
            split: split_of(splits[i])?,
            balls: self.obstacles.of(i)?,
            check: self.check(i)?,
        })
    }

    fn check(&self, row: usize) -> Result<Option<Check>, String> {
        let Some((clearances, certified)) = &self.checks else {
            return Ok(None);
        };
        let (clearance, certified) = (clearances[row], certified[row]);
        if clearance.is_nan() || !(0..=1).contains(&certified) {
            return Err(format!(
                "clearance {clearance}, certified {certified}; a number, and 0 or 1 are needed"
            ));
        }
        Ok(Some(Check {
            clearance,
            is_certified: certified == 1,
        }))
    }
}

struct Obstacles {
    centres: Vec<f32>,
    radii: Vec<f32>,
    offsets: Vec<i64>,
}

impl Obstacles {
    fn read(
        archive: &mut ArchiveReader,
        shapes: &Shapes,
        default_radius: f64,
    ) -> Result<Self, ArchiveError> {
        let obstacles = Self {
            centres: reals(archive, "obstacle_centres")?,
            radii: match shapes.has_radii {
                true => reals(archive, "obstacle_radii")?,
                false => vec![default_radius as f32; shapes.balls],
            },
            offsets: integers(archive, "obstacle_offsets")?,
        };
        let [begin, end] = [obstacles.offsets[0], obstacles.offsets[shapes.rows]];
        if begin != 0 {
            let reason = format!("row 0 begins with obstacle {begin}; obstacle 0 is needed");
            return Err(archive.wrong("obstacle_offsets", reason));
        }
        if end != shapes.balls as i64 {
            let balls = shapes.balls;
            let reason = format!(
                "the last row ends before obstacle {end}; {balls}, the number of obstacles, is needed"
            );
            return Err(archive.wrong("obstacle_offsets", reason));
        }
        Ok(obstacles)
    }

    /// The obstacles of a row.
    fn of(&self, row: usize) -> Result<Vec<Ball>, String> {
        let (first, end) = (self.offsets[row], self.offsets[row + 1]);
        if first < 0 || end < first || end as usize > self.radii.len() {
            return Err(format!(
                "`obstacle_offsets` are {first} and {end}; they must rise and stay within 0..={}",
                self.radii.len()
            ));
        }
        let ball = |i: usize| Ball {
            centre: Point::from_fn(|axis, _| f64::from(self.centres[3 * i + axis])),
            radius: f64::from(self.radii[i]),
        };
        let balls: Vec<Ball> = (first as usize..end as usize).map(ball).collect();
        match balls.iter().find(|ball| !ball.is_allowed()) {
            None => Ok(balls),
            Some(Ball { centre, radius }) => Err(format!(
                "an obstacle of `obstacle_centres` is at {:?}, its radius is {radius}; coordinates within ±{MAX_EXTENT:e} and a radius of 0 to {MAX_EXTENT:e} are allowed",
                <[f64; 3]>::from(*centre)
            )),
        }
    }
}

fn read_path(values: &[f32]) -> Result<Vec<Configuration>, String> {
    for (index, section) in values.chunks_exact(2).enumerate() {
        let bending = f64::from(section[0]).hypot(f64::from(section[1]));
        if bending.is_nan() || bending > MOST_BENDING_RAD {
            let (waypoint, number) = (2 * index / DOF, index % SECTIONS + 1);
            return Err(format!(
                "waypoint {waypoint} of its `paths` bends section {number} by {section:?}; finite angles of together at most π rad are allowed"
            ));
        }
    }
    let waypoints = values.chunks_exact(DOF);
    Ok(waypoints
        .map(|c| Configuration::from_fn(|d, _| f64::from(c[d])))
        .collect())
}

fn read_tip(values: &[f32]) -> Result<Point, String> {
    let extent = -MAX_EXTENT..=MAX_EXTENT;
    if !values.iter().all(|v| extent.contains(&f64::from(*v))) {
        return Err(format!(
            "its `target_tips` are {values:?}; coordinates within ±{MAX_EXTENT:e} are allowed"
        ));
    }
    Ok(Point::from_fn(|axis, _| f64::from(values[axis])))
}

fn index<T: TryFrom<i64>>(array: &str, value: i64) -> Result<T, String> {
    let index = Some(value).filter(|value| *value >= 0);
    let index = index.and_then(|value| T::try_from(value).ok());
    index.ok_or_else(|| {
        format!(
            "`{array}` is {value}; 0 to {} is allowed",
            (1_u64 << (8 * size_of::<T>() - 1)) - 1
        )
    })
}

fn split_of(code: i64) -> Result<Split, String> {
    [Split::Train, Split::Validation, Split::Test]
        .into_iter()
        .find(|s| i64::from(s.code()) == code)
        .ok_or_else(|| format!("`split_indices` is {code}; 0, 1 or 2 is needed"))
}
