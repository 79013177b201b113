//! Which scenes count for how long, and what they mean for a motion.

use shared_types::ipc::IpcOptions;
use shared_types::message;
use shared_types::valid::Scene as ValidScene;

use super::*;
use crate::fixtures::{motion, robot_of_sections, unit_robot};
use crate::live_scene::Progress;

mod certified;

const LENGTH_M: f64 = 0.5;
const SECOND: i64 = 1_000_000_000;
const NOW: i64 = 100 * SECOND;
/// When this daemon began.
const BEGUN: i64 = 90 * SECOND;
const WALL: i64 = 1_790_000_000 * SECOND;
/// In the way of the motion from straight on.
const IN_THE_WAY: [f64; 3] = [0.0, 0.0, 0.75];
const ASIDE: [f64; 3] = [2.0, 0.0, 0.75];

fn at(mono_ns: i64) -> Arrival {
    Arrival {
        mono_ns,
        wall_ns: WALL,
    }
}

fn scene(source: &str, stamp_mono_ns: i64, balls: &[([f64; 3], [f64; 3])]) -> ValidScene {
    let ball = |&(centre_m, velocity_m_s): &([f64; 3], [f64; 3])| message::MovingBall {
        centre_m,
        radius_m: 0.1,
        velocity_m_s,
    };
    ValidScene {
        source: SourceName::new(source).unwrap(),
        sequence: 1,
        stamp_mono_ns,
        lifetime_ns: SECOND / 2,
        takes_leave: false,
        balls: balls.iter().map(ball).collect(),
    }
}

fn wire(scene: &ValidScene) -> Box<SceneMessage> {
    let mut wire = Box::new(SceneMessage::ZEROED);
    scene.write(&mut wire).unwrap();
    wire
}

/// Of a daemon before which there was none.
fn live_of(section_length_m: f64, expected: bool) -> LiveScene {
    let folder = tempfile::tempdir_in("/dev/shm").unwrap();
    after_another(&folder, section_length_m, expected)
}

/// Of a daemon that finds in this folder what another one has left.
fn after_another(folder: &tempfile::TempDir, section_length_m: f64, expected: bool) -> LiveScene {
    let options = IpcOptions {
        prefix: "test".to_owned(),
        root: folder.path().to_owned(),
    };
    let memory = SceneMemory::open(&options, 0).unwrap();
    let robot = robot_of_sections(section_length_m);
    LiveScene::recall(memory, robot, expected, BEGUN)
}

fn live() -> LiveScene {
    live_of(LENGTH_M, false)
}

/// These publishers are there from now on.
fn there(live: &mut LiveScene, publishers: &[u128], now: i64) {
    let present = |&id: &u128| PresentPublisher { id, pid: 4711 };
    let present: Vec<PresentPublisher> = publishers.iter().map(present).collect();
    live.attend(&present, now);
}

fn judge(live: &mut LiveScene, wire: &SceneMessage, publisher: u128, now: i64) -> SceneRefusal {
    live.take(wire, publisher, at(now)).unwrap().refusal
}

fn take(live: &mut LiveScene, scene: &ValidScene, publisher: u128, now: i64) -> SceneRefusal {
    judge(live, &wire(scene), publisher, now)
}

fn leave(source: &str, stamp_mono_ns: i64) -> ValidScene {
    ValidScene {
        takes_leave: true,
        ..scene(source, stamp_mono_ns, &[])
    }
}

/// What is left of a motion from its begin on is free of all obstacles that count.
fn is_free(live: &LiveScene) -> bool {
    certify(live, Progress::from_begin(NOW), 0.0).is_ok()
}

/// What a scene of one source that was just published means for a motion that begins then.
fn verdict(balls: &[([f64; 3], [f64; 3])], begin_mono_ns: i64) -> Result<(), InTheWay> {
    let mut live = live();
    let latest = take(&mut live, &scene("a", NOW, balls), 1, NOW);
    assert_eq!(latest, SceneRefusal::None);
    certify(&live, Progress::from_begin(begin_mono_ns), 0.0)
}

