//! Which scenes count for how long, and what they mean for a motion.

use shared_types::valid::Scene as ValidScene;

use super::*;
use crate::fixtures::{motion, unit_robot};

const LENGTH_M: f64 = 0.5;
const SECOND: i64 = 1_000_000_000;
const NOW: i64 = 100 * SECOND;
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

fn live() -> LiveScene {
    LiveScene::new(LENGTH_M, false)
}

fn take(live: &mut LiveScene, scene: &ValidScene, publisher: u128, now: i64) -> SceneRefusal {
    live.take(&wire(scene), publisher, at(now), |_| true)
        .refusal
}

/// What a scene of one source that was just told means for a motion that begins then.
fn verdict(balls: &[([f64; 3], [f64; 3])], begin_mono_ns: i64) -> Verdict {
    let mut live = live();
    let told = take(&mut live, &scene("a", NOW, balls), 1, NOW);
    assert_eq!(told, SceneRefusal::None);
    certify(&live, 0.0, Timing::from_begin(begin_mono_ns), 0.0)
}

fn certify(live: &LiveScene, from_s: f64, timing: Timing, lag_allowance_s: f64) -> Verdict {
    let (grown, motion) = (unit_robot(), motion());
    let rest = Rest {
        grown: &grown,
        motion: &motion,
        from_s,
        timing,
        stopping_s: 0.0,
        lag_allowance_s,
    };
    live.certify(&rest, &mut Certificates::default())
}

#[test]
fn a_ball_in_the_way_is_seen_and_one_aside_is_not() {
    assert!(verdict(&[], NOW).is_free());
    assert!(!verdict(&[(IN_THE_WAY, [0.0; 3])], NOW).is_free());
    assert!(verdict(&[(ASIDE, [0.0; 3])], NOW).is_free());
}

#[test]
fn a_moving_ball_counts_where_it_will_be() {
    // 5 m away and coming at 1 m/s: far away for a motion of some seconds that begins now, through the body for one that begins
    // when it arrives.
    assert!(motion().duration() < 3.0);
    let coming = [([5.0, 0.0, 0.75], [-1.0, 0.0, 0.0])];
    assert!(verdict(&coming, NOW).is_free());
    assert!(!verdict(&coming, NOW + 5 * SECOND).is_free());
}

#[test]
fn a_ball_that_has_hardly_left_may_still_be_there() {
    // By its velocity it is well clear of the body when the motion begins; it was told to live for 0.5 s.
    let leaving = [([0.15, 0.0, 0.75], [1.0, 0.0, 0.0])];
    assert!(!verdict(&leaving, NOW + 3 * SECOND / 10).is_free());
    assert!(verdict(&leaving, NOW + 2 * SECOND).is_free());
}

#[test]
fn room_for_a_lag_is_asked_for_where_it_is_wanted() {
    // 1.4 s from the body: with a lifetime of 0.5 s behind the end of the motion, but not with one second and a half more.
    let coming = [([8.0, 0.0, 0.75], [-2.0, 0.0, 0.0])];
    let mut live = live();
    take(&mut live, &scene("a", NOW, &coming), 1, NOW);
    let end = motion().duration();
    let timing = Timing::passing(end, NOW + 3 * SECOND, 1.0);
    let late = |allowance| certify(&live, end, timing, allowance);
    assert!(late(0.0).is_free());
    assert!(!late(0.5).is_free());
}

#[test]
fn a_slow_motion_meets_a_ball_that_a_fast_one_leaves_behind() {
    let mut live = live();
    let coming = [([5.0, 0.0, 0.75], [-1.0, 0.0, 0.0])];
    take(&mut live, &scene("a", NOW, &coming), 1, NOW);
    let half = 0.5 * motion().duration();
    assert!(!certify(&live, half, Timing::passing(half, NOW, 0.1), 0.0).is_free());
    assert!(certify(&live, half, Timing::passing(half, NOW, 1.0), 0.0).is_free());
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
    let timing = Timing::from_begin(NOW);
    assert!(!certify(&live, 0.0, timing, 0.0).is_free());
    let leave = ValidScene {
        takes_leave: true,
        ..scene("a", NOW + 1, &[])
    };
    assert_eq!(take(&mut live, &leave, 1, NOW + 1), SceneRefusal::None);
    assert!(certify(&live, 0.0, timing, 0.0).is_free());
    assert_eq!(live.absence(NOW + 2, |_| false), None);
}

