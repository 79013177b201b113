//! Reading the arrays of a data set, whatever width their numbers have.

use super::archive::{ArchiveError, ArchiveReader};
use super::format::DatasetError;

/// First dimension of a shape; 0 for a scalar, which no array of rows is.
pub(super) fn first(shape: &[u64]) -> usize {
    shape.first().map_or(0, |n| *n as usize)
}

/// An array of real numbers; f32, as the format has it, or f64.
pub(super) fn reals(
    archive: &mut ArchiveReader,
    array: &'static str,
) -> Result<(Vec<f32>, Vec<u64>), ArchiveError> {
    let narrow = |v: f64| v as f32;
    archive.read::<f32>(array).or_else(|as_written| {
        let (values, shape) = archive.read::<f64>(array).map_err(|_| as_written)?;
        Ok((values.into_iter().map(narrow).collect(), shape))
    })
}

pub(super) fn real_column(
    archive: &mut ArchiveReader,
    array: &'static str,
    expected: &[usize],
) -> Result<Vec<f32>, DatasetError> {
    let (values, shape) = reals(archive, array)?;
    expect_shape(array, &shape, expected)?;
    Ok(values)
}

pub(super) fn integer_column(
    archive: &mut ArchiveReader,
    array: &'static str,
    count: usize,
) -> Result<Vec<i64>, DatasetError> {
    let (values, shape) = archive
        .read::<i64>(array)
        .or_else(|error| integers::<i32>(archive, array).map_err(|_| error))
        .or_else(|error| integers::<i16>(archive, array).map_err(|_| error))
        .or_else(|error| integers::<i8>(archive, array).map_err(|_| error))
        .or_else(|error| integers::<u8>(archive, array).map_err(|_| error))?;
    expect_shape(array, &shape, &[count])?;
    Ok(values)
}

fn integers<T: npyz::Deserialize + Into<i64>>(
    archive: &mut ArchiveReader,
    array: &'static str,
) -> Result<(Vec<i64>, Vec<u64>), ArchiveError> {
    let (values, shape) = archive.read::<T>(array)?;
    Ok((values.into_iter().map(Into::into).collect(), shape))
}

pub(super) fn expect_shape(
    array: &'static str,
    found: &[u64],
    expected: &[usize],
) -> Result<(), DatasetError> {
    if found
        .iter()
        .map(|n| *n as usize)
        .eq(expected.iter().copied())
    {
        return Ok(());
    }
    Err(DatasetError::Shape {
        array,
        found: found.to_vec(),
        expected: format!("{expected:?}"),
    })
}
