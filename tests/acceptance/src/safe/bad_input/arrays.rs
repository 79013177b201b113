//! The arrays of a data set: headers that lie, values that no row may have, arrays that are missing or in another's place.

use super::dataset_files::{ARCHIVE, ROWS, Set, members};
use super::npz::{Member, archive, npy, told_shapes};
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
            for lie in lies(&member.npy) {
                let mut fresh = members.clone();
                fresh[index].npy.clone_from(&lie.npy);
                let expected = if lie.is_refused {
                    Expected::Refused(vec![lie.fault(ARCHIVE, &member.name)])
                } else {
                    self.refused_or_same(ARCHIVE)
                };
                let name = format!("array {} {}", member.name, lie.name);
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
                Expected::Refused(vec![Fault::key(ARCHIVE, array, &text).and("row")]),
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
                let told = Fault::key(ARCHIVE, &member.name, &name);
                add(
                    &format!("is called {name:?}"),
                    &fresh,
                    Expected::Refused(vec![told]),
                );
            }
            let mut fresh = members.clone();
            fresh.push(member.clone());
            add("is there twice", &fresh, self.refused_or_same(ARCHIVE));
            let mut fresh = members.clone();
            fresh[index].npy = b"not an array".to_vec();
            let told = Fault::key(ARCHIVE, &member.name, "not an a");
            add("is none", &fresh, Expected::Refused(vec![told]));
            let mut fresh = members.clone();
            let other = &members[(index + 1) % members.len()];
            fresh[index].npy = other.npy.clone();
            // Whole numbers of any width are read: what has as many of them is another set, which nothing tells from a good one.
            let is_alike = [member, other].map(|m| INDICES.contains(&m.name.as_str())) == [true; 2];
            let shape = told_shapes(&format!("({})", field(&other.npy, "shape"))).remove(0);
            let told =
                Fault::key(ARCHIVE, &member.name, &shape).or_value(field(&other.npy, "descr"));
            let expected = Expected::refused_if(!is_alike, vec![told]);
            add("is another", &fresh, expected);
        }
        all
    }
}

/// An array whose header lies.
pub(super) struct Lie {
    pub(super) name: String,
    pub(super) npy: Vec<u8>,
    /// Whether it must be refused.
    pub(super) is_refused: bool,
    /// What is wrong in it; a message must show one of these.
    pub(super) told: Vec<String>,
}

impl Lie {
    fn new(name: impl Into<String>, npy: Vec<u8>, told: &[&str]) -> Self {
        Self {
            name: name.into(),
            npy,
            is_refused: true,
            told: told.iter().map(|text| (*text).to_owned()).collect(),
        }
    }

    /// What a message must say of it.
    pub(super) fn fault(&self, file: &str, array: &str) -> Fault {
        Fault::key_one_of(file, array, &self.told)
    }
}

/// A field of the header of an array: `descr` or `shape`.
fn field<'a>(npy: &'a [u8], name: &str) -> &'a str {
    let header = std::str::from_utf8(&npy[10..128]).unwrap();
    let (begin, end) = match name {
        "descr" => ("'descr': '", '\''),
        _ => ("'shape': (", ')'),
    };
    let (_, rest) = header.split_once(begin).unwrap();
    rest.split(end).next().unwrap()
}

/// Headers that lie about an array.
pub(super) fn lies(good: &[u8]) -> Vec<Lie> {
    let (descr, counts) = (field(good, "descr"), field(good, "shape"));
    let (shape_text, content) = (format!("({counts})"), &good[128..]);
    let mut all = wrong_shapes(descr, content);
    for other in [
        "<f8", ">f4", "<f2", "<c8", "|O", "<i8", "|b1", "<U4", "|S1", "nonsense", "",
    ] {
        if other != descr {
            let npy = npy(other, false, &shape_text, content);
            let quoted = "''";
            let told = if other.is_empty() { quoted } else { other };
            all.push(Lie::new(format!("has type {other}"), npy, &[told]));
        }
    }
    let is_vector = counts.trim_end_matches([',', ' ']).find(',').is_none();
    all.push(Lie {
        is_refused: !is_vector,
        ..Lie::new(
            "is column-major",
            npy(descr, true, &shape_text, content),
            &["True"],
        )
    });
    all.extend(wrong_sizes(good, content));
    all
}

/// Shapes that this content does not have, or none has.
fn wrong_shapes(descr: &str, content: &[u8]) -> Vec<Lie> {
    let shapes = [
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
    ];
    let lie = |text: &str| {
        let told = told_shapes(text);
        let told: Vec<&str> = told.iter().map(String::as_str).collect();
        let npy = npy(descr, false, text, content);
        Lie::new(format!("has shape {text}"), npy, &told)
    };
    shapes.into_iter().map(lie).collect()
}

/// An array with too little or too much behind its header, or with another beginning.
fn wrong_sizes(good: &[u8], content: &[u8]) -> Vec<Lie> {
    let bytes = |count: usize| count.to_string();
    let length = content.len();
    vec![
        Lie::new(
            "lacks its last byte",
            good[..good.len() - 1].to_vec(),
            &[&bytes(length - 1)],
        ),
        Lie::new("lacks its content", good[..128].to_vec(), &["0"]),
        Lie::new(
            "has a byte too many",
            [good, &[0]].concat(),
            &[&bytes(length + 1)],
        ),
        Lie::new(
            "is there twice over",
            [good, content].concat(),
            &[&bytes(2 * length)],
        ),
        Lie::new(
            "has an endless header",
            [&good[..8], &[0xff, 0xff], &good[10..]].concat(),
            &["65535"],
        ),
        Lie::new(
            "has another magic",
            [b"\x93NUMPX", &good[6..]].concat(),
            &["\\x93NUMPX"],
        ),
        Lie::new(
            "is of version 9",
            [&good[..6], &[9], &good[7..]].concat(),
            &["\\x93NUMPY\\t"],
        ),
    ]
}
