//! One servo: its control table, and a motor that winds a tendon.

use std::f64::consts::TAU;
use std::time::{Duration, Instant};

use super::protocol::{ALL, Instruction, PING, READ, REBOOT, SYNC_READ, SYNC_WRITE, WRITE, status};

/// Bytes of the control table.
const TABLE: usize = 256;
/// What the watchdog's register says once it has stopped the servo.
const TRIPPED: u8 = 0xFF;
/// Registers: address and bytes.
const MODEL_NUMBER: usize = 0;
const RETURN_DELAY_TIME: usize = 9;
const OPERATING_MODE: usize = 11;
const TORQUE_ENABLE: usize = 64;
const HARDWARE_ERROR_STATUS: usize = 70;
const BUS_WATCHDOG: usize = 98;
const GOAL_PWM: usize = 100;
const GOAL_CURRENT: usize = 102;
const GOAL_VELOCITY: usize = 104;
const PROFILE_VELOCITY: usize = 112;
const GOAL_POSITION: usize = 116;
const PRESENT_CURRENT: usize = 126;
const PRESENT_VELOCITY: usize = 128;
const PRESENT_POSITION: usize = 132;
/// First register that is lost with the power.
const RAM: usize = 64;

/// XM430-W350.
const MODEL: u16 = 1020;
const PULSES_OF_A_TURN: f64 = 4096.0;
/// Pulses a second of one unit of velocity: 0.229 turns a minute.
const UNIT_OF_VELOCITY: f64 = 0.229 / 60.0 * PULSES_OF_A_TURN;
/// Natural frequency of the position loop, rad/s; it is critically damped.
const FREQUENCY: f64 = 150.0;
/// Greatest speed and acceleration of the motor, pulses/s and pulses/s².
const FASTEST: f64 = PULSES_OF_A_TURN;
const STRONGEST: f64 = 2e5;
/// Current that holds a tendon that is stretched by a metre, units of 2.69 mA.
const STIFFNESS: f64 = 5e4;

/// Current that is enough to bend the body, units of 2.69 mA.
const BENDING: i16 = 60;
/// Current that is as much as the gear's friction, which alone holds a motor without torque, units of 2.69 mA.
const FRICTION: f64 = 40.0;
/// How fast a tendon that pulls more than current or friction holds is paid out, lengths a second of what is too much.
const YIELDS: f64 = 20.0;

/// A status packet, and the time that the servo waits before it.
pub(super) struct Answer {
    pub(super) packet: Vec<u8>,
    pub(super) delay: Duration,
}

/// A servo and its tendon.
pub(super) struct Servo {
    id: u8,
    table: [u8; TABLE],
    /// Where the motor is, pulses, and its speed, pulses/s.
    position: f64,
    velocity: f64,
    /// Position at which the tendon of the straight robot is just taut.
    taut: f64,
    pulses_of_a_metre: f64,
    /// When the last packet came.
    heard: Instant,
}

impl Servo {
    /// A servo that has just got power, whose tendon is slack by so much, m, at an arbitrary place of its turn.
    pub(super) fn new(id: u8, spool_radius_m: f64, slack_m: f64) -> Self {
        let pulses_of_a_metre = PULSES_OF_A_TURN / (TAU * spool_radius_m);
        let position = f64::from(id) * 321.0;
        let mut servo = Self {
            id,
            table: [0; TABLE],
            position,
            velocity: 0.0,
            taut: position - slack_m * pulses_of_a_metre,
            pulses_of_a_metre,
            heard: Instant::now(),
        };
        servo.table[MODEL_NUMBER..2].copy_from_slice(&MODEL.to_le_bytes());
        servo.table[RETURN_DELAY_TIME] = 250;
        servo.table[OPERATING_MODE] = 3;
        servo.show();
        servo
    }

    /// Whether its motor may pull so hard that the body bends.
    pub(super) fn bends_the_body(&self) -> bool {
        self.i16(GOAL_CURRENT) >= BENDING
    }

    pub(super) fn position(&self) -> f64 {
        self.position
    }

    /// Length of the tendon relative to where it is taut on the straight robot, m: above 0 it is slack there.
    pub(super) fn length_m(&self) -> f64 {
        (self.position - self.taut) / self.pulses_of_a_metre
    }

    /// What power takes with it: the turns, and every register behind [`RAM`].
    pub(super) fn lose_power(&mut self) {
        let turns = (self.position / PULSES_OF_A_TURN).floor() * PULSES_OF_A_TURN;
        self.position -= turns;
        self.taut -= turns;
        self.velocity = 0.0;
        self.table[RAM..].fill(0);
        self.show();
    }

    /// Puts the servo in error: its motor lets go.
    pub(super) fn fail(&mut self, status: u8) {
        self.table[HARDWARE_ERROR_STATUS] = status;
        self.table[TORQUE_ENABLE] = 0;
    }

