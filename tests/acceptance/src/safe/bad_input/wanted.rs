//! What an option of a command takes.

/// What an option takes.
#[derive(Clone, Copy, Debug)]
pub(super) enum Wanted {
    /// Nothing.
    Flag,
    /// A whole number of the range; numbers above the last one are right, and take too long to try.
    Whole([i128; 2], i128),
    /// A number of the first range; one of it outside the second takes too long to try.
    Real([f64; 2], [f64; 2]),
    /// Numbers whose size must not exceed the first; what else a message may call them.
    Reals(f64, &'static [&'static str]),
    /// A centre whose coordinates must not exceed this in size, and a radius of at most as much.
    Ball(f64),
    /// The name of a source of live scenes.
    Source,
    /// One of the names that the help lists, or these.
    Choice(&'static [&'static str]),
    /// The name of something; another one does not exist.
    Name(&'static str),
    /// As `0/1`.
    Shard,
    /// A file that is read.
    ReadFile,
    /// A folder that is read.
    ReadFolder,
    /// A file that is written.
    WriteFile,
    /// A folder that is written to.
    WriteFolder,
}

impl Wanted {
    /// Good values for the option.
    pub(super) fn good(&self, count: usize, choices: &[String]) -> Vec<String> {
        let one = match self {
            Self::Flag => return Vec::new(),
            Self::Whole([least, most], _) => (*least).max(0).min((*most).max(0)).to_string(),
            Self::Real(_, [_, most]) => most.to_string(),
            Self::Reals(..) | Self::Ball(_) => "0.1".to_owned(),
            Self::Source => "nobody".to_owned(),
            Self::Choice(names) => choices
                .first()
                .cloned()
                .or_else(|| names.first().map(|n| (*n).to_owned()))
                .unwrap(),
            Self::Name(name) => (*name).to_owned(),
            Self::Shard => "0/1".to_owned(),
            Self::ReadFile | Self::ReadFolder | Self::WriteFile | Self::WriteFolder => {
                "path".to_owned()
            }
        };
        vec![one; count]
    }

    pub(super) fn is_path(&self) -> bool {
        matches!(
            self,
            Self::ReadFile | Self::ReadFolder | Self::WriteFile | Self::WriteFolder
        )
    }

    /// What else a message may call the value.
    pub(super) fn aliases(&self) -> &'static [&'static str] {
        match self {
            Self::Reals(_, aliases) => aliases,
            Self::Ball(_) => &["ball"],
            _ => &[],
        }
    }

    /// Whether a text is a right value at a place among the option's; nothing where it is not tried.
    pub(super) fn opinion(&self, text: &str, place: usize, choices: &[String]) -> Option<bool> {
        Some(match self {
            Self::Whole([least, most], _) => {
                let number = text.parse::<i128>();
                number.is_ok_and(|number| (*least..=*most).contains(&number))
            }
            Self::Real([least, most], _) => text
                .parse::<f64>()
                .is_ok_and(|v| (*least..=*most).contains(&v)),
            Self::Reals(most, _) => text.parse::<f64>().is_ok_and(|v| v.abs() <= *most),
            Self::Ball(most) => {
                let least = if place == 3 { 0.0 } else { -most };
                let number = text.parse::<f64>();
                number.is_ok_and(|v| (least..=*most).contains(&v))
            }
            Self::Source => {
                (1..=32).contains(&text.len()) && text.bytes().all(|b| (b' '..=b'~').contains(&b))
            }
            Self::Choice(names) => choices.iter().any(|c| c == text) || names.contains(&text),
            Self::Name(name) => *name == text,
            Self::Shard => false,
            _ => return None,
        })
    }

    /// Whether a right value takes too long to be tried.
    pub(super) fn is_long(&self, text: &str) -> bool {
        match self {
            Self::Whole(_, longest) => text.parse::<i128>().is_ok_and(|number| number > *longest),
            Self::Real(_, [least, most]) => text
                .parse::<f64>()
                .is_ok_and(|number| !(*least..=*most).contains(&number)),
            _ => false,
        }
    }
}
