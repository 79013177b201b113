//! A copying transport: a Unix socket, frames of bytes with their length before them, and a serialiser (postcard).

use std::fs;
use std::io::{self, ErrorKind, Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use anyhow::Context;
use serde::{Deserialize, Serialize};
use shared_types::capacity::DOF;
use shared_types::ipc::IpcOptions;
use shared_types::message::{Knot, PlanReport, PlanRequest};

/// Numbers of a knot: time, configuration, velocity, acceleration.
const NUMBERS: usize = 1 + 3 * DOF;
/// Time between two looks for a client.
const LOOK: Duration = Duration::from_millis(1);
/// Bytes of a frame at most.
const LONGEST: u64 = 16_000_000;

/// A request: as many bytes as the wire's.
#[derive(Deserialize, Serialize)]
struct Request {
    words: Vec<u64>,
}

/// An answer as it is serialised.
#[derive(Deserialize, Serialize)]
pub(super) struct Answer {
    /// As many bytes as the report has.
    report: Vec<u64>,
    knots: Vec<[f64; NUMBERS]>,
}

impl Answer {
    pub(super) fn of(knots: &[Knot]) -> Self {
        let numbers = |knot: &Knot| {
            let mut numbers = [knot.time_s; NUMBERS];
            numbers[1..=DOF].copy_from_slice(&knot.configuration_rad);
            numbers[1 + DOF..=2 * DOF].copy_from_slice(&knot.velocity_rad_s);
            numbers[1 + 2 * DOF..].copy_from_slice(&knot.acceleration_rad_s2);
            numbers
        };
        Self {
            report: words_of::<PlanReport>(),
            knots: knots.iter().map(numbers).collect(),
        }
    }

    pub(super) fn knots(&self) -> Vec<Knot> {
        let part = |numbers: &[f64], index: usize| {
            std::array::from_fn(|axis| numbers[1 + index * DOF + axis])
        };
        let knot = |numbers: &[f64; NUMBERS]| Knot {
            time_s: numbers[0],
            configuration_rad: part(numbers, 0),
            velocity_rad_s: part(numbers, 1),
            acceleration_rad_s2: part(numbers, 2),
        };
        self.knots.iter().map(knot).collect()
    }

    /// A frame.
    pub(super) fn to_bytes(&self) -> anyhow::Result<Vec<u8>> {
        framed(self)
    }

    /// Reads a frame.
    pub(super) fn read(stream: &mut impl Read) -> anyhow::Result<Self> {
        read_frame(stream)
    }
}

/// The client's end.
pub(super) struct CopyingClient(UnixStream);

impl CopyingClient {
    pub(super) fn connect(options: &IpcOptions) -> anyhow::Result<Self> {
        let socket = socket(options);
        let stream = UnixStream::connect(&socket);
        Ok(Self(stream.with_context(|| socket.display().to_string())?))
    }

    /// Asks, and reads the whole answer.
    pub(super) fn round_trip(&mut self) -> anyhow::Result<u64> {
        let request = Request {
            words: words_of::<PlanRequest>(),
        };
        self.0.write_all(&framed(&request)?)?;
        let answer = Answer::read(&mut self.0)?;
        let numbers = answer.knots.iter().flatten().map(|number| number.to_bits());
        Ok(numbers.fold(0, u64::wrapping_add))
    }
}

/// Answers one client, if it comes before all is over.
pub(super) fn serve(
    options: &IpcOptions,
    answer: &Answer,
    is_ready: impl FnOnce(),
    is_over: &AtomicBool,
) -> anyhow::Result<()> {
    let socket = socket(options);
    let listener = UnixListener::bind(&socket)?;
    is_ready();
    let accepted = accept(&listener, is_over);
    // Nobody else is to come.
    fs::remove_file(&socket)?;
    let Some(mut stream) = accepted? else {
        return Ok(());
    };
    while read_frame::<Request>(&mut stream).is_ok() {
        stream.write_all(&answer.to_bytes()?)?;
    }
    Ok(())
}

fn accept(listener: &UnixListener, is_over: &AtomicBool) -> io::Result<Option<UnixStream>> {
    listener.set_nonblocking(true)?;
    while !is_over.load(Ordering::Relaxed) {
        match listener.accept() {
            Ok((stream, _)) => return stream.set_nonblocking(false).map(|()| Some(stream)),
            Err(error) if error.kind() == ErrorKind::WouldBlock => thread::sleep(LOOK),
            Err(error) => return Err(error),
        }
    }
    Ok(None)
}

fn socket(options: &IpcOptions) -> PathBuf {
    options.root.join(format!("{}.socket", options.prefix))
}

/// Zeros of the size of a message.
fn words_of<Message>() -> Vec<u64> {
    vec![0; size_of::<Message>() / size_of::<u64>()]
}

fn framed(message: &impl Serialize) -> anyhow::Result<Vec<u8>> {
    let mut frame = postcard::to_extend(message, vec![0; size_of::<u64>()])?;
    let length = frame.len() - size_of::<u64>();
    frame[..size_of::<u64>()].copy_from_slice(&(length as u64).to_le_bytes());
    Ok(frame)
}

fn read_frame<Message: for<'a> Deserialize<'a>>(stream: &mut impl Read) -> anyhow::Result<Message> {
    let mut length = [0; size_of::<u64>()];
    stream.read_exact(&mut length)?;
    let length = u64::from_le_bytes(length);
    anyhow::ensure!(length <= LONGEST, "a frame of {length} bytes");
    let mut bytes = vec![0; length as usize];
    stream.read_exact(&mut bytes)?;
    Ok(postcard::from_bytes(&bytes)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_comes_through_to_the_bit() {
        let knot = |index: usize| Knot {
            time_s: index as f64,
            configuration_rad: [0.1 + index as f64; DOF],
            velocity_rad_s: std::array::from_fn(|axis| axis as f64 - 0.3),
            acceleration_rad_s2: [f64::MIN_POSITIVE; DOF],
        };
        let knots: Vec<Knot> = (0..5).map(knot).collect();
        let bytes = Answer::of(&knots).to_bytes().unwrap();
        let read = Answer::read(&mut bytes.as_slice()).unwrap();
        assert_eq!(read.knots(), knots);
        assert!(Answer::read(&mut &bytes[..bytes.len() - 1]).is_err());
    }
}
