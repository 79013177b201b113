//! The driver's process: one loop that writes goals and reads states.

use std::time::{Duration, Instant};

use input_files::SettingsError;
use robot_driver::{
    DriverSettings, MotorTargets, ReferenceLimits, RobotConnection, RobotDriver, Shutdown, TENDONS,
    TendonState, TendonVector, longest_cycle_ns, off_configuration_m,
};
use shared_types::codes::MotorFault;
use shared_types::ipc::{IpcError, IpcOptions};
use tracing::{info, warn};

use crate::bus::{BusError, SLACK_IN_THE_LOOP, ServoBus, ServoState};
use crate::config::DynamixelConfig;
use crate::health::{Health, Patience};
use crate::home::Home;
use crate::registers::{
    BUS_WATCHDOG, GOAL_CURRENT, PROFILE_VELOCITY, SCRATCH, TORQUE_ENABLE, WATCHDOG_MS,
    WATCHDOG_TRIPPED,
};
use crate::spools::Spools;

/// Share of a cycle that writing and reading may take.
const SHARE_OF_A_CYCLE: f64 = 0.8;
/// Rounds by which the line is measured, of which one may take longer.
const ROUNDS: usize = 20;
/// Time that the servos have for their first answers.
const FIRST_ANSWERS: Duration = Duration::from_millis(500);

/// Time in which a tendon at its velocity limit goes as far as the servos may jump at the begin, s.
const LARGEST_JUMP_S: f64 = 0.02;

/// Why the robot is not driven.
#[derive(Debug, thiserror::Error)]
pub enum DriverError {
    /// The robot's place cannot be taken, or its services are not available.
    #[error(transparent)]
    Ipc(#[from] IpcError),
    /// The servos do not answer.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// There is no home that counts.
    #[error("{0}; `pcc home` finds it")]
    Home(#[from] SettingsError),
    /// A servo was without power since homing, so that it no longer knows its turns.
    #[error("servo {id} was without power since the robot was homed: `pcc home`")]
    Homeless {
        /// The servo's id.
        id: u8,
    },
    /// The servos stand where no configuration has them.
    #[error(
        "the servos stand {off_mm:.2} mm from the lengths of every configuration, {most_mm:.2} mm are allowed: is each tendon on its servo, and its direction right? `pcc home`"
    )]
    OffConfiguration {
        /// How far, mm.
        off_mm: f64,
        /// What is allowed, mm.
        most_mm: f64,
    },
    /// The line does not carry what a cycle needs.
    #[error(
        "the serial line is too slow: goals and one servo's state take {took:?}, of a cycle of {period:?} at most {share} are allowed; lower rate_hz, \
         raise baud, and see the adapter's latency timer",
        share = SHARE_OF_A_CYCLE
    )]
    TooSlow {
        /// Time that a round takes.
        took: Duration,
        /// Length of a cycle.
        period: Duration,
    },
}

/// The loop and what it works with.
struct Process {
    driver: RobotDriver,
    bus: ServoBus,
    spools: Spools,
    health: Health,
    /// The fault that the log was told, and whether watchdogs had tripped then.
    told: (MotorFault, bool),
    mark: u32,
    /// Servos that were not heard for longer than their watchdog waits, and whose marks and watchdogs have not been read since: they may have been
    /// without power, or have heard nothing.
    marks_due: Vec<bool>,
    slack: u16,
    lag_s: f64,
    /// Time within a cycle by which answers count.
    answers_by: Duration,
    /// Tendons that are read in a cycle, a part of them after the other.
    turns: Vec<Vec<usize>>,
    cycle: usize,
    goals: Vec<i32>,
    measured_m: TendonVector,
    /// Time without a packet after which the servos stop and take no goal any more; none: never.
    watchdog: Option<Duration>,
    /// When the last packet was sent.
    sent: Instant,
}

