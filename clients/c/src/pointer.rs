//! Pointers from C, checked for null.
//!
//! Every function takes pointers that are null, which is refused, or valid for what the header says: values that a `connect` function has
//! returned and that are not freed yet, used by one thread at a time, that which made them; texts that end with a zero; arrays of the
//! length told beside them; room for one message.

use std::ffi::{CStr, c_char};
use std::path::Path;
use std::time::Duration;

use pcc_model::Robot;
use shared_types::ipc::IpcOptions;

use crate::error::{Failure, Outcome};

/// What a pointer points to.
pub(crate) fn read<'a, T>(pointer: *const T, name: &str) -> Outcome<&'a T> {
    // SAFETY: not null, so valid, as the module says.
    unsafe { pointer.as_ref() }.ok_or_else(|| is_null(name))
}

/// What a pointer points to, to be changed.
pub(crate) fn write<'a, T>(pointer: *mut T, name: &str) -> Outcome<&'a mut T> {
    // SAFETY: not null, so valid and used by this call alone, as the module says.
    unsafe { pointer.as_mut() }.ok_or_else(|| is_null(name))
}

/// An array; a null pointer is an empty one where the length is 0.
pub(crate) fn array<'a, T>(pointer: *const T, length: usize, name: &str) -> Outcome<&'a [T]> {
    if length == 0 {
        return Ok(&[]);
    }
    let first = read(pointer, name)?;
    // SAFETY: not null, so as long as told beside it, as the module says.
    Ok(unsafe { std::slice::from_raw_parts(first, length) })
}

/// A text.
pub(crate) fn text<'a>(pointer: *const c_char, name: &str) -> Outcome<&'a str> {
    if pointer.is_null() {
        return Err(is_null(name));
    }
    // SAFETY: not null, so it ends with a zero, as the module says.
    let text = unsafe { CStr::from_ptr(pointer) }.to_str();
    text.map_err(|_| Failure::argument(format!("{name} is no text in UTF-8")))
}

/// A text, or none where the pointer is null.
pub(crate) fn optional_text<'a>(pointer: *const c_char, name: &str) -> Outcome<Option<&'a str>> {
    if pointer.is_null() {
        return Ok(None);
    }
    text(pointer, name).map(Some)
}

/// The robot of a robot file.
pub(crate) fn robot(robot_file: *const c_char) -> Outcome<Robot> {
    let file = Path::new(text(robot_file, "robot_file")?);
    Robot::from_file(file).map_err(|it| Failure::argument(it.to_string()))
}

/// Where the services live; a null pointer stands for what the environment says, or the default.
pub(crate) fn options(prefix: *const c_char, root: *const c_char) -> Outcome<IpcOptions> {
    let mut options = IpcOptions::from_env();
    if let Some(prefix) = optional_text(prefix, "prefix")? {
        prefix.clone_into(&mut options.prefix);
    }
    if let Some(root) = optional_text(root, "root")? {
        options.root = root.into();
    }
    Ok(options)
}

/// The seconds that a call may take.
pub(crate) fn time_limit(timeout_s: f64) -> Outcome<Duration> {
    duration("timeout_s", timeout_s)
}

/// The seconds that an argument says.
pub(crate) fn duration(name: &str, seconds: f64) -> Outcome<Duration> {
    let refused = |_| Failure::argument(format!("{name} is {seconds}; allowed is finite, >= 0"));
    Duration::try_from_secs_f64(seconds).map_err(refused)
}

/// A new value for C, which frees it by [`free`].
pub(crate) fn give<T>(value: T) -> *mut T {
    Box::into_raw(Box::new(value))
}

/// Frees what [`give`] has made; nothing where the pointer is null.
pub(crate) fn free<T>(pointer: *mut T) {
    if !pointer.is_null() {
        // SAFETY: made by `give` and not freed yet, as the module says.
        drop(unsafe { Box::from_raw(pointer) });
    }
}

fn is_null(name: &str) -> Failure {
    Failure::argument(format!("{name} is a null pointer"))
}
