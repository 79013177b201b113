//! All servos of a robot on their serial line.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use dynamixel2::instructions::SyncWriteData;
use dynamixel2::{Bus, ReadError, StatusPacket, TransferError, WriteError};
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use crate::registers::{GOAL_POSITION, HARDWARE_ERROR_STATUS, PRESENT_STATE, STATE_BYTES};

/// The address of all servos at once.
const BROADCAST: u8 = 0xFE;
/// The instructions that have a servo, or many, read from.
const READ: u8 = 0x02;
const SYNC_READ: u8 = 0x82;
/// Bytes of a status packet beside what was read.
const STATUS_OVERHEAD: u32 = 11;
/// Time that adapter and system add to a read outside the loop, and at least to one within it.
const SLACK_OF_A_READ: Duration = Duration::from_millis(10);
pub(crate) const SLACK_IN_THE_LOOP: Duration = Duration::from_millis(2);
/// Deadline of a read that does not wait: `serial2` waits for its whole milliseconds, and `dynamixel2` does not read behind a deadline.
const LOOK: Duration = Duration::from_micros(500);
/// Bits on the line for each byte.
const BITS_OF_A_BYTE: u32 = 10;

/// Why the servos cannot be talked to.
#[derive(Debug, thiserror::Error)]
pub enum BusError {
    /// The serial line does not open.
    #[error("the serial line {device:?} does not open at {baud} baud: {source}")]
    Open {
        /// The line's device.
        device: PathBuf,
        /// Its speed, bit/s.
        baud: u32,
        /// What the system said.
        source: std::io::Error,
    },
    /// A servo did not answer, or not as it should.
    #[error(
        "servo {id} does not answer ({what}): {source}; is it powered, wired, and set to this id and speed?"
    )]
    Servo {
        /// The servo's id.
        id: u8,
        /// What was asked of it.
        what: &'static str,
        /// What came of it.
        source: TransferError,
    },
    /// A servo that was there does not answer any more.
    #[error("servo {id} has fallen silent")]
    Silent {
        /// The servo's id.
        id: u8,
    },
    /// Nothing can be sent.
    #[error("the serial line takes nothing: {0}")]
    Send(#[from] WriteError),
}

/// What a servo says of itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ServoState {
    /// Present position, pulses.
    pub(crate) position: i32,
    /// Present velocity, in units of 0.229 turns a minute.
    pub(crate) velocity: i32,
    /// Present current, in units of 2.69 mA.
    pub(crate) current: i16,
    /// Whether the servo is in error, as its hardware error status says.
    pub(crate) is_in_error: bool,
}

/// The servos of a robot, in the order of its tendons.
pub(crate) struct ServoBus {
    bus: Bus<Vec<u8>, Vec<u8>>,
    ids: Vec<u8>,
    /// Time that adapter and system may add to a read in the loop.
    slack: Duration,
}

impl ServoBus {
    /// Opens the line; nothing is sent yet.
    pub(crate) fn open(device: &Path, baud: u32, ids: &[u8]) -> Result<Self, BusError> {
        let bus = Bus::open(device, baud).map_err(|source| BusError::Open {
            device: device.to_owned(),
            baud,
            source,
        })?;
        Ok(Self {
            bus,
            ids: ids.to_vec(),
            slack: SLACK_IN_THE_LOOP,
        })
    }

    /// Has reads in the loop wait for as long as a round of this length took, at least.
    pub(crate) fn expect_answers_within(&mut self, took: Duration) {
        self.slack = SLACK_IN_THE_LOOP.max(took);
    }

    pub(crate) fn count(&self) -> usize {
        self.ids.len()
    }

    /// The id of the servo of a tendon, counted from 0.
    pub(crate) fn id(&self, tendon: usize) -> u8 {
        self.ids[tendon]
    }

    /// Looks for every servo.
    pub(crate) fn find_all(&mut self) -> Result<(), BusError> {
        self.each("ping", |bus, id| bus.ping(id).map(|_| ()))
    }

    /// Writes a byte to every servo and has each confirm it.
    pub(crate) fn set_u8(&mut self, register: u16, value: u8) -> Result<(), BusError> {
        self.each("a byte written", |bus, id| {
            bus.write_u8(id, register, value).map(|_| ())
        })
    }

    /// Writes a byte to all servos at once; none confirms it.
    pub(crate) fn set_all_u8(&mut self, register: u16, value: u8) -> Result<(), BusError> {
        let all = self.ids.iter().map(|id| SyncWriteData {
            motor_id: *id,
            data: value,
        });
        Ok(self.bus.sync_write_u8(register, all)?)
    }

