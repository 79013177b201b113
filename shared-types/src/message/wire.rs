//! How a wire message is declared.

/// A message, as data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// The name of its type on the wire, with the protocol's version.
    pub type_name: &'static str,
    /// What it is.
    pub doc: &'static str,
    /// Its size.
    pub bytes: usize,
    /// The multiple of its address.
    pub alignment: usize,
    /// The fields in order; there is no padding.
    pub fields: &'static [Field],
}

/// A field of a message, as data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// Its name.
    pub name: &'static str,
    /// What it is, in which unit.
    pub doc: &'static str,
    /// The number's type, or the name of the message's, of its elements where it is an array.
    pub element: &'static str,
    /// Elements of the array; none where it is none.
    pub count: Option<usize>,
    /// Bytes before it.
    pub offset: usize,
    /// Its size.
    pub bytes: usize,
}

/// What a field of a message can be: a number, a wire message, or an array of these.
pub trait FieldType {
    /// All bits zero.
    const ZEROED: Self;
    /// The type's name, of the elements where it is an array.
    const ELEMENT: &'static str;
    /// Elements of the array; none where it is none.
    const COUNT: Option<usize> = None;
}

macro_rules! number_types {
    ($($number:ty),*) => { $(impl FieldType for $number {
        const ZEROED: Self = 0 as Self;
        const ELEMENT: &'static str = stringify!($number);
    })* };
}
number_types!(u8, u32, u64, i64, f64);

impl<T: FieldType + Copy, const N: usize> FieldType for [T; N] {
    const ZEROED: Self = [T::ZEROED; N];
    const ELEMENT: &'static str = T::ELEMENT;
    const COUNT: Option<usize> = Some(N);
}

/// What a service carries: a message, or a slice of messages.
pub trait Payload {
    /// The message.
    const LAYOUT: Layout;
    /// Whether it is a slice of them.
    const IS_SLICE: bool;
}

/// Declares a wire message: its layout attributes, its type name, its zero, and at compile time that its size is the
/// stated one and the sum of its fields' (so there is no padding).
macro_rules! wire_message {
    (
        $(#[doc = $doc:literal])*
        pub struct $name:ident: $type_name:literal, $bytes:literal bytes { $( $(#[doc = $field_doc:literal])* pub $field:ident: $field_type:ty, )* }
    ) => {
        $(#[doc = $doc])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend, bytemuck::Pod, bytemuck::Zeroable)]
        #[type_name($type_name)]
        pub struct $name { $( $(#[doc = $field_doc])* pub $field: $field_type, )* }

        impl $name {
            /// All fields zero.
            pub const ZEROED: Self = Self { $($field: <$field_type as $crate::message::FieldType>::ZEROED,)* };
        }

        impl $crate::message::Payload for $name {
            const LAYOUT: $crate::message::Layout = $crate::message::Layout {
                type_name: $type_name,
                doc: concat!($($doc, "\n",)*),
                bytes: size_of::<Self>(),
                alignment: align_of::<Self>(),
                fields: &[$($crate::message::Field {
                    name: stringify!($field),
                    doc: concat!($($field_doc, "\n",)*),
                    element: <$field_type as $crate::message::FieldType>::ELEMENT,
                    count: <$field_type as $crate::message::FieldType>::COUNT,
                    offset: std::mem::offset_of!(Self, $field),
                    bytes: size_of::<$field_type>(),
                },)*],
            };
            const IS_SLICE: bool = false;
        }

        impl $crate::message::Payload for [$name] {
            const LAYOUT: $crate::message::Layout = <$name as $crate::message::Payload>::LAYOUT;
            const IS_SLICE: bool = true;
        }

        impl Default for $name {
            fn default() -> Self {
                Self::ZEROED
            }
        }

        impl $crate::message::FieldType for $name {
            const ZEROED: Self = $name::ZEROED;
            const ELEMENT: &'static str = $type_name;
        }

        const _: () = assert!(size_of::<$name>() == $bytes, "the size of this message is part of the protocol");
        const _: () = assert!(size_of::<$name>() == 0 $(+ size_of::<$field_type>())*, "this message has padding");
    };
}
pub(super) use wire_message;
