//! Training arrays of the few-step model, made from a data set.

use crate::archive::error::ArchiveError;
use crate::archive::writer::ArchiveWriter;
use crate::row::Row;
use collision::{Scene, SceneError};
use denoiser::FeatureFrame;
use pcc_model::{Configuration, UnitRobot};
use planning::{BALL_FEATURES, COEFFICIENTS, END_FEATURES, residual_coefficients};
use std::path::Path;

/// Rows of training arrays, all in one kind of frame, four a path in this order: the path, its mirror image, the path backwards,
/// its mirror image.
#[derive(Clone, Debug, Default)]
pub struct TrainingRows {
    frame: FeatureFrame,
    ends: Vec<f32>,
    balls: Vec<f32>,
    ball_offsets: Vec<i64>,
    coefficients: Vec<f32>,
    groups: Vec<i64>,
}

/// Computes the training arrays of some rows; `group` is the same for all rows of one target, that of the path forwards.
///
/// # Errors
/// [`SceneError`] where the obstacles of a row do not make a scene.
pub fn training_rows(
    robot: &UnitRobot,
    rows: &[Row],
    first_group: u32,
    frame: FeatureFrame,
) -> Result<TrainingRows, SceneError> {
    let mut out = TrainingRows {
        frame,
        ball_offsets: vec![0],
        ..TrainingRows::default()
    };
    for row in rows {
        let scene = Scene::new(row.balls.clone())?;
        let backwards: Vec<Configuration> = row.path.iter().rev().copied().collect();
        let start_tip = robot.tip(&row.path[0]);
        let ways = [(&row.path, &row.target_tip), (&backwards, &start_tip)];
        for ((path, tip), mirrored) in ways.into_iter().flat_map(|way| [(way, false), (way, true)])
        {
            let (features, coefficients) =
                residual_coefficients(robot, path, tip, &scene, frame, mirrored);
            out.ends.extend(&features.ends);
            out.balls.extend(&features.balls);
            out.ball_offsets
                .push((out.balls.len() / BALL_FEATURES) as i64);
            out.coefficients.extend(coefficients.map(|c| c as f32));
            out.groups
                .push(i64::from(first_group) + i64::from(row.target_index));
        }
    }
    Ok(out)
}

impl TrainingRows {
    /// Number of rows.
    #[must_use]
    pub fn count(&self) -> usize {
        self.groups.len()
    }

    /// Writes the arrays `ends`, `balls`, `ball_offsets`, `coefficients`, `group`, and `frame` (0 canonical, 1 base).
    ///
    /// # Errors
    /// [`ArchiveError`].
    pub fn write(&self, file: &Path) -> Result<(), ArchiveError> {
        let mut archive = ArchiveWriter::create(file)?;
        let (rows, balls) = (self.count(), self.balls.len() / BALL_FEATURES);
        let (ends, offsets) = (self.ends.iter().copied(), self.ball_offsets.iter().copied());
        archive.write("ends", &[rows, END_FEATURES], ends)?;
        let features = self.balls.iter().copied();
        archive.write("balls", &[balls, BALL_FEATURES], features)?;
        archive.write("ball_offsets", &[rows + 1], offsets)?;
        let coefficients = self.coefficients.iter().copied();
        archive.write("coefficients", &[rows, COEFFICIENTS], coefficients)?;
        archive.write("group", &[rows], self.groups.iter().copied())?;
        archive.write("frame", &[1], [self.frame as u8])?;
        archive.finish()
    }
}
