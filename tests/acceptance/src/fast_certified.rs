//! What is certified before anything is filled in, in unseen scenes, and what default then answers.

use std::collections::BTreeMap;

use pcc_model::Robot;
use serde_json::Value;
use tests::programs::repository;

use crate::fast_cases::{Cases, GENERAL, HARD, PLANNERS, REFERENCE, count};
use crate::motions::Motions;
use crate::report::Report;
use crate::runs::number;
use crate::scale::Scale;

/// Share of the requests with at least one certified candidate, %.
const ANY_AT_LEAST: f64 = 99.9;

/// What is asked of a kind of scenes.
struct Bars {
    /// `fast`, certified among its first ten draws, %.
    certified: f64,
    /// `fast` over `straight`, percentage points.
    over_straight: f64,
    /// Median tip length ÷ distance; none: below straight's.
    tip_ratio: Option<f64>,
}

const EASY: Bars = Bars {
    certified: 98.0,
    over_straight: -0.5,
    tip_ratio: Some(1.03),
};
const IN_REFERENCE: Bars = Bars {
    certified: 99.0,
    ..EASY
};
const IN_HARD: Bars = Bars {
    certified: 85.0,
    over_straight: 8.0,
    tip_ratio: None,
};

type Make = fn(Scale) -> anyhow::Result<Cases>;

/// The settings, how they are made, and their bars; none for scenes of which no bar speaks.
const SETTINGS: [(&str, Make, Option<Bars>); 5] = [
    (
        "reference sample",
        |_| Ok(Cases::sample()),
        Some(IN_REFERENCE),
    ),
    (
        "reference",
        |scale| Cases::unseen(&REFERENCE, count(scale)),
        Some(IN_REFERENCE),
    ),
    (
        "general",
        |scale| Cases::unseen(&GENERAL, count(scale)),
        Some(EASY),
    ),
    (
        "hard",
        |scale| Cases::unseen(&HARD, count(scale)),
        Some(IN_HARD),
    ),
    (
        "8 to 16 balls, whoever solves them",
        |scale| Cases::crowded(count(scale)),
        None,
    ),
];

pub(crate) fn run(report: &mut Report, scale: Scale) {
    let command =
        "pcc dataset --method cases --test-only --seed 9011|9012|9013; pcc evaluate --planner …";
    for (name, make, bars) in SETTINGS {
        report.group(&format!("certified, {name}"), command, |report| {
            certified(report, scale, &make(scale)?, bars.as_ref())
        });
    }
    report.group("requests with at least one", command, |report| {
        with_at_least_one(report, scale)
    });
}

fn certified(
    report: &mut Report,
    scale: Scale,
    cases: &Cases,
    bars: Option<&Bars>,
) -> anyhow::Result<()> {
    let robot = Robot::from_file(&repository().join("config/robots/unit.toml"))?;
    let name = cases.name;
    let mut all = BTreeMap::new();
    for planner in PLANNERS {
        let evaluation = cases.evaluation(planner);
        let (result, motions) = cases.run(report, scale, &evaluation)?;
        report.shown(&format!("{name}: {planner}"), row(&result, &motions)?);
        let judged = motions.judge(&robot, scale.pick(1, 4));
        judged.check(report, &format!("{name}: {planner}"));
        all.insert(planner, (result, motions));
    }
    let (explored, found, counted) = all["fast"].1.explored();
    let line = format!(
        "{name}: fast, {explored} cases explored, {found} motions found there, certified ones among them"
    );
    report.none_of(&line, &counted);
    if let Some(bars) = bars {
        shares(report, name, bars, &all["fast"], &all["straight"])?;
        tip_ratios(report, name, bars, &all["fast"].0, &all["straight"].0)?;
    }
    share_of_the_network(report, name, &all["fast"].0, &all["straight-drawn"].0)?;
    let motions: Vec<&Motions> = all.values().map(|(_, motions)| motions).collect();
    feasible(report, name, &all["default"].1, &motions);
    Ok(())
}

fn row(result: &Value, motions: &Motions) -> anyhow::Result<String> {
    Ok(format!(
        "certified before fallback {:.2} % ({}), delivered {:.2} %, answered {:.2} % (with a certified one of those asked for {:.2} %), tip length ÷ distance {:.3}, tip smoothness {:.3e}, duration {:.2} s, modes {:.2}, {:.2} ms (p99 {:.2})",
        100.0 * number(result, "/share_before_fallback")?,
        of_those_drawn(motions),
        100.0 * number(result, "/share_delivered")?,
        100.0 * number(result, "/answered_any")?,
        100.0 * number(result, "/success_any")?,
        number(result, "/tip_length_ratio/median")?,
        number(result, "/tip_smoothness/median")?,
        number(result, "/duration_s/median")?,
        number(result, "/modes/mean")?,
        1e3 * number(result, "/seconds/median")?,
        1e3 * number(result, "/seconds/p99")?,
    ))
}

/// `straight` and `straight-drawn` draw one segment to each goal configuration, the others as many paths as are asked for; what
/// `default` fills in counts as a draw.
fn of_those_drawn(motions: &Motions) -> String {
    let (draws, share) = motions.of_those_drawn();
    format!("{:.2} % of the {draws} drawn or filled in", 100.0 * share)
}

