//! What is heard of several publishers that send at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use shared_types::ipc::IpcOptions;
use shared_types::valid::SourceName;

use super::*;

struct World {
    options: IpcOptions,
    _directory: tempfile::TempDir,
}

fn world() -> World {
    let directory = tempfile::tempdir_in("/dev/shm").unwrap();
    let name = directory.path().file_name().unwrap().to_str().unwrap();
    World {
        options: IpcOptions {
            prefix: name.replace('.', "t"),
            root: directory.path().join("root"),
        },
        _directory: directory,
    }
}

fn send(scenes: &Publisher<SceneMessage>, source: &str, sequence: u32) {
    let mut sample = scenes.loan().unwrap();
    sample.payload_mut().source = SourceName::new(source).unwrap().to_wire();
    sample.payload_mut().sequence = sequence;
    sample.send().unwrap();
}

#[test]
fn who_connects_after_a_flood_is_heard_at_every_call() {
    let world = world();
    let node = IpcNode::create(&world.options, "scene-inbox").unwrap();
    let mut inbox = SceneInbox::open(&node).unwrap();
    let quit = Arc::<AtomicBool>::default();
    let flood = {
        let (options, quit) = (world.options.clone(), Arc::clone(&quit));
        thread::spawn(move || {
            let node = IpcNode::create(&options, "flood").unwrap();
            let scenes = publisher(&node, &scene_service(&node).unwrap()).unwrap();
            while !quit.load(Ordering::Relaxed) {
                send(&scenes, "flood", 1);
            }
        })
    };
    while inbox.waiting.is_empty() {
        assert!(!flood.is_finished(), "the flood has ended");
        inbox.receive();
    }
    let camera = publisher(&node, &scene_service(&node).unwrap()).unwrap();
    let source = SourceName::new("camera").unwrap().to_wire();
    let is_camera = |waiting: &&PendingScene| waiting.scene.source == source;
    let mut unheard = Vec::new();
    for sequence in 1..=2000 {
        send(&camera, "camera", sequence);
        inbox.receive();
        let heard = inbox.waiting.iter().find(is_camera);
        if heard.is_none_or(|camera| camera.scene.sequence != sequence) {
            unheard.push(sequence);
        }
    }
    quit.store(true, Ordering::Relaxed);
    flood.join().unwrap();
    assert!(unheard.is_empty(), "{} of 2000", unheard.len());
}

#[test]
fn a_scene_that_was_not_looked_at_gives_no_way_to_one_of_another_source() {
    let world = world();
    let node = IpcNode::create(&world.options, "scene-inbox").unwrap();
    let mut inbox = SceneInbox::open(&node).unwrap();
    let topic = scene_status_service(&node).unwrap();
    let statuses = subscriber(&node, &topic).unwrap();
    let port = publisher(&node, &scene_service(&node).unwrap()).unwrap();
    for (source, sequence) in [("a", 1), ("a", 2), ("b", 3)] {
        send(&port, source, sequence);
        inbox.receive();
    }
    assert_eq!(inbox.waiting.len(), 1);
    assert_eq!(inbox.waiting[0].scene.sequence, 2);
    assert!(inbox.publisher_of(0).1);
    let accepted = SceneVerdict {
        refusal: SceneRefusal::None,
        invalid: None,
        balls: 0,
    };
    inbox.judge(0, 1, |_, _| Some(accepted));
    let said = std::iter::from_fn(|| statuses.receive().unwrap());
    let said: Vec<[u32; 2]> = said.map(|said| [said.sequence, said.refusal]).collect();
    let refused = SceneRefusal::SeveralNames.code();
    assert_eq!(said, [[2, 0], [3, refused]]);
    assert!(!inbox.publisher_of(0).1);
}

/// Four publishers whose scenes of 1024 balls each take 8 ms, and send a new one each millisecond.
#[test]
fn each_of_several_costly_publishers_has_its_turn() {
    const MILLISECOND: i64 = 1_000_000;
    let mut waiting: Vec<PendingScene> = (0..4)
        .map(|publisher| PendingScene {
            publisher,
            scene: Box::new(SceneMessage {
                ball_count: 1024,
                ..SceneMessage::ZEROED
            }),
            new_since_mono_ns: Some(0),
            not_before_mono_ns: 0,
            other: None,
            said: SceneRefusal::None,
        })
        .collect();
    let (mut now, mut seen, mut longest) = (0, [0; 4], 0);
    while now < 2000 * MILLISECOND {
        for waiting in &mut waiting {
            waiting.new_since_mono_ns.get_or_insert(now);
        }
        let Some(index) = next(&waiting, now) else {
            now += MILLISECOND;
            continue;
        };
        longest = longest.max(now - seen[index]);
        seen[index] = now;
        now += 8 * MILLISECOND;
        waiting[index].new_since_mono_ns = None;
        waiting[index].not_before_mono_ns = now + MAX_IDLE_NS;
    }
    longest = seen
        .iter()
        .fold(longest, |longest, seen| longest.max(now - seen));
    assert!(
        longest < PENDING_GRACE_NS / 2,
        "{} ms",
        longest / MILLISECOND
    );
}
