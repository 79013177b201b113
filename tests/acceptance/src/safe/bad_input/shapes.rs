//! Meshes and voxel grids of a scene.

use std::fs;

use super::configurations::daemon_with_scene;
use super::damage::{self, Damaged};
use super::npz::{npy, shape, told_shapes};
use super::variant::{Expected, Fault, Variant};
use tests::programs::repository;

/// All that is tried of the files that a scene names.
pub(super) fn variants() -> Vec<Variant> {
    let mut all = Vec::new();
    for (file, seed) in [("bracket.stl", 41), ("pyramid.obj", 42), ("heap.npy", 43)] {
        let content = fs::read(repository().join("tests/data/scenes").join(file)).unwrap();
        let is_text = file != "heap.npy";
        let mut bytes: Vec<Damaged> = damage::truncated(&content, 40);
        bytes.extend(damage::flipped(&content, 60, seed));
        bytes.extend(damage::with_surplus(&content, is_text));
        bytes.extend(damage::foreign());
        all.extend(bytes.into_iter().map(|d| {
            let expected = expected(file, &content, &d.content);
            with(file, d.name, d.content, expected)
        }));
        all.extend(damage::PLACES.iter().map(|&(name, make)| Variant {
            family: "mesh or grid",
            name: format!("{file} {name}"),
            make: Box::new(move |folder| {
                let start = daemon_with_scene(folder);
                fs::remove_file(folder.join(file)).unwrap();
                make(&folder.join(file));
                start
            }),
            expected: Expected::Refused(vec![Fault::unreadable(file), Fault::file(file)]),
        }));
    }
    all.extend(binary_meshes());
    all.extend(grids());
    all
}

fn with(file: &'static str, mut name: String, content: Vec<u8>, expected: Expected) -> Variant {
    name.insert_str(0, &format!("{file} "));
    Variant {
        family: "mesh or grid",
        name,
        make: Box::new(move |folder| {
            let start = daemon_with_scene(folder);
            fs::write(folder.join(file), &content).unwrap();
            start
        }),
        expected,
    }
}

/// These files have no checksum: a turned bit can give another file of the kind, which nothing tells from a good one. A mesh
/// that is not closed is told, and so is a file that is too short.
fn expected(file: &str, before: &[u8], after: &[u8]) -> Expected {
    let fault = vec![Fault::file(file), Fault::unreadable(file)];
    match file {
        "heap.npy" if after.len() != before.len() || after[..10] != before[..10] => {
            Expected::Refused(fault)
        }
        "heap.npy" => Expected::Either(fault),
        "bracket.stl" => match (corners(before), corners(after)) {
            (good, Some(corners)) if Some(&corners) == good.as_ref() => Expected::Either(fault),
            _ => Expected::Refused(fault),
        },
        _ => match (faces(before), faces(after)) {
            (good, Some(faces)) if good.as_ref().is_some_and(|good| faces.len() >= good.len()) => {
                Expected::Either(fault)
            }
            _ => Expected::Refused(fault),
        },
    }
}

/// The corners of an ASCII STL file's triangles, if it is one from end to end: one corner changed opens the mesh.
fn corners(content: &[u8]) -> Option<Vec<[f32; 3]>> {
    let text = std::str::from_utf8(content).ok()?;
    let mut corners = Vec::new();
    let mut is_open = false;
    for line in text.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[..] {
            ["solid", ..] => is_open = true,
            ["vertex", x, y, z] => {
                corners.push([x.parse().ok()?, y.parse().ok()?, z.parse().ok()?]);
            }
            ["endsolid", ..] => is_open = false,
            ["facet", "normal", ..] | ["outer", "loop"] | ["endloop" | "endfacet"] | [] => {}
            _ => return None,
        }
    }
    (!is_open).then_some(corners)
}

/// The faces of an OBJ file with numbers of vertices that it has; one fewer opens the mesh.
fn faces(content: &[u8]) -> Option<Vec<Vec<usize>>> {
    let text = std::str::from_utf8(content).ok()?;
    let (mut vertices, mut faces) = (0, Vec::new());
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let numbers: Result<Vec<f64>, _> = words.map(str::parse).collect();
                vertices += usize::from(numbers.ok()?.len() >= 3);
            }
            Some("f") => faces.push(
                words
                    .map(str::parse)
                    .collect::<Result<Vec<usize>, _>>()
                    .ok()?,
            ),
            _ => {}
        }
    }
    let is_there = |vertex: &usize| (1..=vertices).contains(vertex);
    faces.iter().flatten().all(is_there).then_some(faces)
}

