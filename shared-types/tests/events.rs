//! Events over real sockets, each test under a root and a prefix of its own.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot set up its world has to stop"
)]

mod world;

use std::io::Write;
use std::os::fd::AsFd;
use std::time::{Duration, Instant};

use shared_types::ipc::*;
use world::{daemon_and_user, world};

#[test]
fn who_listens_is_told_that_an_answer_was_sent_however_often_it_did_not_listen() {
    let world = world();
    let [daemon, user] = daemon_and_user(&world);
    let listener = event_listener(&user, &plan_answered_event(&user).unwrap()).unwrap();
    let notifier = event_notifier(&daemon, &plan_answered_event(&daemon).unwrap()).unwrap();
    let heard = |limit| listener.wait(None, limit).unwrap();
    assert!(!heard(Duration::from_millis(1)));
    for _ in 0..1000 {
        assert_eq!(notifier.notify().unwrap(), 1, "one listener is reached");
    }
    assert!(heard(Duration::from_secs(60)));
    assert!(!heard(Duration::from_millis(1)), "it was told once");
}

#[test]
fn who_listens_is_woken_by_another_file_too() {
    let world = world();
    let node = IpcNode::create(&world.options, "daemon").unwrap();
    let listener = event_listener(&node, &plan_asked_event(&node).unwrap()).unwrap();
    let (reader, mut writer) = std::io::pipe().unwrap();
    writer.write_all(&[1]).unwrap();
    let begun = Instant::now();
    let told = listener.wait(Some(reader.as_fd()), Duration::from_secs(3600));
    assert!(!told.unwrap(), "nothing was sent");
    assert!(begun.elapsed() < Duration::from_secs(60));
}

#[test]
fn who_takes_the_place_of_a_listener_is_told_by_all_notifiers() {
    let world = world();
    let node = IpcNode::create(&world.options, "user").unwrap();
    let event = plan_answered_event(&node).unwrap();
    let notifiers = [(); 2].map(|()| event_notifier(&node, &event).unwrap());
    for _ in 0..2 {
        let listeners = [(); 2].map(|()| event_listener(&node, &event).unwrap());
        for notifier in &notifiers {
            assert_eq!(notifier.notify().unwrap(), 2);
            for listener in &listeners {
                assert!(listener.wait(None, Duration::from_secs(60)).unwrap());
            }
        }
    }
    assert_eq!(notifiers[0].notify().unwrap(), 0);
}

#[test]
fn a_root_is_as_long_as_sockets_allow() {
    let world = world();
    let begin = world.options.root.as_os_str().len() + world.options.prefix.len();
    let with_length = |length: usize| {
        let mut options = world.options.clone();
        options.root = options.root.join("r".repeat(length - begin - 1));
        let node = IpcNode::create(&options, "user")?;
        event_listener(&node, &plan_answered_event(&node)?).map(drop)
    };
    with_length(LONGEST_ROOT_AND_PREFIX).unwrap();
    let error = with_length(LONGEST_ROOT_AND_PREFIX + 1).unwrap_err();
    assert!(matches!(error, IpcError::Root { .. }), "{error}");
    assert!(
        error
            .to_string()
            .contains(&format!("at most {LONGEST_ROOT_AND_PREFIX}")),
        "{error}"
    );
}
