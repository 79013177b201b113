//! The client against a daemon that is a process of its own and may be killed at any time.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot set up its world has to stop"
)]

use std::thread;
use std::time::Duration;

use crate::support::{KNOTS, LONG, World, seed};
use client::{Client, ClientError};
use shared_types::capacity::DOF;
use shared_types::ipc::*;
use shared_types::valid::{Goal, PlanRequest};

pub(crate) fn request(seed: u64) -> PlanRequest {
    let goal = Goal::Tip {
        position_m: [0.0, 0.0, 2.5],
        tolerance_m: None,
    };
    PlanRequest {
        seed,
        candidate_count: 4,
        ..PlanRequest::new([0.0; DOF], goal)
    }
}

fn client(world: &World) -> Client {
    Client::connect(&world.options).unwrap()
}

#[test]
fn without_a_daemon_there_is_an_error_that_says_what_to_do() {
    let world = World::new();
    let mut client = client(&world);
    let error = client
        .plan(&request(seed::ANSWER), Duration::from_millis(50))
        .unwrap_err();
    assert!(
        matches!(
            error,
            ClientError::NoServer {
                server: "planner-daemon",
                ..
            }
        ),
        "{error}"
    );
    assert!(error.to_string().contains("start it"), "{error}");
    assert!(matches!(
        client.submit(&request(seed::ANSWER)),
        Err(ClientError::NoServer { .. })
    ));
}

#[test]
fn a_client_that_starts_first_waits_for_the_daemon() {
    let world = World::new();
    let mut client = client(&world);
    client
        .wait_for_daemon(Duration::from_millis(20))
        .unwrap_err();
    let _daemon = world.daemon();
    client.wait_for_daemon(LONG).unwrap();
    client.plan(&request(seed::ANSWER), LONG).unwrap();
}

#[test]
fn answers_are_read_in_place_and_may_be_kept() {
    let world = World::new();
    let _daemon = world.daemon();
    let mut client = client(&world);
    let answers: Vec<_> = (0..4)
        .map(|_| client.plan(&request(seed::ANSWER), LONG).unwrap())
        .collect();
    for (index, answer) in answers.iter().enumerate() {
        assert_eq!(answer.report().request_id, index as u64 + 1);
        assert_eq!(answer.candidates().len(), 4);
        assert!(answer.selected().is_none());
        for (index, candidate) in answer.candidates().enumerate() {
            assert_eq!(candidate.knots.len(), KNOTS);
            assert_eq!(candidate.knots[0].time_s, (index * KNOTS) as f64);
        }
    }
    let executed = client
        .plan(
            &PlanRequest {
                execute: true,
                request_id: 99,
                ..request(seed::ANSWER)
            },
            LONG,
        )
        .unwrap();
    assert_eq!(executed.report().request_id, 99);
    assert_eq!(executed.selected().unwrap().knots.len(), KNOTS);
}

#[test]
fn several_requests_work_at_once_and_too_many_are_refused() {
    let world = World::new();
    let _daemon = world.daemon();
    let mut client = client(&world);
    client.wait_for_daemon(LONG).unwrap();
    let mut pending: Vec<_> = (0..4)
        .map(|_| client.submit(&request(seed::HANG)).unwrap())
        .collect();
    assert!(matches!(
        client.submit(&request(seed::ANSWER)),
        Err(ClientError::TooManyRequests)
    ));
    assert!(client.poll(&mut pending[0]).unwrap().is_none());
    pending.pop();
    let last = client.submit(&request(seed::ANSWER)).unwrap();
    assert_eq!(client.wait(last, LONG).unwrap().candidates().len(), 4);
}

#[test]
fn a_slow_daemon_is_a_time_out_and_cancelling_frees_the_place() {
    let world = World::new();
    let _daemon = world.daemon();
    let mut client = client(&world);
    client.wait_for_daemon(LONG).unwrap();
    for _ in 0..12 {
        let pending = client.submit(&request(seed::HANG)).unwrap();
        let error = client.wait(pending, Duration::from_millis(5)).unwrap_err();
        assert!(matches!(error, ClientError::TimedOut { .. }), "{error}");
    }
    client.plan(&request(seed::ANSWER), LONG).unwrap();
}

#[test]
fn a_request_that_the_daemon_drops_is_lost_not_waited_for() {
    let world = World::new();
    let _daemon = world.daemon();
    let mut client = client(&world);
    client.wait_for_daemon(LONG).unwrap();
    let pending = client.submit(&request(seed::DROP)).unwrap();
    let error = client.wait(pending, LONG).unwrap_err();
    assert!(
        matches!(
            error,
            ClientError::ServerLost {
                may_have_acted: false,
                ..
            }
        ),
        "{error}"
    );
}

#[test]
fn an_answer_that_leads_outside_its_memory_is_refused() {
    let world = World::new();
    let _daemon = world.daemon();
    let error = client(&world)
        .plan(&request(seed::GARBAGE), LONG)
        .unwrap_err();
    assert!(matches!(error, ClientError::BadMessage { .. }), "{error}");
    assert!(error.to_string().contains("candidates[3]"), "{error}");
}

