//! Clients that give orders as fast as they can, and wait for no reply.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use shared_types::PROTOCOL_VERSION;
use shared_types::codes::CommandKind;
use shared_types::ipc::{IpcNode, IpcOptions, command_client, command_service};
use shared_types::message::Command;

/// Clients at once.
const CLIENTS: u64 = 3;
/// Between two orders of one client.
const EVERY: Duration = Duration::from_micros(20);

/// Their threads, ended when told.
pub(super) struct CommandFlood {
    quit: Arc<AtomicBool>,
    threads: Vec<JoinHandle<u64>>,
}

impl CommandFlood {
    /// Starts them: orders that change nothing, and some that mean nothing.
    pub(super) fn start(options: &IpcOptions) -> Self {
        let quit = Arc::<AtomicBool>::default();
        let threads = (0..CLIENTS).map(|_| {
            let (options, quit) = (options.clone(), Arc::clone(&quit));
            thread::spawn(move || flood(&options, &quit))
        });
        Self {
            threads: threads.collect(),
            quit,
        }
    }

    /// How many were sent.
    pub(super) fn end(self) -> u64 {
        self.quit.store(true, Ordering::Relaxed);
        let sent = self.threads.into_iter().map(JoinHandle::join);
        sent.map(|sent| sent.expect("a flood does not panic")).sum()
    }
}

fn flood(options: &IpcOptions, quit: &AtomicBool) -> u64 {
    let node = IpcNode::create(options, "command-flood").unwrap();
    let client = command_client(&node, &command_service(&node).unwrap()).unwrap();
    let kinds = [
        CommandKind::SetSpeed.code(),
        CommandKind::Resume.code(),
        77,
        CommandKind::ResetFault.code() + 1000,
    ];
    let mut sent = 0;
    for (kind, command_id) in kinds.into_iter().cycle().zip(1..) {
        if quit.load(Ordering::Relaxed) {
            break;
        }
        let command = Command {
            protocol_version: PROTOCOL_VERSION,
            kind,
            speed: 1.0,
            command_id,
            ..Command::ZEROED
        };
        sent += u64::from(client.send_copy(command).is_ok());
        thread::sleep(EVERY);
    }
    sent
}
