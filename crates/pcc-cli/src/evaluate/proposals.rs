//! Paths that another program drew, to be judged as the planners' own.

use anyhow::bail;
use datasets::ArchiveReader;
use pcc_model::{Configuration, DOF};
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
    archive.expect_type("paths", &["<f4", "<f8"])?;
    let values: Vec<f64> = if archive.descr("paths")? == "<f4" {
        let (values, _) = archive.read::<f32>("paths")?;
        values.into_iter().map(f64::from).collect()
    } else {
        archive.read("paths")?.0
    };
    archive.check_all()?;
    if let Some(index) = values.iter().position(|v| !v.is_finite()) {
        let case = index / (candidates * WAYPOINTS * DOF);
        bail!(
            "array `paths` of {} has the value {} in case {case}; finite values are needed",
            file.display(),
            values[index]
        );
    }
    let shapes: Vec<Configuration> = values
        .chunks_exact(DOF)
        .map(Configuration::from_column_slice)
        .collect();
    let paths: Vec<Waypoints> = shapes.chunks_exact(WAYPOINTS).map(<[_]>::to_vec).collect();
    Ok(paths.chunks_exact(candidates).map(<[_]>::to_vec).collect())
}
