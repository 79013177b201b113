//! How many lines of its own each example has.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Context;

/// The columns of a line; what is wider counts as several lines.
pub(super) const COLUMNS: usize = 150;

/// An example's lines.
pub(super) struct Counted {
    /// The name of its file.
    pub(super) name: String,
    /// Of its own, with those of the shared file that it alone uses.
    pub(super) lines: usize,
    /// The names of these parts of the shared file.
    pub(super) from_shared: Vec<String>,
}

/// Counts the lines of each example of a folder, the files with this ending. Parts of the `shared` file that one example alone uses are its own,
/// too; lines that begin as those `of_all` programs are nobody's.
///
/// # Errors
/// Where a file cannot be read.
pub(super) fn count(
    folder: &Path,
    ending: &str,
    shared: Option<&str>,
    of_all: &[&str],
) -> anyhow::Result<Vec<Counted>> {
    let mut texts = texts(folder, ending)?;
    let shared = match shared {
        Some(name) => texts.remove(name).with_context(|| format!("no {name}"))?,
        None => String::new(),
    };
    let parts = parts(&shared);
    let of_one_example = |name: &str, part: &Part| {
        let users: Vec<&String> = texts
            .keys()
            .filter(|it| part.is_used_in(&texts[*it]))
            .collect();
        users == [name] && !part.is_used_by_others(&parts)
    };
    let counted = texts.iter().map(|(name, text)| {
        let own = parts.iter().filter(|part| of_one_example(name, part));
        let own: Vec<&Part> = own.collect();
        let of_parts: usize = own.iter().map(|it| own_lines(it.text, of_all)).sum();
        Counted {
            name: name.clone(),
            lines: own_lines(text, of_all) + of_parts,
            from_shared: own.iter().map(|part| part.name.to_owned()).collect(),
        }
    });
    Ok(counted.collect())
}

/// The texts of a folder's files with an ending, by their names.
fn texts(folder: &Path, ending: &str) -> anyhow::Result<BTreeMap<String, String>> {
    let mut texts = BTreeMap::new();
    for entry in fs::read_dir(folder)? {
        let path: PathBuf = entry?.path();
        if path.extension().is_some_and(|it| it == ending) {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let text = fs::read_to_string(&path).with_context(|| path.display().to_string())?;
            texts.insert(name.into_owned(), text);
        }
    }
    Ok(texts)
}

/// Lines that are neither blank nor begin as those that all programs have.
fn own_lines(text: &str, of_all: &[&str]) -> usize {
    let is_own = |line: &&str| {
        let line = line.trim();
        !line.is_empty() && !of_all.iter().any(|begin| line.starts_with(begin))
    };
    let lines = text.lines().filter(is_own);
    lines
        .map(|line| line.chars().count().div_ceil(COLUMNS))
        .sum()
}

/// A function or class of a file of Python.
struct Part<'a> {
    name: &'a str,
    text: &'a str,
}

impl Part<'_> {
    fn is_used_in(&self, text: &str) -> bool {
        let mut words = text.split(|c: char| !c.is_alphanumeric() && c != '_');
        words.any(|word| word == self.name)
    }

    /// Whether another part of its file uses it.
    fn is_used_by_others(&self, parts: &[Part]) -> bool {
        let mut others = parts.iter().filter(|part| part.name != self.name);
        others.any(|part| self.is_used_in(part.text))
    }
}

/// The functions and classes of a file of Python, each up to the next line that is not indented.
fn parts(file: &str) -> Vec<Part<'_>> {
    let mut parts = Vec::new();
    let mut begin: Option<usize> = None;
    let mut at = 0;
    let ends = file.split_inclusive('\n').chain(["end"]);
    for line in ends {
        let is_top = line.starts_with(|c: char| !c.is_whitespace());
        if is_top && let Some(from) = begin.take() {
            parts.extend(part(&file[from..at.min(file.len())]));
        }
        if line.starts_with("def ") || line.starts_with("class ") {
            begin = Some(at);
        }
        at += line.len();
    }
    parts
}

fn part(text: &str) -> Option<Part<'_>> {
    let (_, rest) = text.split_once(' ')?;
    let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_')?;
    Some(Part {
        name: &rest[..end],
        text,
    })
}

#[cfg(test)]
mod unit {
    use super::*;

    const SHARED: &str = "import os\n\n\ndef one(a):\n    return a\n\n\nclass Two:\n    x = one\n\n\ndef three():\n    pass\n";

    #[test]
    fn parts_end_where_the_next_one_begins_and_know_who_uses_them() {
        let parts = parts(SHARED);
        let names: Vec<&str> = parts.iter().map(|part| part.name).collect();
        assert_eq!(names, ["one", "Two", "three"]);
        assert!(parts[0].is_used_by_others(&parts) && !parts[2].is_used_by_others(&parts));
        assert!(parts[2].is_used_in("x = three()") && !parts[2].is_used_in("x = threes()"));
        assert_eq!(own_lines(parts[2].text, &["#"]), 2);
        assert_eq!(own_lines(&"a".repeat(COLUMNS + 1), &[]), 2);
    }
}
