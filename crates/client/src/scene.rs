//! Publishing the obstacles that a source knows.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, channel, sync_channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use iceoryx2::port::update_connections::UpdateConnections;
use shared_types::clock::{mono_now_ns, wall_now_ns};
use shared_types::codes::SceneRefusal;
use shared_types::ipc::{
    IpcNode, IpcOptions, JoinOnDrop, Publisher, Subscriber, Topic, guest_publisher,
    guest_subscriber, publisher, scene_service, scene_status_service, spawn_with_ports, subscriber,
};
use shared_types::message::{self, MovingBall, SceneMessage};
use shared_types::valid::{Scene, SceneStatus, SourceName, stamp_refusal};

use crate::ClientError;
use crate::waiting::TimeLimit;

/// Time between two polls for new daemons and their verdicts.
const POLL_INTERVAL: Duration = Duration::from_millis(5);
/// Time between two polls for the verdict on the last scene of a dropped publisher.
const FINAL_VERDICT_POLL_INTERVAL: Duration = Duration::from_millis(1);
/// Longest time that a dropped publisher keeps its ports until a live daemon has judged its last scene.
const FINAL_VERDICT_TIMEOUT: Duration = Duration::from_millis(500);
/// Most scenes sent whose verdicts are tracked: more than a publisher can send between two polls without losing some.
const TRACKED_SCENES: usize = 256;

/// Publishes what one source knows of the obstacles; the last scene published counts for its lifetime.
///
/// A thread of its own hands the last scene to a daemon that starts later. Once its lifetime is over, the daemon executes nothing
/// more and stops what moves, until the source publishes again or takes its leave: dropping this value is no leave.
///
/// Dropping it waits, where a daemon is alive, until the last scene or leave is judged, 500 ms at most: an earlier end could take it
/// back unheard. Call [`ScenePublisher::confirm`] before to know the verdict.
#[derive(Debug)]
pub struct ScenePublisher {
    source: SourceName,
    last_sequence: u32,
    /// The thread ends once this is dropped: declared before the thread, which is joined when it is dropped, because fields are dropped
    /// in the order of their declaration.
    outbox: Sender<Outgoing>,
    board: Arc<VerdictBoard>,
    _thread: JoinOnDrop,
}

/// A scene on its way to the thread that owns the ports.
struct Outgoing {
    scene: Box<SceneMessage>,
    sent: SyncSender<Result<(), ClientError>>,
}

/// The daemon's verdicts on this publisher's scenes, shared with the thread that owns the ports.
#[derive(Debug, Default)]
struct VerdictBoard {
    latest: Mutex<Verdicts>,
    news: Condvar,
}

#[derive(Debug, Default)]
struct Verdicts {
    /// Sequence of the last scene judged; 0: none yet.
    judged: u32,
    last: Option<SceneStatus>,
    /// The first refusal not returned to the caller yet.
    unreported: Option<SceneStatus>,
}

impl ScenePublisher {
    /// Joins the services as a source: 1 to 32 characters of printable ASCII, another name for each source. A program that starts
    /// again takes its name up again. The daemon knows of it from its first scene on.
    ///
    /// # Errors
    /// [`ClientError::InvalidRequest`] for the name, or [`ClientError::Ipc`].
    pub fn connect(options: &IpcOptions, source: &str) -> Result<Self, ClientError> {
        let source = SourceName::new(source).map_err(ClientError::InvalidRequest)?;
        let node = IpcNode::create(options, "pcc-scene")?;
        let (outbox, outgoing) = channel();
        let board = Arc::<VerdictBoard>::default();
        let shared = Arc::clone(&board);
        let thread = spawn_with_ports(
            "pcc-scene",
            move || Ports::join(node, source),
            move |mut ports| ports.serve(&outgoing, &shared),
        )??;
        Ok(Self {
            source,
            last_sequence: 0,
            outbox,
            board,
            _thread: thread.into(),
        })
    }

    /// Publishes all obstacles that this source knows of now, at most 1024; base frame, metres, m/s. Replaces its scene before.
    ///
    /// It counts for `lifetime`, 1 ms to an hour: some periods of a sensor, so that its failure is noticed. A moving ball counts
    /// everywhere that it may be within that time, so what moves wants a short one.
    ///
    /// # Errors
    /// [`ClientError::InvalidRequest`] if a ball or the lifetime is not valid (the scene before then holds), [`ClientError::Ipc`] if
    /// there is no place for one more source, [`ClientError::Transport`], or, when this one was sent, [`ClientError::SceneRefused`] if
    /// the daemon has refused an earlier one and that was not returned yet.
    pub fn publish(&mut self, balls: &[MovingBall], lifetime: Duration) -> Result<(), ClientError> {
        self.publish_stamped(mono_now_ns(), balls, lifetime)
    }

