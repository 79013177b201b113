//! One array: its header is checked before anything is made of it, its values are read when its shape is known to fit.

use crate::error::NpyError;
use crate::header::{Header, header_bytes};
use crate::number::Number;
use std::io::{Error, ErrorKind, Read, Write};

/// Most values that are read at once.
const READ_AT_ONCE: usize = 1 << 13;

/// An array of which the header has been read and checked, and no value yet.
pub struct NpyArray<R: Read> {
    header: Header,
    reader: R,
}

impl<R: Read> NpyArray<R> {
    /// Reads the header of an array that is stored in `size` bytes, header and values.
    ///
    /// # Errors
    /// [`NpyError`], where the header is not understood, or does not describe as many bytes as there are.
    pub fn open(mut reader: R, size: u64) -> Result<Self, NpyError> {
        let header = Header::read(&mut reader)?;
        let (needed, found) = (header.bytes_needed()?, size.saturating_sub(header.length));
        if needed != found {
            return Err(NpyError::Size {
                descr: format!("'{}'", header.descr),
                shape: header.shape,
                needed,
                found,
            });
        }
        if header.is_column_major {
            return Err(NpyError::ColumnMajor);
        }
        Ok(Self { header, reader })
    }

    /// The numbers of rows, of columns, and so on; their product times the bytes of a value fits a u64.
    #[must_use]
    pub fn shape(&self) -> &[u64] {
        &self.header.shape
    }

    /// The type of its values as NumPy names it, such as `<f4`; [`Number::DESCR`] where values of that type can be read.
    #[must_use]
    pub fn descr(&self) -> &str {
        &self.header.descr
    }

    /// Reads the values, row-major, to the end of what they are stored in.
    ///
    /// # Errors
    /// [`NpyError::Values`] if they are not of type `T`, or cannot be read; [`NpyError::Memory`].
    pub fn into_vec<T: Number>(self) -> Result<Vec<T>, NpyError> {
        let Self { header, mut reader } = self;
        let (descr, needed) = (&header.descr, T::DESCR);
        if descr != needed {
            let reason = format!("it holds '{descr}', '{needed}' is needed");
            return Err(Error::other(reason).into());
        }
        let bytes = header.bytes_needed()?;
        let count = usize::try_from(bytes / header.value_bytes).unwrap_or(usize::MAX);
        let mut values = Vec::new();
        if values.try_reserve_exact(count).is_err() {
            let shape = header.shape;
            return Err(NpyError::Memory { shape });
        }
        read_values(&mut reader, count, &mut values)?;
        // At the end a compressed member's checksum is looked at.
        match reader.read(&mut [0])? {
            0 => Ok(values),
            _ => Err(Error::other("there are bytes behind the last value").into()),
        }
    }
}

/// Reads `count` values and appends them to `values`.
fn read_values<T: Number>(
    reader: &mut impl Read,
    count: usize,
    values: &mut Vec<T>,
) -> Result<(), Error> {
    let mut bytes = vec![0; size_of::<T::Bytes>() * count.min(READ_AT_ONCE)];
    let mut left = count;
    while left > 0 {
        let now = left.min(READ_AT_ONCE);
        let bytes = &mut bytes[..size_of::<T::Bytes>() * now];
        reader.read_exact(bytes)?;
        for value in bytes.chunks_exact(size_of::<T::Bytes>()) {
            let number = T::from_bytes(value).ok_or_else(|| {
                let reason = format!("{value:?} is no value of '{}'", T::DESCR);
                Error::new(ErrorKind::InvalidData, reason)
            })?;
            values.push(number);
        }
        left -= now;
    }
    Ok(())
}

