//! What a file of `pcc record` tells that can be replayed.

use std::path::Path;

use anyhow::{Context, bail};
use bytemuck::Pod;
use input_files::read_bytes;
use mcap::read::{MessageStream, Options};
use shared_types::message::{
    Cycle, GoalStatus, Payload, PlanRecord, RobotDescription, SceneMessage, StandingGoal,
    TrajectoryMessage,
};

use super::completeness::Completeness;
use crate::record::{COUNTS, ENCODING};

/// Most bytes of a record, which is read whole.
const MOST_BYTES: u64 = 1 << 36;

/// What is replayed, or shown, of a record.
#[derive(Default)]
pub(crate) struct Recording {
    pub(crate) robots: Vec<RobotDescription>,
    pub(crate) plans: Vec<PlanRecord>,
    pub(crate) trajectories: Vec<TrajectoryMessage>,
    pub(crate) cycles: Vec<Cycle>,
    pub(crate) scenes: Vec<SceneMessage>,
    pub(crate) goals: Vec<StandingGoal>,
    pub(crate) goal_statuses: Vec<GoalStatus>,
    /// Whether all messages are there that the recorder wrote.
    pub(super) completeness: Completeness,
    /// Why the file ends before its end, if it does.
    pub(crate) cut_off: Option<String>,
}

impl Recording {
    pub(crate) fn read(file: &Path) -> anyhow::Result<Self> {
        let bytes = read_bytes(file, MOST_BYTES)?;
        let messages = MessageStream::new_with_options(&bytes, Options::IgnoreEndMagic.into());
        let messages = messages.with_context(|| format!("{} is no MCAP file", file.display()))?;
        let mut recording = Self::default();
        for message in messages {
            let message = match message {
                Ok(message) => message,
                // What a recorder that was killed had written is whole up to here.
                Err(error) => {
                    recording.cut_off = Some(error.to_string());
                    break;
                }
            };
            let topic = message.channel.topic.as_str();
            if topic == COUNTS {
                let counts = serde_json::from_slice(&message.data);
                let counts = counts.with_context(|| format!("{COUNTS} is not understood"))?;
                recording.completeness.end(&counts);
                continue;
            }
            recording.completeness.read(topic, message.sequence);
            if message.channel.message_encoding != ENCODING {
                continue;
            }
            let of = message
                .channel
                .schema
                .as_ref()
                .map(|schema| schema.name.as_str());
            match (topic, of) {
                ("plan_record", of) => recording.plans.push(read(&message.data, of)?),
                ("robot_description", of) => recording.robots.push(read(&message.data, of)?),
                ("trajectory", of) => recording.trajectories.push(read(&message.data, of)?),
                ("scene", of) => recording.scenes.push(read(&message.data, of)?),
                ("goal", of) => recording.goals.push(read(&message.data, of)?),
                ("goal_status", of) => recording.goal_statuses.push(read(&message.data, of)?),
                ("cycle", of) => recording.cycles.push(read(&message.data, of)?),
                _ => {}
            }
        }
        Ok(recording)
    }
}

/// A message from its bytes.
fn read<T: Pod + Payload>(bytes: &[u8], type_name: Option<&str>) -> anyhow::Result<T> {
    let expected = T::LAYOUT.type_name;
    if type_name != Some(expected) || bytes.len() != size_of::<T>() {
        bail!(
            "the record has {} of {} bytes; this program reads {expected} of {} bytes",
            type_name.unwrap_or("messages without a type"),
            bytes.len(),
            size_of::<T>()
        );
    }
    Ok(bytemuck::pod_read_unaligned(bytes))
}
