//! Everything that the robot and the controller publish, kept.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use shared_types::ipc::{
    IpcError, IpcNode, IpcOptions, controller_state_service, cycle_service, cycle_subscriber,
    robot_state_service, subscriber,
};
use shared_types::message::{ControllerState, Cycle, RobotState};

/// What was heard, in order of arrival.
#[derive(Clone, Debug, Default)]
pub struct Heard {
    /// The robot's states, about 1 kHz.
    pub robot: Vec<RobotState>,
    /// The controller's cycles, each once.
    pub cycles: Vec<Cycle>,
    /// The controller's states, about 50 Hz.
    pub controller: Vec<ControllerState>,
}

/// Listens in a thread of its own until dropped.
#[derive(Debug)]
pub struct Listener {
    heard: Arc<Mutex<Heard>>,
    quit: Arc<AtomicBool>,
    thread: Option<JoinHandle<Result<(), IpcError>>>,
}

impl Listener {
    /// Begins to listen; nobody needs to run yet.
    #[must_use]
    pub fn start(options: &IpcOptions) -> Self {
        let (heard, quit) = (Arc::<Mutex<Heard>>::default(), Arc::<AtomicBool>::default());
        let (options, shared, stop) = (options.clone(), Arc::clone(&heard), Arc::clone(&quit));
        let thread = thread::spawn(move || listen(&options, &shared, &stop));
        Self {
            heard,
            quit,
            thread: Some(thread),
        }
    }

    /// Looks at what was heard so far.
    pub fn with<T>(&self, look: impl FnOnce(&Heard) -> T) -> T {
        look(&self.heard.lock().unwrap())
    }

    /// What was heard since the last call of this.
    #[must_use]
    pub fn take(&self) -> Heard {
        std::mem::take(&mut *self.heard.lock().unwrap())
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        self.quit.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn listen(options: &IpcOptions, heard: &Mutex<Heard>, quit: &AtomicBool) -> Result<(), IpcError> {
    let node = IpcNode::create(options, "test-listener")?;
    let robot = subscriber(&node, &robot_state_service(&node)?)?;
    let cycles = cycle_subscriber(&node, &cycle_service(&node)?)?;
    let controller = subscriber(&node, &controller_state_service(&node)?)?;
    while !quit.load(Ordering::Relaxed) {
        let mut heard = heard.lock().unwrap();
        while let Ok(Some(sample)) = robot.receive() {
            heard.robot.push(*sample);
        }
        while let Ok(Some(batch)) = cycles.receive() {
            heard.cycles.extend_from_slice(batch.payload());
        }
        while let Ok(Some(sample)) = controller.receive() {
            heard.controller.push(*sample);
        }
        drop(heard);
        thread::sleep(Duration::from_millis(1));
    }
    Ok(())
}
