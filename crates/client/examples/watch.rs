//! Shows what the controller does for some seconds: `watch SECONDS`.

use std::error::Error;
use std::time::Duration;

use client::ControllerView;
use shared_types::ipc::IpcOptions;

fn main() -> Result<(), Box<dyn Error>> {
    let Some(Ok(seconds)) = std::env::args().nth(1).map(|it| it.parse::<u32>()) else {
        eprintln!("usage: watch SECONDS");
        std::process::exit(2);
    };
    let mut controller = ControllerView::watch(&IpcOptions::from_env())?;
    for _ in 0..10 * seconds {
        if let Some(state) = controller.latest_state()? {
            println!("{}, trajectory {}", state.state, state.values.trajectory_id);
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    Ok(())
}
