//! What the processes refuse to start with, each by name and with a status other than 0.
#![allow(clippy::unwrap_used)]

use tests::starts::{BadStarts, configurations, robot_files, weights};
use tests::world::weights_are_shipped;

fn assert_all_named(starts: &BadStarts, least: usize) {
    assert_eq!(starts.unexpected, Vec::<String>::new());
    assert_eq!(starts.named, starts.tried);
    assert!(starts.tried >= least, "{}", starts.tried);
}

#[test]
fn bad_robot_files() {
    assert_all_named(&robot_files(), 30);
}

#[test]
fn bad_configurations() {
    assert_all_named(&configurations(), 20);
}

#[test]
fn bad_weights() {
    assert_all_named(&weights(), if weights_are_shipped() { 8 } else { 0 });
}
