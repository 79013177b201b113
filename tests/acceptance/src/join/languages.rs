//! The languages whose clients are built here.

use std::env;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, PoisonError};

use anyhow::ensure;
use tests::programs::repository;

use super::examples::{Examples, NAMES, Program};
use crate::paper_python::environment;

/// Lines of its own that an example of a client may have.
const LINES: usize = 15;
/// Compilers and their standards.
const C: [&str; 2] = ["cc", "-std=c11"];
const CPP: [&str; 2] = ["c++", "-std=c++20"];

pub(super) fn rust() -> Examples {
    Examples {
        language: "Rust",
        command: "crates/client/examples",
        folder: repository().join("crates/client/examples"),
        ending: "rs",
        of_all: &["//", "use ", "}"],
        shared: None,
        most_lines: LINES,
        need_arguments: &NAMES,
        watched: ["executing", "holding"],
        program: |name| {
            run(Command::new("cargo")
                .args([
                    "build",
                    "--release",
                    "--locked",
                    "--quiet",
                    "-p",
                    "client",
                    "--example",
                ])
                .arg(name))?;
            Ok(built(release()?.join("examples").join(name)))
        },
        // Built with this program.
        asks: || Ok(built(release()?.join("asks"))),
        told_robot: by_path,
    }
}

pub(super) fn c() -> Examples {
    Examples {
        language: "C",
        command: "clients/c/examples/*.c",
        folder: repository().join("clients/c/examples"),
        ending: "c",
        of_all: &["/*", "#include", "}"],
        shared: None,
        most_lines: LINES,
        need_arguments: &NAMES,
        watched: ["executing", "holding"],
        program: |name| compiled(&c_example(name, "c"), &C),
        asks: || compiled(&beside("asks.c"), &C),
        told_robot: by_path,
    }
}

pub(super) fn cpp() -> Examples {
    Examples {
        language: "C++",
        command: "clients/c/examples/*.cpp",
        folder: repository().join("clients/c/examples"),
        ending: "cpp",
        of_all: &["//", "#include", "}"],
        shared: None,
        most_lines: LINES,
        need_arguments: &NAMES,
        watched: ["executing", "holding"],
        program: |name| compiled(&c_example(name, "cpp"), &CPP),
        asks: || compiled(&beside("asks.cpp"), &CPP),
        told_robot: by_path,
    }
}

pub(super) fn python() -> Examples {
    Examples {
        language: "Python",
        command: "clients/python/examples",
        folder: repository().join("clients/python/examples"),
        ending: "py",
        of_all: &["\"\"\"", "import ", "from ", "#"],
        shared: None,
        most_lines: LINES,
        need_arguments: &NAMES,
        watched: ["executing", "holding"],
        program: |name| {
            let script = repository().join(format!("clients/python/examples/{name}.py"));
            Ok(Program::script(python_client()?, &script))
        },
        asks: || Ok(Program::script(python_client()?, &beside("asks.py"))),
        told_robot: by_path,
    }
}

/// A Python with the module as it is now.
pub(super) fn python_client() -> anyhow::Result<PathBuf> {
    static BUILT: Mutex<Option<PathBuf>> = Mutex::new(None);
    let mut built = BUILT.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(python) = built.as_ref() {
        return Ok(python.clone());
    }
    let python = with_module("venv-pcc", &[])?;
    *built = Some(python.clone());
    Ok(python)
}

/// A Python in `target/` with these packages and the module as it is now.
pub(super) fn with_module(folder: &str, packages: &[&str]) -> anyhow::Result<PathBuf> {
    let of_module = ["maturin>=1.9,<2", "numpy>=1.26"];
    let python = environment(folder, "what the module needs", |pip| {
        pip.args(of_module).args(packages);
    })?;
    run(Command::new(&python)
        .args(["-m", "pip", "install", "--quiet"])
        .args(["--no-build-isolation", "--no-deps", "--force-reinstall"])
        .arg("clients/python")
        .env("PATH", with_folder_of(&python)?))?;
    Ok(python)
}

/// Where programs are looked for, first beside this one: pip calls maturin.
fn with_folder_of(python: &Path) -> anyhow::Result<OsString> {
    let before = env::var_os("PATH").unwrap_or_default();
    let folder = python.parent().map(Path::to_owned);
    Ok(env::join_paths(
        folder.into_iter().chain(env::split_paths(&before)),
    )?)
}

/// A file of this suite.
pub(super) fn beside(name: &str) -> PathBuf {
    let folder = repository().join("tests/acceptance/src/join");
    folder.join(name)
}

fn by_path(robot_file: &Path) -> anyhow::Result<String> {
    Ok(robot_file.display().to_string())
}

fn c_example(name: &str, ending: &str) -> PathBuf {
    let folder = repository().join("clients/c/examples");
    folder.join(name).with_extension(ending)
}

/// A program in C or C++, compiled with every warning an error.
fn compiled(source: &Path, compiler: &[&str; 2]) -> anyhow::Result<Program> {
    run(Command::new("cargo").args([
        "build",
        "--release",
        "--locked",
        "--quiet",
        "-p",
        "pcc-client-c",
    ]))?;
    let include = repository().join("clients/c/include");
    let release = release()?;
    let name = source.file_name().unwrap_or_default().to_string_lossy();
    let program = release.join(name.replace('.', "-"));
    let [compiler, standard] = compiler;
    run(Command::new(compiler)
        .args([*standard, "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-I"])
        .arg(include)
        .arg(source)
        .arg("-L")
        .arg(&release)
        .arg("-lpcc_client")
        .arg(format!("-Wl,-rpath,{}", release.display()))
        .arg("-o")
        .arg(&program))?;
    Ok(built(program))
}

fn built(path: PathBuf) -> Program {
    Program {
        path,
        arguments: Vec::new(),
    }
}

/// The folder of this program, into which cargo builds.
fn release() -> anyhow::Result<PathBuf> {
    let program = env::current_exe()?;
    Ok(program.parent().map(Path::to_owned).unwrap_or_default())
}

fn run(command: &mut Command) -> anyhow::Result<()> {
    let done = command.current_dir(repository()).output()?;
    ensure!(
        done.status.success(),
        "{command:?}: {}",
        String::from_utf8_lossy(&done.stderr)
    );
    Ok(())
}
