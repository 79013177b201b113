//! The wire messages: `repr(C)`, plain numbers and arrays, no padding, one versioned type name each.
//!
//! Each type has `ZEROED`, all fields zero, to start from. None of them is checked: see [`crate::valid`].

mod command;
mod controller_state;
mod heartbeat;
mod plan;
mod robot_state;
mod scene;
mod setpoint;
mod trajectory;

pub use command::{Command, CommandReply};
pub use controller_state::{ControllerState, Cycle};
pub use heartbeat::Heartbeat;
pub use plan::{Ball, CandidateSummary, NONE_SELECTED, PlanReport, PlanRequest};
pub use robot_state::RobotState;
pub use scene::{MovingBall, SceneMessage, SceneStatus};
pub use setpoint::Setpoint;
pub use trajectory::{Knot, TrajectoryMessage};

/// Where a field lies in its message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// Its name.
    pub name: &'static str,
    /// Its type as Rust writes it.
    pub rust_type: &'static str,
    /// Bytes before it.
    pub offset: usize,
    /// Bytes of it.
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
            pub const ZEROED: Self = Self { $($field: <$field_type as $crate::message::Zeroed>::ZEROED,)* };

            /// The fields in order: what another language has to declare.
            pub const FIELDS: &[$crate::message::Field] = &[$($crate::message::Field {
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

        impl $crate::message::Zeroed for $name {
            const ZEROED: Self = $name::ZEROED;
        }

        const _: () = assert!(size_of::<$name>() == $bytes, "the size of this message is part of the protocol");
        const _: () = assert!(size_of::<$name>() == 0 $(+ size_of::<$field_type>())*, "this message has padding");
    };
}
use wire_message;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PROTOCOL_VERSION;
    use iceoryx2::prelude::ZeroCopySend;
    use std::fmt::Write;

    /// The name by which iceoryx2 tells a type from others.
    #[allow(
        unsafe_code,
        reason = "iceoryx2 makes reading a type name unsafe for those who rely on its layout"
    )]
    fn type_name<T: ZeroCopySend>() -> &'static str {
        // SAFETY: only the text is read; nothing is assumed of the layout.
        unsafe { <T as ZeroCopySend>::type_name() }
    }

    /// The layout of all messages as text, one line a field: offset, bytes, name, type. Every type's name must carry the protocol's
    /// version: services of another version cannot be joined then.
    fn layout() -> String {
        let mut text = String::new();
        macro_rules! describe {
            ($($message:ident),*) => { $(
                let name = format!("pcc.v{PROTOCOL_VERSION}.{}", stringify!($message));
                assert_eq!(type_name::<$message>(), name);
                writeln!(text, "{name} {} bytes", size_of::<$message>()).unwrap();
                for Field { name, rust_type, offset, bytes } in $message::FIELDS {
                    writeln!(text, "{offset:>6} {bytes:>6} {name}: {rust_type}").unwrap();
                }
            )* };
        }
        describe!(
            Knot,
            Ball,
            PlanRequest,
            CandidateSummary,
            PlanReport,
            TrajectoryMessage,
            Setpoint,
            RobotState
        );
        describe!(
            ControllerState,
            Cycle,
            MovingBall,
            SceneMessage,
            SceneStatus,
            Heartbeat,
            Command,
            CommandReply
        );
        text
    }

    #[test]
    fn the_layout_is_the_published_one_and_type_names_carry_the_version() {
        let layout = layout();
        assert!(
            layout == include_str!("../../layout.txt"),
            "layout.txt is not what the messages are now:\n{layout}"
        );
    }
}
