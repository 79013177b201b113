//! Starting the daemon: everything is loaded, checked and opened before the first request.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64};
use std::thread;
use std::time::Duration;

use collision::{Scene, SceneFileError, tracking_padding};
use denoiser::{FastModel, Manifest, TemporalUnet, WeightsError};
use input_files::{shortened, shown};
use pcc_model::{Robot, RobotFileError, SECTIONS};
use planning::{DiffusionModel, Models, Planner, PlannerError, PrecisionUnavailable};
use realtime::{Pages, RealtimeError};
use shared_types::clock::mono_now_ns;
use shared_types::ipc::{
    IpcError, IpcNode, IpcOptions, PlanServiceCapacity, Role, RoleLock, shared_memory,
};
use trajectory::{BRAKING_SHARE, RateLaw};

use super::config::Config;
use super::process;
use super::warm_up::warm_up;
use crate::execution::{BackgroundError, BackgroundThreads, Execution, ExecutionRules};
use crate::identity::Identity;
use crate::requests::{LeadTimes, PlanRunner, PlannerKind, RequestValidator, Service};

/// Time slice of a planning thread: threads that ask for shorter ones preempt it when they wake.
const PLANNING_TIME_SLICE: Duration = Duration::from_millis(6);
/// Name of the learned model in the manifest.
const MODEL: &str = "fast";

