//! When a motion is certified beside a scene, and when again.

use pcc_model::Point;

use super::*;
use crate::live_scene::Timing;
use crate::live_scene::moving_ball_cover::Stretch;

fn passing(time_s: f64, mono_ns: i64, rate: f64) -> Progress {
    Progress {
        time_s,
        mono_ns,
        rate,
    }
}

fn is_on_the_way(verdict: Result<(), InTheWay>) -> bool {
    matches!(verdict, Err(InTheWay::OnTheWay { .. }))
}

#[test]
fn a_ball_in_the_way_is_seen_and_one_aside_is_not() {
    assert!(verdict(&[], NOW).is_ok());
    assert!(verdict(&[(IN_THE_WAY, [0.0; 3])], NOW).is_err());
    assert!(verdict(&[(ASIDE, [0.0; 3])], NOW).is_ok());
}

#[test]
fn a_moving_ball_counts_where_it_will_be() {
    // 5 m away and coming at 1 m/s: far away for a motion of some seconds that begins now, through the body for one that begins
    // when it arrives.
    assert!(motion().duration() < 3.0);
    let coming = [([5.0, 0.0, 0.75], [-1.0, 0.0, 0.0])];
    assert_eq!(verdict(&coming, NOW), Err(InTheWay::AtTheEnd));
    assert!(is_on_the_way(verdict(&coming, NOW + 5 * SECOND)));
}

#[test]
fn a_ball_that_comes_to_the_end_is_named_after_one_that_comes_before_it() {
    let mut live = live();
    let (padded, end) = (unit_robot(), motion().end());
    let tip = padded.tip(&end) * LENGTH_M;
    let coming = |beside_m: f64| [([tip.x + beside_m, tip.y + 9.0, tip.z], [0.0, -1.0, 0.0])];
    let progress = Progress::from_begin(NOW);
    take(&mut live, &scene("a", NOW, &coming(0.3)), 1, NOW);
    assert_eq!(certify(&live, progress, 0.0), Ok(()), "it passes beside");
    take(&mut live, &scene("b", NOW, &coming(0.0)), 2, NOW);
    let found = certify(&live, progress, 0.0);
    assert_eq!(found, Err(InTheWay::AtTheEnd));
    take(
        &mut live,
        &scene("c", NOW, &[(IN_THE_WAY, [0.0; 3])]),
        3,
        NOW,
    );
    assert!(is_on_the_way(certify(&live, progress, 0.0)));
}

#[test]
fn a_ball_that_has_hardly_left_may_still_be_there() {
    // By its velocity it is well clear of the body when the motion begins; it was told to live for 0.5 s.
    let leaving = [([0.15, 0.0, 0.75], [1.0, 0.0, 0.0])];
    assert!(verdict(&leaving, NOW + 3 * SECOND / 10).is_err());
    assert!(verdict(&leaving, NOW + 2 * SECOND).is_ok());
}

#[test]
fn room_for_a_lag_is_asked_for_where_it_is_wanted() {
    // 1.75 s from the body: with a lifetime of 0.5 s and 0.35 s without supervision behind the end of the motion, but not with 0.5 s more.
    let coming = [([8.7, 0.0, 0.75], [-2.0, 0.0, 0.0])];
    let mut live = live();
    take(&mut live, &scene("a", NOW, &coming), 1, NOW);
    let end = motion().duration();
    let progress = passing(end, NOW + 3 * SECOND, 1.0);
    let late = |allowance| certify(&live, progress, allowance);
    assert_eq!(late(0.0), Err(InTheWay::AtTheEnd));
    assert!(is_on_the_way(late(0.5)));
}

#[test]
fn a_slow_motion_meets_a_ball_that_a_fast_one_leaves_behind() {
    let mut live = live();
    let coming = [([5.0, 0.0, 0.75], [-1.0, 0.0, 0.0])];
    take(&mut live, &scene("a", NOW, &coming), 1, NOW);
    let half = 0.5 * motion().duration();
    let at_rate = |rate| certify(&live, passing(half, NOW, rate), 0.0);
    assert!(is_on_the_way(at_rate(0.1)));
    assert_eq!(at_rate(1.0), Err(InTheWay::AtTheEnd));
}

