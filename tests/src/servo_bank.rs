//! Nine Dynamixel servos on the other end of a pseudo-terminal, protocol 2.0, with the byte times of their line.
//!
//! Written down from the e-manual of ROBOTIS (protocol 2.0, control table of XM430): nothing here comes from the driver or its library. Each servo
//! winds a tendon of the robot: it is taut or slack by the lengths of all nine, and its current is the tension.

mod protocol;
mod servo;

use std::collections::VecDeque;
use std::fs::{self, File, OpenOptions};
use std::io::{ErrorKind, Read, Write};
use std::os::fd::OwnedFd;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{JoinHandle, sleep};
use std::time::{Duration, Instant};

use realtime::{reduce_wakeup_latency, use_fifo_priority};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{OFlags, fcntl_setfl};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use tempfile::TempDir;
use toml::{Table, Value};

use crate::brute_force::Body;
use protocol::{Instruction, Line};
use servo::{Answer, Servo};

/// Servos of a robot.
pub const SERVOS: usize = 9;
/// Their ids.
pub const IDS: [u8; SERVOS] = [1, 2, 3, 4, 5, 6, 7, 8, 9];
/// Priority of the thread that answers, above all processes of a robot.
const PRIORITY: u8 = 90;
/// What a configuration for the servos says that the shipped one does not.
const SETTINGS: [(&str, Value); 4] = [
    // Half of a shared machine's two processors is not enough for more.
    ("rate_hz", Value::Integer(250)),
    // Two over the motors' frequency, and half a cycle.
    ("lag_ms", Value::Float(15.3)),
    // Bytes on a pseudo-terminal wait for the kernel now and then.
    ("bus_watchdog_ms", Value::Integer(100)),
    ("home_speed_rpm", Value::Float(10.0)),
];
/// Step of the motors' motion.
const STEP: Duration = Duration::from_micros(500);
/// The line's link in the bank's folder.
const LINE: &str = "line";
/// The longest that the bank waits for bytes before it looks whether it has ended or is unplugged.
const LONGEST_WAIT: Duration = Duration::from_millis(20);
/// Bits on the line for each byte.
const BITS_OF_A_BYTE: u32 = 10;

/// What is wrong with the servos and their line.
#[derive(Clone, Debug, Default)]
pub struct Faults {
    /// One in so many status packets is not sent; 0: none.
    pub drop_one_in: u32,
    /// One in so many status packets has a wrong checksum; 0: none.
    pub damage_one_in: u32,
    /// One in so many instruction packets, goals and requests for states, is not heard; 0: none.
    pub unheard_one_in: u32,
    /// One in so many instruction packets comes with a wrong checksum; 0: none.
    pub garbled_one_in: u32,
    /// How much later than they should status packets are sent, while the line goes on.
    pub late: Duration,
    /// The servo that is in error (its hardware error status), counted from 0.
    pub in_error: Option<(usize, u8)>,
    /// The servo whose motor does not turn.
    pub stuck: Option<usize>,
    /// The servo whose tendon has come off.
    pub loose: Option<usize>,
    /// The servo that has no power.
    pub unpowered: Option<usize>,
    /// Whether no servo hears anything, or answers.
    pub silent: bool,
    /// Whether the line's adapter is unplugged: what has it open can neither read nor write any more, and it must be opened anew afterwards.
    pub unplugged: bool,
}

/// The servos, and the motors' part of them.
struct Bank {
    servos: [Servo; SERVOS],
    faults: Faults,
    baud: u32,
    /// Status packets that were sent, by which single ones are dropped or damaged.
    sent: u32,
    /// Instruction packets that came, by which single ones are lost or damaged.
    heard: u32,
    /// Packets, or bursts of them, that were lost, damaged or late.
    spoilt: u32,
}