#[test]
fn only_what_changed_is_certified_again() {
    let mut live = live();
    let (grown, motion) = (unit_robot(), motion());
    let resting = [(ASIDE, [0.0; 3])];
    let moving = [([9.0, 0.0, 0.75], [0.1, 0.0, 0.0])];
    let versions = |live: &mut LiveScene, told: &ValidScene, begin_mono_ns| {
        assert_eq!(take(live, told, 1, told.stamp_mono_ns), SceneRefusal::None);
        let rest = Rest {
            grown: &grown,
            motion: &motion,
            from_s: 0.0,
            timing: Timing::from_begin(begin_mono_ns),
            stopping_s: 0.0,
            lag_allowance_s: 0.0,
        };
        let mut certificates = Certificates::default();
        assert!(live.certify(&rest, &mut certificates).is_free());
        let held = live
            .sources
            .iter()
            .filter_map(|source| source.told.as_ref());
        let later = Timing::from_begin(begin_mono_ns + SECOND);
        let held: Vec<[bool; 2]> = held
            .map(|told| [rest.timing, later].map(|timing| certificates.hold(told, timing, &rest)))
            .collect();
        (live.versions, held)
    };
    let resting_held = vec![[true, true]];
    assert_eq!(
        versions(&mut live, &scene("a", NOW, &resting), NOW),
        (1, resting_held.clone())
    );
    assert_eq!(
        versions(&mut live, &scene("a", NOW + 1, &resting), NOW),
        (1, resting_held)
    );
    let moving_held = vec![[true, false]];
    assert_eq!(
        versions(&mut live, &scene("a", NOW + 2, &moving), NOW),
        (2, moving_held.clone())
    );
    assert_eq!(
        versions(&mut live, &scene("a", NOW + 3, &moving), NOW),
        (3, moving_held)
    );
}

#[test]
fn a_source_that_falls_silent_is_missed_until_it_speaks_or_leaves() {
    let mut live = live();
    assert_eq!(live.absence(NOW, |_| false), None);
    assert_eq!(
        LiveScene::new(LENGTH_M, true).absence(NOW, |_| false),
        Some(SceneAbsence::Missing)
    );
    take(&mut live, &scene("a", NOW, &[]), 1, NOW);
    let end = NOW + SECOND / 2;
    assert_eq!(live.absence(end - 1, |_| false), None);
    let by_1 = |publisher| publisher == 1;
    assert_eq!(live.absence(end, by_1), None, "its next scene has arrived");
    let absence = live.absence(end, |_| false).unwrap();
    assert!(absence.to_string().contains("\"a\""), "{absence}");
    // Its publisher starts again.
    take(&mut live, &scene("a", end, &[]), 2, end);
    assert_eq!(live.absence(end, |_| false), None);
    assert_eq!(live.sources.len(), 1, "it has taken the dead one's place");
    let leave = ValidScene {
        takes_leave: true,
        ..scene("a", end + SECOND, &[])
    };
    take(&mut live, &leave, 3, end + SECOND);
    assert_eq!(
        live.absence(end + SECOND, |_| false),
        None,
        "anyone may sign it off"
    );
}

#[test]
fn a_publisher_takes_the_place_of_one_that_is_gone_but_not_of_one_that_is_there() {
    for there in [true, false] {
        let mut live = live();
        let ball = [(IN_THE_WAY, [0.0; 3])];
        take(&mut live, &scene("a", NOW, &ball), 1, NOW);
        let next = wire(&scene("a", NOW + 1, &[]));
        let judged = live.take(&next, 2, at(NOW + 1), |publisher| publisher == 1 && there);
        assert_eq!(judged.refusal, SceneRefusal::None);
        let verdict = certify(&live, 0.0, Timing::from_begin(NOW), 0.0);
        assert_eq!(verdict.is_free(), !there);
    }
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
        let told = take(&mut live, &scene("a", stamp, &[]), 1, NOW);
        assert_eq!(told, refusal);
        assert!(live.absence(NOW, |_| false).is_some(), "{refusal}");
    }
    let mut bad = wire(&scene("a", NOW, &[]));
    bad.lifetime_ns = 0;
    assert_eq!(
        live.take(&bad, 1, at(NOW), |_| true).refusal,
        SceneRefusal::Malformed
    );
    bad.protocol_version = 1;
    let judged = live.take(&bad, 1, at(NOW), |_| true);
    assert_eq!(judged.refusal, SceneRefusal::WrongVersion);
    take(&mut live, &scene("a", NOW, &[]), 1, NOW);
    let older = take(&mut live, &scene("a", NOW - 1, &[]), 1, NOW);
    assert_eq!(
        (older, live.absence(NOW, |_| false)),
        (SceneRefusal::Superseded, None)
    );
}

#[test]
fn there_are_so_many_sources_at_most_and_a_name_more_changes_nothing() {
    let mut live = live();
    for index in 0..MOST_SOURCES {
        let told = scene(&format!("source {index}"), NOW, &[]);
        assert_eq!(
            take(&mut live, &told, index as u128, NOW),
            SceneRefusal::None
        );
    }
    let more = take(&mut live, &scene("one more", NOW, &[]), 99, NOW);
    assert_eq!(more, SceneRefusal::TooManySources);
    assert_eq!(live.absence(NOW, |_| false), None);
}
