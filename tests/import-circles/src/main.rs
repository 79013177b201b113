//! Finds import circles between the files of a crate.
//!
//! `import-circles [PATH …]`: crate roots, or folders whose crate roots are meant; without any, those of the whole workspace of the
//! working directory. Exit status 1 where there is a circle, with each circle's files and imports on standard output.
//!
//! An import is a path of `use`, or one in code, that begins with `crate`, `self`, `super`, a child module or an imported name, and
//! ends in another file of the crate. A path through a re-export counts for the file that defines the item, so a file that only
//! re-exports is in no circle. What is compiled for tests alone does not count.
//! Not seen: methods that another file's `impl` defines, and `macro_rules` macros that are used without a path.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod circles;
mod crate_files;
mod crate_roots;
mod source_file;

use crate::crate_files::{CrateFiles, Imports};
use std::env;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

fn main() -> anyhow::Result<ExitCode> {
    let asked: Vec<PathBuf> = env::args_os().skip(1).map(PathBuf::from).collect();
    let roots = crate_roots::selected(&asked)?;
    let mut count = 0;
    for root in &roots {
        count += report(root)?;
    }
    println!("{} crate roots, {count} import circles", roots.len());
    Ok(ExitCode::from(u8::from(count > 0)))
}

/// Prints the import circles of the crate with this root, and returns their number.
fn report(root: &Path) -> anyhow::Result<usize> {
    let imports = CrateFiles::read(root)?.imports();
    let here = env::current_dir()?.canonicalize()?;
    let shown = root.strip_prefix(here).unwrap_or(root);
    let circles = circles::circles(&imports.targets());
    for circle in &circles {
        let files = circle.len();
        println!("{}: an import circle of {files} files:", shown.display());
        for &file in circle {
            print_imports(&imports, file, circle);
        }
    }
    Ok(circles.len())
}

/// Prints what a file imports from the other files of its circle.
fn print_imports(imports: &Imports, file: usize, circle: &[usize]) {
    for (other, paths) in &imports.of_file[file] {
        if circle.contains(other) {
            let paths: Vec<&str> = paths.iter().map(String::as_str).collect();
            let (from, to) = (&imports.modules[file], &imports.modules[*other]);
            println!("    {from} imports {to}: {}", paths.join(", "));
        }
    }
}
