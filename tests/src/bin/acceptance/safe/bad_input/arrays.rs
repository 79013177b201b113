//! The arrays of a data set: headers that lie, values that no row may have, arrays that are missing or in another's place.

use super::datasets::{ARCHIVE, ROWS, Set};
use super::npz::{Member, archive, npy, reals, shape};
use super::variant::{Expected, Fault, Variant};

/// Arrays of one whole number a row.
const INDICES: [&str; 4] = [
    "target_indices",
    "start_indices",
    "ik_indices",
    "split_indices",
];

impl Set {
    /// Each array with a header that lies, and too little or too much behind it.
    pub(super) fn lying_arrays(&self) -> Vec<Variant> {
        let members = members();
        let mut all = Vec::new();
        for (index, member) in members.iter().enumerate() {
            for (name, npy, is_refused) in lies(&member.npy) {
                let mut fresh = members.clone();
                fresh[index].npy = npy;
                let expected = if is_refused {
                    Expected::Refused(vec![Fault::key(ARCHIVE, &member.name, "")])
                } else {
                    self.refused_or_same(ARCHIVE)
                };
                let name = format!("array {} {name}", member.name);
                all.push(self.with(name, archive(&fresh), self.meta.clone(), expected));
            }
        }
        all.extend(self.wrong_values());
        all
    }

    /// Numbers that no row may have.
    fn wrong_values(&self) -> Vec<Variant> {
        let wrong = [
            f32::NAN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            1e30,
            -1e30,
            // Beyond what a section bends, and beyond the extent of a scene.
            1.1e7,
            -1.1e7,
        ];
        let mut all = Vec::new();
        let mut add = |array: &str, index: usize, bytes: &[u8], text: String| {
            let mut fresh = members();
            let member = fresh.iter_mut().find(|m| m.name == array).unwrap();
            let begin = 128 + index * bytes.len();
            member.npy[begin..begin + bytes.len()].copy_from_slice(bytes);
            all.push(self.with(
                format!("{array}[{index}] = {text}"),
                archive(&fresh),
                self.meta.clone(),
                Expected::Refused(vec![Fault::key(ARCHIVE, "row", &text)]),
            ));
        };
        for value in wrong.into_iter().chain([3.2, -3.2]) {
            for index in [0, 5, ROWS * 64 * 6 - 1] {
                add("paths", index, &value.to_le_bytes(), value.to_string());
            }
        }
        for value in wrong {
            for array in ["target_tips", "obstacle_centres"] {
                for index in [0, 2, ROWS * 3 - 1] {
                    add(array, index, &value.to_le_bytes(), value.to_string());
                }
            }
        }
        for code in [-1_i8, 3, i8::MIN, i8::MAX] {
            add("split_indices", 1, &code.to_le_bytes(), code.to_string());
        }
        for offset in [-1_i64, 3, i64::MAX, i64::MIN, 1 << 62] {
            for index in [0, 1, ROWS] {
                add(
                    "obstacle_offsets",
                    index,
                    &offset.to_le_bytes(),
                    offset.to_string(),
                );
            }
        }
        all
    }

    /// Arrays missing, twice, foreign, and others in their place.
    pub(super) fn damaged_members(&self) -> Vec<Variant> {
        let members = members();
        let mut all = Vec::new();
        for (index, member) in members.iter().enumerate() {
            let mut add = |name: &str, fresh: &[Member], expected: Expected| {
                let name = format!("array {} {name}", member.name);
                all.push(self.with(name, archive(fresh), self.meta.clone(), expected));
            };
            let refused = || Expected::Refused(vec![Fault::key(ARCHIVE, &member.name, "")]);
            let mut fresh = members.clone();
            fresh.remove(index);
            add("is missing", &fresh, refused());
            for name in [
                member.name.to_uppercase(),
                format!("../{}", member.name),
                String::new(),
            ] {
                let mut fresh = members.clone();
                fresh[index].name.clone_from(&name);
                add(&format!("is called {name:?}"), &fresh, refused());
            }
            let mut fresh = members.clone();
            fresh.push(member.clone());
            add("is there twice", &fresh, self.refused_or_same(ARCHIVE));
            let mut fresh = members.clone();
            fresh[index].npy = b"not an array".to_vec();
            add("is none", &fresh, refused());
            let mut fresh = members.clone();
            let other = &members[(index + 1) % members.len()];
            fresh[index].npy = other.npy.clone();
            // Whole numbers of any width are read: what has as many of them is another set, which nothing tells from a good one.
            let is_alike = [member, other].map(|m| INDICES.contains(&m.name.as_str())) == [true; 2];
            let expected = if is_alike {
                Expected::Either(vec![Fault::file(ARCHIVE)])
            } else {
                refused()
            };
            add("is another", &fresh, expected);
        }
        all
    }
}

