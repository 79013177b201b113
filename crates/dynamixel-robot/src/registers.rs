//! The control table of the X series, and its units.

/// Mode of operation; written while the torque is off.
pub(crate) const OPERATING_MODE: u16 = 11;
/// Greatest current, in units of [`MILLIAMPERES`].
pub(crate) const CURRENT_LIMIT: u16 = 38;
/// Time before a status packet, 2 µs.
pub(crate) const RETURN_DELAY_TIME: u16 = 9;
/// Whether the motor holds: 1 or 0.
pub(crate) const TORQUE_ENABLE: u16 = 64;
/// Why the servo has given up; 0: it has not.
pub(crate) const HARDWARE_ERROR_STATUS: u16 = 70;
/// Time without a packet after which the servo stops, [`WATCHDOG_MS`]; 0: never; [`WATCHDOG_TRIPPED`]: it has stopped, and takes no goal until 0 is
/// written.
pub(crate) const BUS_WATCHDOG: u16 = 98;
/// Current that a position is held with at most.
pub(crate) const GOAL_CURRENT: u16 = 102;
/// Speed on the way to a goal, in units of [`RPM`]; 0: none of its own.
pub(crate) const PROFILE_VELOCITY: u16 = 112;
/// Position to go to, pulses.
pub(crate) const GOAL_POSITION: u16 = 116;
/// Current, velocity and position, as [`STATE_BYTES`] bytes.
pub(crate) const PRESENT_STATE: u16 = 126;
/// Four bytes that nothing reads and that are 0 after power was lost (Indirect Data 1 to 4, which point to themselves then).
pub(crate) const SCRATCH: u16 = 224;

/// Bytes from [`PRESENT_STATE`] on: i16, i32, i32.
pub(crate) const STATE_BYTES: u16 = 10;
/// Current-based position control, over many turns.
pub(crate) const CURRENT_BASED_POSITION: u8 = 5;
/// Pulses of a turn.
pub(crate) const PULSES_OF_A_TURN: f64 = 4096.0;
/// Unit of currents, mA.
pub(crate) const MILLIAMPERES: f64 = 2.69;
/// Unit of velocities, turns a minute.
pub(crate) const RPM: f64 = 0.229;
/// What the watchdog says once it has stopped the servo.
pub(crate) const WATCHDOG_TRIPPED: u8 = 0xFF;
/// Unit of the watchdog, ms.
pub(crate) const WATCHDOG_MS: u32 = 20;
