//! `include/pcc/client.h` is what the functions say. `UPDATE_EXPECT=1` writes it anew.
#![allow(clippy::unwrap_used)] // tests

use std::path::Path;

use cbindgen::{Builder, Config};
use expect_test::expect_file;

#[test]
fn the_header_is_what_the_functions_say() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = Config::from_file(folder.join("cbindgen.toml")).unwrap();
    let source = folder.join("src");
    let files = [
        "error",
        "plan",
        "results",
        "controller",
        "scene",
        "goal",
        "driver",
        "follower",
        "text",
    ];
    let builder = files.iter().fold(Builder::new(), |builder, file| {
        builder.with_src(source.join(file).with_extension("rs"))
    });
    let mut written = Vec::new();
    let bindings = builder.with_config(config).generate().unwrap();
    bindings.write(&mut written);
    let written = String::from_utf8(written).unwrap();
    expect_file!["../include/pcc/client.h"].assert_eq(&written);
}