    /// Writes two bytes to every servo and has each confirm them.
    pub(crate) fn set_u16(&mut self, register: u16, value: u16) -> Result<(), BusError> {
        self.each("two bytes written", |bus, id| {
            bus.write_u16(id, register, value).map(|_| ())
        })
    }

    /// Writes four bytes to every servo and has each confirm them.
    pub(crate) fn set_u32(&mut self, register: u16, value: u32) -> Result<(), BusError> {
        self.each("four bytes written", |bus, id| {
            bus.write_u32(id, register, value).map(|_| ())
        })
    }

    /// Four bytes of each servo.
    pub(crate) fn read_u32(&mut self, register: u16) -> Result<Vec<u32>, BusError> {
        let mut read = Vec::with_capacity(self.count());
        self.each("four bytes read", |bus, id| {
            read.push(bus.read_u32(id, register)?.data);
            Ok(())
        })?;
        Ok(read)
    }

    /// So many bytes of one servo; none where it does not answer as soon as a round of servos does, nor until this instant: watchdogs must not trip
    /// meanwhile.
    pub(crate) fn try_read<const BYTES: usize>(
        &mut self,
        tendon: usize,
        register: u16,
        until: Option<Instant>,
    ) -> Option<[u8; BYTES]> {
        let id = self.ids[tendon];
        let encode = |packet: &mut [u8]| {
            packet[..2].copy_from_slice(&register.to_le_bytes());
            packet[2..].copy_from_slice(&(BYTES as u16).to_le_bytes());
        };
        self.bus.write_instruction(id, READ, 4, encode).ok()?;
        let on_the_line = self.time_of(14 + STATUS_OVERHEAD + BYTES as u32);
        let answers_by = Instant::now() + on_the_line + self.slack;
        let deadline = until.map_or(answers_by, |it| it.min(answers_by));
        let mut bytes = None;
        hear(&mut self.bus, deadline, |answer| {
            let Some(answer) = answer else {
                return false;
            };
            if answer.packet_id() == id {
                bytes = answer.parameters().try_into().ok();
            }
            answer.packet_id() != id && Instant::now() < deadline
        });
        bytes
    }

    /// Why a servo is in error, by its hardware error status.
    pub(crate) fn hardware_error(&mut self, tendon: usize) -> Result<u8, BusError> {
        let id = self.ids[tendon];
        let status = self.bus.read_u8(id, HARDWARE_ERROR_STATUS);
        let status = status.map(|status| status.data);
        status.map_err(|source| BusError::Servo {
            id,
            what: "its hardware error status",
            source,
        })
    }

    /// Has every servo go to a position, pulses, in one packet that no servo answers.
    pub(crate) fn send_goals(&mut self, positions: &[i32]) -> Result<(), BusError> {
        let goals = self.ids.iter().zip(positions);
        let goals = goals.map(|(id, position)| SyncWriteData {
            motor_id: *id,
            data: position.to_le_bytes(),
        });
        Ok(self.bus.sync_write(GOAL_POSITION, 4, goals)?)
    }

    /// Has every servo go to a position, pulses, one after the other, and each confirm it.
    pub(crate) fn set_goals(&mut self, positions: &[i32]) -> Result<(), BusError> {
        for (&id, position) in self.ids.iter().zip(positions) {
            let written = self.bus.write_u32(id, GOAL_POSITION, *position as u32);
            written.map_err(|source| BusError::Servo {
                id,
                what: "a goal written",
                source,
            })?;
        }
        Ok(())
    }

    /// Asks these tendons' servos for their states; [`Self::receive_states`] takes the answers.
    pub(crate) fn ask_for_states(&mut self, tendons: &[usize]) -> Result<(), BusError> {
        let ids = &self.ids;
        let encode = |packet: &mut [u8]| {
            packet[..2].copy_from_slice(&PRESENT_STATE.to_le_bytes());
            packet[2..4].copy_from_slice(&STATE_BYTES.to_le_bytes());
            for (place, tendon) in packet[4..].iter_mut().zip(tendons) {
                *place = ids[*tendon];
            }
        };
        let parameters = 4 + tendons.len();
        Ok(self
            .bus
            .write_instruction(BROADCAST, SYNC_READ, parameters, encode)?)
    }

