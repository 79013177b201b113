//! Scene files: what they hold, and refusals by name.
#![allow(clippy::unwrap_used)]

use collision::Scene;
use pcc_model::Point;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

fn shipped() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/scenes")
}

/// A folder with the shipped scene's files and a scene file of this text.
fn folder(text: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    for file in std::fs::read_dir(shipped()).unwrap() {
        let file = file.unwrap();
        std::fs::copy(file.path(), folder.path().join(file.file_name())).unwrap();
    }
    std::fs::write(folder.path().join("scene.toml"), text).unwrap();
    folder
}

fn refusal(text: &str) -> String {
    let folder = folder(text);
    let error = Scene::from_file(&folder.path().join("scene.toml"), 1.0).unwrap_err();
    error.to_string()
}

#[test]
fn the_shipped_scene_is_read_in_units_of_the_section_length() {
    let scene = Scene::from_file(&shipped().join("workshop.toml"), 0.5).unwrap();
    assert_eq!((scene.balls().len(), scene.solids().len()), (2, 5));
    assert_eq!(scene.balls()[0].centre, Point::new(2.4, 1.8, 4.4));
    let distance = |solid: usize, metres: [f64; 3]| {
        scene.solids()[solid]
            .nearest(&(Point::from(metres) / 0.5))
            .distance
            * 0.5
    };
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-6, "{a} {b}");
    near(distance(0, [1.0, -1.5, 1.0]), 0.35);
    let (sine, cosine) = 0.2_f64.sin_cos();
    near(distance(1, [-1.9 + 0.5 * cosine, 0.5 * sine, 1.0]), 0.45);
    let eighth = 0.5_f64.sqrt();
    near(
        distance(2, [0.9 + 0.1 * eighth, -0.3 - 0.1 * eighth, 1.0]),
        0.1,
    );
    near(distance(2, [0.9, -0.3, 0.8]), 0.1);
    near(distance(3, [-0.6, -1.2, 2.3]), 0.2);
    near(distance(3, [-0.6, -1.2, 1.6]), -0.1);
    near(distance(4, [-0.45, 1.05, -0.3]), 0.1);
    assert!(distance(4, [-0.45, 1.05, -0.15]) < 0.0);
}

#[test]
fn a_scene_without_obstacles_says_so() {
    let empty = folder("balls = []");
    let path = empty.path().join("scene.toml");
    assert!(Scene::from_file(&path, 1.0).unwrap().is_empty());
    for silent in ["", "# all of it was cut off\n"] {
        let said = refusal(silent);
        assert!(
            said.contains("names no obstacle") && said.contains("scene.toml"),
            "{said}"
        );
    }
}