/// Drives the robot until it is told to shut down; it then ramps to rest, and the servos hold.
///
/// # Errors
/// [`DriverError`].
pub fn run(
    config: &DynamixelConfig,
    options: &IpcOptions,
    shutdown: Shutdown,
) -> Result<(), DriverError> {
    let settings = DriverSettings {
        period: config.period,
        limits: ReferenceLimits::of(&config.robot, config.period),
    };
    let connection = RobotConnection::open(options, &config.robot, &settings)?;
    let mut bus = ServoBus::open(&config.device, config.baud, &config.servo_ids)?;
    bus.find_all()?;
    let home = Home::read(config)?;
    check_marks(&mut bus, home.mark)?;
    let states = bus.all_states(Instant::now() + FIRST_ANSWERS)?;
    let goals: Vec<i32> = states.iter().map(|state| state.position).collect();
    let answers_by = config.period.mul_f64(SHARE_OF_A_CYCLE);
    let turns = turns(&mut bus, &goals, config.period, answers_by)?;
    info!(
        "{} of {} servos are read in a cycle",
        turns[0].len(),
        bus.count()
    );
    let spools = Spools::new(config.robot.spool_radius, &config.directions, home.zeros);
    let measured_m = spools.lengths_m(&goals);
    check_lengths(config, &measured_m)?;
    if shutdown.is_asked() {
        return Ok(());
    }
    hold(&mut bus, &goals, config)?;
    let state = TendonState {
        position_m: measured_m,
        velocity_m_s: [0.0; TENDONS],
    };
    let watchdog = watchdog(config);
    let patience = patience(config, turns.len() as u32, watchdog);
    let process = Process {
        driver: connection.drive_until(shutdown, &state),
        health: Health::new(bus.count(), patience, Instant::now()),
        told: (MotorFault::None, false),
        mark: home.mark,
        marks_due: vec![false; bus.count()],
        slack: config.slack,
        lag_s: config.lag_s,
        answers_by,
        turns,
        cycle: 0,
        goals,
        measured_m,
        watchdog,
        sent: Instant::now(),
        spools,
        bus,
    };
    if let Some(Err(refused)) = config.realtime_priority.map(realtime::use_fifo_priority) {
        warn!("{refused}");
    }
    if let Err(refused) = realtime::reduce_wakeup_latency() {
        warn!("{refused}");
    }
    process.serve()
}

/// Time without a packet after which a servo's watchdog stops it.
fn watchdog(config: &DynamixelConfig) -> Option<Duration> {
    let watchdog_ms = u32::from(config.bus_watchdog) * WATCHDOG_MS;
    (watchdog_ms > 0).then(|| Duration::from_millis(watchdog_ms.into()))
}

/// How long is waited for servos of which each is read once in so many cycles.
fn patience(config: &DynamixelConfig, rounds: u32, watchdog: Option<Duration>) -> Patience {
    let longest_cycle = Duration::from_nanos(longest_cycle_ns(config.period).unsigned_abs());
    // Three rounds without an answer, and one in which the driver was held up in every cycle.
    let silent_after = config
        .silent_after
        .max(3 * rounds * config.period)
        .max((rounds + 1) * longest_cycle);
    // A servo that has answered in turn was not silent.
    let turn = (rounds + 1) * config.period;
    let marks_after = watchdog.map_or(silent_after, |it| it.max(turn).min(silent_after));
    Patience {
        silent_after,
        marks_after,
        longest_cycle,
    }
}

/// Checks that no servo was without power since homing.
fn check_marks(bus: &mut ServoBus, mark: u32) -> Result<(), DriverError> {
    let marks = bus.read_u32(SCRATCH)?;
    match marks.iter().position(|it| *it != mark) {
        Some(tendon) => Err(DriverError::Homeless { id: bus.id(tendon) }),
        None => Ok(()),
    }
}

/// Checks that the servos hardly jump where they are driven from.
fn check_lengths(config: &DynamixelConfig, lengths_m: &TendonVector) -> Result<(), DriverError> {
    let off_m = off_configuration_m(&config.robot, lengths_m);
    let most_m = LARGEST_JUMP_S * config.robot.tendon_limits.velocity;
    if off_m <= most_m {
        return Ok(());
    }
    Err(DriverError::OffConfiguration {
        off_mm: 1e3 * off_m,
        most_mm: 1e3 * most_m,
    })
}

/// Has the servos hold these positions with the torque limit.
fn hold(bus: &mut ServoBus, goals: &[i32], config: &DynamixelConfig) -> Result<(), BusError> {
    bus.set_u8(BUS_WATCHDOG, 0)?;
    bus.set_u32(PROFILE_VELOCITY, 0)?;
    bus.set_u16(GOAL_CURRENT, config.current_limit)?;
    bus.send_goals(goals)?;
    bus.set_u8(TORQUE_ENABLE, 1)?;
    bus.set_u8(BUS_WATCHDOG, config.bus_watchdog)
}

/// Which tendons are read in which cycle: as many at once as the line carries.
fn turns(
    bus: &mut ServoBus,
    goals: &[i32],
    period: Duration,
    within: Duration,
) -> Result<Vec<Vec<usize>>, DriverError> {
    let all: Vec<usize> = (0..bus.count()).collect();
    let mut took = Duration::ZERO;
    for at_once in (1..=all.len()).rev() {
        let tendons = &all[..at_once];
        if bus.time_to_write() + bus.time_to_read(at_once) > within && at_once > 1 {
            continue;
        }
        took = time_of_a_round(bus, goals, tendons)?;
        if took <= within {
            bus.expect_answers_within(took);
            let cycles = all.len().div_ceil(at_once);
            let parts = all.chunks(all.len().div_ceil(cycles));
            return Ok(parts.map(<[usize]>::to_vec).collect());
        }
    }
    Err(DriverError::TooSlow { took, period })
}

