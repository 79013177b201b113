//! The services over real shared memory, each test under a root and a prefix of its own.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot set up its world has to stop"
)]

mod world;

use std::fs;
use std::os::unix::fs::PermissionsExt;

use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::*;
use shared_types::capacity::MAX_SCENE_BALLS;
use shared_types::ipc::*;
use shared_types::message::*;
use world::{daemon_and_user, files_of, world};

/// Bytes of this prefix's files in /dev/shm whose names end like this.
fn segment_bytes(options: &IpcOptions, suffix: &str) -> usize {
    files_of(options)
        .filter(|file| file.file_name().into_string().unwrap().ends_with(suffix))
        .map(|file| file.metadata().unwrap().len() as usize)
        .sum()
}

fn round_trip<T>(open: impl Fn(&IpcNode) -> Result<Topic<T>, IpcError>, message: T)
where
    T: Copy + std::fmt::Debug + PartialEq + ZeroCopySend + 'static,
{
    let world = world();
    let sender = IpcNode::create(&world.options, "sender").unwrap();
    let receiver = IpcNode::create(&world.options, "receiver").unwrap();
    let (sending, receiving) = (open(&sender).unwrap(), open(&receiver).unwrap());
    let subscriber = subscriber(&receiver, &receiving).unwrap();
    let publisher = publisher(&sender, &sending).unwrap();
    assert!(subscriber.receive().unwrap().is_none());
    publisher.send_copy(message).unwrap();
    assert_eq!(*subscriber.receive().unwrap().unwrap(), message);
}

#[test]
fn every_message_arrives_as_it_was_sent() {
    let mut trajectory = TrajectoryMessage {
        trajectory_id: 3,
        knot_count: 2,
        ..TrajectoryMessage::ZEROED
    };
    trajectory.knots[255].acceleration_rad_s2[5] = 1.5;
    round_trip(trajectory_service, trajectory);
    round_trip(
        setpoint_service,
        Setpoint {
            acceleration_m_s2: [2.5; 9],
            ..Setpoint::ZEROED
        },
    );
    round_trip(
        robot_state_service,
        RobotState {
            rejected_setpoints: 4,
            ..RobotState::ZEROED
        },
    );
    round_trip(
        controller_state_service,
        ControllerState {
            lateness_histogram: [5; 64],
            ..ControllerState::ZEROED
        },
    );
    round_trip(
        motion_result_service,
        MotionResult {
            reason: ReasonText::new("the ball comes nearer"),
            ..MotionResult::ZEROED
        },
    );
    let mut scene = SceneMessage {
        ball_count: 1024,
        ..SceneMessage::ZEROED
    };
    scene.balls[MAX_SCENE_BALLS - 1].velocity_m_s[2] = -0.5;
    round_trip(
        plan_record_service,
        PlanRecord {
            sequence: 3,
            ..PlanRecord::ZEROED
        },
    );
    round_trip(scene_service, scene);
    round_trip(
        scene_status_service,
        SceneStatus {
            sequence: 8,
            ..SceneStatus::ZEROED
        },
    );
    round_trip(
        heartbeat_service,
        Heartbeat {
            pid: 6,
            ..Heartbeat::ZEROED
        },
    );
}

#[test]
fn cycles_arrive_in_batches_each_exactly_once() {
    let world = world();
    let node = IpcNode::create(&world.options, "test").unwrap();
    let topic = cycle_service(&node).unwrap();
    let subscriber = subscriber(&node, &topic).unwrap();
    let publisher = cycle_publisher(&node, &topic).unwrap();
    for batch in 0..60_u64 {
        let sample = publisher.loan_slice_uninit(10).unwrap();
        let sample = sample.write_from_fn(|index| Cycle {
            sequence: batch * 10 + index as u64,
            ..Cycle::ZEROED
        });
        sample.send().unwrap();
    }
    let mut received = Vec::new();
    while let Some(sample) = subscriber.receive().unwrap() {
        received.extend(sample.payload().iter().map(|cycle| cycle.sequence));
    }
    assert_eq!(received, (0..600).collect::<Vec<_>>());
}

