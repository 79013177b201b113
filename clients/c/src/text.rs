//! The texts of codes.

use std::collections::HashMap;
use std::ffi::{CString, c_char};
use std::ptr::null;
use std::sync::LazyLock;

use shared_types::codes::SETS;

use crate::error::{Failure, Outcome, or_fail};
use crate::pointer::text;

/// The text of each code, by the name of its set.
static TEXTS: LazyLock<HashMap<(&str, u32), CString>> = LazyLock::new(|| {
    let of_set = SETS.iter().flat_map(|set| {
        let values = set.values.iter();
        values.map(|value| {
            (
                (set.name, value.code),
                CString::new(value.text).unwrap_or_default(),
            )
        })
    });
    of_set.collect()
});

/// The text for people of a code, as in `pcc_text("Outcome", report->outcome)`; valid for ever. Null where there is no such set or code.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_text(set: *const c_char, code: u32) -> *const c_char {
    or_fail(find(set, code), null())
}

fn find(set: *const c_char, code: u32) -> Outcome<*const c_char> {
    let set = text(set, "set")?;
    let found = TEXTS.get(&(set, code));
    let missing = || Failure::argument(format!("there is no code {code} in a set {set}"));
    Ok(found.ok_or_else(missing)?.as_ptr())
}
