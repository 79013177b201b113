//! Archives whose arrays have, or say that they have, far more bytes than the file.

use std::fs;

use serde_json::{Map, Value};
use tests::programs::repository;

use super::dataset_files::{ARCHIVE, META, ROWS, members, text_of, write};
use super::npz::{Member, Packed, npy, packed_archive, shape};
use super::variant::{Expected, Fault, Variant};

/// Rows of a set whose paths have 300 MB.
const MANY_ROWS: usize = 200_000;
/// Waypoints and angles of a path.
const PATH: [usize; 2] = [64, 6];

/// All that is tried of archives that are larger than they look.
pub(super) fn variants() -> Vec<Variant> {
    let refused = || Expected::Refused(vec![Fault::file(ARCHIVE)]);
    let either = || Expected::Either(vec![Fault::file(ARCHIVE)]);
    let good: Vec<Packed> = members().iter().map(Packed::stored).collect();
    let with = |extra: Packed| {
        let kept = good.iter().filter(|member| member.name != extra.name);
        let all: Vec<Packed> = kept.cloned().chain([extra.clone()]).collect();
        packed_archive(&all)
    };
    let mut claims = zeros("paths", &[ROWS, PATH[0], PATH[1]]);
    claims.size = u32::MAX - 15;
    let mut much_claimed = zeros("paths", &[2_000_000, PATH[0], PATH[1]]);
    much_claimed.packed.truncate(1000);
    let crowd: Vec<Packed> = (0..5000)
        .map(|i| zeros(&format!("extra_{i}"), &[3]))
        .chain(good.clone())
        .collect();
    vec![
        variant(
            "paths of 300 MB, all zero",
            packed_archive(&many_rows()),
            MANY_ROWS,
            either(),
        ),
        variant(
            "paths of 3 GB for two rows",
            with(zeros("paths", &[2_000_000, PATH[0], PATH[1]])),
            ROWS,
            refused(),
        ),
        variant(
            "an array of 3 GB that nobody reads",
            with(zeros("extra", &[750_000_000])),
            ROWS,
            refused(),
        ),
        variant("paths that claim 4 GB", with(claims), ROWS, refused()),
        variant(
            "paths of 3 GB of which 1,000 bytes are there",
            with(much_claimed),
            ROWS,
            refused(),
        ),
        variant(
            "5,000 arrays that nobody reads",
            packed_archive(&crowd),
            ROWS,
            either(),
        ),
    ]
}

/// All arrays of a set of many rows that are zero.
fn many_rows() -> Vec<Packed> {
    let rows = MANY_ROWS;
    let mut all = vec![
        zeros("paths", &[rows, PATH[0], PATH[1]]),
        zeros("target_tips", &[rows, 3]),
        zeros("obstacle_centres", &[0, 3]),
    ];
    let indices = [
        "target_indices",
        "start_indices",
        "ik_indices",
        "split_indices",
    ];
    all.extend(indices.map(|name| zeros_of("|i1", 1, name, &[rows])));
    all.push(zeros_of("<i8", 8, "obstacle_offsets", &[rows + 1]));
    all
}

fn zeros(name: &str, counts: &[usize]) -> Packed {
    zeros_of("<f4", 4, name, counts)
}

/// An array of zeros, deflated.
fn zeros_of(descr: &str, item: usize, name: &str, counts: &[usize]) -> Packed {
    let header = npy(descr, false, &shape(counts), &[]);
    let bytes = item * counts.iter().product::<usize>();
    Packed::zeros_behind(name, &header, bytes)
}

fn variant(name: &str, archive: Vec<u8>, rows: usize, expected: Expected) -> Variant {
    let sample = repository()
        .join("tests/data/reference-mixed-sample")
        .join(META);
    let mut meta: Map<String, Value> = serde_json::from_slice(&fs::read(sample).unwrap()).unwrap();
    meta.insert("actual_paths".to_owned(), rows.into());
    meta.remove("split_counts");
    let meta = text_of(&meta);
    Variant {
        family: "data set, larger than it looks",
        name: name.to_owned(),
        make: Box::new(move |folder| write(folder, &archive, &meta)),
        expected,
    }
}

impl Packed {
    /// A member as it is.
    fn stored(member: &Member) -> Self {
        Self::of(&member.name, &member.npy)
    }
}
