//! The header of an array: a Python dictionary with the type of the values, their order and the shape.

use crate::error::{MAX_HEADER, NpyError};
use crate::number::bytes_of;
use input_files::shortened;
use std::io::{Error, ErrorKind, Read};

/// What a file begins with, before the format's version.
const MAGIC: &[u8] = b"\x93NUMPY";
/// Bytes of [`MAGIC`] and of the format's version.
const PREAMBLE: usize = 8;
/// Brackets within brackets that a header may have; that of an array of numbers has one pair in another.
const MAX_NESTING: usize = 4;
/// A header's length is a multiple of so many bytes, so that the values behind it lie as a processor wants them.
const ALIGNMENT: usize = 64;
/// Digits of the first dimension for which NumPy leaves room, so that an array may grow.
const ROOM_TO_GROW: usize = 21;

/// What the header of an array tells.
pub(crate) struct Header {
    /// Type of the values, such as `<f4`.
    pub(crate) descr: String,
    pub(crate) is_column_major: bool,
    pub(crate) shape: Vec<u64>,
    /// Bytes of one value.
    pub(crate) value_bytes: u64,
    /// Bytes of the header itself, from the file's first.
    pub(crate) length: u64,
}

impl Header {
    /// Reads a header up to the first byte of the values.
    pub(crate) fn read(reader: &mut impl Read) -> Result<Self, NpyError> {
        let (text, length) = read_text(reader)?;
        let entries = Entries::of(&text)?;
        let shape = shape_of(entries.shape)?;
        // A shape that cannot be counted is told before a type that is not known.
        product(&shape)?;
        let (is_column_major, descr) = (entries.is_column_major()?, entries.descr()?);
        let value_bytes = bytes_of(&descr).ok_or_else(|| entries.no_numbers())?;
        Ok(Self {
            descr,
            is_column_major,
            shape,
            value_bytes,
            length,
        })
    }

    /// The bytes that the values need.
    pub(crate) fn bytes_needed(&self) -> Result<u64, NpyError> {
        let needed = product(&self.shape)?.checked_mul(self.value_bytes);
        needed.ok_or_else(|| NpyError::Overflow {
            shape: self.shape.clone(),
        })
    }
}

/// The text of a header, and the bytes of the whole header.
fn read_text(reader: &mut impl Read) -> Result<(String, u64), NpyError> {
    let cut = |_| NpyError::Header("it ends within the header".into());
    let mut preamble = [0; PREAMBLE];
    reader.read_exact(&mut preamble).map_err(cut)?;
    let [magic @ .., major, minor] = preamble;
    let is_npy = magic == MAGIC && (1..=3).contains(&major) && minor == 0;
    if !is_npy {
        let found = preamble.escape_ascii();
        return Err(NpyError::Header(format!("it begins with `{found}`")));
    }
    // Two bytes tell the length in version 1, four in later ones.
    let mut length = [0; 4];
    let told = if major == 1 { 2 } else { 4 };
    reader.read_exact(&mut length[..told]).map_err(cut)?;
    let length = u32::from_le_bytes(length) as usize;
    if length > MAX_HEADER {
        return Err(NpyError::Header(format!("its header has {length} bytes")));
    }
    let mut text = vec![0; length];
    reader.read_exact(&mut text).map_err(cut)?;
    let text =
        String::from_utf8(text).map_err(|_| NpyError::Header("its header is not text".into()))?;
    Ok((text, (PREAMBLE + told + length) as u64))
}

/// The three values of a header's dictionary, as text.
struct Entries<'a> {
    descr: &'a str,
    fortran_order: &'a str,
    shape: &'a str,
}

impl<'a> Entries<'a> {
    fn of(text: &'a str) -> Result<Self, NpyError> {
        let refused = |reason: &str| {
            let shown = shortened(&format!("{:?}", text.trim()));
            NpyError::Header(format!("its header {shown} {reason}"))
        };
        if nesting(text) > MAX_NESTING {
            return Err(refused("has too many brackets"));
        }
        let entries = dictionary(text).ok_or_else(|| refused("is not a Python dictionary"))?;
        let entry = |name: &str| {
            let found = entries.iter().find(|(key, _)| *key == name);
            found.map(|(_, value)| *value)
        };
        let [Some(descr), Some(fortran_order), Some(shape)] =
            ["descr", "fortran_order", "shape"].map(entry)
        else {
            return Err(refused("lacks one of its keys"));
        };
        if entries.len() != 3 {
            return Err(refused("has other keys"));
        }
        Ok(Self {
            descr,
            fortran_order,
            shape,
        })
    }

    fn is_column_major(&self) -> Result<bool, NpyError> {
        match self.fortran_order {
            "True" => Ok(true),
            "False" => Ok(false),
            other => {
                let shown = shortened(other);
                let reason = format!("its fortran_order is {shown}, which is no truth value");
                Err(NpyError::Header(reason))
            }
        }
    }

