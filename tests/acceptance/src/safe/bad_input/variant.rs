//! One damaged file or option: how it is tried, what must come of it, and whether it did.

use std::fs;
use std::path::Path;
use std::time::Duration;

use tests::trial::{Ending, Outcome, Start};

/// A program that neither ends nor serves by then hangs.
pub(super) const LIMIT: Duration = Duration::from_secs(30);

/// Writes what is damaged into an empty folder and says what is to be started.
pub(super) type Make = Box<dyn Fn(&Path) -> Start + Send + Sync>;

/// One thing that is tried.
pub(super) struct Variant {
    /// What kind of file or option.
    pub(super) family: &'static str,
    /// What was done to it.
    pub(super) name: String,
    pub(super) make: Make,
    pub(super) expected: Expected,
}

/// What must come of a variant.
#[derive(Clone, Debug)]
pub(super) enum Expected {
    /// Nothing that has a meaning is damaged: it must be taken.
    Taken,
    /// It must be refused, and one of these be told.
    Refused(Vec<Fault>),
    /// Both are right by what is documented; a refusal must name one of these.
    Either(Vec<Fault>),
    /// It must be refused, or change nothing: this file (relative to the folder) then has the content that undamaged input gives.
    RefusedOrSame {
        faults: Vec<Fault>,
        result: &'static str,
        undamaged: std::sync::Arc<Vec<u8>>,
    },
}

impl Expected {
    /// One of these faults must be told; where it need not be refused, it may be taken as well.
    pub(super) fn refused_if(must_be: bool, faults: Vec<Fault>) -> Self {
        if must_be {
            Self::Refused(faults)
        } else {
            Self::Either(faults)
        }
    }

    /// Whether it must be refused, or at least change nothing.
    pub(super) fn is_refusal(&self) -> bool {
        matches!(self, Self::Refused(_) | Self::RefusedOrSame { .. })
    }

    /// The class under which it is counted.
    pub(super) fn class(&self) -> &'static str {
        match self {
            Self::Taken => "must be taken",
            Self::Refused(_) => "must be refused",
            Self::Either(_) => "either",
            Self::RefusedOrSame { .. } => "refused or same result",
        }
    }

    fn faults(&self) -> &[Fault] {
        match self {
            Self::Taken => &[],
            Self::Refused(faults) | Self::Either(faults) => faults,
            Self::RefusedOrSame { faults, .. } => faults,
        }
    }
}

/// What a message must name; what does not apply is empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Fault {
    /// The file's name.
    pub(super) file: String,
    /// Names of the key, one of which must be there.
    pub(super) keys: Vec<String>,
    /// Words that must all be there besides.
    pub(super) besides: Vec<String>,
    /// The value as it was written.
    pub(super) value: String,
    /// Other things that may be told in the value's place.
    pub(super) other_values: Vec<String>,
    /// Whether the file could not be read at all: the system's reason then stands for what is allowed.
    pub(super) is_unreadable: bool,
}

impl Fault {
    /// Something is wrong with a file as a whole.
    pub(super) fn file(file: &str) -> Self {
        Self {
            file: file.to_owned(),
            ..Self::default()
        }
    }

    /// A file cannot be read.
    pub(super) fn unreadable(file: &str) -> Self {
        Self {
            is_unreadable: true,
            ..Self::file(file)
        }
    }

    /// The value of a key of a file.
    pub(super) fn key(file: &str, key: &str, value: &str) -> Self {
        Self {
            file: file.to_owned(),
            keys: vec![key.to_owned()],
            value: value.to_owned(),
            ..Self::default()
        }
    }

    /// The value of a key of a file, of which one of these must be shown; no value where there is none.
    pub(super) fn key_one_of(file: &str, key: &str, values: &[String]) -> Self {
        let mut values = values.iter().cloned();
        Self {
            value: values.next().unwrap_or_default(),
            other_values: values.collect(),
            ..Self::key(file, key, "")
        }
    }

    /// An option of a command line, which stands for file and key.
    pub(super) fn option(option: &str, value: &str) -> Self {
        Self::key("", option, value)
    }

    /// The same with a value that must be shown.
    pub(super) fn with_value(mut self, value: impl Into<String>) -> Self {
        self.value = value.into();
        self
    }

    /// Another name by which the key may be told.
    pub(super) fn or_key(mut self, key: &str) -> Self {
        self.keys.push(key.to_owned());
        self
    }