fn certify(live: &LiveScene, progress: Progress, lag_allowance_s: f64) -> Result<(), InTheWay> {
    let (padded, motion) = (unit_robot(), motion());
    let rest = RemainingMotion {
        padded: &padded,
        motion: &motion,
        progress,
        stopping_s: 0.0,
        lag_allowance_s,
    };
    live.certify(&rest, &mut Certificates::default())
}

#[test]
fn the_obstacles_of_all_sources_count_together_until_one_takes_its_leave() {
    let mut live = live();
    take(
        &mut live,
        &scene("a", NOW, &[(IN_THE_WAY, [0.0; 3])]),
        1,
        NOW,
    );
    take(&mut live, &scene("b", NOW, &[(ASIDE, [0.0; 3])]), 2, NOW);
    let progress = Progress::from_begin(NOW);
    assert!(certify(&live, progress, 0.0).is_err());
    let left = take(&mut live, &leave("a", NOW + 1), 1, NOW + 1);
    assert_eq!(left, SceneRefusal::None);
    assert!(certify(&live, progress, 0.0).is_ok());
    assert_eq!(live.absence(NOW + 2), None);
}

#[test]
fn a_source_that_falls_silent_is_missed_until_it_speaks_or_leaves() {
    let mut live = live();
    assert_eq!(live.absence(NOW), None);
    assert_eq!(
        live_of(LENGTH_M, true).absence(NOW),
        Some(SceneAbsence::Missing)
    );
    take(&mut live, &scene("a", NOW, &[]), 1, NOW);
    let end = NOW + SECOND / 2;
    assert_eq!(live.absence(end - 1), None);
    let by_1 = |publisher| publisher == 1;
    assert_eq!(
        live.absence_in_motion(end, by_1),
        None,
        "its next scene has arrived"
    );
    let absence = live.absence(end).unwrap();
    assert!(absence.to_string().contains("\"a\""), "{absence}");
    // Its publisher starts again.
    take(&mut live, &scene("a", end, &[]), 2, end);
    assert_eq!(live.absence(end), None);
    assert_eq!(live.sources.len(), 1, "it has taken the dead one's place");
    take(&mut live, &leave("a", end + SECOND), 3, end + SECOND);
    assert_eq!(live.absence(end + SECOND), None, "anyone may sign it off");
}

#[test]
fn what_is_refused_is_named_and_its_source_is_missed() {
    let mut live = live();
    for (stamp, refusal) in [
        (WALL, SceneRefusal::OtherClock),
        (NOW + 1, SceneRefusal::InTheFuture),
        (NOW - SECOND / 2, SceneRefusal::TooOld),
        (0, SceneRefusal::TooOld),
    ] {
        let latest = take(&mut live, &scene("a", stamp, &[]), 1, NOW);
        assert_eq!(latest, refusal);
        assert!(live.absence(NOW).is_some(), "{refusal}");
    }
    let mut bad = wire(&scene("a", NOW, &[]));
    bad.lifetime_ns = 0;
    assert_eq!(judge(&mut live, &bad, 1, NOW), SceneRefusal::Malformed);
    bad.protocol_version = 1;
    assert_eq!(judge(&mut live, &bad, 1, NOW), SceneRefusal::WrongVersion);
    take(&mut live, &scene("a", NOW, &[]), 1, NOW);
    let older = take(&mut live, &scene("a", NOW - 1, &[]), 1, NOW);
    assert_eq!((older, live.absence(NOW)), (SceneRefusal::Superseded, None));
}

