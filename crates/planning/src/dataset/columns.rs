//! Reading the arrays of a data set, whatever width their numbers have.
//!
//! Every shape is compared before any value is read: a small archive may hold gigabytes of zeros.

use arrays::{ArchiveError, ArchiveReader, DType, Deserialize, TypeChar};

/// Number of rows of an array; 0 for a scalar, which no array of rows is.
pub(super) fn rows_of(archive: &ArchiveReader, array: &str) -> Result<usize, ArchiveError> {
    let rows = archive.shape(array)?.first().copied().unwrap_or(0);
    // More than an address can count are more than there is memory for; the shape is refused by what it is compared with.
    Ok(usize::try_from(rows).unwrap_or(usize::MAX))
}

/// Real numbers; f32, as the format has it, or f64.
pub(super) fn reals(archive: &mut ArchiveReader, array: &str) -> Result<Vec<f32>, ArchiveError> {
    match number(archive.dtype(array)?) {
        Some((TypeChar::Float, 8)) => {
            let (values, _) = archive.read::<f64>(array)?;
            Ok(values.into_iter().map(|v| v as f32).collect())
        }
        _ => Ok(archive.read(array)?.0),
    }
}

/// Whole numbers of any width.
pub(super) fn integers(archive: &mut ArchiveReader, array: &str) -> Result<Vec<i64>, ArchiveError> {
    match number(archive.dtype(array)?) {
        Some((TypeChar::Int, 4)) => widened::<i32>(archive, array),
        Some((TypeChar::Int, 2)) => widened::<i16>(archive, array),
        Some((TypeChar::Int, 1)) => widened::<i8>(archive, array),
        Some((TypeChar::Uint, 1)) => widened::<u8>(archive, array),
        _ => Ok(archive.read(array)?.0),
    }
}

fn widened<T: Deserialize + Into<i64>>(
    archive: &mut ArchiveReader,
    array: &str,
) -> Result<Vec<i64>, ArchiveError> {
    let (values, _) = archive.read::<T>(array)?;
    Ok(values.into_iter().map(Into::into).collect())
}

fn number(dtype: &DType) -> Option<(TypeChar, u64)> {
    match dtype {
        DType::Plain(plain) => Some((plain.type_char(), plain.size_field())),
        _ => None,
    }
}