/// A bank of servos that answers on a pseudo-terminal until it is dropped.
pub struct ServoBank {
    /// Holds the link by which the line is opened, the same however often it is plugged in.
    folder: TempDir,
    bank: Arc<Mutex<Bank>>,
    ended: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

/// The bank's end of a line that is plugged in.
struct Plugged {
    terminal: File,
    // Held open, so that the line outlives a driver that closes it.
    _line: File,
}

impl Plugged {
    /// Plugs the line in, to be opened by this link.
    fn in_at(link: &Path) -> Self {
        let (terminal, device) = open_terminal();
        let _ = fs::remove_file(link);
        symlink(&device, link).unwrap();
        let mut options = OpenOptions::new();
        let line = options.read(true).write(true).open(&device).unwrap();
        Self {
            terminal,
            _line: line,
        }
    }
}

/// Status packets that are sent later.
type Late = VecDeque<(Instant, Vec<u8>)>;

impl ServoBank {
    /// Servos that wind the tendons of a body, on a line of this speed (bit/s) onto spools of this radius (m); each tendon of the straight robot
    /// is slack by so much, m.
    #[must_use]
    pub fn start(body: &Body, spool_radius_m: f64, baud: u32, slack_m: [f64; SERVOS]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join(LINE);
        let plugged = Plugged::in_at(&link);
        let bank = Bank {
            servos: std::array::from_fn(|k| Servo::new(IDS[k], spool_radius_m, slack_m[k])),
            faults: Faults::default(),
            baud,
            sent: 0,
            heard: 0,
            spoilt: 0,
        };
        let bank = Arc::new(Mutex::new(bank));
        let ended = Arc::<AtomicBool>::default();
        let answering = {
            let (bank, ended) = (Arc::clone(&bank), Arc::clone(&ended));
            std::thread::spawn(move || {
                // Servos wait for nobody, and packets take some 50 µs.
                let _ = use_fifo_priority(PRIORITY);
                let _ = reduce_wakeup_latency();
                answer(plugged, &link, &bank, &ended);
            })
        };
        let turning = {
            let (bank, ended, body) = (Arc::clone(&bank), Arc::clone(&ended), body.clone());
            std::thread::spawn(move || {
                let _ = use_fifo_priority(PRIORITY);
                turn(&body, &bank, &ended);
            })
        };
        Self {
            folder,
            bank,
            ended,
            threads: vec![answering, turning],
        }
    }

    /// The settings of [`ServoBank::write_config`] that are not the shipped ones, beside what names robot and line.
    #[must_use]
    pub fn settings() -> String {
        SETTINGS
            .map(|(name, value)| format!("{name} {value}"))
            .join(", ")
    }

    /// Writes a configuration of `dynamixel-robot` for these servos, which count as silent after the shipped time if `silent_ms` is none.
    ///
    /// # Panics
    /// Where the file cannot be written.
    pub fn write_config(&self, file: &Path, robot_file: &Path, silent_ms: Option<i64>) {
        let ids = IDS.map(|id| Value::from(i64::from(id)));
        let device = self.folder.path().join(LINE);
        let mut config = Table::from_iter([
            ("robot".to_owned(), robot_file.to_str().unwrap().into()),
            ("device".to_owned(), device.to_str().unwrap().into()),
            ("servo_ids".to_owned(), ids.to_vec().into()),
            ("directions".to_owned(), vec![Value::from(1); SERVOS].into()),
            ("baud".to_owned(), i64::from(lock(&self.bank).baud).into()),
        ]);
        config.extend(SETTINGS.map(|(name, value)| (name.to_owned(), value)));
        config.extend(silent_ms.map(|silent_ms| ("silent_ms".to_owned(), silent_ms.into())));
        fs::write(file, config.to_string()).unwrap();
    }

    /// Changes what is wrong.
    pub fn set(&self, change: impl FnOnce(&mut Faults)) {
        let mut bank = lock(&self.bank);
        change(&mut bank.faults);
        if let Some(unpowered) = bank.faults.unpowered {
            bank.servos[unpowered].lose_power();
        }
        if let Some((servo, status)) = bank.faults.in_error {
            bank.servos[servo].fail(status);
        }
    }

