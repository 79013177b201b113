//! Paths that another program drew, to be judged as the planners' own.

use anyhow::bail;
use pcc_model::{Configuration, DOF};
use planning::dataset::ArchiveReader;
use planning::{WAYPOINTS, Waypoints};
use std::path::Path;

/// Reads `paths [C, candidates, 64, 6]`, f32 or f64, radians; case by case.
pub(super) fn read(file: &Path, candidates: usize) -> anyhow::Result<Vec<Vec<Waypoints>>> {
    let mut archive = ArchiveReader::open(file)?;
    let cases = archive.shape("paths")?.first().copied().unwrap_or(0) as usize;
    if cases == 0 {
        bail!(
            "array `paths` of {} has no case; at least 1 is needed",
            file.display()
        );
    }
    archive.expect_shape("paths", &[cases, candidates, WAYPOINTS, DOF])?;
    let values = match archive.read::<f32>("paths") {
        Ok((values, _)) => values.into_iter().map(f64::from).collect(),
        Err(_) => archive.read::<f64>("paths")?.0,
    };
    archive.check_all()?;
    let wrong = values.iter().position(|v| !v.is_finite());
    if let Some(index) = wrong {
        let case = index / (candidates * WAYPOINTS * DOF);
        bail!(
            "array `paths` of {} is not finite in case {case}",
            file.display()
        );
    }
    let shapes: Vec<Configuration> = values
        .chunks_exact(DOF)
        .map(Configuration::from_column_slice)
        .collect();
    let paths: Vec<Waypoints> = shapes.chunks_exact(WAYPOINTS).map(<[_]>::to_vec).collect();
    Ok(paths.chunks_exact(candidates).map(<[_]>::to_vec).collect())
}