    /// A word that must be told besides the key.
    pub(super) fn and(mut self, word: &str) -> Self {
        self.besides.push(word.to_owned());
        self
    }

    /// Another thing that may be told in the value's place.
    pub(super) fn or_value(mut self, value: impl Into<String>) -> Self {
        self.other_values.push(value.into());
        self
    }

    fn names_key(&self, text: &str) -> bool {
        let is_of_file = !self.file.is_empty();
        let mut keys = self.keys.iter();
        let mut besides = self.besides.iter();
        (self.keys.is_empty() || keys.any(|key| says_key(text, key, is_of_file)))
            && besides.all(|word| says_text(text, word))
    }

    /// What of this the text does not say.
    fn missing(&self, text: &str) -> Vec<&'static str> {
        let mut missing = Vec::new();
        let file: String = self.file.chars().take(SHOWN_OF_A_PATH).collect();
        if !text.contains(&file) {
            missing.push("the file");
        }
        if !self.names_key(text) {
            missing.push("the key");
        }
        let others = &self.other_values;
        if !says_value(text, &self.value) && !others.iter().any(|value| says_value(text, value)) {
            missing.push("the value");
        }
        let words = if self.is_unreadable {
            UNREADABLE
        } else {
            ALLOWED
        };
        // That something was not expected does not say what is.
        let text = text
            .replace("unexpected", "")
            .replace("not allowed:", "allowed:")
            .replace("not allowed", "");
        if !words.iter().any(|word| text.contains(word)) {
            missing.push("what is allowed");
        }
        missing
    }
}

/// Words of a clause that says what is allowed.
const ALLOWED: &[&str] = &[
    "allowed",
    "expected ",
    "needed",
    "needs ",
    "must be ",
    "must have ",
    "must rise ",
    "must not ",
    "at most ",
    "at least ",
    "missing field",
    "required arguments",
    "values required for ",
    "is required",
    "possible values",
    "goes with",
    "ends in",
    "end in",
    "cannot be used",
];
/// Words by which a file that cannot be read is told.
const UNREADABLE: &[&str] = &[
    "No such file",
    "Is a directory",
    "is a directory",
    "Permission denied",
    "os error",
    "regular file",
    "empty",
    "larger than",
    "too large",
    "at most",
    "symbolic link",
    "Not a directory",
    "stream did not contain valid UTF-8",
    "UTF-8",
    "NUL byte",
    "allowed",
    "needed",
];
/// Of a long value, so many bytes must be shown.
const SHOWN: usize = 12;
/// Of a long path, so many characters must be shown.
const SHOWN_OF_A_PATH: usize = 100;

fn says_value(text: &str, value: &str) -> bool {
    match value.replace('_', "").parse::<f64>() {
        // A number of hundreds of digits may be cut as a text is, and one with underscores be told as it was written.
        Ok(number) => {
            let is_as_written = value.len() > 24 || value.contains('_');
            says_number(text, number) || is_as_written && says_text(text, value)
        }
        Err(_) => says_text(text, value),
    }
}

/// Whether a text is shown: as a word of its own, or, of a long one, its beginning.
fn says_text(text: &str, value: &str) -> bool {
    let begin: String = value.chars().take(SHOWN).collect();
    if begin.is_empty() {
        return true;
    }
    let is_whole = begin.len() == value.len();
    // A message may write a NUL as text does.
    let plain = text.replace("\\u0000", "").replace("\\0", "");
    [text, plain.as_str()]
        .iter()
        .any(|text| words(text, &begin, is_whole).next().is_some())
}

/// What stands before and behind each place where a word stands for itself, or where a longer one begins like it.
fn words<'a>(
    text: &'a str,
    word: &'a str,
    is_whole: bool,
) -> impl Iterator<Item = (&'a str, &'a str)> {
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    let places = text
        .match_indices(word)
        .map(|(at, _)| (&text[..at], &text[at + word.len()..]));
    places.filter(move |(before, after)| {
        let is_begin = !word.starts_with(is_part) || !before.ends_with(is_part);
        let is_end = !word.ends_with(is_part) || !after.starts_with(is_part);
        is_begin && (is_end || !is_whole)
    })
}