#[test]
fn a_late_subscriber_gets_the_last_trajectory() {
    let world = world();
    let node = IpcNode::create(&world.options, "test").unwrap();
    let topic = trajectory_service(&node).unwrap();
    let publisher = publisher(&node, &topic).unwrap();
    for trajectory_id in 1..=3 {
        publisher
            .send_copy(TrajectoryMessage {
                trajectory_id,
                ..TrajectoryMessage::ZEROED
            })
            .unwrap();
    }
    let subscriber = subscriber(&node, &topic).unwrap();
    publisher.update_connections().unwrap();
    assert_eq!(subscriber.receive().unwrap().unwrap().trajectory_id, 3);
    assert!(subscriber.receive().unwrap().is_none());
}

#[test]
fn a_second_publisher_of_trajectories_is_refused() {
    let world = world();
    let node = IpcNode::create(&world.options, "test").unwrap();
    let topic = trajectory_service(&node).unwrap();
    let first = publisher(&node, &topic).unwrap();
    let error = publisher(&node, &topic).unwrap_err();
    assert!(
        matches!(
            error,
            IpcError::Full {
                port: "publisher",
                ..
            }
        ),
        "{error}"
    );
    drop(first);
    publisher(&node, &topic).unwrap();
}

/// Fills all places that watchers get, and then all that visitors get; how many are left to visitors, and to the robot's processes.
fn places_left<T>(open: impl Fn(&IpcNode) -> Result<Topic<T>, IpcError>) -> [usize; 2]
where
    T: Copy + std::fmt::Debug + ZeroCopySend + 'static,
{
    type Subscribe<T> = fn(&IpcNode, &Topic<T>) -> Result<Subscriber<T>, IpcError>;
    let world = world();
    let node = IpcNode::create(&world.options, "test").unwrap();
    let topic = open(&node).unwrap();
    let fill = |subscribe: Subscribe<T>| -> Vec<_> {
        std::iter::from_fn(|| subscribe(&node, &topic).ok()).collect()
    };
    let watchers = fill(observer_subscriber);
    assert!(!watchers.is_empty());
    let visitors = fill(guest_subscriber);
    [visitors.len(), fill(subscriber).len()]
}

#[test]
fn who_watches_leaves_places_for_who_acts_and_both_for_the_processes_that_the_robot_needs() {
    assert_eq!(places_left(trajectory_service), [0, 2]);
    assert_eq!(places_left(setpoint_service), [0, 2]);
    assert_eq!(places_left(robot_state_service), [6, 2]);
    assert_eq!(places_left(controller_state_service), [6, 2]);
    assert_eq!(places_left(scene_service), [0, 2]);
    assert_eq!(places_left(scene_status_service), [0, 2]);
    assert_eq!(places_left(heartbeat_service), [2, 2]);
}

#[test]
fn four_sources_of_scenes_leave_a_place_for_who_signs_one_off() {
    let world = world();
    let node = IpcNode::create(&world.options, "test").unwrap();
    let topic = scene_service(&node).unwrap();
    let sources: Vec<_> = std::iter::from_fn(|| guest_publisher(&node, &topic).ok()).collect();
    assert_eq!(sources.len(), 4);
    let fifth = publisher(&node, &topic).unwrap();
    let mut present = Vec::new();
    topic.list_publishers(&mut present);
    assert_eq!(present.len(), 5);
    assert!(present.iter().all(|one| one.pid == std::process::id()));
    drop((sources, fifth));
    topic.list_publishers(&mut present);
    assert_eq!(present, []);
}

