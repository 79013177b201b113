//! A bridge between a daemon's world and a controller's, to be killed: `message-bridge ROOT PREFIX ROOT PREFIX`. At the word `tear` it
//! leaves off in the middle of writing a trajectory, and says `torn`.
#![allow(clippy::unwrap_used, reason = "a test program fails by panicking")]

use std::env;
use std::io::stdin;

use shared_types::ipc::IpcOptions;
use tests::bridge::Bridge;

fn main() {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let worlds: Vec<IpcOptions> = arguments
        .chunks_exact(2)
        .map(|world| IpcOptions {
            root: world[0].clone().into(),
            prefix: world[1].clone(),
        })
        .collect();
    let [daemon, controller] = &worlds[..] else {
        panic!("usage: message-bridge ROOT PREFIX ROOT PREFIX");
    };
    let bridge = Bridge::start(daemon, controller);
    for line in stdin().lines() {
        if line.unwrap() == "tear" {
            bridge.tear();
            println!("torn");
        }
    }
}
