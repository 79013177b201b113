//! What the processes refuse to start with, each by name and with a status other than 0.
#![allow(clippy::unwrap_used)]

use tests::diffusion_starts::{bad_diffusion_weights, undamaged_start};
use tests::programs::repository;
use tests::starts::{BadStarts, configurations, robot_files, weights};

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
    assert_all_named(&weights(), 8);
}

#[test]
fn bad_diffusion_weights_of_daemon_and_pcc() {
    let folder = repository().join("crates/denoiser/tests/fixtures/unet");
    assert_eq!(undamaged_start(&folder, "unet"), Vec::<String>::new());
    assert_all_named(&bad_diffusion_weights(&folder, "unet"), 10);
}
