//! One array: its header is checked before anything is made of it, its values are read when its shape is known to fit.

use input_files::shortened;
use npyz::{DType, Deserialize, NpyFile, Order};
use py_literal::Value;
use std::io::{Chain, Cursor, Read};
use thiserror::Error;

/// Values for which there is memory: space for more is asked for before they are read.
const KNOWN_TO_FIT: usize = 1 << 20;
/// Bytes before the header's text: `\x93NUMPY`, two of the version, two of the text's length (version 1).
const PREAMBLE: usize = 10;
/// Longest text of a header that is read; NumPy's have some hundred bytes.
const MAX_HEADER: usize = 1024;
/// Brackets within brackets that a header may have; that of an array of numbers has one pair in another.
const MAX_NESTING: usize = 4;

/// Why an array is refused.
#[derive(Debug, Error)]
pub enum NpyError {
    /// It does not begin as an array does, or its header is not understood.
    #[error(
        "not a NumPy array: {0}; `\\x93NUMPY`, version 1.0, and a header of at most {MAX_HEADER} bytes with descr, fortran_order and shape are needed"
    )]
    Header(String),
    /// The product of the shape is beyond what can be counted.
    #[error(
        "shape {shape:?} has more bytes than can be counted; at most {} are allowed",
        u64::MAX
    )]
    Overflow {
        /// The shape.
        shape: Vec<u64>,
    },
    /// There are fewer or more bytes than the shape needs.
    #[error("shape {shape:?} of {descr} needs {needed} bytes behind the header, there are {found}")]
    Size {
        /// The shape.
        shape: Vec<u64>,
        /// Type of the values, as NumPy writes it.
        descr: String,
        /// Bytes that the shape needs.
        needed: u64,
        /// Bytes behind the header.
        found: u64,
    },
    /// The first index runs fastest.
    #[error("fortran_order is True, column-major; False, row-major (C) order, is needed")]
    ColumnMajor,
    /// The values are of another type, or cannot be read; a checksum that does not hold shows here.
    #[error("{0}; undamaged values, as many as the shape says, are needed")]
    Values(#[from] std::io::Error),
    /// There is not as much memory as the values need.
    #[error(
        "shape {shape:?} needs more memory than there is; at most as many values as fit into it are allowed"
    )]
    Memory {
        /// The shape.
        shape: Vec<u64>,
    },
}

/// An array of which the header has been read and checked, and no value yet.
pub struct NpyArray<R: Read> {
    file: NpyFile<Chain<Cursor<Vec<u8>>, R>>,
}

impl<R: Read> NpyArray<R> {
    /// Reads the header of an array that is stored in `size` bytes, header and values.
    ///
    /// # Errors
    /// [`NpyError`], where the header is not understood, or does not describe as many bytes as there are.
    pub fn open(mut reader: R, size: u64) -> Result<Self, NpyError> {
        let header = read_header(&mut reader)?;
        let found = size.saturating_sub(header.len() as u64);
        let HeaderText { descr, shape } = HeaderText::read(&header[PREAMBLE..])?;
        // npyz multiplies the shape without looking.
        let values = product(&shape)?;
        let file = NpyFile::new(Cursor::new(header).chain(reader))
            .map_err(|error| NpyError::Header(format!("its descr is {descr}: {error}")))?;
        let item = file.dtype().num_bytes().unwrap_or(0);
        let is_number = matches!(file.dtype(), DType::Plain(_)) && item > 0;
        if !is_number {
            let reason = format!("its descr is {descr}, no type of numbers");
            return Err(NpyError::Header(reason));
        }
        let needed = values.checked_mul(item as u64).ok_or(NpyError::Overflow {
            shape: shape.clone(),
        })?;
        if needed != found {
            return Err(NpyError::Size {
                shape,
                descr,
                needed,
                found,
            });
        }
        if file.order() != Order::C {
            return Err(NpyError::ColumnMajor);
        }
        Ok(Self { file })
    }

    /// The numbers of rows, of columns, and so on; their product times [`DType::num_bytes`] fits a u64.
    #[must_use]
    pub fn shape(&self) -> &[u64] {
        self.file.shape()
    }

    /// The type of its values, a plain number.
    #[must_use]
    pub fn dtype(&self) -> DType {
        self.file.dtype()
    }

    /// Reads the values, row-major, to the end of what they are stored in.
    ///
    /// # Errors
    /// [`NpyError::Values`] if they are not of type `T`, or cannot be read.
    pub fn into_vec<T: Deserialize>(self) -> Result<Vec<T>, NpyError> {
        let dtype = self.file.dtype().descr();
        let shape = self.file.shape().to_vec();
        let (header, mut reader) = (self.file.header().clone(), self.file.into_inner());
        let values = NpyFile::with_header(header, &mut reader)
            .data::<T>()
            .map_err(|error| std::io::Error::other(format!("it holds {dtype}: {error}")))?;
        let mut read = Vec::new();
        let count = usize::try_from(values.len()).unwrap_or(usize::MAX);
        if count > KNOWN_TO_FIT && read.try_reserve_exact(count).is_err() {
            return Err(NpyError::Memory { shape });
        }
        for value in values {
            read.push(value?);
        }
        // At the end a compressed member's checksum is looked at.
        match reader.read(&mut [0])? {
            0 => Ok(read),
            _ => Err(std::io::Error::other("there are bytes behind the last value").into()),
        }
    }
}

