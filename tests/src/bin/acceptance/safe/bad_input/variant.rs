//! One damaged file or option: how it is tried, what must come of it, and whether it did.

use std::fs;
use std::path::Path;

use tests::trial::{Ending, Outcome, Start};

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
    /// The value as it was written.
    pub(super) value: String,
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

    /// An option of a command line, which stands for file and key.
    pub(super) fn option(option: &str, value: &str) -> Self {
        Self::key("", option, value)
    }

    /// Another name by which the key may be told.
    pub(super) fn or_key(mut self, key: &str) -> Self {
        self.keys.push(key.to_owned());
        self
    }

    /// What of this the text does not say.
    fn missing(&self, text: &str) -> Vec<&'static str> {
        let mut missing = Vec::new();
        if !text.contains(&self.file) {
            missing.push("the file");
        }
        if !self.keys.is_empty() && !self.keys.iter().any(|key| text.contains(key.as_str())) {
            missing.push("the key");
        }
        if !says_value(text, &self.value) {
            missing.push("the value");
        }
        let words = if self.is_unreadable {
            UNREADABLE
        } else {
            ALLOWED
        };
        // That something was not expected does not say what is.
        let text = text.replace("unexpected", "");
        if !words.iter().any(|word| text.contains(word)) {
            missing.push("what is allowed");
        }
        missing
    }
}

/// Words of a clause that says what is allowed.
const ALLOWED: &[&str] = &[
    "allowed",
    "expected",
    "needed",
    "needs",
    "must ",
    "at most",
    "at least",
    "missing field",
    "required",
    "possible values",
    "goes with",
    "finite",
    "ends in",
    "end in",
    "only",
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

fn says_value(text: &str, value: &str) -> bool {
    let begin: String = value.chars().take(SHOWN).collect();
    // A message may write a NUL as text does.
    let plain = text.replace("\\u0000", "").replace("\\0", "");
    if text.contains(&begin) || plain.contains(&begin) {
        return true;
    }
    let Ok(number) = value.replace('_', "").parse::<f64>() else {
        return false;
    };
    let is_part = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '+');
    let mut tokens = text.split(|c: char| !is_part(c));
    tokens.any(|token| {
        let token = token.trim_end_matches('.');
        let said = token.parse::<f64>();
        said.is_ok_and(|said| {
            said == number || (said.is_nan() && number.is_nan()) || is_close(said, number)
        })
    })
}

/// Whether a message's rounding explains the difference.
fn is_close(a: f64, b: f64) -> bool {
    a.is_finite() && b.is_finite() && (a - b).abs() <= 1e-5 * b.abs()
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

/// Of the kinds, those that the line counts as panics, hangs and so on.
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
        // The system did not start it: nothing of the program was tried.
        Ending::Exited(126) => return Vec::new(),
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
            ["the value"]
        );
        assert_eq!(
            fault.missing("tube_radius_m = 1e308: wrong"),
            ["the file", "what is allowed"]
        );
    }

    #[test]
    fn a_value_is_known_however_it_is_written() {
        assert!(says_value("rate_hz = NaN is", "nan"));
        assert!(says_value("radius -0.1, allowed", "-1e-1"));
        assert!(!says_value("radius 0.1, allowed", "-1e-1"));
    }
}