#[test]
fn every_bad_value_is_refused_by_name() {
    let position = "position_m = [0.0, 0.0, 0.0]";
    for (text, named) in [
        ("balls = 3", "is not understood"),
        ("[[spheres]]\nradius_m = 1.0", "unknown field `spheres`"),
        ("[[balls]]\nradius_m = 1.0", "missing field `centre_m`"),
        (
            "[[balls]]\ncentre_m = [0.0, nan, 0.0]\nradius_m = 1.0",
            "balls[0]: centre_m is NaN",
        ),
        (
            "[[balls]]\ncentre_m = [0.0, 1.0, 0.0]\nradius_m = -1.0",
            "balls[0]: radius_m is -1",
        ),
        (
            "[[capsules]]\nfrom_m = [0.0, 0.0, 0.0]\nto_m = [0.0, 0.0, 1.0]\nradius_m = 0.0",
            "capsules[0]: radius_m is 0",
        ),
        (
            &format!("[[boxes]]\nsides_m = [1.0, inf, 1.0]\n{position}"),
            "boxes[0]: sides_m is inf",
        ),
        (
            "[[boxes]]\nsides_m = [1.0, 1.0, 1.0]\nposition_m = [nan, 0.0, 0.0]",
            "boxes[0]: position_m is NaN",
        ),
        (
            &format!(
                "[[boxes]]\nsides_m = [1.0, 1.0, 1.0]\n{position}\nquaternion_xyzw = [1.0, 1.0, 0.0, 0.0]"
            ),
            "boxes[0]: quaternion_xyzw is [1.0, 1.0, 0.0, 0.0], of norm 1.41",
        ),
        (
            &format!(
                "[[boxes]]\nsides_m = [1.0, 1.0, 1.0]\n{position}\nrotation_vector_rad = [nan, 1.0, 0.0]"
            ),
            "rotation_vector_rad is [NaN",
        ),
        (
            &format!(
                "[[boxes]]\nsides_m = [1.0, 1.0, 1.0]\n{position}\nrotation_vector_rad = [0.0, 1.0, 0.0]\nquaternion_xyzw = [0.0, 0.0, 0.0, 1.0]"
            ),
            "both given",
        ),
        (
            &format!("[[meshes]]\nfile = \"no.stl\"\n{position}"),
            "no.stl",
        ),
        (
            &format!("[[meshes]]\nfile = \"heap.npy\"\n{position}"),
            "ends in .stl or .obj",
        ),
        (
            &format!("[[meshes]]\nfile = \"scene.toml.stl\"\n{position}"),
            "scene.toml.stl",
        ),
        (
            &format!("[[meshes]]\nfile = \"pyramid.obj\"\nunit_m = 0.0\n{position}"),
            "meshes[0]: unit_m is 0",
        ),
        (
            &format!("[[voxels]]\nfile = \"heap.npy\"\nvoxel_m = -1.0\n{position}"),
            "voxels[0]: voxel_m is -1",
        ),
        (
            &format!("[[voxels]]\nfile = \"heap.npy\"\nvoxel_m = 5e-324\n{position}"),
            "voxels[0]: voxel_m is 0.000",
        ),
        (
            &format!("[[voxels]]\nfile = \"bracket.stl\"\nvoxel_m = 0.1\n{position}"),
            "voxels[0]",
        ),
    ] {
        let refusal = refusal(text);
        assert!(refusal.contains(named), "{text}: {refusal}");
    }
}

#[test]
fn too_many_values_too_many_balls_and_missing_files_are_refused_by_name() {
    let position = "position_m = [0.0, 0.0, 0.0]";
    for (text, named) in [
        (
            "[[balls]]\ncentre_m = [0.0, 1.0, 0.0, 7.0]\nradius_m = 1.0",
            "invalid length 4, expected an array of exactly 3 numbers",
        ),
        (
            &format!(
                "[[boxes]]\nsides_m = [1.0, 1.0, 1.0]\n{position}\nquaternion_xyzw = [0.0, 0.0, 0.0, 1.0, 9.0]"
            ),
            "invalid length 5",
        ),
    ] {
        let refusal = refusal(text);
        assert!(refusal.contains(named), "{text}: {refusal}");
    }
    let ball = "[[balls]]\ncentre_m = [0.0, 1.0, 0.0]\nradius_m = 1.0\n";
    assert!(refusal(&ball.repeat(1025)).contains("has 1025 balls; at most 1024"));
    let gone = Scene::from_file(Path::new("/nowhere/scene.toml"), 1.0).unwrap_err();
    assert!(
        gone.to_string()
            .contains("cannot read \"/nowhere/scene.toml\""),
        "{gone}"
    );
}