#[test]
fn a_slow_motion_that_may_speed_up_before_its_controller_says_so_is_certified_at_full_rate_too() {
    let (padded, motion) = (unit_robot(), motion());
    let half = 0.5 * motion.duration();
    let tip = |ahead_s: f64| padded.tip(&motion.at(half + ahead_s).position);
    let onward = (tip(0.45) - tip(0.0)).normalize();
    let across = onward.cross(&tip(0.45)).normalize();
    let only_if_slow = |before: f64| {
        // It crosses the way before the robot now, and is gone when the slow motion comes there.
        let centre: Point = (tip(0.45) + onward * before) * LENGTH_M;
        let mut live = live();
        let crossing = scene("a", NOW, &[(centre.into(), across.into())]);
        take(&mut live, &crossing, 1, NOW);
        let rest = RemainingMotion {
            padded: &padded,
            motion: &motion,
            progress: passing(half, NOW, 0.05),
            stopping_s: 0.0,
            lag_allowance_s: 0.0,
        };
        let latest = live.sources[0].latest.as_ref().unwrap();
        let (rate, whole) = rest.stretches().next().unwrap();
        let is_free_if_slow = latest.certify(&rest, rate, whole).is_ok();
        is_free_if_slow && live.certify(&rest, &mut Certificates::default()).is_err()
    };
    let before = (0..100).map(|i| 0.01 * f64::from(i));
    assert!(before.filter(|&before| only_if_slow(before)).count() > 0);
}

#[test]
fn only_what_changed_is_certified_again() {
    let mut live = live();
    let (padded, motion) = (unit_robot(), motion());
    let resting = [(ASIDE, [0.0; 3])];
    let moving = [([9.0, 0.0, 0.75], [0.1, 0.0, 0.0])];
    let versions = |live: &mut LiveScene, latest: &ValidScene, begin_mono_ns| {
        assert_eq!(
            take(live, latest, 1, latest.stamp_mono_ns),
            SceneRefusal::None
        );
        let rest = RemainingMotion {
            padded: &padded,
            motion: &motion,
            progress: Progress::from_begin(begin_mono_ns),
            stopping_s: 0.0,
            lag_allowance_s: 0.0,
        };
        let mut certificates = Certificates::default();
        assert!(live.certify(&rest, &mut certificates).is_ok());
        let held = live
            .sources
            .iter()
            .filter_map(|source| source.latest.as_ref());
        let later = Timing::from_begin(begin_mono_ns + SECOND);
        let certificate = |version, timing| Certificate {
            version,
            rate: RateAssumption::MeasuredRate,
            stretch: Stretch {
                timing,
                until_s: motion.duration(),
            },
        };
        let held: Vec<[bool; 2]> = held
            .map(|latest| {
                let wanted = [rest.progress.timing(), later]
                    .map(|timing| certificate(latest.version, timing));
                wanted.map(|wanted| certificates.hold(&wanted, latest.moves(), 0.0))
            })
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
fn a_longer_lifetime_of_moving_balls_is_certified_anew() {
    let mut live = live();
    for (velocity, versions) in [([0.0; 3], 1), ([0.1, 0.0, 0.0], 3)] {
        let latest = scene("a", NOW, &[([9.0, 0.0, 0.75], velocity)]);
        let longer = ValidScene {
            lifetime_ns: 2 * latest.lifetime_ns,
            ..latest.clone()
        };
        take(&mut live, &latest, 1, NOW);
        take(&mut live, &longer, 1, NOW);
        assert_eq!(live.versions, versions);
        let end = NOW + longer.lifetime_ns;
        assert_eq!(live.absence(end - 1), None);
        assert!(live.absence(end).is_some());
    }
}
