//! What is wrong with the header of a safetensors file: tensor by tensor, so that a message can name the one that is.

use serde_json::{Map, Value};
use std::ops::Range;

/// Bytes before the header, which tell its length.
const LENGTH: usize = 8;
/// Bytes of a value of F32.
const VALUE: u64 = 4;

/// What is wrong with a file's header, and what is needed; nothing where its tensors of F32 fill the file, one right behind
/// the other.
pub(crate) fn header_fault(content: &[u8]) -> Option<String> {
    let checked = tensors(content).and_then(|(tensors, bytes)| check(tensors, bytes));
    checked.err()
}

/// The header's entries, and how many bytes lie behind it.
fn tensors(content: &[u8]) -> Result<(Map<String, Value>, u64), String> {
    let Some((length, rest)) = content.split_first_chunk::<LENGTH>() else {
        let count = content.len();
        return Err(format!(
            "it has {count} bytes; at least {LENGTH}, the length of its header, are needed"
        ));
    };
    let (length, most) = (u64::from_le_bytes(*length), rest.len());
    let header = usize::try_from(length)
        .ok()
        .and_then(|n| rest.split_at_checked(n));
    let Some((header, data)) = header else {
        return Err(format!(
            "its first {LENGTH} bytes say that its header has {length} bytes; at most {most}, as many as are behind them, are allowed"
        ));
    };
    let entries = serde_json::from_slice(header).map_err(|error| {
        format!("its header of {length} bytes: {error}; an object of JSON is needed")
    })?;
    Ok((entries, data.len() as u64))
}

/// Checks that the tensors fill `bytes` bytes.
fn check(tensors: Map<String, Value>, bytes: u64) -> Result<(), String> {
    let mut places = Vec::with_capacity(tensors.len());
    for (name, entry) in tensors {
        if name != "__metadata__" {
            let place =
                place_of(&entry, bytes).map_err(|reason| format!("tensor `{name}` {reason}"))?;
            places.push((place.start, place.end, name));
        }
    }
    places.sort_unstable();
    let mut end = 0;
    for (start, behind, name) in places {
        if start != end {
            return Err(format!(
                "tensor `{name}` begins at byte {start}; {end}, right behind the tensor before it, is needed"
            ));
        }
        end = behind;
    }
    if end == bytes {
        return Ok(());
    }
    Err(format!(
        "its tensors have {end} bytes, and {bytes} are behind its header; so many are needed"
    ))
}

/// Where a tensor lies, if its type, its shape and its place fit each other.
fn place_of(entry: &Value, bytes: u64) -> Result<Range<u64>, String> {
    let wrong = |key: &str, needed: &str| {
        let found = entry
            .get(key)
            .map_or("missing".to_owned(), Value::to_string);
        format!("has `{key}` {found}; {needed} is needed")
    };
    let whole = |key: &str| -> Option<Vec<u64>> {
        let numbers = entry.get(key)?.as_array()?;
        numbers.iter().map(Value::as_u64).collect()
    };
    if entry.get("dtype").and_then(Value::as_str) != Some("F32") {
        return Err(wrong("dtype", "\"F32\""));
    }
    let shape = whole("shape").ok_or_else(|| wrong("shape", "a list of counts"))?;
    let size = shape.iter().try_fold(VALUE, |size, n| size.checked_mul(*n));
    let size = size.ok_or_else(|| wrong("shape", "one of fewer bytes than can be counted"))?;
    let place = whole("data_offsets").filter(|offsets| offsets.len() == 2);
    let place = place.filter(|place| place[0] <= place[1] && place[1] <= bytes);
    let Some(place) = place else {
        let needed = format!("a place from 0 to {bytes}");
        return Err(wrong("data_offsets", &needed));
    };
    let found = place[1] - place[0];
    if found == size {
        return Ok(place[0]..place[1]);
    }
    Err(format!(
        "has {found} bytes by its `data_offsets`; {size} are needed by its `shape` {shape:?} of F32"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(header: &str, data: usize) -> Vec<u8> {
        let length = header.len() as u64;
        [&length.to_le_bytes()[..], header.as_bytes(), &vec![0; data]].concat()
    }

    #[test]
    fn the_tensor_that_is_wrong_is_named_with_what_is_needed() {
        let entry = |shape: &str, place: &str| {
            format!(r#"{{"a":{{"dtype":"F32","shape":{shape},"data_offsets":{place}}}}}"#)
        };
        let good = entry("[2]", "[0,8]");
        assert_eq!(header_fault(&file(&good, 8)), None);
        for (content, said) in [
            (vec![0; 7], "at least 8"),
            (u64::MAX.to_le_bytes().to_vec(), "at most 0"),
            (file("[]", 0), "object of JSON is needed"),
            (
                file(&good.replace("F32", "F16"), 8),
                "tensor `a` has `dtype` \"F16\"; \"F32\" is needed",
            ),
            (
                file(&entry("[3]", "[0,8]"), 8),
                "12 are needed by its `shape` [3]",
            ),
            (
                file(&entry("[18446744073709551615,2]", "[0,8]"), 8),
                "`shape` [18446744073709551615,2]",
            ),
            (file(&entry("[2]", "[0,9]"), 8), "a place from 0 to 8"),
            (file(&entry("[1]", "[4,8]"), 8), "begins at byte 4; 0"),
            (file(&good, 12), "8 bytes, and 12 are behind"),
        ] {
            let fault = header_fault(&content).unwrap_or_default();
            assert!(fault.contains(said), "{said}: {fault}");
        }
    }
}