    /// The name of the type; that of single bytes, which have no order, is the one that NumPy writes, `|u1` for `<u1`.
    fn descr(&self) -> Result<String, NpyError> {
        let name = string(self.descr).ok_or_else(|| self.no_numbers())?;
        Ok(match name {
            "<b1" | ">b1" | "<i1" | ">i1" | "<u1" | ">u1" => format!("|{}", &name[1..]),
            _ => name.to_owned(),
        })
    }

    fn no_numbers(&self) -> NpyError {
        let shown = shortened(self.descr);
        NpyError::Header(format!("its descr is {shown}, no type of numbers"))
    }
}

/// The keys, without quotes, and values of a dictionary; none where the text is no dictionary whose keys are strings.
fn dictionary<'a>(text: &'a str) -> Option<Vec<(&'a str, &'a str)>> {
    let inside = text.trim().strip_prefix('{')?.strip_suffix('}')?;
    let mut parts = split_outside(inside, ',')?;
    // There may be a comma behind the last entry.
    parts.pop_if(|last| last.is_empty());
    let entry = |part: &&'a str| -> Option<(&'a str, &'a str)> {
        let pair = split_outside(part, ':')?;
        let [key, value] = pair.as_slice() else {
            return None;
        };
        (!value.is_empty()).then_some((string(key)?, *value))
    };
    parts.iter().map(entry).collect()
}

/// The parts of a text between commas or colons that stand in no string and no brackets, without the blanks around them; none
/// where a string or a bracket has no end.
fn split_outside(text: &str, separator: char) -> Option<Vec<&str>> {
    let (mut parts, mut begin) = (Vec::new(), 0);
    let (mut quote, mut closing) = (None, Vec::new());
    for (at, character) in text.char_indices() {
        match (quote, character) {
            // What a backslash makes of the next character, no name of a type needs.
            (_, '\\') => return None,
            (Some(open), _) => quote = quote.filter(|_| character != open),
            (None, '\'' | '"') => quote = Some(character),
            (None, '(') => closing.push(')'),
            (None, '[') => closing.push(']'),
            (None, '{') => closing.push('}'),
            (None, ')' | ']' | '}') => {
                closing.pop().filter(|needed| *needed == character)?;
            }
            (None, _) if character == separator && closing.is_empty() => {
                parts.push(text[begin..at].trim());
                begin = at + separator.len_utf8();
            }
            _ => {}
        }
    }
    parts.push(text[begin..].trim());
    (quote.is_none() && closing.is_empty()).then_some(parts)
}

/// The content of a string in quotes; none where the text is anything else.
fn string(text: &str) -> Option<&str> {
    let quote = text.chars().next().filter(|c| matches!(c, '\'' | '"'))?;
    let content = text.strip_prefix(quote)?.strip_suffix(quote)?;
    (!content.contains(quote)).then_some(content)
}

/// The shape that a header tells.
fn shape_of(shape: &str) -> Result<Vec<u64>, NpyError> {
    let refused = |reason: &str| {
        let shown = shortened(shape);
        NpyError::Header(format!("its shape is {shown}, {reason}"))
    };
    let no_tuple = || refused("which is not a tuple");
    let inside = shape.strip_prefix('(').and_then(|s| s.strip_suffix(')'));
    let mut numbers: Vec<&str> = inside.ok_or_else(no_tuple)?.split(',').collect();
    // A comma behind a single number makes it a tuple, and there may be one behind the last of several.
    let has_comma = numbers.len() > 1;
    let is_blank = |number: &mut &str| number.trim().is_empty();
    if numbers.pop_if(is_blank).is_none() && !has_comma {
        return Err(no_tuple());
    }
    let count = |number: &str| {
        let digits = number.trim();
        let is_count = digits.bytes().all(|b| b.is_ascii_digit());
        digits.parse().ok().filter(|_| is_count)
    };
    let counts: Option<Vec<u64>> = numbers.into_iter().map(count).collect();
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

/// The header that NumPy writes for a row-major array (version 1.0), from the file's first byte.
pub(crate) fn header_bytes(descr: &str, shape: &[usize]) -> Result<Vec<u8>, Error> {
    let counts: Vec<String> = shape.iter().map(ToString::to_string).collect();
    let comma = if shape.len() == 1 { "," } else { "" };
    let counts = counts.join(", ") + comma;
    let mut text = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({counts}), }}");
    if let Some(first) = shape.first() {
        text += &" ".repeat(ROOM_TO_GROW - first.to_string().len());
    }
    // Two bytes tell the length of the text, which ends with a line feed.
    let before = PREAMBLE + 2;
    let whole = (before + text.len() + 1).next_multiple_of(ALIGNMENT);
    text += &" ".repeat(whole - before - text.len() - 1);
    text.push('\n');
    let length = u16::try_from(text.len()).ok();
    let length = length.filter(|_| text.len() <= MAX_HEADER).ok_or_else(|| {
        let reason = format!(
            "a shape of {} dimensions has too long a header",
            shape.len()
        );
        Error::new(ErrorKind::InvalidInput, reason)
    })?;
    Ok([MAGIC, &[1, 0], &length.to_le_bytes(), text.as_bytes()].concat())
}