/// Why the daemon does not start.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// The robot file is refused.
    #[error("`robot`: {0}")]
    Robot(#[from] Box<RobotFileError>),
    /// The static scene is refused.
    #[error("static scene: {0}")]
    Scene(#[from] Box<SceneFileError>),
    /// The learned model is refused.
    #[error("{key}, in {}: {source}", shown(.folder))]
    Weights {
        /// The key that asks for the model.
        key: String,
        /// The weights' folder.
        folder: PathBuf,
        /// What is wrong with the weights.
        source: Box<WeightsError>,
    },
    /// The diffusion model cannot be computed as configured.
    #[error(transparent)]
    Precision(#[from] PrecisionUnavailable),
    /// The robot's sections differ in length, which the unit model cannot express.
    #[error("robot file {}: the planner needs three sections of one length, got {lengths:?}", shown(.robot))]
    UnequalSections {
        /// The robot file.
        robot: PathBuf,
        /// The sections' lengths, m.
        lengths: [f64; SECTIONS],
    },
    /// The planner cannot serve this robot.
    #[error("robot file {}: {source}", shown(.robot))]
    Planner {
        /// The robot file.
        robot: PathBuf,
        /// What is wrong with the robot.
        source: PlannerError,
    },
    /// The services are not available, or another daemon runs.
    #[error(transparent)]
    Ipc(#[from] IpcError),
    /// A background thread did not start.
    #[error(transparent)]
    Background(#[from] BackgroundError),
    /// The configuration takes more shared memory than it declares.
    #[error(
        "shared_memory_budget_mb = {allowed_mb} is not allowed: {needed_mb:.1} MB at least are needed for clients = {}, \
         requests_per_client = {}, candidates = {}, knots_per_candidate = {}: lower these, or declare more",
        .capacity.clients, .capacity.active_requests_per_client, .capacity.candidates, .capacity.knots_per_candidate
    )]
    SharedMemory {
        /// The plan service's capacity.
        capacity: PlanServiceCapacity,
        /// What the services take, 10^6 bytes.
        needed_mb: f64,
        /// Declared shared memory, 10^6 bytes.
        allowed_mb: f64,
    },
    /// The process takes more memory than is declared.
    #[error(
        "resident_memory_budget_mb = {allowed_mb} is not allowed: the daemon needs {needed_mb:.1} MB of resident memory at least: \
         lower threads or the plan service's capacity, or declare more"
    )]
    ResidentMemory {
        /// What the process takes, 10^6 bytes.
        needed_mb: f64,
        /// Declared resident memory, 10^6 bytes.
        allowed_mb: f64,
    },
    /// The processors asked for are not available.
    #[error("`processors`: {0}")]
    Processors(#[source] RealtimeError),
    /// The system takes a priority back that it granted.
    #[error(transparent)]
    Priority(#[from] RealtimeError),
    /// The system refuses something that the daemon cannot go without.
    #[error("the system refuses: {0}")]
    System(#[from] std::io::Error),
}

/// The daemon, ready to serve. It belongs to the thread that started it.
pub struct Daemon {
    // Dropped in this order: supervision, which stops what moves, before the heart; ports before the node; the role last.
    service: Service,
    _background: BackgroundThreads,
    _node: IpcNode,
    _role: RoleLock,
}

impl Daemon {
    /// Takes the daemon's role, loads robot and model, opens the services and checks the budgets.
    ///
    /// # Errors
    /// [`StartError`]: the first thing that is not as it must be; nothing stays behind.
    pub fn start(config: &Config, options: &IpcOptions) -> Result<Self, StartError> {
        use_processors(config)?;
        let role = RoleLock::acquire(options, Role::PlannerDaemon)?;
        let shared_bytes = check_shared_memory(config)?;
        let robot = Robot::from_file(&config.robot).map_err(Box::new)?;
        let static_scene = load_scene(config, &robot)?;
        let priority = granted_priority(config);
        let (planner, weights_hash) = load_planner(config, &robot, priority)?;
        let identity = Identity {
            // No other daemon of this machine was started then.
            instance: mono_now_ns().unsigned_abs(),
            robot_hash: robot.hash(),
            weights_hash,
        };
        lock_memory(config);
        let lead_times = warm_up(&planner, config).map_err(|source| not_served(config, source))?;
        let node = IpcNode::create(options, "planner-daemon")?;
        let supervision_rounds = Arc::<AtomicU64>::default();
        let execution = Execution::start(
            options,
            execution_rules(config, &planner, &robot, identity),
            identity.instance,
            &supervision_rounds,
            priority.map(|planning| planning + 2),
        )?;
        let service_priority = priority.map(|planning| planning + 1);
        // The heart beats before requests are served: what is requested before a controller hears this daemon is refused by it.
        let background = BackgroundThreads::start(
            options,
            identity.description(&robot),
            &supervision_rounds,
            service_priority,
        )?;
        execution.wait_until_known();
        let service = open_service(
            config,
            &node,
            static_scene,
            planner,
            execution,
            (lead_times, identity),
        )?;
        prefault_shared_memory(config, options);
        if let Some(priority) = service_priority {
            realtime::use_fifo_priority(priority)?;
        }
        let resident_bytes = check_resident_memory(config)?;
        announce(config, &robot, [shared_bytes, resident_bytes]);
        Ok(Self {
            service,
            _background: background,
            _node: node,
            _role: role,
        })
    }

    /// Serves until `terminated` is set, and answers the running plan then.
    pub fn run(&mut self, terminated: &AtomicBool) {
        tracing::info!("ready");
        self.service.run(terminated);
        tracing::info!("ended");
    }
}

/// Logs what was loaded, and the shared and resident memory that is taken, bytes.
fn announce(config: &Config, robot: &Robot, [shared_bytes, resident_bytes]: [usize; 2]) {
    tracing::info!(
        "robot {}, {}, {} threads, up to {} candidates of {} knots for {} clients",
        robot.name,
        resident_models(config),
        config.threads,
        config.capacity.candidates,
        config.capacity.knots_per_candidate,
        config.capacity.clients
    );
    if config.planner == PlannerKind::Null {
        tracing::warn!(
            "planner = \"null\": one plan answers every request, and nothing is executed"
        );
    }
    tracing::info!(
        "shared memory {:.1} of {:.1} MB, resident memory {:.1} of {:.1} MB",
        megabytes(shared_bytes),
        megabytes(config.shared_memory_budget),
        megabytes(resident_bytes),
        megabytes(config.resident_memory_budget)
    );
}

/// The models that requests can be answered with.
fn resident_models(config: &Config) -> String {
    let fast = config.weights.as_ref().map_or("none", |_| MODEL);
    match &config.diffusion {
        Some(diffusion) => format!("model {fast}, diffusion model {diffusion}"),
        None => format!("model {fast}, no diffusion model"),
    }
}

fn megabytes(bytes: usize) -> f64 {
    bytes as f64 * 1e-6
}

fn use_processors(config: &Config) -> Result<(), StartError> {
    if config.processors.is_empty() {
        return Ok(());
    }
    realtime::set_cpu_affinity(&config.processors).map_err(StartError::Processors)
}

fn lock_memory(config: &Config) {
    if !config.lock_memory {
        return;
    }
    if let Err(error) = realtime::lock_memory(Pages::Touched) {
        tracing::warn!("{error}, or set lock_memory = false");
    }
}

/// The SCHED_FIFO priority of planning, where the configuration asks for one and the system grants the two above it as well: service
/// and heartbeat run one above planning, supervision two above.
fn granted_priority(config: &Config) -> Option<u8> {
    let planning = config.realtime_priority?;
    let tried = thread::spawn(move || realtime::use_fifo_priority(planning + 2));
    match tried.join().expect("a system call does not panic") {
        Ok(()) => Some(planning),
        Err(error) => {
            tracing::warn!(
                "answers and orders to stop can be late: {error}, or set realtime_priority = 0"
            );
            None
        }
    }
}

/// Faults in the pages of the answers' shared memory, so that no answer waits for one.
fn prefault_shared_memory(config: &Config, options: &IpcOptions) {
    if !config.lock_memory {
        return;
    }
    match realtime::prefault_shared_memory(&options.prefix) {
        Ok(0) => {
            tracing::warn!("no shared memory to bring into RAM was found in /proc/self/maps");
        }
        Ok(bytes) => tracing::debug!("{:.1} MB of shared memory are in RAM", megabytes(bytes)),
        Err(error) => tracing::warn!(
            "shared memory is not brought into RAM, large answers can be delayed once ({error}): Linux 5.14 and space in \
             /dev/shm are needed"
        ),
    }
}

fn load_scene(config: &Config, robot: &Robot) -> Result<Scene, StartError> {
    let Some(file) = &config.scene else {
        return Ok(Scene::default());
    };
    let scene = Scene::from_file(file, robot.section_lengths[0]).map_err(Box::new)?;
    let (balls, solids) = (scene.balls().len(), scene.solids().len());
    tracing::info!("static scene {file:?}: {balls} balls, {solids} solids");
    Ok(scene)
}

/// The planner, and the hash of its weights.
fn load_planner(
    config: &Config,
    robot: &Robot,
    priority: Option<u8>,
) -> Result<(Planner, u64), StartError> {
    let models = config
        .weights
        .as_ref()
        .map(|folder| load_models(folder, config, robot));
    let (models, weights_hash) = models.transpose()?.unwrap_or_default();
    let unit_robot = robot.to_unit();
    let unit_robot = unit_robot.ok_or_else(|| StartError::UnequalSections {
        robot: config.robot.clone(),
        lengths: robot.section_lengths,
    })?;
    let planner = Planner::new(unit_robot, models, config.threads)
        .map_err(|source| not_served(config, source))?;
    let own_processors = own_processors(config.threads);
    planner.on_every_worker(|worker| {
        // A defect of the planner is an answer like any other.
        logging::do_not_abort_on_panic();
        if let Some(processors) = &own_processors
            && let Err(error) = realtime::set_cpu_affinity(&[processors[worker]])
        {
            tracing::warn!("a planning thread: {error}");
        }
        if let Some(priority) = priority
            && let Err(error) = realtime::use_fifo_priority(priority)
        {
            tracing::warn!("a planning thread: {error}");
        }
        if let Err(error) = realtime::set_time_slice(PLANNING_TIME_SLICE) {
            tracing::warn!("answers may be a few ms late where processors are scarce: {error}");
        }
    });
    Ok((planner, weights_hash))
}

/// A processor for each planning thread, where there are as many: a thread that another one wakes would else wait behind it on its processor
/// (decision 0035). They exchange them later on (decision 0045).
fn own_processors(threads: usize) -> Option<Vec<usize>> {
    let allowed = realtime::allowed_processors().ok()?;
    (allowed.len() == threads).then_some(allowed)
}

fn not_served(config: &Config, source: PlannerError) -> StartError {
    StartError::Planner {
        robot: config.robot.clone(),
        source,
    }
}

/// The models, and the hash of the few-step model's weights.
fn load_models(folder: &Path, config: &Config, robot: &Robot) -> Result<(Models, u64), StartError> {
    let refused = |key: String| {
        move |source| StartError::Weights {
            key,
            folder: folder.into(),
            source: Box::new(source),
        }
    };
    let by_weights = || refused("`weights`".to_owned());
    let manifest = Manifest::open(folder).map_err(by_weights())?;
    let limit = robot.bending_limit;
    let weights = manifest.weights(MODEL).map_err(by_weights())?;
    let fast = FastModel::from_weights(&weights, limit).map_err(by_weights())?;
    let diffusion = config.diffusion.as_ref().map(|diffusion| {
        let key = format!("[diffusion] model = {:?}", shortened(&diffusion.model));
        let unet = manifest
            .weights(&diffusion.model)
            .and_then(|weights| TemporalUnet::load(&weights, limit))
            .map_err(refused(key))?;
        Ok::<_, StartError>(DiffusionModel::new(unet, diffusion.settings())?)
    });
    let models = Models {
        fast: Some(fast),
        diffusion: diffusion.transpose()?,
    };
    Ok((models, weights.hash()))
}

fn execution_rules(
    config: &Config,
    planner: &Planner,
    robot: &Robot,
    identity: Identity,
) -> ExecutionRules {
    let unit_robot = planner.robot();
    let padding = tracking_padding(unit_robot, config.path_tolerance_rad);
    let limits = &robot.tendon_limits;
    ExecutionRules {
        robot_hash: identity.robot_hash,
        padded: unit_robot.with_tube_padding(&padding),
        path_tolerance_rad: config.path_tolerance_rad,
        rate_law: RateLaw::new(&robot.tendons, limits.acceleration * BRAKING_SHARE),
        begin_lead: config.begin_lead,
        scene_expected: config.scene_expected,
    }
}

fn open_service(
    config: &Config,
    node: &IpcNode,
    static_scene: Scene,
    planner: Planner,
    execution: Execution,
    (lead_times, identity): (LeadTimes, Identity),
) -> Result<Service, StartError> {
    let validator = RequestValidator {
        robot: planner.robot().clone(),
        capacity: config.capacity,
        default_deadline: config.default_deadline,
        padding: tracking_padding(planner.robot(), config.path_tolerance_rad),
        static_scene,
        planner: config.planner,
    };
    let runner = PlanRunner::new(planner, config.planner, config.wait)?;
    let (wait, queued) = (config.wait, config.queued_per_client);
    Ok(Service::open(
        node,
        validator,
        runner,
        execution,
        (lead_times, identity),
        wait,
        queued,
    )?)
}

fn check_shared_memory(config: &Config) -> Result<usize, StartError> {
    let services = shared_memory(&config.capacity);
    let needed: usize = services.iter().map(|(_, bytes)| bytes).sum();
    for (service, bytes) in services {
        tracing::debug!("{service}: {:.2} MB", megabytes(bytes));
    }
    if needed > config.shared_memory_budget {
        return Err(StartError::SharedMemory {
            capacity: config.capacity,
            needed_mb: megabytes(needed),
            allowed_mb: megabytes(config.shared_memory_budget),
        });
    }
    Ok(needed)
}

fn check_resident_memory(config: &Config) -> Result<usize, StartError> {
    let needed = process::resident_bytes()?;
    if needed > config.resident_memory_budget {
        return Err(StartError::ResidentMemory {
            needed_mb: megabytes(needed),
            allowed_mb: megabytes(config.resident_memory_budget),
        });
    }
    Ok(needed)
}