/// Whether a key is named, as a word of its own. A key of a file may be a word of any sentence, too (`file`, `robot`): it counts only
/// where it is quoted or something is said of it, and never where it begins a file's name.
fn says_key(text: &str, key: &str, is_of_file: bool) -> bool {
    /// What quotes the word, or lets it stand in a list or at the end of a path of keys.
    const BEFORE: [char; 6] = ['`', '\'', '"', '[', '.', '<'];
    const BEHIND: [&str; 13] = [
        "`", "'", "\"", "]", ">", "=", ":", "[", " =", " [", " is ", " are ", " ha",
    ];
    let is_name = key.contains(['_', '-']);
    key.is_empty()
        || words(text, key, true).any(|(before, after)| {
            let mut behind = after.chars();
            let begins_name =
                behind.next() == Some('.') && behind.next().is_some_and(char::is_alphanumeric);
            let is_marked =
                before.ends_with(BEFORE) || BEHIND.iter().any(|mark| after.starts_with(mark));
            !is_of_file || !begins_name && (is_name || is_marked)
        })
}

/// Whether a number is told, as a whole token outside of what says which are allowed.
fn says_number(text: &str, number: f64) -> bool {
    let is_part = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '+');
    let mut begin = 0;
    let tokens = text.split(|c: char| !is_part(c)).map(|token| {
        let at = token.as_ptr() as usize - text.as_ptr() as usize;
        begin = at + token.len();
        (&text[..at], token, &text[begin..])
    });
    tokens.into_iter().any(|(before, token, after)| {
        let is_said = token
            .trim_end_matches('.')
            .parse::<f64>()
            .is_ok_and(|said| (said.is_nan() && number.is_nan()) || is_close(said, number));
        is_said && !is_bound(before, token, after)
    })
}

/// Whether a number is an end of a range: `0 to 5`, `0..=5`, `at most 5`, `±5`.
fn is_bound(before: &str, token: &str, after: &str) -> bool {
    const BEFORE: [&str; 10] = [
        " to",
        "at most",
        "at least",
        "..=",
        "..",
        "±",
        "above",
        "below",
        "up to",
        "larger than",
    ];
    let before = before.trim_end();
    token.ends_with("..")
        || after.starts_with(" to ")
        || BEFORE.iter().any(|word| before.ends_with(word))
}

/// Whether a message's rounding explains the difference.
fn is_close(a: f64, b: f64) -> bool {
    a == b || a.is_finite() && b.is_finite() && (a - b).abs() <= 1e-5 * b.abs()
}

/// What can be wrong with how a program takes a variant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    Panicked,
    Killed,
    Hung,
    AcceptedSilently,
    RefusedUndamaged,
    Misnamed,
}

/// The kinds, and what the report calls each of them.
impl Kind {
    pub(super) const ALL: [(Self, &'static str); 6] = [
        (Self::Panicked, "panics"),
        (Self::Killed, "ended by a signal or by lack of memory"),
        (Self::Hung, "hangs"),
        (Self::AcceptedSilently, "accepted silently"),
        (Self::RefusedUndamaged, "refused though nothing is wrong"),
        (
            Self::Misnamed,
            "messages that do not name file, key, value and what is allowed",
        ),
    ];
}

/// What is wrong, if something is.
pub(super) fn judge(expected: &Expected, outcome: &Outcome, folder: &Path) -> Vec<(Kind, String)> {
    let text = &outcome.text;
    let panicked = text.contains("panicked at") || outcome.ending == Ending::Exited(101);
    match outcome.ending {
        _ if panicked => return vec![(Kind::Panicked, String::new())],
        Ending::Hung => return vec![(Kind::Hung, String::new())],
        Ending::Killed(signal) => return vec![(Kind::Killed, format!("signal {signal}"))],
        Ending::ServedBadly => return vec![(Kind::Hung, "after SIGTERM".to_owned())],
        _ if text.contains("memory allocation of") => {
            return vec![(Kind::Killed, "out of memory".to_owned())];
        }
        Ending::Served | Ending::Exited(0) => return judge_taken(expected, folder),
        _ if is_not_started(outcome) => return Vec::new(),
        Ending::Exited(_) => {}
    }
    let mut wrong = Vec::new();
    if matches!(expected, Expected::Taken) {
        wrong.push((Kind::RefusedUndamaged, String::new()));
    }
    let missing = expected.faults().iter().map(|fault| fault.missing(text));
    match missing.min_by_key(Vec::len) {
        Some(missing) if !missing.is_empty() => {
            wrong.push((Kind::Misnamed, format!("without {}", missing.join(", "))));
        }
        _ => {}
    }
    wrong
}

/// Whether the system did not start it (an argument too long, a NUL): nothing of the program was tried.
pub(super) fn is_not_started(outcome: &Outcome) -> bool {
    outcome.ending == Ending::Exited(126)
        && outcome.text.starts_with("the system refuses to start it")
}

fn judge_taken(expected: &Expected, folder: &Path) -> Vec<(Kind, String)> {
    let silently = |why: &str| vec![(Kind::AcceptedSilently, why.to_owned())];
    match expected {
        Expected::Taken | Expected::Either(_) => Vec::new(),
        Expected::Refused(_) => silently(""),
        Expected::RefusedOrSame {
            result, undamaged, ..
        } => match fs::read(folder.join(result)) {
            Ok(content) if content == **undamaged => Vec::new(),
            Ok(_) => silently("with another result"),
            Err(_) => silently("without a result"),
        },
    }
}

#[cfg(test)]
mod unit {
    use super::*;