#[test]
fn what_was_told_before_the_machine_was_suspended_counts_no_more() {
    let folder = tempfile::tempdir_in("/dev/shm").unwrap();
    let mut live = after_another(&folder, LENGTH_M, false);
    take(&mut live, &scene("a", NOW, &[]), 1, NOW);
    assert_eq!(live.absence(NOW), None);
    live.notice_suspension(SECOND, NOW + 2);
    let absence = live.absence(NOW + 2).unwrap();
    assert!(absence.to_string().contains("\"a\""), "{absence}");
    let told_before = take(&mut live, &scene("a", NOW + 1, &[]), 1, NOW + 3);
    assert_eq!(told_before, SceneRefusal::TooOld);
    assert!(live.absence(NOW + 3).is_some());
    let mut next = after_another(&folder, LENGTH_M, false);
    let told_before = take(&mut next, &scene("a", NOW + 1, &[]), 1, NOW + 3);
    assert_eq!(told_before, SceneRefusal::TooOld, "by the next daemon");
    for mut live in [live, next] {
        take(&mut live, &scene("a", NOW + 2, &[]), 1, NOW + 3);
        assert_eq!(live.absence(NOW + 3), None);
    }
}

#[test]
fn there_are_so_many_sources_at_most_and_one_more_is_missed_while_it_is_there() {
    let mut live = live();
    for index in 0..MAX_SOURCES {
        let latest = scene(&format!("source {index}"), NOW, &[]);
        assert_eq!(
            take(&mut live, &latest, index as u128, NOW),
            SceneRefusal::None
        );
    }
    there(&mut live, &[99], NOW);
    let more = take(&mut live, &scene("one more", NOW, &[]), 99, NOW);
    assert_eq!(more, SceneRefusal::TooManySources);
    let absence = live.absence_in_motion(NOW, |_| false).unwrap().to_string();
    assert!(absence.contains("too many sources"), "{absence}");
    there(&mut live, &[], NOW);
    assert_eq!(live.absence(NOW), None);
}

#[test]
fn a_publisher_that_was_not_heard_is_missed_and_has_some_time_to_speak_in_motion() {
    let mut live = live();
    there(&mut live, &[1], NOW);
    let absence = SceneAbsence::Unheard { pid: 4711 };
    let text = absence.to_string();
    assert!(
        text.contains("a publisher of scenes has not been heard"),
        "{text}"
    );
    assert_eq!(live.absence(NOW), Some(absence));
    assert_eq!(
        live.absence_in_motion(NOW + FIRST_SCENE_TIMEOUT_NS - 1, |_| false),
        None
    );
    let late = NOW + FIRST_SCENE_TIMEOUT_NS;
    there(&mut live, &[1], late);
    assert_eq!(live.absence_in_motion(late, |_| false), Some(absence));
    take(&mut live, &scene("a", late, &[]), 1, late);
    assert_eq!(live.absence(late), None);
    there(&mut live, &[1, 2], late);
    take(&mut live, &leave("a", late), 2, late);
    assert_eq!(live.absence(late), None, "who signs off was heard");
    there(&mut live, &[1, 2, 3], late);
    assert_eq!(live.absence(late), Some(absence));
    there(&mut live, &[1, 2], late);
    assert_eq!(live.absence(late), None, "it was never a source");
}

#[test]
fn a_publisher_whose_scenes_are_refused_is_missed_whatever_the_reason() {
    type Damage = fn(&mut SceneMessage);
    let cases: [(Damage, &str); 4] = [
        (|wire| wire.protocol_version = 1, "\"a\""),
        (|wire| wire.ball_count = u32::MAX, "\"a\""),
        (|wire| wire.source = [200; 32], "malformed"),
        (
            |wire| (wire.source, wire.protocol_version) = ([200; 32], 1),
            "wrong version",
        ),
    ];
    for (damage, named) in cases {
        let mut live = live();
        there(&mut live, &[1], NOW);
        let mut bad = wire(&scene("a", NOW, &[]));
        damage(&mut bad);
        assert_ne!(judge(&mut live, &bad, 1, NOW), SceneRefusal::None);
        let absence = live.absence_in_motion(NOW, |_| false).unwrap().to_string();
        assert!(absence.contains(named), "{absence}");
        take(&mut live, &scene("a", NOW, &[]), 1, NOW);
        assert_eq!(live.absence(NOW), None);
    }
}

