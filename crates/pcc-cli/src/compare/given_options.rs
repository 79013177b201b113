//! The options that this command was given, as the commands on the page have them.

use super::arguments::Arguments;
use super::case_sets::file_name;
use super::figure_name::FigureName;
use crate::command_line::with_hyphens;
use crate::sampler::name_of;
use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Args, Command};
use std::ffi::OsString;
use std::path::{Path, PathBuf, absolute};

/// The program as it lies in the repository's folder once it is built.
const PROGRAM: &str = "target/release/pcc compare";
/// Folder of what the commands on the page make.
const OUT: &str = "out";
/// Options that the commands on the page have of their own.
const OWN: [&str; 3] = ["figures", "sets", "out"];

/// The options that were given, but for those that the commands on the page have of their own.
pub(super) struct GivenOptions {
    options: Vec<String>,
    /// Folder of the page.
    out: PathBuf,
}

impl GivenOptions {
    pub(super) fn of_this_process(out: &Path) -> anyhow::Result<Self> {
        Self::of(std::env::args_os().skip(1), out)
    }

    /// Of a command line that begins with the command's name.
    fn of(words: impl Iterator<Item = OsString>, out: &Path) -> anyhow::Result<Self> {
        let command = with_hyphens(Arguments::augment_args(Command::new("compare")));
        let matches = command.clone().try_get_matches_from(words)?;
        let options = command.get_arguments().filter(|it| {
            let name = it.get_id().as_str();
            let is_given = matches.value_source(name) == Some(ValueSource::CommandLine);
            is_given && !OWN.contains(&name)
        });
        Ok(Self {
            options: options.map(|it| option(it, &matches)).collect(),
            out: out.to_owned(),
        })
    }

    /// The command that makes a figure again.
    pub(super) fn figure_command(&self, figure: FigureName) -> String {
        self.command("--figures", &name_of(&figure))
    }

    /// The command that makes the comparison on a set again.
    pub(super) fn set_command(&self, set: &str) -> String {
        self.command("--sets", set)
    }

    fn command(&self, option: &str, value: &str) -> String {
        let mut words = vec![PROGRAM.to_owned()];
        words.extend(self.options.iter().cloned());
        words.extend([option.to_owned(), quoted(value)]);
        words.extend(["--out".to_owned(), quoted(&self.folder_of(value))]);
        words.join(" ")
    }

    /// Where a command writes: never onto the page that it is under.
    fn folder_of(&self, value: &str) -> String {
        let folder = format!("{OUT}/{}", file_name(value));
        let is_page = absolute(&folder).ok() == absolute(&self.out).ok();
        if is_page { folder + "-again" } else { folder }
    }
}

/// An option as it is written.
fn option(option: &Arg, matches: &ArgMatches) -> String {
    let name = format!("--{}", option.get_long().unwrap_or_default());
    if !option.get_action().takes_values() {
        return name;
    }
    let values = matches.get_raw(option.get_id().as_str());
    let values = values.into_iter().flatten();
    let values: Vec<String> = values.map(|it| it.display().to_string()).collect();
    format!("{name} {}", quoted(&values.join(",")))
}

/// A word as a shell reads it.
fn quoted(word: &str) -> String {
    let is_plain = |it: char| it.is_ascii_alphanumeric() || "_-./,:=+".contains(it);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn given(line: &[&str]) -> GivenOptions {
        let words = ["compare"].iter().chain(line).map(OsString::from);
        GivenOptions::of(words, Path::new("out/steps")).unwrap()
    }

    #[test]
    fn a_command_has_every_option_that_was_given_but_the_folder() {
        let it = given(&[
            "--weights",
            "my weights",
            "--quick",
            "--seed=7",
            "--out",
            "out/steps",
        ]);
        assert_eq!(
            it.figure_command(FigureName::TipLength),
            "target/release/pcc compare --quick --seed 7 --weights 'my weights' --figures tip-length --out out/tip-length"
        );
        let it = given(&["--planners", "fast,apf", "--sets", "x", "--out", "y"]);
        assert_eq!(
            it.set_command("data/it's"),
            r"target/release/pcc compare --planners fast,apf --sets 'data/it'\''s' --out 'out/it'\''s'"
        );
    }

    #[test]
    fn no_command_writes_onto_its_own_page() {
        let command = given(&["--out", "out/steps"]).figure_command(FigureName::Steps);
        assert!(command.ends_with("--out out/steps-again"), "{command}");
    }
}