/// A tetrahedron as a binary STL file, which says that it has so many triangles.
fn tetrahedron(header: &str, says: u32) -> Vec<u8> {
    let corners = [
        [0.0_f32, 0.0, 0.0],
        [100.0, 0.0, 0.0],
        [0.0, 100.0, 0.0],
        [0.0, 0.0, 100.0],
    ];
    let mut file = header.as_bytes().to_vec();
    file.resize(80, b' ');
    file.extend(says.to_le_bytes());
    for triangle in [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] {
        file.extend([0; 12]);
        file.extend(
            triangle
                .iter()
                .flat_map(|i: &usize| corners[*i])
                .flat_map(f32::to_le_bytes),
        );
        file.extend([0; 2]);
    }
    file
}

fn binary_meshes() -> Vec<Variant> {
    let file = "bracket.stl";
    let good = tetrahedron("binary", 4);
    let mut all = vec![
        with(file, "binary".to_owned(), good.clone(), Expected::Taken),
        with(
            file,
            "binary, called solid".to_owned(),
            tetrahedron("solid body", 4),
            Expected::Taken,
        ),
    ];
    let mut refused = |name: String, content: Vec<u8>, faults: Vec<Fault>| {
        all.push(with(file, name, content, Expected::Refused(faults)));
    };
    for says in [0, 3, 5, 1_000_000, u32::MAX] {
        let told = || vec![Fault::key(file, "triangles", &says.to_string())];
        let name = format!("binary, of {says} triangles");
        refused(name, tetrahedron("binary", says), told());
        let name = format!("called solid, of {says}");
        refused(name, tetrahedron("solid", says), told());
    }
    for d in damage::truncated(&good, 30) {
        let told = Fault::file(file).with_value(d.content.len().to_string());
        refused(format!("binary, {}", d.name), d.content, vec![told]);
    }
    for triangle in 0..4 {
        for at in 0..9 {
            let place = 84 + 50 * triangle + 12 + 4 * at;
            for value in [f32::NAN, f32::INFINITY, 1e38, -3.0] {
                let mut content = good.clone();
                content[place..place + 4].copy_from_slice(&value.to_le_bytes());
                let told = Fault::key(file, "vertex", &value.to_string());
                let mut faults = vec![told];
                if value == -3.0 {
                    // One of the edges that are open then: each of the body ends in a corner at 100, the others at −3.
                    faults = vec![Fault::key(file, "edge", "-3").or_value("100")];
                }
                refused(format!("binary, {value} at {place}"), content, faults);
            }
        }
    }
    all
}

fn grids() -> Vec<Variant> {
    let file = "heap.npy";
    let cells = vec![1_u8; 800];
    let mut all = vec![with(
        file,
        "made anew".to_owned(),
        npy("|u1", false, "(10, 10, 8)", &cells),
        Expected::Taken,
    )];
    let mut refused = |name: String, npy: Vec<u8>, fault: Fault| {
        all.push(with(file, name, npy, Expected::Refused(vec![fault])));
    };
    for text in [
        "()",
        "(800, )",
        "(10, 80)",
        "(10, 10, 8, 1)",
        "(10, 10, 9)",
        "(10, 10, 7)",
        "(0, 10, 8)",
        "(10, 10, -8)",
        "(6148914691236517206, 3, 1)",
        "(4294967296, 4294967296, 1)",
        "(257, 256, 256)",
        "(18446744073709551615, 1, 1)",
        "(a, b, c)",
        "(10, 10",
    ] {
        let fault = Fault::key_one_of(file, "shape", &told_shapes(text));
        let npy = npy("|u1", false, text, &cells);
        refused(format!("has shape {text}"), npy, fault);
    }
    for descr in [
        "<f4", "<f8", "<i8", "|i1", "<u2", "|O", "<U1", "nonsense", "",
    ] {
        let told = if descr.is_empty() { "''" } else { descr };
        // Of values of another size, the shape needs another number of bytes.
        let fault = Fault::key(file, "descr", told).or_key("shape");
        let npy = npy(descr, false, "(10, 10, 8)", &cells);
        refused(format!("has type {descr}"), npy, fault);
    }
    refused(
        "is column-major".to_owned(),
        npy("|u1", true, "(10, 10, 8)", &cells),
        Fault::key(file, "fortran_order", "True"),
    );
    refused(
        "is empty of voxels".to_owned(),
        npy("|u1", false, &shape(&[10, 10, 8]), &[0; 800]),
        Fault::key(file, "voxels", "0"),
    );
    all
}
