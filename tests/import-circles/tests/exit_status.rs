//! The program fails where a circle is made, and says which files and paths it is of.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn run(workspace: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_import-circles"));
    command
        .current_dir(workspace)
        .args(arguments)
        .output()
        .unwrap()
}

#[test]
fn the_program_fails_where_a_circle_is_made() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = "[package]\nname = \"made\"\nedition = \"2024\"\n[workspace]\n";
    fs::create_dir(folder.path().join("src")).unwrap();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    write("Cargo.toml", manifest);
    write("src/lib.rs", "mod a;\nmod b;\n");
    write("src/a.rs", "use crate::b::B;\npub struct A(B);\n");
    write("src/b.rs", "pub struct B;\n");
    let clean = run(folder.path(), &[]);
    assert!(clean.status.success(), "{clean:?}");
    assert_eq!(clean.stdout, b"1 crate roots, 0 import circles\n");

    write(
        "src/b.rs",
        "pub struct B;\npub fn a() -> crate::a::A {\n    crate::a::A(B)\n}\n",
    );
    for arguments in [&[][..], &["src"], &["src/lib.rs"]] {
        let circle = run(folder.path(), arguments);
        assert_eq!(circle.status.code(), Some(1), "{circle:?}");
        let said = String::from_utf8(circle.stdout).unwrap();
        assert!(
            said.starts_with("src/lib.rs: an import circle of 2 files:\n"),
            "{said}"
        );
        assert!(
            said.contains("    a imports b: crate::b::B\n    b imports a: crate::a::A\n"),
            "{said}"
        );
    }
    let unknown = run(folder.path(), &["src/a.rs"]);
    let said = String::from_utf8(unknown.stderr).unwrap();
    assert!(said.contains("src/a.rs: not a crate root"), "{said}");
}