/// The time of a round of goals and states, but for the longest one.
fn time_of_a_round(
    bus: &mut ServoBus,
    goals: &[i32],
    tendons: &[usize],
) -> Result<Duration, BusError> {
    let mut times = Vec::with_capacity(ROUNDS);
    for _ in 0..ROUNDS {
        let begun = Instant::now();
        bus.send_goals(goals)?;
        bus.ask_for_states(tendons)?;
        bus.receive_states(tendons.len(), begun + FIRST_ANSWERS, |_, _| ());
        times.push(begun.elapsed());
    }
    times.sort();
    Ok(times[ROUNDS - 2])
}

impl Process {
    fn serve(mut self) -> Result<(), DriverError> {
        while let Some(targets) = self.driver.next_targets() {
            self.step(&targets);
        }
        // The servos hold while nobody talks to them; each by itself would end at the first one that does not answer.
        self.bus.set_all_u8(BUS_WATCHDOG, 0)?;
        self.bus.set_u8(BUS_WATCHDOG, 0)?;
        info!("ended");
        Ok(())
    }

    fn step(&mut self, targets: &MotorTargets) {
        let begun = Instant::now();
        if self.health.begin_cycle(begun) {
            self.marks_due.fill(true);
        }
        let ahead = |k: usize| targets.position_m[k] + self.lag_s * targets.velocity_m_s[k];
        let goals_m = std::array::from_fn(ahead);
        self.spools.positions(&goals_m, &mut self.goals);
        if self.talk(begun + self.answers_by).is_err() {
            self.health.lose_line();
        }
        let (fault, tendon) = self.health.fault();
        self.tell(fault, tendon);
        self.driver.report(&self.measured_m, fault);
    }

    /// Writes the goals and reads the servos whose turn it is.
    fn talk(&mut self, deadline: Instant) -> Result<(), BusError> {
        if !self.health.line_is_lost() {
            // What came too late for the last cycle: the next packet throws away what was not read.
            self.listen(self.bus.count(), Instant::now());
        }
        let tendons = &self.turns[self.cycle % self.turns.len()];
        self.cycle += 1;
        if (self.watchdog).is_some_and(|watchdog| self.sent.elapsed() > watchdog) {
            self.health.trip_watchdogs();
        }
        self.bus.send_goals(&self.goals)?;
        self.bus.ask_for_states(tendons)?;
        self.sent = Instant::now();
        let count = tendons.len();
        self.listen(count, deadline);
        self.look_at_marks();
        Ok(())
    }

    /// Takes so many answers at most until a deadline.
    fn listen(&mut self, count: usize, deadline: Instant) {
        let Self {
            bus,
            spools,
            health,
            measured_m,
            marks_due,
            ..
        } = self;
        bus.receive_states(count, deadline, |tendon, state: ServoState| {
            measured_m[tendon] = spools.length_m(tendon, state.position);
            let is_slack = state.current.unsigned_abs() < self.slack;
            marks_due[tendon] |= health.hear(tendon, state.is_in_error, is_slack);
        });
    }

    /// Reads what a servo that was not heard may have forgotten, and whether its watchdog has tripped.
    fn look_at_marks(&mut self) {
        let until = self.watchdog.map(|it| self.sent + it - SLACK_IN_THE_LOOP);
        let Self {
            bus,
            health,
            marks_due,
            ..
        } = self;
        // An answer that is lost is asked for again in the next cycle; a line that is lost says so when goals are written.
        let due = marks_due.iter().position(|is_due| *is_due);
        if let Some(tendon) = due
            && let Some(mark) = bus.try_read(tendon, SCRATCH, until)
            && let Some([watchdog]) = bus.try_read(tendon, BUS_WATCHDOG, until)
        {
            marks_due[tendon] = false;
            if u32::from_le_bytes(mark) != self.mark {
                health.lose_home();
            }
            if watchdog == WATCHDOG_TRIPPED {
                health.trip_watchdogs();
            }
        }
    }

    /// Tells the log what has become of the servos.
    fn tell(&mut self, fault: MotorFault, tendon: Option<usize>) {
        let told = (fault, self.health.watchdogs_have_tripped());
        if told == self.told {
            return;
        }
        self.told = told;
        let servo = tendon.map(|tendon| self.bus.id(tendon));
        match (fault, servo) {
            (MotorFault::None, _) => info!("all servos answer"),
            (MotorFault::Bus, _) if self.health.watchdogs_have_tripped() => warn!(
                "servos heard nothing for longer than bus_watchdog_ms: they have stopped and take no goal; start the driver again"
            ),
            (MotorFault::Bus, _) => warn!("no servo answers"),
            (MotorFault::Motor, Some(id)) => {
                warn!("servo {id} is in error: its hardware error status says why");
            }
            (MotorFault::Motor, None) => warn!("a servo was without power: `pcc home`"),
            (_, Some(id)) => warn!("servo {id} does not answer, or its tendon is slack"),
            (_, None) => warn!("{fault}"),
        }
    }
}
