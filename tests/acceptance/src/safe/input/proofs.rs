//! Vector instructions that a processor may lack: safe code must not get at them without having looked.
//!
//! A copy of the crate gets a module of safe code that does not look; the compiler must refuse it.

use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, ensure};
use tests::programs::repository;

use super::outcome::text;
use crate::report::Report;

/// Safe code that comes by a level or a unit without detection: each in every spelling that might compile, with what the compiler
/// must say of it: that a value of the level is missing, that its maker is private, or that there is no default.
const ATTEMPTS: [(&str, &[(&str, &str)]); 4] = [
    (
        "sums of AVX-512 without a value of the level",
        &[(
            "use crate::simd::lanes::Lanes; pub fn f(a: &[f32; 16]) { let v = <crate::simd::token::Avx512 as Lanes>::get(a); let _ = v; }",
            "error[E0061]",
        )],
    ),
    (
        "a value of AVX-512",
        &[
            (
                "pub fn f() -> crate::simd::token::Avx512 { crate::simd::token::Avx512 }",
                "error[E0603]",
            ),
            (
                "pub fn f() -> crate::simd::token::Avx512 { crate::simd::token::Avx512(()) }",
                "error[E0603]",
            ),
            (
                "pub fn f() -> crate::simd::token::Avx512 { crate::simd::token::Avx512 {} }",
                "due to private fields",
            ),
            (
                "pub fn f() -> crate::simd::token::Avx512 { Default::default() }",
                "error[E0277]",
            ),
        ],
    ),
    (
        "a value of AVX2",
        &[
            (
                "pub fn f() -> crate::simd::token::Avx2 { crate::simd::token::Avx2 }",
                "error[E0603]",
            ),
            (
                "pub fn f() -> crate::simd::token::Avx2 { crate::simd::token::Avx2(()) }",
                "error[E0603]",
            ),
            (
                "pub fn f() -> crate::simd::token::Avx2 { Default::default() }",
                "error[E0277]",
            ),
        ],
    ),
    (
        "a unit for bf16",
        &[
            (
                "use crate::gemm::Bf16Unit; pub fn f() -> Bf16Unit { Bf16Unit::Avx512 }",
                "error[E0308]",
            ),
            (
                "use crate::gemm::Bf16Unit; pub fn f() -> Bf16Unit { Bf16Unit::Amx }",
                "error[E0308]",
            ),
            (
                "use crate::gemm::{Avx512Bf16, Bf16Unit}; pub fn f() -> Bf16Unit { Bf16Unit::Avx512(Avx512Bf16(())) }",
                "error[E0423]",
            ),
            (
                "use crate::gemm::{AmxBf16, Bf16Unit}; pub fn f() -> Bf16Unit { Bf16Unit::Amx(AmxBf16(())) }",
                "error[E0423]",
            ),
        ],
    ),
];

/// Safe code that is as it should be.
const GOOD: &str = "pub fn f(a: &mut [f32]) { crate::layers::activation::silu(a); }";

pub(super) fn run(report: &mut Report) -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    copy_crate(folder.path())?;
    let library = folder.path().join("crates/denoiser/src/lib.rs");
    let source = fs::read_to_string(&library)?;
    let refusal = |module: &str| -> anyhow::Result<Option<String>> {
        let module = format!(
            "{source}\n#[allow(dead_code, unreachable_pub, missing_docs)]\nmod tried {{ {module} }}\n"
        );
        fs::write(&library, module)?;
        let output = check(folder.path())?;
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        Ok((!output.status.success()).then_some(said))
    };
    let said = refusal(GOOD)?;
    ensure!(
        said.is_none(),
        "the copy of the crate does not compile: {said:?}"
    );
    let mut wrong = Vec::new();
    for (what, spellings) in ATTEMPTS {
        for (spelling, reason) in spellings {
            match refusal(spelling)? {
                None => wrong.push(format!("{what}: {spelling} compiles")),
                Some(said) if !said.contains(reason) => {
                    wrong.push(format!("{what}: {spelling}: not {reason}, but {said}"));
                }
                Some(_) => {}
            }
        }
    }
    let name = "defect 10: safe code that gets at AVX-512, AVX2 or bf16 without having looked for them, or is refused for another reason";
    report.none_of(name, &wrong);
    Ok(())
}

/// The crate and those that it needs, in a workspace of their own.
fn copy_crate(to: &Path) -> anyhow::Result<()> {
    let from = repository();
    let copied = Command::new("cp")
        .args(["-r", text(&from.join("crates")), text(to)])
        .status()?;
    ensure!(copied.success(), "cp");
    fs::copy(from.join("Cargo.lock"), to.join("Cargo.lock"))?;
    let manifest = fs::read_to_string(from.join("Cargo.toml"))?;
    let (head, rest) = manifest.split_once("members = [").context("members")?;
    let (_, tail) = rest.split_once(']').context("members")?;
    let manifest = format!("{head}members = [\"crates/denoiser\"]{tail}");
    fs::write(to.join("Cargo.toml"), manifest)?;
    Ok(())
}

fn check(folder: &Path) -> anyhow::Result<std::process::Output> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(cargo);
    command.current_dir(folder).env_remove("RUSTC_WRAPPER");
    command.args(["check", "--quiet", "--offline", "--lib", "-p", "denoiser"]);
    command.args(["--target-dir", text(&folder.join("target"))]);
    Ok(command.output()?)
}
