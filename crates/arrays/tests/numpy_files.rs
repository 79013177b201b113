//! Arrays that NumPy wrote are read, and written again byte by byte.
#![allow(clippy::unwrap_used)]

use arrays::{NpyArray, NpyError, Number, write_npy};
use std::fmt::Debug;
use std::path::Path;

/// The bytes of a file of `tests/data/npy`, which `scripts/fixtures_npy.py` made.
fn file(name: &str) -> Vec<u8> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/npy");
    std::fs::read(folder.join(format!("{name}.npy"))).unwrap()
}

fn open(bytes: &[u8]) -> Result<NpyArray<&[u8]>, NpyError> {
    NpyArray::open(bytes, bytes.len() as u64)
}

/// Compares an array with the values that it must begin with, and writes it anew.
fn check<T: Number + PartialEq + Debug>(name: &str, shape: &[usize], values: &[T]) -> Vec<u8> {
    let bytes = file(name);
    let array = open(&bytes).unwrap();
    assert_eq!(array.descr(), T::DESCR, "{name}");
    let found: Vec<usize> = array.shape().iter().map(|n| *n as usize).collect();
    assert_eq!(found, shape, "{name}");
    let read: Vec<T> = array.into_vec().unwrap();
    assert_eq!(&read[..values.len()], values, "{name}");
    let mut written = Vec::new();
    write_npy(&mut written, shape, read).unwrap();
    written
}

/// The same, and the file is written as NumPy did.
fn check_both_ways<T: Number + PartialEq + Debug>(name: &str, shape: &[usize], values: &[T]) {
    assert!(
        check(name, shape, values) == file(name),
        "{name} is written otherwise"
    );
}

#[test]
fn every_type_is_read_and_written_as_numpy_does() {
    // The last of the floating-point numbers is NaN.
    let reals = [0.0, -0.0, 1.5, -2.25, f64::INFINITY];
    check_both_ways("f8", &[2, 3], &reals);
    check_both_ways("f4", &[2, 3], &reals.map(|value| value as f32));
    check_both_ways("i1", &[4], &[i8::MIN, 0, 1, i8::MAX]);
    check_both_ways("i2", &[4], &[i16::MIN, 0, 1, i16::MAX]);
    check_both_ways("i4", &[4], &[i32::MIN, 0, 1, i32::MAX]);
    check_both_ways("i8", &[4], &[i64::MIN, 0, 1, i64::MAX]);
    check_both_ways("u1", &[4], &[0, 0, 1, u8::MAX]);
    check_both_ways("u4", &[4], &[0, 0, 1, u32::MAX]);
    check_both_ways("u8", &[4], &[0, 0, 1, u64::MAX]);
    check_both_ways("b1", &[1, 2, 1], &[true, false]);
    check_both_ways("scalar", &[], &[-7_i16]);
    check_both_ways::<f32>("empty", &[0, 7], &[]);
}

#[test]
fn later_versions_of_the_format_are_read() {
    for name in ["version-2", "version-3"] {
        check(name, &[3], &[1_i32, 2, 3]);
    }
}

#[test]
fn bits_of_nan_and_of_zero_are_kept() {
    let bytes = file("f4");
    let read: Vec<f32> = open(&bytes).unwrap().into_vec().unwrap();
    assert!(read[5].is_nan() && read[1].is_sign_negative());
}

#[test]
fn arrays_of_other_kinds_are_refused_by_name() {
    for (name, named) in [
        ("column-major", "fortran_order is True"),
        ("records", "no type of numbers"),
    ] {
        let Err(error) = open(&file(name)) else {
            panic!("{name} was accepted");
        };
        assert!(error.to_string().contains(named), "{name}: {error}");
    }
    // Their sizes are known, so that an archive that holds one among others can be checked; their values are not read.
    for (name, descr) in [("big-endian", ">i4"), ("half", "<f2"), ("text", "<U3")] {
        let bytes = file(name);
        let array = open(&bytes).unwrap();
        assert_eq!(array.descr(), descr);
        let refused = array.into_vec::<i32>().unwrap_err().to_string();
        assert!(
            refused.contains(descr) && refused.contains("'<i4' is needed"),
            "{refused}"
        );
    }
}

#[test]
fn no_part_of_a_file_is_taken_for_a_whole_one() {
    for name in ["f4", "scalar", "version-2", "version-3", "b1"] {
        let bytes = file(name);
        for length in 0..bytes.len() {
            assert!(open(&bytes[..length]).is_err(), "{name}: {length} bytes");
        }
    }
}