/// Headers that lie about an array; whether each must be refused.
fn lies(good: &[u8]) -> Vec<(String, Vec<u8>, bool)> {
    let header = String::from_utf8_lossy(&good[10..128]).into_owned();
    let field = |name: &str, end: char| {
        let begin = header.find(name).unwrap() + name.len();
        header[begin..].split(end).next().unwrap().to_owned()
    };
    let (descr, counts) = (field("'descr': '", '\''), field("'shape': (", ')'));
    let (shape_text, content) = (format!("({counts})"), &good[128..]);
    let with_shape = |text: &str| npy(&descr, false, text, content);
    let mut all: Vec<(String, Vec<u8>, bool)> = [
        "()",
        "(0, )",
        "(0, 3)",
        "(1, )",
        "(2, 64)",
        "(2, 64, 6, 1)",
        "(6148914691236517206, 3)",
        "(18446744073709551615, )",
        "(4294967296, 4294967296)",
        "(9223372036854775807, 2)",
        "(-1, 3)",
        "(1000000000, 64, 6)",
        "(1.5, )",
        "('a', )",
        "(3",
    ]
    .iter()
    .map(|text| (format!("has shape {text}"), with_shape(text), true))
    .collect();
    for other in [
        "<f8", ">f4", "<f2", "<c8", "|O", "<i8", "|b1", "<U4", "|S1", "nonsense", "",
    ] {
        if other != descr {
            all.push((
                format!("has type {other}"),
                npy(other, false, &shape_text, content),
                true,
            ));
        }
    }
    let is_vector = counts.trim_end_matches([',', ' ']).find(',').is_none();
    all.push((
        "is column-major".to_owned(),
        npy(&descr, true, &shape_text, content),
        !is_vector,
    ));
    all.push((
        "lacks its last byte".to_owned(),
        good[..good.len() - 1].to_vec(),
        true,
    ));
    all.push(("lacks its content".to_owned(), good[..128].to_vec(), true));
    all.push((
        "has a byte too many".to_owned(),
        [good, &[0]].concat(),
        true,
    ));
    all.push((
        "is there twice over".to_owned(),
        [good, content].concat(),
        true,
    ));
    all.push((
        "has an endless header".to_owned(),
        [&good[..8], &[0xff, 0xff], &good[10..]].concat(),
        true,
    ));
    all.push((
        "has another magic".to_owned(),
        [b"\x93NUMPX", &good[6..]].concat(),
        true,
    ));
    all.push((
        "is of version 9".to_owned(),
        [&good[..6], &[9], &good[7..]].concat(),
        true,
    ));
    all
}

/// The arrays of a set of two rows, each path straight up to a bend, one ball a row.
pub(super) fn members() -> Vec<Member> {
    let member = |name: &str, descr: &str, counts: &[usize], content: Vec<u8>| Member {
        name: name.to_owned(),
        npy: npy(descr, false, &shape(counts), &content),
    };
    let angle = |i: usize| (i / 6 % 64) as f32 * 0.01 * if i.is_multiple_of(6) { 1.0 } else { 0.2 };
    let path: Vec<f32> = (0..ROWS * 64 * 6).map(angle).collect();
    let tips = [0.9, 0.3, 2.4, 0.9, 0.3, 2.4];
    let numbers = |values: &[i64], size: usize| -> Vec<u8> {
        values
            .iter()
            .flat_map(|v| v.to_le_bytes()[..size].to_vec())
            .collect()
    };
    vec![
        member("paths", "<f4", &[ROWS, 64, 6], reals(&path)),
        member("target_tips", "<f4", &[ROWS, 3], reals(&tips)),
        member("target_indices", "<i4", &[ROWS], numbers(&[0, 1], 4)),
        member("start_indices", "<i2", &[ROWS], numbers(&[0, 0], 2)),
        member("ik_indices", "<i2", &[ROWS], numbers(&[0, 0], 2)),
        member("split_indices", "|i1", &[ROWS], numbers(&[0, 2], 1)),
        member(
            "obstacle_centres",
            "<f4",
            &[ROWS, 3],
            reals(&[-1.5, 0.0, 1.0, -1.5, 0.2, 1.0]),
        ),
        member(
            "obstacle_offsets",
            "<i8",
            &[ROWS + 1],
            numbers(&[0, 1, 2], 8),
        ),
    ]
}