fn shares(
    report: &mut Report,
    name: &str,
    bars: &Bars,
    fast: &(Value, Motions),
    straight: &(Value, Motions),
) -> anyhow::Result<()> {
    let share = 100.0 * number(&fast.0, "/share_before_fallback")?;
    let [certified, null_arm] = [fast, straight].map(|(_, motions)| 100.0 * motions.share());
    let delivered = 100.0 * number(&fast.0, "/share_delivered")?;
    let line = format!("{name}: fast, certified before fallback among the first ten draws");
    let figure = format!("{share:.2} % (with what exploring adds {delivered:.2} %)");
    let passed = share >= bars.certified && (certified - share).abs() < 1e-6;
    let bar = format!(">= {} %, and as many as paths.npz has", bars.certified);
    report.check(&line, figure, &bar, passed);
    let line = format!("{name}: fast over straight, points of certified draws");
    let [ours, theirs] = [fast, straight].map(|(_, motions)| of_those_drawn(motions));
    let figure = format!(
        "{:+.2} (straight {null_arm:.2} %; fast {ours}, straight {theirs})",
        share - null_arm
    );
    // Both are counts of draws: half a point is half a point, whatever the last bit says.
    let passed = share - null_arm >= bars.over_straight - 1e-9;
    report.check(
        &line,
        figure,
        &format!(">= {:+}", bars.over_straight),
        passed,
    );
    Ok(())
}

fn tip_ratios(
    report: &mut Report,
    name: &str,
    bars: &Bars,
    fast: &Value,
    straight: &Value,
) -> anyhow::Result<()> {
    let [fast, straight] =
        [fast, straight].map(|result| number(result, "/tip_length_ratio/median"));
    let (fast, straight) = (fast?, straight?);
    let line = format!("{name}: fast, median tip length ÷ distance");
    let figure = format!("{fast:.3} (straight {straight:.3})");
    match bars.tip_ratio {
        Some(bar) => report.check(&line, figure, &format!("<= {bar}"), fast <= bar),
        None => report.check(&line, figure, "< straight's", fast < straight),
    }
    Ok(())
}

/// What is the network's, and not that of what its paths go through after sampling.
fn share_of_the_network(
    report: &mut Report,
    name: &str,
    fast: &Value,
    drawn: &Value,
) -> anyhow::Result<()> {
    let both = |path: &str| {
        let [fast, drawn] = [fast, drawn].map(|result| number(result, path));
        Ok::<_, anyhow::Error>((fast?, drawn?))
    };
    let (certified, drawn_certified) = both("/share_before_fallback")?;
    let (ratio, drawn_ratio) = both("/tip_length_ratio/median")?;
    let (smoothness, drawn_smoothness) = both("/tip_smoothness/median")?;
    let line = format!("{name}: the network's share, fast beside straight-drawn");
    let figure = format!(
        "certified {:+.2} points, tip length ÷ distance {:+.3} ({ratio:.3} and {drawn_ratio:.3}), tip smoothness × {:.3} ({smoothness:.3e} and {drawn_smoothness:.3e})",
        100.0 * (certified - drawn_certified),
        ratio - drawn_ratio,
        smoothness / drawn_smoothness,
    );
    report.shown(&line, figure);
    Ok(())
}

/// Feasible: a certified path is known, whoever found it.
fn feasible(report: &mut Report, name: &str, default: &Motions, all: &[&Motions]) {
    let is_feasible = |case: usize| all.iter().any(|motions| motions.is_answered(case));
    let feasible: Vec<usize> = (0..default.cases())
        .filter(|&case| is_feasible(case))
        .collect();
    let answered = feasible.iter().filter(|&&case| default.is_answered(case));
    let line = format!("{name}: feasible requests answered by default");
    report.all_of(&line, answered.count(), feasible.len());
}

/// `fast` is judged by its ten draws, without what exploring finds; `default` by what it delivers, as its clients get it.
fn with_at_least_one(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    for unseen in [&REFERENCE, &GENERAL, &HARD] {
        let cases = Cases::unseen(unseen, count(scale))?;
        let name = cases.name;
        let (_, fast) = cases.run(report, scale, &cases.evaluation("fast"))?;
        let (_, default) = cases.run(report, scale, &cases.evaluation("default"))?;
        let certified = |case: &usize| fast.certified(*case).next().is_some();
        let line = format!(
            "{name}: fast, requests with at least one certified among the ten draws, without exploring"
        );
        at_least_one(report, &line, fast.cases(), certified);
        let answered = (0..fast.cases()).filter(|&case| fast.is_answered(case));
        let line = format!("{name}: fast, requests answered with what exploring finds");
        let figure = format!("{} of {}", answered.count(), fast.cases());
        report.shown(&line, figure);
        let line = format!("{name}: default, requests with at least one certified candidate");
        let answered = |case: &usize| default.is_answered(*case);
        at_least_one(report, &line, default.cases(), answered);
    }
    Ok(())
}

fn at_least_one(report: &mut Report, line: &str, cases: usize, has: impl Fn(&usize) -> bool) {
    let count = (0..cases).filter(has).count();
    let share = 100.0 * count as f64 / cases as f64;
    let figure = format!("{share:.2} % ({count} of {cases})");
    let bar = format!(">= {ANY_AT_LEAST} %");
    report.check(line, figure, &bar, share >= ANY_AT_LEAST);
}
