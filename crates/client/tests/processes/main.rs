//! The client against other processes, which may be killed at any time.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot set up its world has to stop"
)]

mod plan;
mod support;
mod views;

use std::thread;
use std::time::Duration;

use client::Client;
use shared_types::ipc::{IpcOptions, Role, RoleLock};
use support::{LONG, seed};

#[test]
#[ignore = "the other process of these tests, not a test"]
fn daemon_process() {
    support::serve();
}

#[test]
#[ignore = "the other process of these tests, not a test"]
fn client_process() {
    let mut client = Client::connect(&IpcOptions::from_env()).unwrap();
    client.wait_for_daemon(LONG).unwrap();
    let _pending = client.submit(&plan::request(seed::HANG)).unwrap();
    // The test looks whether this role is taken by trying to take it, so it may take a few attempts.
    let _role = loop {
        match RoleLock::acquire(&IpcOptions::from_env(), Role::Robot) {
            Ok(role) => break role,
            Err(_) => thread::sleep(Duration::from_micros(100)),
        }
    };
    thread::sleep(LONG);
}

#[test]
#[ignore = "the other process of these tests, not a test"]
fn controller_process() {
    support::publish_setpoints();
}