    /// Packets, or bursts of them, that were lost, damaged or late so far.
    #[must_use]
    pub fn spoilt(&self) -> u32 {
        lock(&self.bank).spoilt
    }

    /// Takes the power of all servos and gives it back.
    pub fn reboot(&self) {
        let mut bank = lock(&self.bank);
        bank.servos.iter_mut().for_each(Servo::lose_power);
    }

    /// Where the motors are, pulses.
    #[must_use]
    pub fn positions(&self) -> [f64; SERVOS] {
        lock(&self.bank).servos.each_ref().map(Servo::position)
    }

    /// Lengths of the tendons between the spools and where they are taut on the straight robot, m.
    #[must_use]
    pub fn lengths_m(&self) -> [f64; SERVOS] {
        lock(&self.bank).servos.each_ref().map(Servo::length_m)
    }
}

impl Drop for ServoBank {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

fn lock(bank: &Mutex<Bank>) -> MutexGuard<'_, Bank> {
    bank.lock().unwrap_or_else(PoisonError::into_inner)
}

fn open_terminal() -> (File, PathBuf) {
    let terminal: OwnedFd = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    grantpt(&terminal).unwrap();
    unlockpt(&terminal).unwrap();
    fcntl_setfl(&terminal, OFlags::RDWR | OFlags::NONBLOCK).unwrap();
    let name = ptsname(&terminal, Vec::new()).unwrap();
    (terminal.into(), PathBuf::from(name.to_str().unwrap()))
}

/// Answers what comes on the line, while it is plugged in.
fn answer(plugged: Plugged, link: &Path, bank: &Mutex<Bank>, ended: &AtomicBool) {
    let (mut plugged, mut line, mut late) = (Some(plugged), Line::default(), Late::new());
    let mut bytes = [0; 256];
    while !ended.load(Ordering::Relaxed) {
        let is_unplugged = lock(bank).faults.unplugged;
        if is_unplugged {
            plugged = None;
            (line, late) = (Line::default(), Late::new());
            sleep(LONGEST_WAIT);
            continue;
        }
        let Plugged { terminal, .. } = plugged.get_or_insert_with(|| Plugged::in_at(link));
        send_what_is_due(terminal, &mut late);
        match terminal.read(&mut bytes) {
            Ok(count) => line.receive(&bytes[..count]),
            Err(error) if error.kind() == ErrorKind::WouldBlock => {
                let due = late.front().map(|(due, _)| *due);
                wait_for_bytes(terminal, due);
            }
            Err(_) => sleep(Duration::from_millis(1)),
        }
        while let Some(packet) = line.next_packet() {
            let length = packet.len();
            let heard = lock(bank).hear(packet);
            if let Some(instruction) = heard {
                carry_out(terminal, bank, &instruction, length, &mut late);
            }
        }
    }
}

fn send_what_is_due(terminal: &mut File, late: &mut Late) {
    while let Some((due, burst)) = late.front() {
        if *due > Instant::now() {
            return;
        }
        // A driver that has closed the line hears nothing.
        let _ = terminal.write_all(burst);
        late.pop_front();
    }
}

/// Waits until bytes come or something is due, for a moment at most.
fn wait_for_bytes(terminal: &File, due: Option<Instant>) {
    let mut files = [PollFd::new(terminal, PollFlags::IN)];
    let left = due.map(|due| due.saturating_duration_since(Instant::now()));
    let moment = left.unwrap_or(LONGEST_WAIT).min(LONGEST_WAIT);
    let moment = Timespec::try_from(moment).expect("a moment is short");
    let _ = poll(&mut files, Some(&moment));
}

/// Has the servos do what they are told, once its bytes have come, and sends their answers together once the last one's bytes have gone.
fn carry_out(
    terminal: &mut File,
    bank: &Mutex<Bank>,
    instruction: &Instruction,
    length: usize,
    late: &mut Late,
) {
    let mut at = Instant::now();
    let later = {
        let bank = lock(bank);
        at += bank.time_of(length);
        bank.faults.late
    };
    sleep(at.saturating_duration_since(Instant::now()));
    let mut burst = Vec::new();
    for index in 0..SERVOS {
        let mut bank = lock(bank);
        if let Some(Answer { packet, delay }) = bank.answer_of(index, instruction) {
            at += delay + bank.time_of(packet.len());
            burst.extend_from_slice(&packet);
        }
    }
    if later > Duration::ZERO {
        lock(bank).spoilt += u32::from(!burst.is_empty());
        late.push_back((at + later, burst));
        return;
    }
    sleep(at.saturating_duration_since(Instant::now()));
    // A driver that has closed the line hears nothing.
    let _ = terminal.write_all(&burst);
}

impl Bank {
    /// Time that bytes take on the line.
    fn time_of(&self, bytes: usize) -> Duration {
        Duration::from_secs(1) * (bytes as u32 * BITS_OF_A_BYTE) / self.baud
    }

