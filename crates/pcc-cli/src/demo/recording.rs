//! The recording of a demonstration: every cycle of the controller's loop, and the scenes.

use crate::output_files::write_whole;
use anyhow::anyhow;
use client::CycleRecorder;
use datasets::ArchiveWriter;
use pcc_model::Robot;
use serde_json::json;
use shared_types::ipc::IpcOptions;
use shared_types::message::{Cycle, MovingBall};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

/// The files that a recorded demonstration writes.
pub(super) const FILES: [&str; 3] = ["recording.npz", "scene.json", "demo.json"];

/// A recording under way, in a thread of its own, since ports stay in the thread that made them.
pub(super) struct Recording {
    cycles: Arc<Mutex<Vec<Cycle>>>,
    stop: Arc<AtomicBool>,
    worker: Option<JoinHandle<anyhow::Result<u64>>>,
    scenes: Vec<(i64, Vec<MovingBall>)>,
}

impl Recording {
    pub(super) fn begin(options: &IpcOptions) -> Self {
        let (cycles, stop) = (
            Arc::new(Mutex::new(Vec::new())),
            Arc::new(AtomicBool::new(false)),
        );
        let (into, until, options) = (Arc::clone(&cycles), Arc::clone(&stop), options.clone());
        let worker = std::thread::spawn(move || record(&options, &into, &until));
        Self {
            cycles,
            stop,
            worker: Some(worker),
            scenes: Vec::new(),
        }
    }

    /// Notes that the scene changed; balls with a velocity move on from where they are then.
    pub(super) fn note_scene(&mut self, stamp_mono_ns: i64, balls: &[MovingBall]) {
        self.scenes.push((stamp_mono_ns, balls.to_vec()));
    }

    /// The cycles evaluated at or after a time.
    pub(super) fn since(&self, stamp_mono_ns: i64) -> anyhow::Result<Vec<Cycle>> {
        let cycles = self
            .cycles
            .lock()
            .map_err(|_| anyhow!("the recorder stopped"))?;
        Ok(cycles[cycles.partition_point(|c| c.stamp_mono_ns < stamp_mono_ns)..].to_vec())
    }

    /// Ends the recording; returns how many cycles were missed.
    pub(super) fn end(&mut self) -> anyhow::Result<u64> {
        self.stop.store(true, Ordering::Relaxed);
        self.worker.take().map_or(Ok(0), |w| {
            w.join().map_err(|_| anyhow!("the recorder panicked"))?
        })
    }

    /// Writes `recording.npz` and `scene.json`.
    pub(super) fn save(&self, folder: &Path, robot: &Robot) -> anyhow::Result<()> {
        let cycles = self.since(i64::MIN)?;
        write_cycles(&folder.join("recording.npz"), &cycles)?;
        let event = |(stamp, shown): &(i64, Vec<MovingBall>)| {
            let balls: Vec<[f64; 4]> = shown
                .iter()
                .map(|b| [b.centre_m[0], b.centre_m[1], b.centre_m[2], b.radius_m])
                .collect();
            let velocities: Vec<[f64; 3]> = shown.iter().map(|b| b.velocity_m_s).collect();
            json!({ "stamp_ns": stamp, "balls": balls, "velocities_m_s": velocities })
        };
        let limits = &robot.tendon_limits;
        let scene = json!({
            "robot": robot.name,
            "limits": { "velocity_m_s": limits.velocity, "acceleration_m_s2": limits.acceleration, "jerk_m_s3": limits.jerk },
            "events": self.scenes.iter().map(event).collect::<Vec<_>>(),
        });
        write_whole(
            &folder.join("scene.json"),
            &serde_json::to_string_pretty(&scene)?,
        )
    }
}

impl Drop for Recording {
    fn drop(&mut self) {
        // A caller that needs the error calls `end` before.
        let _ = self.end();
    }
}

fn record(
    options: &IpcOptions,
    into: &Mutex<Vec<Cycle>>,
    until: &AtomicBool,
) -> anyhow::Result<u64> {
    let mut recorder = CycleRecorder::connect(options)?;
    let mut fresh = Vec::new();
    loop {
        let last = until.load(Ordering::Relaxed);
        recorder.drain(&mut fresh)?;
        into.lock()
            .map_err(|_| anyhow!("the recording was abandoned"))?
            .extend(fresh.drain(..).map(|cycle| cycle.values));
        if last {
            return Ok(recorder.missed());
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// The values of one array in a cycle.
type Values = fn(&Cycle) -> &[f64];

fn write_cycles(file: &Path, cycles: &[Cycle]) -> anyhow::Result<()> {
    let n = cycles.len();
    let mut archive = ArchiveWriter::create(file)?;
    archive.write("stamp_ns", &[n], cycles.iter().map(|c| c.stamp_mono_ns))?;
    let arrays: [(&str, Values); 6] = [
        ("setpoint_m", |c| &c.setpoint_m),
        ("setpoint_velocity_m_s", |c| &c.setpoint_velocity_m_s),
        ("setpoint_acceleration_m_s2", |c| {
            &c.setpoint_acceleration_m_s2
        }),
        ("measured_tendon_m", |c| &c.measured_tendon_m),
        ("commanded_configuration", |c| {
            &c.commanded_configuration_rad
        }),
        ("measured_configuration", |c| &c.measured_configuration_rad),
    ];
    for (name, values) in arrays {
        let width = values(&Cycle::ZEROED).len();
        let values = cycles.iter().flat_map(values).copied();
        archive.write(name, &[n, width], values)?;
    }
    archive.write("state", &[n], cycles.iter().map(|c| c.state))?;
    archive.write(
        "trajectory_id",
        &[n],
        cycles.iter().map(|c| c.trajectory_id),
    )?;
    Ok(archive.finish()?)
}