#[test]
fn a_plan_is_written_in_place_and_read_in_place() {
    let world = world();
    let [daemon, user] = daemon_and_user(&world);
    let capacity = PlanServiceCapacity::default();
    let service = plan_service(&daemon, &capacity).unwrap();
    let server = plan_server(&daemon, &service, &capacity).unwrap();
    let opened = open_plan_service(&user).unwrap();
    let client = plan_client(&user, &opened).unwrap();

    let request = PlanRequest {
        request_id: 42,
        candidate_count: 16,
        ..PlanRequest::ZEROED
    };
    let pending = client
        .loan_uninit()
        .unwrap()
        .write_payload(request)
        .send()
        .unwrap();
    assert_eq!(pending.number_of_server_connections(), 1);
    let active = server.receive().unwrap().unwrap();
    assert_eq!(*active.payload(), request);

    let knots = capacity.knots_per_response();
    let mut response = active.loan_slice_uninit(knots).unwrap();
    let report = response.user_header_mut();
    *report = PlanReport {
        request_id: request.request_id,
        candidate_count: 16,
        ..PlanReport::ZEROED
    };
    report.reason = ReasonText::new("done");
    let response = response.write_from_fn(|index| Knot {
        time_s: index as f64,
        ..Knot::ZEROED
    });
    response.send().unwrap();
    drop(active);

    let answer = pending.receive().unwrap().unwrap();
    drop(pending);
    assert_eq!(answer.user_header().request_id, 42);
    assert_eq!(answer.user_header().reason.text(), "done");
    assert_eq!(answer.payload().len(), knots);
    assert!(
        answer
            .payload()
            .iter()
            .enumerate()
            .all(|(index, knot)| knot.time_s == index as f64)
    );
    let too_long = client
        .loan_uninit()
        .unwrap()
        .write_payload(request)
        .send()
        .unwrap();
    assert!(
        server
            .receive()
            .unwrap()
            .unwrap()
            .loan_slice_uninit(knots + 1)
            .is_err()
    );
    drop(too_long);
}

#[test]
fn without_a_daemon_the_plan_service_is_missing_and_says_who_creates_it() {
    let world = world();
    let node = IpcNode::create(&world.options, "test").unwrap();
    let error = open_plan_service(&node).unwrap_err();
    assert!(matches!(error, IpcError::Missing { .. }), "{error}");
    assert!(error.to_string().contains("planner-daemon"), "{error}");
}

/// What a creator leaves that was killed while it wrote: a file that is still writable, and no user of it.
#[test]
fn a_service_that_a_dead_process_left_half_made_is_made_again() {
    let world = world();
    let node = IpcNode::create(&world.options, "test").unwrap();
    let capacity = PlanServiceCapacity::default();
    let service = plan_service(&node, &capacity).unwrap();
    let mut files = fs::read_dir(world.options.root.join("services")).unwrap();
    let file = files.next().unwrap().unwrap().path();
    let text = fs::read(&file).unwrap();
    drop(service);
    assert!(!file.exists());
    for open_first in [false, true] {
        fs::write(&file, &text[..text.len() / 2]).unwrap();
        fs::set_permissions(&file, fs::Permissions::from_mode(0o600)).unwrap();
        if open_first {
            let error = open_plan_service(&node).unwrap_err();
            assert!(matches!(error, IpcError::Missing { .. }), "{error}");
        }
        drop(plan_service(&node, &capacity).unwrap());
    }
}

/// A client in another language does not hold the lock under which this project's processes open services.
#[test]
fn a_service_that_a_live_process_is_making_is_left_to_it() {
    let world = world();
    let node = IpcNode::create(&world.options, "test").unwrap();
    let capacity = PlanServiceCapacity::default();
    let service = plan_service(&node, &capacity).unwrap();
    let folder = |name: &str| fs::read_dir(world.options.root.join(name)).unwrap();
    let file = folder("services").next().unwrap().unwrap().path();
    let text = fs::read(&file).unwrap();
    let hash = file.file_stem().unwrap().to_str().unwrap().to_owned();
    drop(service);
    let own: Vec<_> = folder("nodes").map(|entry| entry.unwrap().path()).collect();
    let maker = IpcNode::create(&world.options, "maker").unwrap();
    let mut folders = folder("nodes").map(|entry| entry.unwrap().path());
    let its_folder = folders
        .find(|path| path.is_dir() && !own.contains(path))
        .unwrap();
    let note = its_folder.join(format!("{hash}.service_tag"));
    fs::write(&note, "").unwrap();
    fs::write(&file, &text[..text.len() / 2]).unwrap();
    fs::set_permissions(&file, fs::Permissions::from_mode(0o600)).unwrap();
    plan_service(&node, &capacity).unwrap_err();
    assert!(file.exists());
    fs::remove_file(note).unwrap();
    drop(plan_service(&node, &capacity).unwrap());
    drop(maker);
}

