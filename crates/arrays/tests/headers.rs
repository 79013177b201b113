//! Headers drawn at random: well-formed ones are understood, others are refused without a panic and without taking memory.
#![allow(clippy::unwrap_used)]

use arrays::{NpyArray, Number, write_npy};
use proptest::prelude::*;

/// A file of this version with this header and so many bytes of zeros behind it.
fn file(major: u8, header: &str, values: usize) -> Vec<u8> {
    let length = header.len() as u32;
    let told = if major == 1 { 2 } else { 4 };
    let mut bytes = [
        &b"\x93NUMPY"[..],
        &[major, 0],
        &length.to_le_bytes()[..told],
    ]
    .concat();
    bytes.extend(header.as_bytes());
    bytes.resize(bytes.len() + values, 0);
    bytes
}

/// One of the headers that Python understands as the same dictionary: order of the keys, quotes, blanks, last commas.
fn header(
    shape: &[u64],
    order: [usize; 3],
    quote: char,
    blank: &str,
    ends: (bool, bool),
) -> String {
    let counts: Vec<String> = shape.iter().map(u64::to_string).collect();
    let mut tuple = counts.join(&format!(",{blank}"));
    if shape.len() == 1 || (ends.0 && !shape.is_empty()) {
        tuple.push(',');
    }
    let values = [
        format!("{quote}<i2{quote}"),
        "False".into(),
        format!("({tuple})"),
    ];
    let keys = ["descr", "fortran_order", "shape"];
    let entries = order.map(|i| {
        format!(
            "{blank}{quote}{}{quote}{blank}:{blank}{}",
            keys[i], values[i]
        )
    });
    let comma = if ends.1 { "," } else { "" };
    format!("{{{}{blank}{comma}{blank}}}{blank}\n", entries.join(","))
}

/// All that is said of an array, or that it is refused.
fn outcome(bytes: &[u8]) -> Result<Vec<i16>, String> {
    let array = NpyArray::open(bytes, bytes.len() as u64).map_err(|error| error.to_string())?;
    let product: u64 = array.shape().iter().product();
    let values = array.into_vec().map_err(|error| error.to_string())?;
    assert_eq!(values.len() as u64, product, "a shape has as many values");
    Ok(values)
}

proptest! {
    #[test]
    fn a_well_formed_header_is_understood(
        shape in prop::collection::vec(0..5_u64, 0..5),
        order in Just([0, 1, 2]).prop_shuffle(),
        quote in prop::sample::select(vec!['\'', '"']),
        blank in prop::sample::select(vec!["", " ", "  ", "\n", "\t "]),
        ends in any::<(bool, bool)>(),
        major in 1..=3_u8,
    ) {
        let header = header(&shape, order, quote, blank, ends);
        let values: u64 = shape.iter().product();
        let bytes = file(major, &header, 2 * values as usize);
        let array = NpyArray::open(&bytes[..], bytes.len() as u64).map_err(|e| TestCaseError::fail(e.to_string()))?;
        prop_assert_eq!(array.shape(), &shape[..]);
        prop_assert_eq!(array.descr(), i16::DESCR);
        prop_assert_eq!(array.into_vec::<i16>().map(|v| v.len() as u64).ok(), Some(values));
    }

    #[test]
    fn what_is_written_is_read(values in prop::collection::vec(any::<f64>(), 0..40), columns in 1..5_usize) {
        let rows = values.len() / columns;
        let values = &values[..rows * columns];
        let mut bytes = Vec::new();
        write_npy(&mut bytes, &[rows, columns], values.iter().copied()).unwrap();
        prop_assert!((bytes.len() - 8 * values.len()).is_multiple_of(64));
        let array = NpyArray::open(&bytes[..], bytes.len() as u64).unwrap();
        prop_assert_eq!(array.shape(), &[rows as u64, columns as u64][..]);
        let read: Vec<f64> = array.into_vec().unwrap();
        let bits = |values: &[f64]| -> Vec<u64> { values.iter().map(|v| v.to_bits()).collect() };
        prop_assert_eq!(bits(&read), bits(values));
    }

    #[test]
    fn a_damaged_header_is_refused_or_understood(
        shape in prop::collection::vec(0..5_u64, 0..5),
        major in 1..=3_u8,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        kept in any::<prop::sample::Index>(),
    ) {
        let values: u64 = shape.iter().product();
        let header = header(&shape, [0, 1, 2], '\'', " ", (true, true));
        let mut bytes = file(major, &header, 2 * values as usize);
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        let _ = outcome(&bytes);
        let _ = outcome(&bytes[..kept.index(bytes.len())]);
    }

    #[test]
    fn any_text_is_refused_or_understood(major in 1..=3_u8, text in "[{}()\\[\\]'\":, \\\\a-f0-9<|µ\n]{0,200}") {
        let _ = outcome(&file(major, &text, 4));
        let _ = outcome(text.as_bytes());
        let entry = format!("{{'descr': {text}, 'fortran_order': False, 'shape': {text}}}");
        let _ = outcome(&file(major, &entry, 4));
    }
}