    /// The instruction of a packet, as the servos hear it; none where none of them does.
    fn hear(&mut self, mut packet: Vec<u8>) -> Option<Instruction> {
        self.heard = self.heard.wrapping_add(1);
        let is_nth = |one_in: u32| one_in > 0 && self.heard.is_multiple_of(one_in);
        if self.faults.silent || is_nth(self.faults.unheard_one_in) {
            self.spoilt += 1;
            return None;
        }
        if is_nth(self.faults.garbled_one_in)
            && let Some(last) = packet.last_mut()
        {
            *last ^= 0x55;
            self.spoilt += 1;
        }
        Instruction::of(&packet)
    }

    /// What a servo sends: nothing where it has nothing to say or is not heard.
    fn answer_of(&mut self, index: usize, instruction: &Instruction) -> Option<Answer> {
        if self.faults.unpowered == Some(index) {
            return None;
        }
        let mut answer = self.servos[index].obey(instruction)?;
        self.sent = self.sent.wrapping_add(1);
        let is_nth = |one_in: u32| one_in > 0 && self.sent.is_multiple_of(one_in);
        let is_lost = is_nth(self.faults.drop_one_in);
        let is_damaged = is_nth(self.faults.damage_one_in);
        self.spoilt += u32::from(is_lost || is_damaged);
        if is_damaged && let Some(last) = answer.packet.last_mut() {
            *last ^= 0x55;
        }
        (!is_lost).then_some(answer)
    }
}

/// Turns the motors, step by step.
fn turn(body: &Body, bank: &Mutex<Bank>, ended: &AtomicBool) {
    let mut next = Instant::now();
    while !ended.load(Ordering::Relaxed) {
        next += STEP;
        sleep(next.saturating_duration_since(Instant::now()));
        let mut bank = lock(bank);
        let faults = bank.faults.clone();
        let lengths_m = bank.servos.each_ref().map(Servo::length_m);
        // Motors that may pull hard bend the body to the shape that all tendons mean together; weak ones leave it straight. Each tendon is
        // stretched by what that shape leaves over.
        let bends = bank.servos.iter().all(Servo::bends_the_body);
        let shape = body.explain(&lengths_m).configuration;
        let taut_m = if bends {
            body.tendons(&shape)
        } else {
            [0.0; SERVOS]
        };
        for (index, servo) in bank.servos.iter_mut().enumerate() {
            let stretch_m = taut_m[index] - servo.length_m();
            let stretch_m = if faults.loose == Some(index) {
                0.0
            } else {
                stretch_m.max(0.0)
            };
            let turns = faults.stuck != Some(index) && faults.unpowered != Some(index);
            servo.step(STEP.as_secs_f64(), stretch_m, turns);
        }
    }
}