    /// Publishes obstacles that were seen at an earlier time, nanoseconds of `CLOCK_MONOTONIC`, from which `lifetime` counts.
    ///
    /// # Errors
    /// As [`ScenePublisher::publish`], and [`ClientError::SceneRefused`] if the stamp is one of another clock, of the future, or too
    /// old: nothing is sent then.
    pub fn publish_stamped(
        &mut self,
        stamp_mono_ns: i64,
        balls: &[MovingBall],
        lifetime: Duration,
    ) -> Result<(), ClientError> {
        self.send(&Scene {
            source: self.source,
            sequence: self.last_sequence.wrapping_add(1).max(1),
            stamp_mono_ns,
            lifetime_ns: i64::try_from(lifetime.as_nanos()).unwrap_or(i64::MAX),
            takes_leave: false,
            balls: balls.to_vec(),
        })
    }

    /// Signs the source off: no scene of it is expected any more, and its obstacles are gone; those that another publisher has published
    /// of under this name count until their lifetime ends.
    ///
    /// # Errors
    /// [`ClientError::Ipc`] or [`ClientError::Transport`].
    pub fn take_leave(&mut self) -> Result<(), ClientError> {
        self.send(&Scene {
            source: self.source,
            sequence: self.last_sequence.wrapping_add(1).max(1),
            stamp_mono_ns: mono_now_ns(),
            lifetime_ns: shared_types::valid::MOST_SCENE_LIFETIME_NS,
            takes_leave: true,
            balls: Vec::new(),
        })
    }

    /// Waits until the daemon has judged the last scene.
    ///
    /// # Errors
    /// [`ClientError::SceneRefused`] with its reason, of the last scene or of an earlier one whose refusal was not told before, or
    /// [`ClientError::NoServer`] if none has judged the last one in time.
    pub fn confirm<'program>(
        &self,
        timeout: impl Into<TimeLimit<'program>>,
    ) -> Result<(), ClientError> {
        let limit = timeout.into();
        let waits = |verdicts: &mut Verdicts| verdicts.judged != self.last_sequence;
        let mut verdicts = loop {
            let (verdicts, news) = (self.board.lock(), &self.board.news);
            let waited = news.wait_timeout_while(verdicts, limit.remaining(), waits);
            let (verdicts, result) = waited.unwrap_or_else(PoisonError::into_inner);
            if !result.timed_out() {
                break verdicts;
            }
            drop(verdicts);
            if limit.is_over() {
                return Err(ClientError::NoServer {
                    server: "planner-daemon that judges scenes",
                    waited: limit.duration(),
                });
            }
        };
        let earlier = verdicts.unreported.take();
        let last = verdicts.last.as_ref();
        match last
            .filter(|it| it.refusal != SceneRefusal::None)
            .or(earlier.as_ref())
        {
            Some(refused) => Err(self.refused_by_daemon(refused)),
            None => Ok(()),
        }
    }

    fn send(&mut self, scene: &Scene) -> Result<(), ClientError> {
        let (stamp, lifetime) = (scene.stamp_mono_ns, scene.lifetime_ns);
        let mut wire = Box::new(SceneMessage::ZEROED);
        scene
            .write(&mut wire)
            .map_err(ClientError::InvalidRequest)?;
        if let Some(refusal) = stamp_refusal(stamp, lifetime, mono_now_ns(), wall_now_ns()) {
            return Err(self.refused(scene.sequence, refusal, String::new()));
        }
        let (sent, sent_result) = sync_channel(1);
        let outgoing = Outgoing { scene: wire, sent };
        let gone = || ClientError::transport("send a scene", "its thread has ended");
        self.outbox.send(outgoing).map_err(|_| gone())?;
        sent_result.recv().map_err(|_| gone())??;
        self.last_sequence = scene.sequence;
        let unreported = self.board.lock().unreported.take();
        unreported.map_or(Ok(()), |status| Err(self.refused_by_daemon(&status)))
    }

    fn refused_by_daemon(&self, status: &SceneStatus) -> ClientError {
        self.refused(status.sequence, status.refusal, status.reason.to_string())
    }

    fn refused(&self, sequence: u32, refusal: SceneRefusal, reason: String) -> ClientError {
        ClientError::SceneRefused {
            source_name: self.source.to_string(),
            sequence,
            refusal,
            reason,
        }
    }
}

/// The services, and the ports once there is something to say, in the thread that uses them.
struct Ports {
    source: SourceName,
    scenes: Topic<SceneMessage>,
    statuses: Topic<message::SceneStatus>,
    open: Option<OpenPorts>,
    node: IpcNode,
}

/// The open ports. A publisher without a scene stops every motion, so the port is made with the first scene, not before.
struct OpenPorts {
    scenes: Publisher<SceneMessage>,
    statuses: Subscriber<message::SceneStatus>,
}

