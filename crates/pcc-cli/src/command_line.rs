//! The command line: read as a whole, with errors of a few lines.

use clap::builder::StyledStr;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Arg, Command, CommandFactory, Error, FromArgMatches};
use std::any::TypeId;
use std::ffi::{OsStr, OsString};
use std::path::PathBuf;

/// Characters of a value that a message shows.
const SHOWN: usize = 60;

/// Reads the arguments of this process, or ends the process with a message that states the allowed ones.
pub(crate) fn read<P: CommandFactory + FromArgMatches>() -> P {
    let given: Vec<OsString> = std::env::args_os().collect();
    read_from(&given).unwrap_or_else(|error| error.exit())
}

fn read_from<P: CommandFactory + FromArgMatches>(given: &[OsString]) -> Result<P, Error> {
    let mut command = with_hyphens(P::command());
    let matches = command.try_get_matches_from_mut(given);
    let read = matches.and_then(|matches| {
        P::from_arg_matches(&matches).map_err(|error| error.format(&mut command))
    });
    read.map_err(|error| explained(error, &command, given))
}

/// Lets every option take a value that begins with a hyphen, but for paths: the value is then refused as what it is, and not as
/// an option that nobody meant.
pub(crate) fn with_hyphens(command: Command) -> Command {
    command
        .mut_args(|option| {
            let is_path = option.get_value_parser().type_id() == TypeId::of::<PathBuf>();
            let takes_value = option.get_action().takes_values();
            option.allow_hyphen_values(takes_value && !is_path)
        })
        .mut_subcommands(with_hyphens)
}

/// A value as a message shows it: cut where it is long, escaped where it is no text.
pub(crate) fn shown_value(value: &OsStr) -> String {
    let text = match value.to_str() {
        Some(text) => text.to_owned(),
        None => value.as_encoded_bytes().escape_ascii().to_string(),
    };
    match text.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{}… ({} bytes)", &text[..end], text.len()),
        None => text,
    }
}

/// An error with its values shortened, and with the options and commands that are allowed.
fn explained(mut error: Error, command: &Command, given: &[OsString]) -> Error {
    if error.kind() == ErrorKind::InvalidUtf8 {
        return not_utf8(command, given);
    }
    for kind in [
        ContextKind::InvalidArg,
        ContextKind::InvalidSubcommand,
        ContextKind::InvalidValue,
    ] {
        if let Some(ContextValue::String(value)) = error.get(kind) {
            let value = shown_value(value.as_ref());
            error.insert(kind, ContextValue::String(value));
        }
    }
    let is_unknown = [ErrorKind::UnknownArgument, ErrorKind::InvalidSubcommand];
    if is_unknown.contains(&error.kind()) {
        let tip = StyledStr::from(allowed(named(command, given)));
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip]));
    }
    error
}

/// The innermost command that the arguments name.
fn named<'a>(command: &'a Command, given: &[OsString]) -> &'a Command {
    let find = |command: &'a Command, word: &OsString| command.find_subcommand(word);
    let words = given.iter().skip(1);
    words.fold(command, |command, word| {
        find(command, word).unwrap_or(command)
    })
}

/// The options and commands that a command takes.
fn allowed(command: &Command) -> String {
    let options = command.get_arguments().map(Arg::to_string);
    let commands = command.get_subcommands().map(|c| c.get_name().to_owned());
    let all: Vec<String> = options.chain(commands).collect();
    format!("{} are allowed", all.join(", "))
}

fn not_utf8(command: &Command, given: &[OsString]) -> Error {
    let at = given.iter().position(|word| word.to_str().is_none());
    let (before, word) = given.split_at(at.unwrap_or(given.len()));
    let option = before.iter().rev().find(|word| {
        let bytes = word.as_encoded_bytes();
        bytes.starts_with(b"--")
    });
    let option = option.map_or_else(String::new, |option| format!(" for '{}'", option.display()));
    let word = word
        .first()
        .map(|word| shown_value(word))
        .unwrap_or_default();
    let message = format!("invalid value '{word}'{option}: only text in UTF-8 is allowed");
    Error::raw(ErrorKind::InvalidUtf8, message).format(&mut named(command, given).clone())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Arguments;
    use std::os::unix::ffi::OsStringExt;

    fn said(words: &[&str]) -> String {
        let words: Vec<OsString> = words.iter().map(OsString::from).collect();
        said_of(&words)
    }

    fn said_of(words: &[OsString]) -> String {
        let given: Vec<OsString> = std::iter::once("pcc".into())
            .chain(words.iter().cloned())
            .collect();
        let Err(error) = read_from::<Arguments>(&given) else {
            panic!("{words:?} were taken");
        };
        error.to_string()
    }

    #[test]
    fn a_long_value_is_told_shortly() {
        let long = "9".repeat(100_000);
        for words in [
            ["watch", "--times", &long],
            ["plan", "--sampler", &long],
            ["watch", &long, "surplus"],
        ] {
            let text = said(&words);
            assert!(text.len() < 1000 && text.contains("999… ("), "{text}");
        }
    }

    #[test]
    fn a_value_that_begins_with_a_hyphen_is_refused_as_the_value_that_it_is() {
        for value in ["-inf", "- 1", "-1e308"] {
            let text = said(&["watch", "--rate-hz", value]);
            assert!(text.contains(value) && text.contains("--rate-hz"), "{text}");
            let text = said(&["plan", "--sampler", value]);
            assert!(
                text.contains(value) && text.contains("rrt-connect"),
                "{text}"
            );
        }
    }

    #[test]
    fn bytes_that_are_no_text_are_told_with_their_option() {
        let bytes = OsString::from_vec(b"1\xff".to_vec());
        for option in ["--times", "--rate-hz"] {
            let text = said_of(&["watch".into(), option.into(), bytes.clone()]);
            assert!(text.contains("1\\xff") && text.contains(option), "{text}");
        }
        let text = said_of(&["scene".into(), "leave".into(), bytes]);
        assert!(text.contains("1\\xff") && text.contains("UTF-8"), "{text}");
    }

    #[test]
    fn who_names_an_unknown_option_is_told_the_known_ones() {
        let text = said(&["watch", "--rate"]);
        assert!(
            text.contains("--rate-hz") && text.contains("allowed"),
            "{text}"
        );
        let text = said(&["watches"]);
        assert!(text.contains("watch") && text.contains("allowed"), "{text}");
    }
}
