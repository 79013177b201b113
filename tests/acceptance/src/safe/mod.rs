//! Everything that could hurt or mislead, tried from outside on live processes.

mod bad_input;
mod controller;
mod half_made;
mod input;
pub(crate) mod kills;
pub(crate) mod on_path;
mod pending_stops;
mod pressure;
mod relay;
mod scene;
mod stops;
mod unsupervised;
mod users;

use crate::report::Report;
use crate::scale::Scale;

/// The suite's groups, in this order.
pub(crate) const GROUPS: &[fn(&mut Report, Scale)] = &[
    stops::run,
    controller::run,
    relay::run,
    pending_stops::run,
    scene::run,
    unsupervised::run,
    users::run,
    half_made::run,
    input::run,
    bad_input::run,
    pressure::run,
    kills::run,
];