#[test]
fn an_invalid_request_is_not_sent() {
    let world = World::new();
    let invalid = PlanRequest {
        candidate_count: 0,
        ..request(seed::ANSWER)
    };
    let error = client(&world).plan(&invalid, LONG).unwrap_err();
    assert!(matches!(error, ClientError::InvalidRequest(_)), "{error}");
}

#[test]
fn a_killed_daemon_is_an_error_and_its_successor_is_found_without_a_restart() {
    let world = World::new();
    let mut client = client(&world);
    for execute in [false, true, false] {
        let mut daemon = world.daemon();
        client.wait_for_daemon(LONG).unwrap();
        let kept = client.plan(&request(seed::ANSWER), LONG).unwrap();
        let pending = client
            .submit(&PlanRequest {
                execute,
                ..request(seed::HANG)
            })
            .unwrap();
        daemon.kill();
        let error = client.wait(pending, LONG).unwrap_err();
        let expected = matches!(error, ClientError::ServerLost { may_have_acted, .. } if may_have_acted == execute);
        assert!(expected, "{error}");
        assert_eq!(
            kept.candidate(3).unwrap().knots[2].time_s,
            11.0,
            "the dead daemon's answer stays readable"
        );
    }
}

#[test]
fn a_request_that_killed_its_daemon_is_sent_once_more_to_the_successor() {
    let world = World::new();
    let mut first = world.daemon();
    let mut client = client(&world);
    client.wait_for_daemon(LONG).unwrap();
    thread::scope(|scope| {
        let restart = scope.spawn(|| {
            while first.is_running() {
                thread::sleep(Duration::from_millis(2));
            }
            world.process("daemon_process", "immune")
        });
        let answer = client.plan(&request(seed::POISON), LONG).unwrap();
        assert_eq!(answer.candidates().len(), 4);
        drop(restart.join().unwrap());
    });
}

#[test]
fn a_request_to_execute_is_never_sent_twice() {
    let world = World::new();
    let _daemon = world.daemon();
    let request = PlanRequest {
        execute: true,
        ..request(seed::POISON)
    };
    let error = client(&world).plan(&request, LONG).unwrap_err();
    assert!(
        matches!(
            error,
            ClientError::ServerLost {
                may_have_acted: true,
                ..
            }
        ),
        "{error}"
    );
    assert!(
        error.to_string().contains("look at the controller's state"),
        "{error}"
    );
}

#[test]
fn a_second_daemon_is_refused_by_name_and_a_killed_one_leaves_its_role_at_once() {
    let world = World::new();
    let mut first = world.daemon();
    let mut client = client(&world);
    client.wait_for_daemon(LONG).unwrap();
    let text = world.daemon().error_output();
    assert!(
        text.contains("a planner-daemon already runs here (process "),
        "{text}"
    );
    client.plan(&request(seed::ANSWER), LONG).unwrap();
    first.kill();
    RoleLock::acquire(&world.options, Role::PlannerDaemon).unwrap();
}

#[test]
fn a_successor_with_more_capacity_is_served_once_the_client_looks_again() {
    let world = World::new();
    let mut client = client(&world);
    let mut first = world.daemon();
    client.wait_for_daemon(LONG).unwrap();
    first.kill();
    let text = world.process("daemon_process", "3").error_output();
    assert!(
        text.contains("exists with other capacities, the types being the same"),
        "{text}"
    );
    client
        .wait_for_daemon(Duration::from_millis(300))
        .unwrap_err();
    let _larger = world.process("daemon_process", "3");
    client.wait_for_daemon(LONG).unwrap();
    client.plan(&request(seed::ANSWER), LONG).unwrap();
}

#[test]
fn killed_clients_leave_their_places() {
    let world = World::new();
    let _daemon = world.daemon();
    let mut client = client(&world);
    for _ in 0..4 {
        let mut other = world.process("client_process", "");
        // The other client holds this role once it has a request at work.
        while RoleLock::acquire(&world.options, Role::Robot).is_ok() {
            assert!(other.is_running());
            thread::sleep(Duration::from_millis(2));
        }
        other.kill();
        client.plan(&request(seed::ANSWER), LONG).unwrap();
    }
}

#[test]
fn after_everyone_was_killed_any_start_order_works_without_cleaning_by_hand() {
    let world = World::new();
    for client_first in [true, false] {
        let (mut daemon, mut other) = (world.daemon(), world.process("client_process", ""));
        while RoleLock::acquire(&world.options, Role::Robot).is_ok() {
            thread::sleep(Duration::from_millis(2));
        }
        daemon.kill();
        other.kill();
        if client_first {
            let mut client = client(&world);
            assert!(matches!(
                client.submit(&request(seed::ANSWER)),
                Err(ClientError::NoServer { .. })
            ));
            let _daemon = world.daemon();
            client.plan(&request(seed::ANSWER), LONG).unwrap();
        } else {
            let _daemon = world.daemon();
            client(&world).plan(&request(seed::ANSWER), LONG).unwrap();
        }
    }
}

#[test]
fn a_daemon_killed_at_any_moment_of_its_start_does_not_stand_in_its_successors_way() {
    let world = World::new();
    for milliseconds in 1..=15 {
        let mut daemon = world.daemon();
        thread::sleep(Duration::from_millis(milliseconds));
        daemon.kill();
    }
    let _daemon = world.daemon();
    client(&world).plan(&request(seed::ANSWER), LONG).unwrap();
}
