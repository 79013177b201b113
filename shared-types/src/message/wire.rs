//! How a wire message is declared.

/// Where a field lies in its message.
#[cfg(test)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// The field's name.
    pub name: &'static str,
    /// The field's type as Rust writes it.
    pub rust_type: &'static str,
    /// Bytes before the field.
    pub offset: usize,
    /// Bytes of the field.
    pub bytes: usize,
}

/// A type whose zero a constant can name: the numbers, their arrays, and every wire message.
pub trait Zeroed {
    /// All bits zero.
    const ZEROED: Self;
}

macro_rules! zeroed_number {
    ($($number:ty),*) => { $(impl Zeroed for $number { const ZEROED: Self = 0 as Self; })* };
}
zeroed_number!(u8, u32, u64, i64, f64);

impl<T: Zeroed + Copy, const N: usize> Zeroed for [T; N] {
    const ZEROED: Self = [T::ZEROED; N];
}

/// Declares a wire message: its layout attributes, its type name, its zero, and at compile time that its size is the
/// stated one and the sum of its fields' (so there is no padding).
macro_rules! wire_message {
    (
        $(#[$attribute:meta])*
        pub struct $name:ident: $type_name:literal, $bytes:literal bytes { $( $(#[$field_attribute:meta])* pub $field:ident: $field_type:ty, )* }
    ) => {
        $(#[$attribute])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
        #[type_name($type_name)]
        pub struct $name { $( $(#[$field_attribute])* pub $field: $field_type, )* }

        impl $name {
            /// All fields zero.
            pub const ZEROED: Self = Self { $($field: <$field_type as $crate::message::wire::Zeroed>::ZEROED,)* };

            /// The fields in order: what another language has to declare.
            #[cfg(test)]
            pub const FIELDS: &[$crate::message::wire::Field] = &[$($crate::message::wire::Field {
                name: stringify!($field),
                rust_type: stringify!($field_type),
                offset: std::mem::offset_of!(Self, $field),
                bytes: size_of::<$field_type>(),
            },)*];
        }

        impl Default for $name {
            fn default() -> Self {
                Self::ZEROED
            }
        }

        impl $crate::message::wire::Zeroed for $name {
            const ZEROED: Self = $name::ZEROED;
        }

        const _: () = assert!(size_of::<$name>() == $bytes, "the size of this message is part of the protocol");
        const _: () = assert!(size_of::<$name>() == 0 $(+ size_of::<$field_type>())*, "this message has padding");
    };
}
pub(super) use wire_message;
