//! The archive of paths that another program proposes, which `pcc evaluate` judges.

use std::fs;
use std::path::Path;

use tests::programs::repository;
use tests::trial::Start;

use super::arrays::lies;
use super::damage::{self, Damaged};
use super::dataset_files::members;
use super::npz::{Member, archive, contents, npy, reals, shape};
use super::variant::{Expected, Fault, Variant};

const FILE: &str = "proposed.npz";
const FAMILY: &str = "proposed paths";
/// Cases, paths a case, waypoints, angles.
const SHAPE: [usize; 4] = [1, 1, 64, 6];

/// All that is tried of proposed paths.
pub(super) fn variants() -> Vec<Variant> {
    let good = paths(&SHAPE);
    let whole = archive(std::slice::from_ref(&good));
    let mut all = vec![with("undamaged", whole.clone(), Expected::Taken)];
    all.extend(damaged(&whole));
    all.extend(places());
    for lie in lies(&good.npy) {
        let told = lie.fault(FILE, "paths");
        let fresh = Member {
            npy: lie.npy,
            ..good.clone()
        };
        let name = format!("paths {}", lie.name);
        all.push(with(
            &name,
            archive(&[fresh]),
            Expected::Refused(vec![told]),
        ));
    }
    all.extend(other_arrays(&good));
    all.extend(other_shapes());
    all.extend(wrong_values(&good));
    all
}

/// A path that bends more and more, as the members of a data set have it, in an array of any shape.
fn paths(counts: &[usize]) -> Member {
    let known = members().into_iter().find(|m| m.name == "paths").unwrap();
    let values = known.npy[128..].iter().copied().cycle();
    let bytes = 4 * counts.iter().product::<usize>();
    let content: Vec<u8> = values.take(bytes).collect();
    Member {
        npy: npy("<f4", false, &shape(counts), &content),
        ..known
    }
}

fn with(name: &str, content: Vec<u8>, expected: Expected) -> Variant {
    Variant {
        family: FAMILY,
        name: format!("{FILE} {name}"),
        make: Box::new(move |folder| {
            fs::write(folder.join(FILE), &content).unwrap();
            start()
        }),
        expected,
    }
}

/// Bytes cut, flipped, added and foreign. A checksum guards what the array holds; a bit of the rest may have no meaning.
fn damaged(whole: &[u8]) -> Vec<Variant> {
    let (_, place) = contents(whole).remove(0);
    let of_array = || Expected::Refused(vec![Fault::key(FILE, "paths", "")]);
    let of_file = || Expected::Refused(vec![Fault::file(FILE), Fault::unreadable(FILE)]);
    let either = || Expected::Either(vec![Fault::file(FILE), Fault::unreadable(FILE)]);
    let mut all = Vec::new();
    let mut add = |damaged: Vec<Damaged>, expected: &dyn Fn() -> Expected| {
        let variant = |d: Damaged| with(&d.name, d.content, expected());
        all.extend(damaged.into_iter().map(variant));
    };
    add(damage::truncated(whole, 40), &of_file);
    add(damage::foreign(), &of_file);
    add(damage::with_surplus(whole, false), &of_file);
    let flips = |begin: usize, end: usize, count: usize| -> Vec<Damaged> {
        let at = |i: usize| begin + i * (end - begin) / count;
        let flip = |i: usize| damage::flip(whole, at(i), (i % 8) as u32);
        (0..count).map(flip).collect()
    };
    add(flips(place.start, place.end, 40), &of_array);
    add(flips(0, place.start, place.start), &either);
    let rest = whole.len() - place.end;
    add(flips(place.end, whole.len(), rest), &either);
    all
}

/// Something else in the place of the file.
fn places() -> Vec<Variant> {
    let place = |&(name, make): &(&str, fn(&Path))| Variant {
        family: FAMILY,
        name: format!("{FILE} {name}"),
        make: Box::new(move |folder| {
            make(&folder.join(FILE));
            start()
        }),
        expected: Expected::Refused(vec![Fault::unreadable(FILE), Fault::file(FILE)]),
    };
    damage::PLACES.iter().map(place).collect()
}

/// The array missing, of another name, twice, and with others beside it.
fn other_arrays(good: &Member) -> Vec<Variant> {
    let refused = |told: &str| Expected::Refused(vec![Fault::key(FILE, "paths", told)]);
    let called = |name: &str| Member {
        name: name.to_owned(),
        ..good.clone()
    };
    let mut all = vec![
        with("without an array", archive(&[]), refused("")),
        with(
            "with paths twice",
            archive(&[good.clone(), good.clone()]),
            Expected::Refused(vec![Fault::file(FILE)]),
        ),
        with(
            "with another array beside it",
            archive(&[good.clone(), called("other")]),
            Expected::Taken,
        ),
    ];
    for name in ["PATHS", "../paths", "path", ""] {
        let name_of = format!("with paths called {name:?}");
        all.push(with(&name_of, archive(&[called(name)]), refused(name)));
    }
    all
}

/// The array of other counts of cases, paths a case, waypoints and angles.
fn other_shapes() -> Vec<Variant> {
    let mut all = Vec::new();
    for counts in [
        &[0, 1, 64, 6][..],
        &[1, 2, 64, 6],
        &[1, 0, 64, 6],
        &[1, 1, 63, 6],
        &[1, 1, 64, 5],
        &[1, 64, 6],
        &[64, 6],
        &[1, 1, 64, 6, 1],
    ] {
        let told = format!("{counts:?}");
        let fault = Fault::key(FILE, "paths", &told);
        // Without a case there is no shape to speak of.
        let fault = if counts[0] == 0 {
            fault.or_value("no case")
        } else {
            fault
        };
        let name = format!("of shape {told}");
        all.push(with(
            &name,
            archive(&[paths(counts)]),
            Expected::Refused(vec![fault]),
        ));
    }
    // More cases than the sample has.
    let many = archive(&[paths(&[1000, 1, 64, 6])]);
    let told = Fault::key(FILE, "paths", "1000");
    all.push(with("of 1000 cases", many, Expected::Refused(vec![told])));
    all
}

/// Values that are no angles are refused; angles that no section bends by are judged as any path.
fn wrong_values(good: &Member) -> Vec<Variant> {
    let last = SHAPE.iter().product::<usize>() - 1;
    let mut all = Vec::new();
    for value in [
        f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        1e30,
        -1e30,
        3.2,
        f32::MIN_POSITIVE,
    ] {
        for index in [0, 200, last] {
            let mut fresh = good.clone();
            let begin = 128 + 4 * index;
            fresh.npy[begin..begin + 4].copy_from_slice(&reals(&[value]));
            let told = Fault::key(FILE, "paths", &value.to_string()).and("case");
            let expected = Expected::refused_if(!value.is_finite(), vec![told]);
            all.push(with(
                &format!("{value} at {index}"),
                archive(&[fresh]),
                expected,
            ));
        }
    }
    all
}

/// Judges the paths of one case.
fn start() -> Start {
    let repository = repository();
    let file = |path: &str| repository.join(path).to_str().unwrap().to_owned();
    let (set, robot) = (
        file("tests/data/reference-mixed-sample"),
        file("config/robots/unit.toml"),
    );
    Start::new(
        "pcc",
        &[
            "evaluate",
            "--dataset",
            &set,
            "--planner",
            "proposed",
            "--proposals",
            FILE,
            "--candidates",
            "1",
            "--threads",
            "1",
            "--robot",
            &robot,
            "--out",
            "out",
        ],
    )
}
