//! Real-time priorities of threads that ask or watch.

/// Of who looks whether anybody has the processor at all: above everything.
pub const OF_A_SENTRY: u8 = 98;
/// Of who watches: below those of the controller's and the robot's loops, above the daemon and its clients.
pub const OF_A_WATCH: u8 = 60;
/// Of a client: above the daemon's.
pub const OF_A_CLIENT: u8 = 50;
/// Of the daemon's planning.
pub const OF_PLANNING: u8 = 10;
