//! The driver of a robot whose tendons are wound by Dynamixel servos, protocol 2.0 over a serial line; it takes the simulated robot's place.
//!
//! The servos run in current-based position control over many turns: a goal position, and a goal current that is the torque limit. Each
//! cycle writes all goals in one packet and reads a part of the servos, as many as the line carries.
//!
//! A servo counts its turns only while it has power. [`home`] winds the tendons of the straight robot to their pre-tension, notes the positions,
//! and leaves a mark in each servo's memory, which is gone with the power: [`run`] starts only where every servo still bears it.
//!
//! Registers and units are those of the X series (e-manual of ROBOTIS, control tables of XM430 and XH430).

mod bus;
mod config;
mod health;
mod home;
mod registers;
mod service;
mod spools;

pub use bus::BusError;
pub use config::DynamixelConfig;
pub use home::{HomeError, home};
pub use service::{DriverError, run};