/// The bytes of a header, from the first.
fn read_header(reader: &mut impl Read) -> Result<Vec<u8>, NpyError> {
    let cut = |_| NpyError::Header("it ends within the header".into());
    let mut header = vec![0; PREAMBLE];
    reader.read_exact(&mut header).map_err(cut)?;
    if !header.starts_with(b"\x93NUMPY\x01\x00") {
        let found = header[..8].escape_ascii();
        return Err(NpyError::Header(format!("it begins with `{found}`")));
    }
    let length = usize::from(u16::from_le_bytes([header[8], header[9]]));
    if length > MAX_HEADER {
        return Err(NpyError::Header(format!("its header has {length} bytes")));
    }
    header.resize(PREAMBLE + length, 0);
    reader.read_exact(&mut header[PREAMBLE..]).map_err(cut)?;
    Ok(header)
}

/// What the text of a header tells.
struct HeaderText {
    /// Type of the values, as it is written there.
    descr: String,
    shape: Vec<u64>,
}

impl HeaderText {
    fn read(text: &[u8]) -> Result<Self, NpyError> {
        let text = std::str::from_utf8(text)
            .map_err(|_| NpyError::Header("its header is not text".into()))?;
        let refused = |reason: &str| {
            let shown = shortened(&format!("{:?}", text.trim()));
            NpyError::Header(format!("its header {shown} {reason}"))
        };
        if nesting(text) > MAX_NESTING {
            return Err(refused("has too many brackets"));
        }
        let no_dictionary = || refused("is not a Python dictionary");
        let header: Value = text.trim().parse().map_err(|_| no_dictionary())?;
        let Value::Dict(entries) = &header else {
            return Err(no_dictionary());
        };
        let entry = |name: &str| {
            let found = entries
                .iter()
                .find(|(key, _)| key.as_string().map(String::as_str) == Some(name));
            found.map(|(_, value)| value)
        };
        let [Some(descr), Some(_), Some(shape)] = ["descr", "fortran_order", "shape"].map(entry)
        else {
            return Err(refused("lacks one of its keys"));
        };
        if entries.len() != 3 {
            return Err(refused("has other keys"));
        }
        Ok(Self {
            descr: shortened(&descr.to_string()),
            shape: shape_of(shape)?,
        })
    }
}

/// The shape that a header tells.
fn shape_of(shape: &Value) -> Result<Vec<u64>, NpyError> {
    let refused = |reason: &str| {
        let shown = shortened(&shape.to_string());
        NpyError::Header(format!("its shape is {shown}, {reason}"))
    };
    let Value::Tuple(numbers) = shape else {
        return Err(refused("which is not a tuple"));
    };
    let number = |number: &Value| match number {
        Value::Integer(n) => n.to_string().parse().ok(),
        _ => None,
    };
    let counts: Option<Vec<u64>> = numbers.iter().map(number).collect();
    counts.ok_or_else(|| refused("which are not counts"))
}

/// How many brackets are open at most.
fn nesting(text: &str) -> usize {
    let (mut open, mut most) = (0_usize, 0);
    for byte in text.bytes() {
        match byte {
            b'(' | b'[' | b'{' => open += 1,
            b')' | b']' | b'}' => open = open.saturating_sub(1),
            _ => {}
        }
        most = most.max(open);
    }
    most
}

/// The number of values, where it can be counted, and the strides too, which a dimension of 0 does not make small.
fn product(shape: &[u64]) -> Result<u64, NpyError> {
    let overflow = || NpyError::Overflow {
        shape: shape.to_vec(),
    };
    let mut dimensions = shape.iter().filter(|n| **n > 0);
    let largest = dimensions.try_fold(1_u64, |product, n| product.checked_mul(*n));
    let largest = largest.ok_or_else(overflow)?;
    Ok(if shape.contains(&0) { 0 } else { largest })
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn what_is_not_an_array_is_refused_by_name_before_memory_is_taken() {
        let deep = format!("{}{}", "(".repeat(400), ")".repeat(400));
        for (bytes, named) in [
            (b"".to_vec(), "ends within"),
            (b"\x93NUMPY\x02\x00\xff\xff\xff\xff".to_vec(), "begins with"),
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
        ] {
            let Err(error) = open(&bytes) else {
                panic!("{named}: it was accepted");
            };
            assert!(error.to_string().contains(named), "{named}: {error}");
        }
    }
}
