//! Types of the values of an array.

/// A number that an array may hold; a truth value is one, too.
pub trait Number: Copy {
    /// The type as a header names it: byte order, kind and number of bytes, such as `<f4`.
    const DESCR: &'static str;
    /// As many bytes as a number has.
    type Bytes: AsRef<[u8]>;

    /// The number that these bytes are; none where they are too few, too many, or no number of this type.
    fn from_bytes(bytes: &[u8]) -> Option<Self>;

    /// The bytes of the number, the lowest first.
    fn to_bytes(self) -> Self::Bytes;
}

macro_rules! numbers {
    ($($number:ty: $descr:literal,)*) => {$(
        impl Number for $number {
            const DESCR: &'static str = $descr;
            type Bytes = [u8; size_of::<$number>()];

            fn from_bytes(bytes: &[u8]) -> Option<Self> {
                bytes.try_into().ok().map(Self::from_le_bytes)
            }

            fn to_bytes(self) -> Self::Bytes {
                self.to_le_bytes()
            }
        }
    )*};
}

numbers! {
    f32: "<f4",
    f64: "<f8",
    i8: "|i1",
    i16: "<i2",
    i32: "<i4",
    i64: "<i8",
    u8: "|u1",
    u32: "<u4",
    u64: "<u8",
}

impl Number for bool {
    const DESCR: &'static str = "|b1";
    type Bytes = [u8; 1];

    fn from_bytes(bytes: &[u8]) -> Option<Self> {
        match bytes {
            [0] => Some(false),
            [1] => Some(true),
            _ => None,
        }
    }

    fn to_bytes(self) -> Self::Bytes {
        [u8::from(self)]
    }
}

/// The bytes of one value of a type; none where it is no type of values that are all of one size, or not NumPy's name of one.
pub(crate) fn bytes_of(descr: &str) -> Option<u64> {
    let mut characters = descr.chars();
    let (order, kind) = (characters.next()?, characters.next()?);
    let digits = characters.as_str();
    let is_count = !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit());
    let size: u64 = digits.parse().ok().filter(|_| is_count)?;
    let (is_known, has_order) = match kind {
        'b' => (size == 1, false),
        'i' | 'u' => (matches!(size, 1 | 2 | 4 | 8), size > 1),
        'f' => (matches!(size, 2 | 4 | 8 | 16), true),
        'c' => (matches!(size, 8 | 16 | 32), true),
        'U' => (size > 0, true),
        'S' | 'V' => (size > 0, false),
        _ => (false, false),
    };
    let is_ordered = matches!(order, '<' | '>') || (order == '|' && !has_order);
    // Text has four bytes a character.
    let width = if kind == 'U' { 4 } else { 1 };
    size.checked_mul(width).filter(|_| is_known && is_ordered)
}