    /// The answers of so many servos that come before a deadline, or before this call where that is later, each told with its tendon. A servo
    /// that is silent, or whose answer is damaged, is left out.
    pub(crate) fn receive_states(
        &mut self,
        count: usize,
        deadline: Instant,
        mut told: impl FnMut(usize, ServoState),
    ) {
        if count == 0 {
            return;
        }
        let mut left = count;
        let ids = &self.ids;
        hear(&mut self.bus, deadline, |answer| {
            left -= 1;
            if let Some(answer) = answer {
                let tendon = ids.iter().position(|id| *id == answer.packet_id());
                let state = state_of(answer.parameters(), answer.alert());
                if let Some((tendon, state)) = tendon.zip(state) {
                    told(tendon, state);
                }
            }
            left > 0
        });
    }

    /// The states of all servos, each asked until it answers.
    ///
    /// # Errors
    /// [`BusError::Silent`] where one does not by the deadline.
    pub(crate) fn all_states(&mut self, deadline: Instant) -> Result<Vec<ServoState>, BusError> {
        let mut states = vec![None; self.count()];
        loop {
            let is_missing = |tendon: &usize| states[*tendon].is_none();
            let missing: Vec<usize> = (0..states.len()).filter(is_missing).collect();
            let Some(first) = missing.first() else {
                return Ok(states.into_iter().flatten().collect());
            };
            if Instant::now() >= deadline {
                return Err(BusError::Silent {
                    id: self.id(*first),
                });
            }
            self.ask_for_states(&missing)?;
            let usual = SLACK_OF_A_READ + 2 * self.time_to_read(missing.len());
            let until = deadline.min(Instant::now() + usual);
            self.receive_states(missing.len(), until, |tendon, state| {
                states[tendon] = Some(state);
            });
        }
    }

    /// Time that the line is busy while all goals are written.
    pub(crate) fn time_to_write(&self) -> Duration {
        self.time_of(14 + 5 * self.count() as u32)
    }

    /// Time that the line is busy while the states of so many servos are read.
    pub(crate) fn time_to_read(&self, servos: usize) -> Duration {
        let servos = servos as u32;
        self.time_of(14 + servos + servos * (STATUS_OVERHEAD + u32::from(STATE_BYTES)))
    }

    fn time_of(&self, bytes: u32) -> Duration {
        Duration::from_secs(1) * (bytes * BITS_OF_A_BYTE) / self.bus.baud_rate()
    }

    fn each(
        &mut self,
        what: &'static str,
        mut ask: impl FnMut(&mut Bus<Vec<u8>, Vec<u8>>, u8) -> Result<(), TransferError>,
    ) -> Result<(), BusError> {
        for &id in &self.ids {
            ask(&mut self.bus, id).map_err(|source| BusError::Servo { id, what, source })?;
        }
        Ok(())
    }
}