/// What a creator leaves that was killed before it gave its shared memory a size: iceoryx2 alone waits for it for ever.
#[test]
fn shared_memory_that_a_dead_process_left_without_a_size_stands_in_nobodys_way() {
    let world = world();
    let capacity = PlanServiceCapacity::default();
    let node = IpcNode::create(&world.options, "test").unwrap();
    let service = plan_service(&node, &capacity).unwrap();
    let mut files = fs::read_dir(world.options.root.join("services")).unwrap();
    let file = files.next().unwrap().unwrap().path();
    let text = fs::read(&file).unwrap();
    let is_dynamic = |file: &fs::DirEntry| file.path().extension().is_some_and(|e| e == "dynamic");
    let memory = files_of(&world.options).find(is_dynamic).unwrap().path();
    drop(service);
    assert!(!file.exists() && !memory.exists());
    fs::write(&memory, "").unwrap();
    fs::set_permissions(&memory, fs::Permissions::from_mode(0o200)).unwrap();
    fs::write(&file, text).unwrap();
    fs::set_permissions(&file, fs::Permissions::from_mode(0o400)).unwrap();
    drop(plan_service(&node, &capacity).unwrap());
    assert!(!memory.exists());
}

#[test]
fn who_opens_services_and_stops_is_named_to_the_others() {
    let world = world();
    let node = IpcNode::create(&world.options, "test").unwrap();
    let lock = world
        .options
        .root
        .join(format!("{}.services.lock", world.options.prefix));
    let held = fs::File::create(lock).unwrap();
    held.lock().unwrap();
    let error = open_plan_service(&node).unwrap_err();
    assert!(matches!(error, IpcError::Busy { .. }), "{error}");
    drop(held);
    scene_service(&node).unwrap();
}

#[test]
fn a_client_beyond_the_capacity_is_refused_and_may_come_when_another_leaves() {
    let world = world();
    let node = IpcNode::create(&world.options, "test").unwrap();
    let service = plan_service(
        &node,
        &PlanServiceCapacity {
            clients: 2,
            ..Default::default()
        },
    )
    .unwrap();
    let mut clients: Vec<_> = (0..2)
        .map(|_| plan_client(&node, &service).unwrap())
        .collect();
    let error = plan_client(&node, &service).unwrap_err();
    assert!(
        matches!(error, IpcError::Full { port: "client", .. }),
        "{error}"
    );
    clients.pop();
    plan_client(&node, &service).unwrap();
}

#[test]
fn the_budget_is_what_the_segments_take() {
    let world = world();
    let node = IpcNode::create(&world.options, "test").unwrap();
    let capacity = PlanServiceCapacity::default();
    let service = plan_service(&node, &capacity).unwrap();
    let server = plan_server(&node, &service, &capacity).unwrap();
    let clients: Vec<_> = (0..capacity.clients)
        .map(|_| plan_client(&node, &service).unwrap())
        .collect();
    let (computed, real) = (
        plan_bytes(&capacity),
        segment_bytes(&world.options, ".data"),
    );
    assert!(
        real >= computed && real - computed < computed / 50,
        "computed {computed}, real {real}"
    );
    println!(
        "plan: computed {computed}, real {real}; {:?}",
        shared_memory(&capacity)
    );
    drop((server, clients));

    let scene = scene_service(&node).unwrap();
    let scene_publisher = publisher(&node, &scene).unwrap();
    let cycle = cycle_service(&node).unwrap();
    let cycle_publisher = cycle_publisher(&node, &cycle).unwrap();
    let expected: usize = shared_memory(&capacity)
        .iter()
        .filter(|(service, _)| *service == "scene" || *service == "cycle")
        .map(|(_, bytes)| bytes)
        .sum();
    let real = segment_bytes(&world.options, ".data");
    assert!(
        real >= expected && real - expected < expected / 50,
        "computed {expected}, real {real}"
    );
    drop((scene_publisher, cycle_publisher));
}

/// Compiles only as long as what the documentation says may be moved to the thread that uses it may be.
#[test]
fn nodes_and_services_may_be_moved_to_another_thread() {
    fn assert_send<T: Send>() {}
    assert_send::<IpcNode>();
    assert_send::<RoleLock>();
    assert_send::<PlanService>();
    assert_send::<CommandService>();
    assert_send::<Topic<Setpoint>>();
}
