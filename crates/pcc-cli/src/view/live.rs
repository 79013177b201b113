//! `pcc view --live`: the page served to this machine, and what the processes tell while they run.

mod hub;
mod server;
mod sources;
mod watcher;

use self::hub::Hub;
use self::server::Server;
use self::watcher::Watcher;
use shared_types::ipc::IpcOptions;
use signal_hook::consts::{SIGINT, SIGTERM};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::Duration;

/// Time between two looks at what is there: pages get 50 frames a second at most.
const ROUND: Duration = Duration::from_millis(20);

/// Serves until it is interrupted.
pub(super) fn serve(port: u16, scene: Option<&Path>) -> anyhow::Result<()> {
    let hub = Arc::<Hub>::default();
    let mut watcher = Watcher::join(&IpcOptions::from_env(), scene)?;
    let server = Server::start(port, Arc::clone(&hub))?;
    let interrupted = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&interrupted))?;
    }
    say!("serving {} until interrupted", server.address());
    while !interrupted.load(Ordering::Relaxed) {
        watcher.tell(&hub)?;
        sleep(ROUND);
    }
    Ok(())
}