/// Passes each answer that comes before a deadline, or before this call where that is later, to `wants_more`, none for a damaged one, until that
/// returns false.
fn hear(
    bus: &mut Bus<Vec<u8>, Vec<u8>>,
    deadline: Instant,
    mut wants_more: impl FnMut(Option<StatusPacket<'_>>) -> bool,
) {
    let mut is_last_look = false;
    loop {
        match bus.read_status_response_deadline(Instant::now() + LOOK) {
            Err(ReadError::Io(error)) => {
                let is_over = is_last_look || error.kind() != ErrorKind::TimedOut;
                is_last_look = Instant::now() >= deadline;
                if is_over || !has_bytes_by(bus, deadline) {
                    return;
                }
            }
            answer => {
                if !wants_more(answer.ok()) {
                    return;
                }
            }
        }
    }
}

/// Waits for bytes until a deadline, to the microsecond; whether some are there.
fn has_bytes_by(bus: &Bus<Vec<u8>, Vec<u8>>, deadline: Instant) -> bool {
    let left = deadline.saturating_duration_since(Instant::now());
    let Ok(left) = Timespec::try_from(left) else {
        return false;
    };
    let mut line = [PollFd::new(bus.serial_port(), PollFlags::IN)];
    // A line that hangs up has none.
    poll(&mut line, Some(&left)).is_ok() && line[0].revents() == PollFlags::IN
}

/// The state that these parameters of a status packet are; none where they are of another length.
fn state_of(parameters: &[u8], is_in_error: bool) -> Option<ServoState> {
    let unstuffed = without_stuffing(parameters)?;
    let (current, rest) = unstuffed.split_first_chunk()?;
    let (velocity, rest) = rest.split_first_chunk()?;
    let (position, _) = rest.split_first_chunk()?;
    Some(ServoState {
        current: i16::from_le_bytes(*current),
        velocity: i32::from_le_bytes(*velocity),
        position: i32::from_le_bytes(*position),
        is_in_error,
    })
}

/// Parameters without the bytes that keep a header out of them: `dynamixel2` 0.9 leaves one in where three bytes 0xFF come before 0xFD, as between a
/// velocity of -1 and a position.
fn without_stuffing(parameters: &[u8]) -> Option<[u8; STATE_BYTES as usize]> {
    if let Ok(whole) = parameters.try_into() {
        return Some(whole);
    }
    let mut unstuffed = [0; STATE_BYTES as usize];
    let (mut length, mut is_stuffing) = (0, false);
    for &byte in parameters {
        if is_stuffing && byte == 0xFD {
            is_stuffing = false;
            continue;
        }
        *unstuffed.get_mut(length)? = byte;
        length += 1;
        is_stuffing = unstuffed[..length].ends_with(&[0xFF, 0xFF, 0xFD]);
    }
    (length == unstuffed.len()).then_some(unstuffed)
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::io::{Read, Write};

    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

    use super::*;

    /// The state of servo 1 or 2 at position 0, by the protocol's description, with its checksum.
    const STATES: [[u8; 21]; 2] = [
        [
            0xFF, 0xFF, 0xFD, 0, 1, 14, 0, 0x55, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x9C, 0x70,
        ],
        [
            0xFF, 0xFF, 0xFD, 0, 2, 14, 0, 0x55, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x96, 0x73,
        ],
    ];

    /// A line of two servos, and its other end.
    fn line() -> (ServoBus, File) {
        let terminal = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        grantpt(&terminal).unwrap();
        unlockpt(&terminal).unwrap();
        let device = ptsname(&terminal, Vec::new()).unwrap();
        let bus = ServoBus::open(Path::new(device.to_str().unwrap()), 57_600, &[1, 2]).unwrap();
        (bus, terminal.into())
    }

    fn heard(bus: &mut ServoBus, deadline: Instant) -> Vec<usize> {
        let mut tendons = Vec::new();
        bus.receive_states(2, deadline, |tendon, _| tendons.push(tendon));
        tendons
    }

    #[test]
    fn what_has_come_before_it_is_looked_counts_whatever_the_deadline() {
        let (mut bus, mut servos) = line();
        servos.write_all(STATES.as_flattened()).unwrap();
        let soon = Instant::now() + Duration::from_secs(5);
        assert!(has_bytes_by(&bus.bus, soon));
        assert_eq!(heard(&mut bus, Instant::now()), [0, 1]);
        assert_eq!(heard(&mut bus, Instant::now()), [0; 0]);
    }

    #[test]
    fn an_answer_in_two_pieces_is_waited_for() {
        let (mut bus, mut servos) = line();
        let (first, second) = STATES.as_flattened().split_at(30);
        servos.write_all(first).unwrap();
        std::thread::scope(|scope| {
            scope.spawn(|| {
                std::thread::sleep(Duration::from_millis(3));
                servos.write_all(second).unwrap();
            });
            let deadline = Instant::now() + Duration::from_secs(5);
            assert_eq!(heard(&mut bus, deadline), [0, 1]);
        });
    }

    #[test]
    fn a_late_answer_of_another_servo_is_no_answer_of_the_one_that_is_asked() {
        let (mut bus, mut servos) = line();
        std::thread::scope(|scope| {
            scope.spawn(|| {
                servos.read_exact(&mut [0; 14]).unwrap();
                let [asked, late] = STATES;
                servos.write_all([late, asked].as_flattened()).unwrap();
            });
            let state = bus.try_read::<{ STATE_BYTES as usize }>(0, PRESENT_STATE, None);
            assert_eq!(state, Some([0; STATE_BYTES as usize]));
        });
        assert_eq!(bus.try_read::<1>(0, PRESENT_STATE, None), None);
    }

    #[test]
    fn a_deadline_within_a_millisecond_is_waited_for() {
        let (bus, _servos) = line();
        let deadline = Instant::now() + Duration::from_micros(900);
        assert!(!has_bytes_by(&bus.bus, deadline));
        assert!(Instant::now() >= deadline);
    }

    #[test]
    fn a_velocity_and_a_position_that_look_like_a_header_are_understood() {
        let bytes = [0x25, 0, 0xFF, 0xFF, 0xFF, 0xFF, 0xFD, 0x01, 0, 0];
        let expected = ServoState {
            current: 0x25,
            velocity: -1,
            position: 0x1FD,
            is_in_error: true,
        };
        assert_eq!(state_of(&bytes, true), Some(expected));
        let stuffed = [0x25, 0, 0xFF, 0xFF, 0xFF, 0xFF, 0xFD, 0xFD, 0x01, 0, 0];
        assert_eq!(state_of(&stuffed, true), Some(expected));
        assert_eq!(state_of(&bytes[..9], true), None);
        assert_eq!(state_of(&[0; 11], true), None);
    }
}