#[test]
fn meshes_that_are_open_empty_or_inside_out_and_grids_of_other_kinds_are_refused() {
    let mesh = "[[meshes]]\nfile = \"a.obj\"\nposition_m = [0.0, 0.0, 0.0]";
    let grid = "[[voxels]]\nfile = \"a.npy\"\nvoxel_m = 0.1\nposition_m = [0.0, 0.0, 0.0]";
    let pyramid = std::fs::read_to_string(shipped().join("pyramid.obj")).unwrap();
    let heap = std::fs::read(shipped().join("heap.npy")).unwrap();
    let wide = String::from_utf8_lossy(&heap).contains("|u1");
    assert!(wide, "the shipped grid holds bytes");
    let replaced = |from: &str, to: &str| -> Vec<u8> {
        let at = heap
            .windows(from.len())
            .position(|w| w == from.as_bytes())
            .unwrap();
        [&heap[..at], to.as_bytes(), &heap[at + from.len()..]].concat()
    };
    for (text, file, content, named) in [
        (
            mesh,
            "a.obj",
            pyramid.replace("f 4 1 5\n", "").into_bytes(),
            "a.obj\": the mesh is open",
        ),
        (
            mesh,
            "a.obj",
            pyramid.replace("f 4 1 5", "f 4 5 1").into_bytes(),
            "face the same side",
        ),
        (
            mesh,
            "a.obj",
            pyramid.replace("v 0 0 0.6", "v 0 0 -0.6").into_bytes(),
            "inside out",
        ),
        (
            mesh,
            "a.obj",
            pyramid.replace("v 0 0 0.6", "v 0 nan 0.6").into_bytes(),
            "meshes[0]",
        ),
        (mesh, "a.obj", Vec::new(), "0 triangles"),
        (grid, "a.npy", replaced("|u1", "|i1"), "its descr is '|i1'"),
        (
            grid,
            "a.npy",
            replaced("False", "True "),
            "row-major (C) order, is needed",
        ),
        (
            grid,
            "a.npy",
            replaced("(10, 10, 8)", "(10, 80)   "),
            "three dimensions",
        ),
        (
            grid,
            "a.npy",
            replaced("(10, 10, 8)", "(9000,9000,9000)"),
            "voxels[0]",
        ),
        (grid, "a.npy", heap[..300].to_vec(), "voxels[0]"),
    ] {
        let folder = folder(text);
        std::fs::write(folder.path().join(file), content).unwrap();
        let refused = Scene::from_file(&folder.path().join("scene.toml"), 1.0);
        let refusal = refused.unwrap_err().to_string();
        assert!(refusal.contains(named), "{named}: {refusal}");
    }
}

/// A scene file of one mesh, which has these bytes as an STL file.
fn with_stl(bytes: &[u8]) -> Result<Scene, collision::SceneFileError> {
    let folder = folder("[[meshes]]\nfile = \"a.stl\"\nposition_m = [0.0, 0.0, 0.0]");
    std::fs::write(folder.path().join("a.stl"), bytes).unwrap();
    Scene::from_file(&folder.path().join("scene.toml"), 1.0)
}

/// The shipped mesh, which is text, as a binary STL file whose 80 bytes of text begin with `header`.
fn binary_bracket(header: &[u8]) -> Vec<u8> {
    let text = std::fs::read_to_string(shipped().join("bracket.stl")).unwrap();
    let numbers = |line: &str| -> Option<Vec<u8>> {
        let line = line.trim();
        let numbers = line
            .strip_prefix("facet normal")
            .or_else(|| line.strip_prefix("vertex"))?;
        let numbers = numbers.split_whitespace();
        Some(
            numbers
                .flat_map(|n| n.parse::<f32>().unwrap().to_le_bytes())
                .collect(),
        )
    };
    let vectors: Vec<Vec<u8>> = text.lines().filter_map(numbers).collect();
    let triangles = vectors.chunks_exact(4);
    let count = u32::try_from(triangles.len()).unwrap();
    let mut bytes = header.to_vec();
    bytes.resize(80, b' ');
    bytes.extend(count.to_le_bytes());
    for triangle in triangles {
        bytes.extend(triangle.concat());
        bytes.extend([0; 2]);
    }
    bytes
}

#[test]
fn a_binary_mesh_is_known_by_its_size_whatever_its_text_says() {
    let named_solid = binary_bracket(b"solid bracket");
    let named_else = binary_bracket(b"bracket");
    assert!(named_solid.len() > 1000, "{}", named_solid.len());
    let text = std::fs::read(shipped().join("bracket.stl")).unwrap();
    let [mesh, same, other] =
        [&text, &named_solid, &named_else].map(|bytes| with_stl(bytes).unwrap());
    let point = Point::new(0.3, -0.2, 0.1);
    let nearest = |scene: &Scene| scene.solids()[0].nearest(&point).point;
    assert_eq!(nearest(&mesh), nearest(&same));
    assert_eq!(nearest(&mesh), nearest(&other));
    let cut = &named_else[..named_else.len() - 7];
    let longer = [&named_else[..], b"more"].concat();
    for bytes in [cut, &longer, &named_solid[..1000], b"", b"solid "] {
        let refused = with_stl(bytes).unwrap_err().to_string();
        assert!(
            refused.contains("meshes[0]") && refused.contains("a.stl"),
            "{refused}"
        );
    }
}
