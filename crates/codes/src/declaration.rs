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

/// Declares a code: the enum, its numbers on the wire, and its text for people.
macro_rules! codes {
    ($(#[$attribute:meta])* $what:literal pub enum $name:ident {
        $( $(#[$variant_attribute:meta])* $variant:ident = $code:literal $text:literal, )*
    }) => {
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u32)]
        pub enum $name { $( $(#[$variant_attribute])* $variant = $code, )* }

        impl $name {
            /// All of them, by code.
            pub const ALL: &[Self] = &[$(Self::$variant,)*];

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
