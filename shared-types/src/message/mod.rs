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
pub use scene::{MovingBall, SceneMessage};
pub use setpoint::Setpoint;
pub use trajectory::{Knot, TrajectoryMessage};

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