#[test]
fn a_name_goes_to_a_publisher_that_came_after_the_one_before_was_gone() {
    let mut live = live();
    there(&mut live, &[1], NOW);
    take(
        &mut live,
        &scene("a", NOW, &[(IN_THE_WAY, [0.0; 3])]),
        1,
        NOW,
    );
    there(&mut live, &[2], NOW + 1);
    assert!(!is_free(&live), "its obstacles count until then");
    let next = take(&mut live, &scene("a", NOW + 1, &[]), 2, NOW + 1);
    assert_eq!((next, live.absence(NOW + 1)), (SceneRefusal::None, None));
    assert!(is_free(&live));
}

#[test]
fn a_second_live_publisher_of_a_name_is_refused_and_missed_and_does_not_inherit() {
    let mut live = live();
    let ball = [(IN_THE_WAY, [0.0; 3])];
    there(&mut live, &[1, 2], NOW);
    take(&mut live, &scene("a", NOW, &ball), 1, NOW);
    let second = wire(&scene("a", NOW, &[]));
    assert_eq!(
        live.take(&second, 2, at(NOW)),
        None,
        "the first may be dead"
    );
    let later = NOW + FIRST_SCENE_TIMEOUT_NS;
    take(&mut live, &scene("a", later, &ball), 1, later);
    let second = wire(&scene("a", later, &[]));
    let refused = judge(&mut live, &second, 2, later);
    assert_eq!(refused, SceneRefusal::NameTaken);
    let absence = live
        .absence_in_motion(later, |_| false)
        .unwrap()
        .to_string();
    assert!(absence.contains("another publisher"), "{absence}");
    // The first one dies: it was alive while the second one was there, so that this is another camera.
    there(&mut live, &[2], later);
    assert_eq!(judge(&mut live, &second, 2, later), SceneRefusal::NameTaken);
    assert!(!is_free(&live));
    // The second one's own leave takes nothing of the first one's.
    take(&mut live, &leave("a", later), 2, later);
    assert_eq!(live.absence(later), None);
    assert!(!is_free(&live));
    let end = later + SECOND / 2;
    assert!(live.absence(end).is_some(), "the first one is missed");
}

#[test]
fn a_killed_publisher_that_nobody_has_cleaned_up_after_yet_gives_its_name_up_once_it_is() {
    let mut live = live();
    there(&mut live, &[1], NOW);
    take(&mut live, &scene("a", NOW, &[]), 1, NOW);
    there(&mut live, &[1, 2], NOW + 1);
    let next = wire(&scene("a", NOW + 1, &[]));
    assert_eq!(live.take(&next, 2, at(NOW + 1)), None);
    assert!(
        live.absence(NOW + 1).is_some(),
        "nothing is executed meanwhile"
    );
    there(&mut live, &[2], NOW + 2);
    assert_eq!(judge(&mut live, &next, 2, NOW + 2), SceneRefusal::None);
    assert_eq!((live.absence(NOW + 2), live.sources.len()), (None, 1));
}

#[test]
fn a_signed_off_source_counts_until_its_lifetime_ends_and_is_not_missed_then() {
    let ball = [(IN_THE_WAY, [0.0; 3])];
    let end = NOW + SECOND / 2;
    let mut live = live();
    take(&mut live, &scene("a", NOW, &ball), 1, NOW);
    take(&mut live, &leave("a", NOW + 1), 2, NOW + 1);
    there(&mut live, &[], end - 1);
    assert!(!is_free(&live));
    assert_eq!(live.absence(end - 1), None);
    assert_eq!(live.absence(end), None);
    there(&mut live, &[], end);
    assert!(is_free(&live));
    // One that speaks again is a source again.
    take(&mut live, &scene("a", end, &ball), 1, end);
    take(&mut live, &leave("a", end + 1), 2, end + 1);
    take(&mut live, &scene("a", end + 2, &ball), 1, end + 2);
    there(&mut live, &[], end + SECOND);
    assert!(live.absence(end + SECOND).is_some());
}