    /// Does what an instruction says, if it is for this servo; its answer, if it gives one.
    pub(super) fn obey(&mut self, instruction: &Instruction) -> Option<Answer> {
        self.watch();
        self.heard = Instant::now();
        let Instruction {
            id,
            code,
            parameters,
        } = instruction;
        let is_for_it = [self.id, ALL].contains(id);
        let answered = match *code {
            PING if is_for_it => {
                let [low, high] = MODEL.to_le_bytes();
                Ok(vec![low, high, 45])
            }
            READ if is_for_it => self.read(parameters),
            WRITE if is_for_it => self.write(parameters).map(|()| Vec::new()),
            SYNC_READ if parameters.get(4..)?.contains(&self.id) => self.read(parameters),
            SYNC_WRITE => {
                let (head, servos) = parameters.split_at_checked(4)?;
                let length = usize::from(u16::from_le_bytes([head[2], head[3]]));
                let own = servos
                    .chunks_exact(1 + length)
                    .find(|it| it[0] == self.id)?;
                let _ = self.write(&[&head[..2], &own[1..]].concat());
                return None;
            }
            REBOOT if is_for_it => {
                self.lose_power();
                Ok(Vec::new())
            }
            _ => return None,
        };
        let alert = if self.table[HARDWARE_ERROR_STATUS] == 0 {
            0
        } else {
            0x80
        };
        let (error, parameters) = match answered {
            Ok(parameters) => (0, parameters),
            Err(error) => (error, Vec::new()),
        };
        Some(Answer {
            packet: status(self.id, error | alert, &parameters),
            delay: Duration::from_micros(2) * u32::from(self.table[RETURN_DELAY_TIME]),
        })
    }

    /// Address and length; what is there, or the number of the error.
    fn read(&self, parameters: &[u8]) -> Result<Vec<u8>, u8> {
        const LENGTH: u8 = 5;
        let [a, b, c, d, ..] = *parameters else {
            return Err(LENGTH);
        };
        let from = usize::from(u16::from_le_bytes([a, b]));
        let until = from + usize::from(u16::from_le_bytes([c, d]));
        self.table
            .get(from..until)
            .map(<[u8]>::to_vec)
            .ok_or(LENGTH)
    }

    /// Address and bytes.
    fn write(&mut self, parameters: &[u8]) -> Result<(), u8> {
        const LENGTH: u8 = 5;
        const ACCESS: u8 = 7;
        let (address, bytes) = parameters.split_first_chunk().ok_or(LENGTH)?;
        let from = usize::from(u16::from_le_bytes(*address));
        let is_locked = from < RAM && self.table[TORQUE_ENABLE] == 1;
        if is_locked || (PRESENT_CURRENT..RAM + 90).contains(&from) {
            return Err(ACCESS);
        }
        let is_goal = [GOAL_PWM, GOAL_CURRENT, GOAL_VELOCITY, GOAL_POSITION].contains(&from);
        let resets = from == BUS_WATCHDOG && bytes == [0];
        if self.table[BUS_WATCHDOG] == TRIPPED && (is_goal || from == BUS_WATCHDOG && !resets) {
            return Err(ACCESS);
        }
        let place = self.table.get_mut(from..from + bytes.len()).ok_or(LENGTH)?;
        place.copy_from_slice(bytes);
        if self.table[HARDWARE_ERROR_STATUS] != 0 {
            self.table[TORQUE_ENABLE] = 0;
        }
        Ok(())
    }

    /// Stops the servo until its watchdog is written to 0, where no packet came for too long.
    fn watch(&mut self) {
        let units = self.table[BUS_WATCHDOG];
        let longest = Duration::from_millis(20) * u32::from(units);
        if units > 0 && units != TRIPPED && self.heard.elapsed() > longest {
            self.table[BUS_WATCHDOG] = TRIPPED;
        }
    }

    /// Turns the motor for some seconds, with a tendon that is stretched by so much, m.
    pub(super) fn step(&mut self, seconds: f64, stretch_m: f64, turns: bool) {
        let pull = STIFFNESS * stretch_m;
        let most = f64::from(self.i16(GOAL_CURRENT));
        self.watch();
        let is_stopped = self.table[BUS_WATCHDOG] == TRIPPED;
        let holds = self.table[TORQUE_ENABLE] == 1;
        if holds && turns && !is_stopped {
            let goal = f64::from(self.i32(GOAL_POSITION));
            let wanted =
                FREQUENCY * FREQUENCY * (goal - self.position) - 2.0 * FREQUENCY * self.velocity;
            let acceleration = wanted.clamp(-STRONGEST, STRONGEST);
            let profile = self.i32(PROFILE_VELOCITY);
            let fastest = if profile > 0 {
                f64::from(profile) * UNIT_OF_VELOCITY
            } else {
                FASTEST
            };
            let velocity = (self.velocity + acceleration * seconds).clamp(-fastest, fastest);
            // Winding against as much as the current holds stalls, and more turns the motor back.
            let too_much_m = (pull - most).max(0.0) / STIFFNESS;
            self.velocity = if pull < most {
                velocity
            } else {
                velocity.max(0.0) + YIELDS * too_much_m * self.pulses_of_a_metre
            };
        } else if holds || !turns {
            self.velocity = 0.0;
        } else {
            let too_much_m = (pull - FRICTION).max(0.0) / STIFFNESS;
            self.velocity = YIELDS * too_much_m * self.pulses_of_a_metre;
        }
        self.position += self.velocity * seconds;
        let current = if holds { pull.min(most) } else { 0.0 };
        self.table[PRESENT_CURRENT..PRESENT_CURRENT + 2]
            .copy_from_slice(&(-current as i16).to_le_bytes());
        self.show();
    }

    /// Puts position and velocity into the table.
    fn show(&mut self) {
        let velocity = (self.velocity / UNIT_OF_VELOCITY).round() as i32;
        self.table[PRESENT_VELOCITY..PRESENT_VELOCITY + 4].copy_from_slice(&velocity.to_le_bytes());
        let position = self.position.round() as i32;
        self.table[PRESENT_POSITION..PRESENT_POSITION + 4].copy_from_slice(&position.to_le_bytes());
    }

    fn i16(&self, register: usize) -> i16 {
        i16::from_le_bytes([self.table[register], self.table[register + 1]])
    }

    fn i32(&self, register: usize) -> i32 {
        let bytes: [u8; 4] = std::array::from_fn(|k| self.table[register + k]);
        i32::from_le_bytes(bytes)
    }
}