impl OpenPorts {
    /// Makes the ports; a leave uses the reserved places, since hanging sources may hold all others.
    fn open(ports: &Ports, takes_leave: bool) -> Result<Self, ClientError> {
        let (node, scenes, statuses) = (&ports.node, &ports.scenes, &ports.statuses);
        Ok(if takes_leave {
            Self {
                statuses: subscriber(node, statuses)?,
                scenes: publisher(node, scenes)?,
            }
        } else {
            Self {
                statuses: guest_subscriber(node, statuses)?,
                scenes: guest_publisher(node, scenes)?,
            }
        })
    }

    fn send(&self, scene: &SceneMessage) -> Result<(), ClientError> {
        let mut sample = self
            .scenes
            .loan()
            .map_err(|reason| ClientError::transport("prepare a scene", reason))?;
        *sample.payload_mut() = *scene;
        sample
            .send()
            .map(drop)
            .map_err(|reason| ClientError::transport("send a scene", reason))
    }
}

impl Ports {
    fn join(node: IpcNode, source: SourceName) -> Result<Self, ClientError> {
        Ok(Self {
            source,
            statuses: scene_status_service(&node)?,
            scenes: scene_service(&node)?,
            open: None,
            node,
        })
    }

    /// Sends scenes, hands the last one to daemons that start later, and receives verdicts, until the publisher is dropped.
    fn serve(&mut self, outgoing: &Receiver<Outgoing>, board: &VerdictBoard) {
        let mut sent_scenes = VecDeque::with_capacity(TRACKED_SCENES);
        loop {
            match outgoing.recv_timeout(POLL_INTERVAL) {
                Ok(Outgoing { scene, sent }) => {
                    if sent_scenes.len() == TRACKED_SCENES {
                        sent_scenes.pop_front();
                    }
                    sent_scenes.push_back((scene.sequence, scene.stamp_mono_ns));
                    let _ = sent.send(self.send(&scene));
                }
                Err(RecvTimeoutError::Timeout) => {
                    if let Some(open) = &self.open {
                        // A daemon that cannot be reached now is tried again next time.
                        let _ = open.scenes.update_connections();
                    }
                }
                Err(RecvTimeoutError::Disconnected) => {
                    return self.wait_for_final_verdict(board, &sent_scenes);
                }
            }
            self.receive_verdicts(board, &sent_scenes);
        }
    }

    fn send(&mut self, scene: &SceneMessage) -> Result<(), ClientError> {
        let open = match self.open.take() {
            Some(open) => open,
            None => OpenPorts::open(self, scene.takes_leave != 0)?,
        };
        self.open.insert(open).send(scene)
    }

    /// Keeps the ports until a daemon that is there has judged the last scene: it may not have received it yet.
    fn wait_for_final_verdict(&self, board: &VerdictBoard, sent_scenes: &VecDeque<(u32, i64)>) {
        let Some(&(last, _)) = sent_scenes.back() else {
            return;
        };
        let until = Instant::now() + FINAL_VERDICT_TIMEOUT;
        while self.has_listeners() && Instant::now() < until {
            self.receive_verdicts(board, sent_scenes);
            if board.lock().judged == last {
                return;
            }
            thread::sleep(FINAL_VERDICT_POLL_INTERVAL);
        }
    }

    /// Whether a daemon subscribes to scenes.
    fn has_listeners(&self) -> bool {
        let Some(open) = &self.open else {
            return false;
        };
        let _ = open.scenes.update_connections();
        self.scenes.number_of_subscribers() > 0
    }

    /// Receives the verdicts on these scenes (sequence and stamp); those on another publisher's scenes of the same name are passed over.
    fn receive_verdicts(&self, board: &VerdictBoard, sent_scenes: &VecDeque<(u32, i64)>) {
        let Some(open) = &self.open else {
            return;
        };
        while let Ok(Some(sample)) = open.statuses.receive() {
            let copy = *sample;
            let Ok(status) = SceneStatus::try_from(&copy) else {
                continue;
            };
            let scene = (status.sequence, status.scene_stamp_mono_ns);
            let is_ours = status.source == self.source.to_wire() && sent_scenes.contains(&scene);
            if is_ours {
                board.take(&status);
            }
        }
    }
}

impl VerdictBoard {
    fn lock(&self) -> MutexGuard<'_, Verdicts> {
        self.latest.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn take(&self, status: &SceneStatus) {
        let mut verdicts = self.lock();
        verdicts.judged = status.sequence;
        verdicts.last = Some(*status);
        if status.refusal != SceneRefusal::None {
            verdicts.unreported.get_or_insert(*status);
        }
        self.news.notify_all();
    }
}