#[test]
fn obstacles_that_make_no_scene_are_no_empty_scene() {
    // In sections of a nanometre every ball is too far away to be one.
    let mut live = live_of(1e-9, false);
    let latest = take(&mut live, &scene("a", NOW, &[(ASIDE, [0.0; 3])]), 1, NOW);
    assert_eq!(latest, SceneRefusal::Malformed);
    let absence = live.absence(NOW).unwrap().to_string();
    assert!(absence.contains("\"a\""), "{absence}");
}

#[test]
fn a_publisher_that_sends_under_two_names_stops_everything_until_it_is_gone() {
    let ball = [(IN_THE_WAY, [0.0; 3])];
    let mut live = live();
    there(&mut live, &[1], NOW);
    let future = take(&mut live, &scene("a", NOW + 1, &ball), 1, NOW);
    assert_eq!(future, SceneRefusal::InTheFuture);
    let other = take(&mut live, &scene("b", NOW, &[]), 1, NOW);
    assert_eq!(other, SceneRefusal::SeveralNames);
    take(&mut live, &scene("a", NOW + 1, &ball), 1, NOW + 1);
    let absence = live.absence_in_motion(NOW + 1, |_| false).unwrap();
    assert!(absence.to_string().contains("one source name"), "{absence}");
    there(&mut live, &[], NOW + 2);
    assert!(!is_free(&live), "what it told under its first name counts");
    let missed = live.absence(NOW + SECOND).unwrap().to_string();
    assert!(missed.contains("\"a\""), "{missed}");
    assert_eq!(live.sources.len(), 1);
}

#[test]
fn a_leave_of_any_age_is_one_and_takes_nothing_of_what_was_told_since() {
    let mut live = live();
    there(&mut live, &[1], NOW);
    let old = take(&mut live, &leave("a", BEGUN - SECOND), 1, NOW);
    assert_eq!((old, live.absence(NOW)), (SceneRefusal::None, None));
    let late = take(&mut live, &leave("a", BEGUN - SECOND), 1, NOW);
    assert_eq!(
        (late, live.absence(NOW)),
        (SceneRefusal::NoSuchSource, None)
    );
    there(&mut live, &[1, 2, 3], NOW);
    let unknown = take(&mut live, &leave("c", NOW), 3, NOW);
    assert_eq!(unknown, SceneRefusal::NoSuchSource);
    take(&mut live, &scene("b", NOW, &[]), 2, NOW);
    there(&mut live, &[1, 2, 3, 4], NOW);
    let before = take(&mut live, &leave("b", NOW - 1), 4, NOW);
    assert_eq!(before, SceneRefusal::None);
    let end = NOW + SECOND / 2;
    assert!(live.absence(end).is_some(), "it was told since");
}

#[test]
fn the_next_daemon_knows_what_this_one_was_told() {
    let folder = tempfile::tempdir_in("/dev/shm").unwrap();
    let mut live = after_another(&folder, LENGTH_M, false);
    there(&mut live, &[7, 8], NOW);
    let resting = scene("camera", NOW, &[([0.5, 0.0, 1.0], [0.0; 3])]);
    assert_eq!(take(&mut live, &resting, 7, NOW), SceneRefusal::None);
    let too_old = scene("lidar", NOW - 2 * SECOND, &[]);
    assert_eq!(take(&mut live, &too_old, 8, NOW), SceneRefusal::TooOld);
    drop(live);
    let mut next = after_another(&folder, LENGTH_M, false);
    there(&mut next, &[], NOW);
    let ended = |name: &str| {
        Some(SceneAbsence::Ended {
            source_name: SourceName::new(name).unwrap(),
        })
    };
    assert_eq!(next.absence(NOW), ended("lidar"));
    assert_eq!(
        take(&mut next, &leave("lidar", NOW + 1), 9, NOW + 1),
        SceneRefusal::None
    );
    assert_eq!(next.absence(NOW + 1), None);
    assert_eq!(
        next.sources[0].latest.as_ref().unwrap().scene.balls,
        resting.balls
    );
    assert_eq!(next.absence(NOW + SECOND / 2), ended("camera"));
    drop(next);
    let third = after_another(&folder, LENGTH_M, false);
    assert_eq!(third.sources.len(), 1);
}
