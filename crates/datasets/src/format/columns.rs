//! Reading the arrays of a data set, whatever width their numbers have.
//!
//! Every shape is compared before any value is read: a small archive may hold gigabytes of zeros.

use crate::archive::error::ArchiveError;
use crate::archive::reader::ArchiveReader;
use arrays::Number;

/// Types of real numbers that are read.
const REALS: [&str; 2] = ["<f4", "<f8"];
/// Types of whole numbers that are read.
const INTEGERS: [&str; 5] = ["<i8", "<i4", "<i2", "|i1", "|u1"];

/// Number of rows of an array; 0 for a scalar, which no array of rows is.
pub(super) fn rows_of(archive: &ArchiveReader, array: &str) -> Result<usize, ArchiveError> {
    let rows = archive.shape(array)?.first().copied().unwrap_or(0);
    // More than an address can count are more than there is memory for; the shape is refused by what it is compared with.
    Ok(usize::try_from(rows).unwrap_or(usize::MAX))
}

/// Real numbers; f32, as the format has it, or f64.
pub(super) fn reals(archive: &mut ArchiveReader, array: &str) -> Result<Vec<f32>, ArchiveError> {
    archive.expect_type(array, &REALS)?;
    if archive.descr(array)? == "<f8" {
        let (values, _) = archive.read::<f64>(array)?;
        return Ok(values.into_iter().map(|v| v as f32).collect());
    }
    Ok(archive.read(array)?.0)
}

/// Whole numbers of any width.
pub(super) fn integers(archive: &mut ArchiveReader, array: &str) -> Result<Vec<i64>, ArchiveError> {
    archive.expect_type(array, &INTEGERS)?;
    match archive.descr(array)? {
        "<i4" => widened::<i32>(archive, array),
        "<i2" => widened::<i16>(archive, array),
        "|i1" => widened::<i8>(archive, array),
        "|u1" => widened::<u8>(archive, array),
        _ => Ok(archive.read(array)?.0),
    }
}

fn widened<T: Number + Into<i64>>(
    archive: &mut ArchiveReader,
    array: &str,
) -> Result<Vec<i64>, ArchiveError> {
    let (values, _) = archive.read::<T>(array)?;
    Ok(values.into_iter().map(Into::into).collect())
}