/// Writes an array, given in row-major order, byte by byte as NumPy does.
///
/// # Errors
/// Those of the writer, and where there are fewer or more values than the shape has.
pub fn write_npy<T: Number>(
    writer: &mut impl Write,
    shape: &[usize],
    values: impl IntoIterator<Item = T>,
) -> Result<(), Error> {
    writer.write_all(&header_bytes(T::DESCR, shape)?)?;
    let needed = shape.iter().try_fold(1_usize, |n, m| n.checked_mul(*m));
    let mut written = 0;
    for value in values {
        writer.write_all(value.to_bytes().as_ref())?;
        written += 1;
    }
    if needed == Some(written) {
        return Ok(());
    }
    let reason = format!("shape {shape:?} does not have {written} values");
    Err(Error::new(ErrorKind::InvalidInput, reason))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::MAX_HEADER;

    fn npy(header: &str, values: &[u8]) -> Vec<u8> {
        let length = (header.len() as u16).to_le_bytes();
        [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes(), values].concat()
    }

    fn open(bytes: &[u8]) -> Result<NpyArray<&[u8]>, NpyError> {
        NpyArray::open(bytes, bytes.len() as u64)
    }

    fn of_shape(shape: &str) -> String {
        format!("{{'descr': '<i2', 'fortran_order': False, 'shape': {shape}, }}\n")
    }

    fn refused_by_name(cases: &[(Vec<u8>, &str)]) {
        for (bytes, named) in cases {
            let Err(error) = open(bytes) else {
                panic!("{named}: it was accepted");
            };
            assert!(error.to_string().contains(named), "{named}: {error}");
        }
    }

    #[test]
    fn an_array_is_read() {
        let bytes = npy(&of_shape("(2, 1)"), &[1, 0, 255, 255]);
        let array = open(&bytes).unwrap();
        assert_eq!(array.shape(), [2, 1]);
        assert_eq!(array.into_vec::<i16>().unwrap(), [1, -1]);
        let wrong = open(&bytes).unwrap().into_vec::<f64>().unwrap_err();
        assert!(wrong.to_string().contains("<i2"), "{wrong}");
        let empty = npy(&of_shape("(0, 7)"), &[]);
        assert!(open(&empty).unwrap().into_vec::<i16>().unwrap().is_empty());
    }

    #[test]
    fn the_order_of_single_bytes_has_no_meaning() {
        let bytes = npy(&of_shape("(2,)").replace("<i2", ">u1"), &[1, 255]);
        let array = open(&bytes).unwrap();
        assert_eq!(array.descr(), u8::DESCR);
        assert_eq!(array.into_vec::<u8>().unwrap(), [1, 255]);
        let of_truth = npy(&of_shape("(2,)").replace("<i2", "|b1"), &[1, 2]);
        let wrong = open(&of_truth).unwrap().into_vec::<bool>().unwrap_err();
        assert!(wrong.to_string().contains("[2] is no value"), "{wrong}");
    }

    #[test]
    fn a_reader_that_ends_early_or_late_is_refused() {
        let bytes = npy(&of_shape("(2,)"), &[1, 0, 255, 255]);
        let whole = bytes.len() as u64;
        for (told, named) in [(3, "fill whole buffer"), (5, "behind the last value")] {
            let stored = [&bytes[..], &[0]].concat();
            let stored = &stored[..bytes.len() - 4 + told];
            let read = NpyArray::open(stored, whole).unwrap().into_vec::<i16>();
            let wrong = read.unwrap_err().to_string();
            assert!(wrong.contains(named), "{named}: {wrong}");
        }
    }

    #[test]
    fn more_or_fewer_values_than_a_shape_has_are_not_written() {
        for values in [vec![1_u8; 5], vec![1; 7]] {
            let refused = write_npy(&mut Vec::new(), &[2, 3], values).unwrap_err();
            assert!(refused.to_string().contains("[2, 3]"), "{refused}");
        }
        let endless = [1; MAX_HEADER];
        let refused = write_npy(&mut Vec::new(), &endless, [0_u8]).unwrap_err();
        assert!(refused.to_string().contains("dimensions"), "{refused}");
    }

    #[test]
    fn what_is_not_an_array_is_refused_by_name_before_memory_is_taken() {
        let deep = format!("{}{}", "(".repeat(400), ")".repeat(400));
        refused_by_name(&[
            (b"".to_vec(), "ends within"),
            (npy(&" ".repeat(2000), &[]), "2000 bytes"),
            (npy("(1, 2)", &[]), "not a Python dictionary"),
            (npy(&of_shape(&deep), &[]), "too many brackets"),
            (npy(&of_shape("(-1,)"), &[]), "its shape is"),
            (npy(&of_shape("(1.5,)"), &[]), "not counts"),
            (npy(&of_shape("2"), &[]), "not a tuple"),
            (npy("{'descr': '<i2', 'shape': (1,)}", &[0, 0]), "lacks one"),
            (
                npy(&of_shape("(6148914691236517206, 3)"), &[0; 12]),
                "counted",
            ),
            (
                npy(&of_shape("(0, 6148914691236517206, 4)"), &[]),
                "counted",
            ),
            (npy(&of_shape("(18446744073709551615,)"), &[]), "counted"),
            (
                npy(&of_shape("(3,)"), &[0; 5]),
                "needs 6 bytes behind the header, there are 5",
            ),
            (
                npy(&of_shape("(2,)"), &[0; 5]),
                "needs 4 bytes behind the header, there are 5",
            ),
            (
                npy(&of_shape("(1,)").replace("False", "True"), &[0; 2]),
                "column-major",
            ),
            (npy(&of_shape("(1,)").replace("<i2", "|O"), &[0; 2]), "|O"),
        ]);
    }

    #[test]
    fn a_header_that_is_nearly_one_is_refused_by_name() {
        refused_by_name(&[
            (b"\x93NUMPY\x01".to_vec(), "ends within"),
            (b"\x93NUMPY\x03\x00\x01".to_vec(), "ends within"),
            (b"\x93NUMPY\x01\x00\x01\x00".to_vec(), "ends within"),
            (b"\x93NUMPY\x04\x00\x00\x00".to_vec(), "begins with"),
            (b"\x93NUMPY\x01\x01\x00\x00".to_vec(), "begins with"),
            (
                b"\x93NUMPY\x02\x00\xff\xff\xff\xff".to_vec(),
                "4294967295 bytes",
            ),
            (npy("\u{0}{'descr': ", &[]), "not a Python dictionary"),
            (
                npy(&of_shape("(1,)), (1,)"), &[]),
                "not a Python dictionary",
            ),
            (npy(&of_shape("(1,]"), &[]), "not a Python dictionary"),
            (
                npy(&of_shape("(1,), 'a\\'"), &[]),
                "not a Python dictionary",
            ),
            (npy(&of_shape("(1,),"), &[]), "not a Python dictionary"),
            (npy(&of_shape("(1,), 'a': 1"), &[]), "other keys"),
            (npy(&of_shape("(1,), 'shape': (1,)"), &[]), "other keys"),
            (npy(&of_shape("(1)"), &[]), "not a tuple"),
            (npy(&of_shape("(,)"), &[]), "not counts"),
            (npy(&of_shape("(1, , 2)"), &[]), "not counts"),
            (npy(&of_shape("(+1,)"), &[]), "not counts"),
            (npy(&of_shape("(0x1,)"), &[]), "not counts"),
            (npy(&of_shape("(18446744073709551616,)"), &[]), "not counts"),
            (
                npy(&of_shape("(1,)").replace("False", "0"), &[0; 2]),
                "fortran_order is 0",
            ),
            (
                npy(&of_shape("(1,)").replace("<i2", "|i2"), &[0; 2]),
                "'|i2', no type of numbers",
            ),
            (
                npy(&of_shape("(1,)").replace("'<i2'", "2"), &[0; 2]),
                "its descr is 2, no type of numbers",
            ),
            (
                npy(
                    &of_shape("(1,)").replace("<i2", "<U9223372036854775807"),
                    &[],
                ),
                "no type of numbers",
            ),
        ]);
    }
}
