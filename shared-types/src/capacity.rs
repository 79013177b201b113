//! Array sizes of the wire messages: changing one changes the protocol version.

/// A constant of the wire, as data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Constant {
    /// Its name.
    pub name: &'static str,
    /// What it is.
    pub doc: &'static str,
    /// Its value.
    pub value: usize,
}

macro_rules! capacities {
    ($( $(#[doc = $doc:literal])* pub const $name:ident: usize = $value:expr; )*) => {
        $( $(#[doc = $doc])* pub const $name: usize = $value; )*

        /// All of them, as data.
        pub const CAPACITIES: &[Constant] = &[$(Constant {
            name: stringify!($name),
            doc: concat!($($doc, "\n",)*),
            value: $name,
        },)*];
    };
}

capacities! {
    /// Degrees of freedom: two bending components a section, three sections.
    pub const DOF: usize = 6;
    /// Sections of the robot.
    pub const SECTIONS: usize = 3;
    /// Bytes of the name of a robot.
    pub const ROBOT_NAME_BYTES: usize = 64;
    /// Tendons of the robot: three a section.
    pub const TENDONS: usize = 9;
    /// Obstacle balls in one plan request.
    pub const MAX_BALLS: usize = 64;
    /// Obstacle balls in one source's live scene.
    pub const MAX_SCENE_BALLS: usize = 1024;
    /// Bytes of the name of a source of live scenes.
    pub const SOURCE_NAME_BYTES: usize = 32;
    /// Goals of one plan request, and goals ahead of a motion.
    pub const MAX_GOALS: usize = 8;
    /// Candidates in one plan response.
    pub const MAX_CANDIDATES: usize = 64;
    /// Knots of one trajectory.
    pub const MAX_KNOTS: usize = 256;
    /// Bins of the loop's lateness histogram ([`crate::lateness`]).
    pub const HISTOGRAM_BINS: usize = 64;
    /// Stages of planning that a response times ([`crate::codes::Stage`]).
    pub const STAGES: usize = crate::codes::Stage::ALL.len();
    /// Bytes of a [`crate::message::ReasonText`].
    pub const REASON_BYTES: usize = 164;
    /// Plans that the daemon retains, from which a request can go on.
    pub const RECENT_PLANS: usize = 16;
}
