//! The declaration of codes, and the error for an unknown number.

/// A code that this version of the protocol does not know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnknownCode {
    /// The field's meaning.
    pub what: &'static str,
    /// The code found.
    pub code: u32,
    /// The codes known, with their texts.
    pub known: &'static [(u32, &'static str)],
}

impl std::fmt::Display for UnknownCode {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{} is no {}; allowed are", self.code, self.what)?;
        let separators = std::iter::once(" ").chain(std::iter::repeat(", "));
        self.known
            .iter()
            .zip(separators)
            .try_for_each(|((code, text), separator)| {
                write!(formatter, "{separator}{code} ({text})")
            })
    }
}

impl std::error::Error for UnknownCode {}

/// All meanings of a code, as data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CodeSet {
    /// The Rust name of the enum.
    pub name: &'static str,
    /// What the code is about.
    pub doc: &'static str,
    /// Its numbers.
    pub values: &'static [CodeValue],
}

/// One meaning of a code, as data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CodeValue {
    /// The number on the wire.
    pub code: u32,
    /// The Rust name of the variant.
    pub name: &'static str,
    /// The text for people.
    pub text: &'static str,
    /// What it means.
    pub doc: &'static str,
}

/// Declares a code: the enum, its numbers on the wire, and its text for people.
macro_rules! codes {
    ($(#[doc = $doc:literal])* $what:literal pub enum $name:ident {
        $( $(#[doc = $variant_doc:literal])* $variant:ident = $code:literal $text:literal, )*
    }) => {
        $(#[doc = $doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u32)]
        pub enum $name { $( $(#[doc = $variant_doc])* $variant = $code, )* }

        impl $name {
            /// All of them, by code.
            pub const ALL: &[Self] = &[$(Self::$variant,)*];

            /// All of them, as data.
            pub const SET: super::declaration::CodeSet = super::declaration::CodeSet {
                name: stringify!($name),
                doc: concat!($($doc, "\n",)*),
                values: &[$(super::declaration::CodeValue {
                    code: $code,
                    name: stringify!($variant),
                    text: $text,
                    doc: concat!($($variant_doc, "\n",)*),
                },)*],
            };

            /// The number on the wire.
            #[must_use]
            pub const fn code(self) -> u32 {
                self as u32
            }

            /// The text for people.
            #[must_use]
            pub const fn text(self) -> &'static str {
                match self { $(Self::$variant => $text,)* }
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                formatter.pad(self.text())
            }
        }

        impl TryFrom<u32> for $name {
            type Error = UnknownCode;

            fn try_from(code: u32) -> Result<Self, UnknownCode> {
                match code {
                    $($code => Ok(Self::$variant),)*
                    _ => Err(UnknownCode { what: $what, code, known: &[$(($code, $text),)*] }),
                }
            }
        }
    };
}
pub(super) use codes;