    #[test]
    fn a_message_must_say_all_four() {
        let fault = Fault::key("unit.toml", "tube_radius_m", "1e308");
        let all = "unit.toml: tube_radius_m = 1e308 is not allowed: 0 to 10 m";
        assert!(fault.missing(all).is_empty());
        assert_eq!(
            fault.missing("unit.toml: tube_radius_m is not allowed"),
            ["the value", "what is allowed"]
        );
        assert_eq!(
            fault.missing("tube_radius_m = 1e308: wrong"),
            ["the file", "what is allowed"]
        );
        let count = "error: 3 values required for '--tip <X> <Y> <Z>' but 2 were provided";
        assert!(Fault::option("--tip", "").missing(count).is_empty());
        let needs_none = "error: 2 values for '--tip <X> <Y> <Z>' were provided";
        let missing = Fault::option("--tip", "").missing(needs_none);
        assert_eq!(missing, ["what is allowed"]);
    }

    #[test]
    fn a_key_is_known_as_a_word_that_something_is_said_of() {
        let fault = Fault::key("controller.toml", "robot", "1.5");
        let said = "controller.toml: robot = 1.5 is not allowed: a file is needed";
        assert!(fault.missing(said).is_empty());
        let other = "controller.toml: 1.5 for robot.toml is not allowed, nor for the robot";
        assert_eq!(fault.missing(other), ["the key", "what is allowed"]);
        assert!(!says_key("a.toml: No such file or directory", "file", true));
        assert!(says_key("missing field `file`", "file", true));
        assert!(says_key("balls[0].radius_m is", "radius_m", true));
        assert!(!says_key("it ends without an end", "out", false));
        assert!(says_key("--out is needed", "--out", false));
        let row = Fault::key("a.npz", "paths", "7").and("row");
        let allowed = "a.npz: row 3: `paths` has 7; less is allowed";
        assert!(row.missing(allowed).is_empty());
        let elsewhere = "a.npz: array `paths` has 7; less is allowed";
        assert_eq!(row.missing(elsewhere), ["the key"]);
    }

    #[test]
    fn a_value_is_known_however_it_is_written() {
        assert!(says_value("rate_hz = NaN is", "nan"));
        assert!(says_value("radius -0.1, allowed", "-1e-1"));
        assert!(!says_value("radius 0.1, allowed", "-1e-1"));
        assert!(!says_value("rate_hz is wrong: 0 to 100 is allowed", "0"));
        assert!(!says_value("rate_hz is wrong: 0 to 100 is allowed", "100"));
        assert!(!says_value("the planner, allowed", "plan"));
        assert!(says_value("rate_hz = 0 is not allowed: 1 to 100", "0"));
        assert!(says_value("rate_hz is 1e300; 1 to 100 is allowed", "1e300"));
        let quoted = "invalid value '1_000' for '--seed': a whole number is needed";
        assert!(says_value(quoted, "1_000"));
        assert!(says_value("seed is 1000, allowed", "1_000"));
        assert!(!says_value("1 to 1000 is allowed", "1_000"));
        assert!(!says_value("seed is 11_000, allowed", "1_000"));
        assert!(!says_value("1 and 000 are allowed", "1_000"));
    }
}
