//! Tip length, tip smoothness and modes beside RRT-Connect and straight segments, and what each takes.

use collision::Scene;
use pcc_model::{Configuration, Robot};
use planning::{modes, path_metrics};
use serde_json::Value;
use tests::programs::repository;

use crate::fast_cases::{Cases, GENERAL, HARD, PLANNERS, REFERENCE, count};
use crate::fast_picture::{Curve, draw};
use crate::runs::{CANDIDATES, Unseen, folder, number};
use crate::second_look::Motions;
use crate::spread::median;
use crate::{Report, Scale};

/// Share of the cases on which `fast` is ahead, %.
const AHEAD_AT_LEAST: f64 = 90.0;
const TREE: &str = "rrt-connect";
/// Candidates at the points of the picture.
const POINTS: [usize; 5] = [1, 2, 4, 10, 32];

pub(crate) fn run(report: &mut Report, scale: Scale) {
    for unseen in [REFERENCE, GENERAL, HARD] {
        let command = format!("{}; pcc evaluate --planner …", unseen.command());
        report.group(&format!("quality, {}", unseen.name), &command, |report| {
            quality(report, scale, &unseen)
        });
    }
    let command = "pcc evaluate --planner … --candidates …";
    report.group("time and tip length", command, |report| {
        for unseen in [GENERAL, HARD] {
            picture(report, scale, &unseen)?;
        }
        Ok(())
    });
}

/// Figures of a case's certified candidates, one value each.
#[derive(Default)]
struct Figures {
    tip_length: Vec<f64>,
    tip_length_ratio: Vec<f64>,
    smoothness: Vec<f64>,
    duration: Vec<f64>,
    ends: Vec<Configuration>,
}

/// Of every case.
fn figures(robot: &Robot, motions: &Motions) -> anyhow::Result<Vec<Figures>> {
    let case = |case: usize| {
        let mut figures = Figures::default();
        for slot in motions.certified(case) {
            let motion = motions.motion(slot)?;
            // The clearance is not wanted here.
            let metrics = path_metrics(robot, &Scene::default(), &motion);
            figures.tip_length.push(metrics.tip_length);
            let ratio = metrics.tip_length / metrics.tip_distance;
            figures.tip_length_ratio.push(ratio);
            figures.smoothness.push(metrics.tip_smoothness);
            figures.duration.push(metrics.duration_s);
            figures.ends.push(motion.at(motion.duration()).position);
        }
        Ok(figures)
    };
    (0..motions.cases()).map(case).collect()
}

/// What a planner did with all cases.
struct Candidates {
    planner: &'static str,
    result: Value,
    cases: Vec<Figures>,
}

impl Candidates {
    fn of(
        report: &Report,
        scale: Scale,
        cases: &Cases,
        planner: &'static str,
        candidates: usize,
    ) -> anyhow::Result<Self> {
        let robot = Robot::from_file(&repository().join("config/robots/unit.toml"))?;
        let evaluation = cases.evaluation(planner).candidates(candidates);
        let (result, motions) = cases.run(report, scale, &evaluation)?;
        let cases = figures(&robot, &motions)?;
        Ok(Self {
            planner,
            result,
            cases,
        })
    }

    fn median_ms(&self) -> anyhow::Result<f64> {
        Ok(1e3 * number(&self.result, "/seconds/median")?)
    }

    fn mean_modes(&self) -> f64 {
        let modes = self.cases.iter().map(|case| modes(&case.ends));
        modes.sum::<usize>() as f64 / self.cases.len() as f64
    }
}

/// What is good if it is small.
struct Good {
    name: &'static str,
    of: fn(&Figures) -> &[f64],
}

const GOODS: [Good; 2] = [
    Good {
        name: "tip length",
        of: |figures| &figures.tip_length,
    },
    Good {
        name: "tip smoothness",
        of: |figures| &figures.smoothness,
    },
];

/// One value for all candidates of a case; without candidates it is infinite.
type Summary = fn(&[f64]) -> f64;

fn middle(values: &[f64]) -> f64 {
    if values.is_empty() {
        return f64::INFINITY;
    }
    median(values)
}

fn least(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::INFINITY, f64::min)
}

/// Share of the cases, %, on which `ours` is ahead of all rivals in all goods; those that nobody solves do not count.
fn ahead(ours: &Candidates, rivals: &[&Candidates], goods: &[Good], of: Summary) -> f64 {
    let value =
        |candidates: &Candidates, good: &Good, case: usize| of((good.of)(&candidates.cases[case]));
    let is_ahead = |case: usize| {
        let mut pairs = goods
            .iter()
            .flat_map(|good| rivals.iter().map(move |rival| (good, rival)));
        pairs.all(|(good, rival)| value(ours, good, case) < value(rival, good, case))
    };
    let is_solved = |case: usize| {
        let mut all = rivals.iter().copied().chain([ours]);
        all.any(|candidates| !candidates.cases[case].duration.is_empty())
    };
    let solved: Vec<usize> = (0..ours.cases.len())
        .filter(|&case| is_solved(case))
        .collect();
    let ahead = solved.iter().filter(|&&case| is_ahead(case)).count();
    100.0 * ahead as f64 / solved.len().max(1) as f64
}

fn quality(report: &mut Report, scale: Scale, unseen: &Unseen) -> anyhow::Result<()> {
    let cases = Cases::unseen(unseen, count(scale))?;
    let name = cases.name;
    let of = |planner, candidates| Candidates::of(report, scale, &cases, planner, candidates);
    let [default, fast, straight, tree] =
        ["default", "fast", "straight", TREE].map(|planner| of(planner, CANDIDATES));
    let (default, fast, straight, tree) = (default?, fast?, straight?, tree?);
    let affordable = CANDIDATES as f64 * fast.median_ms()? / tree.median_ms()?;
    let affordable = (affordable as usize).clamp(1, 64);
    let in_its_time = of(TREE, affordable)?;
    let equal_number = format!("{CANDIDATES} candidates each");
    let equal_time = format!("{TREE} with the {affordable} candidates that fast's time allows");
    for (terms, tree) in [(equal_number, &tree), (equal_time, &in_its_time)] {
        for ours in [&fast, &default] {
            beside_the_rivals(report, &format!("{name}, {terms}"), ours, [tree, &straight]);
        }
        modes_beside(report, &format!("{name}, {terms}"), [&default, &fast], tree);
    }
    durations(report, name, [&default, &fast, &tree], &straight);
    Ok(())
}

/// `fast` is judged, by the medians of a case's candidates; everything else is shown.
fn beside_the_rivals(
    report: &mut Report,
    terms: &str,
    ours: &Candidates,
    rivals: [&Candidates; 2],
) {
    let planner = ours.planner;
    for good in &GOODS {
        let good = std::slice::from_ref(good);
        let what = good[0].name;
        let share = |rivals: &[&Candidates], of| format!("{:.1} %", ahead(ours, rivals, good, of));
        let line = format!("{terms}: {planner} ahead of both in {what}");
        let of_each = rivals.map(|rival| {
            let [middle, best] = [middle as Summary, least].map(|of| share(&[rival], of));
            format!("{}: {middle}, best candidate {best}", rival.planner)
        });
        let both = ahead(ours, &rivals, good, middle);
        let figure = format!("{both:.1} % of the cases ({})", of_each.join("; "));
        report.shown(&line, figure);
    }
    let line = format!("{terms}: {planner} ahead of both in tip length and tip smoothness at once");
    let share = ahead(ours, &rivals, &GOODS, middle);
    let figure = format!("{share:.1} % of the cases");
    if planner == "fast" {
        let bar = format!(">= {AHEAD_AT_LEAST} %");
        report.check(&line, figure, &bar, share >= AHEAD_AT_LEAST);
    } else {
        report.shown(&line, figure);
    }
}

/// What a request is given is judged; before filling, a draw that is not certified is a mode less.
fn modes_beside(
    report: &mut Report,
    terms: &str,
    [default, fast]: [&Candidates; 2],
    tree: &Candidates,
) {
    let [default, fast, theirs] = [default, fast, tree].map(Candidates::mean_modes);
    let line = format!("{terms}: modes of default's candidates, mean");
    let figure = format!("{default:.3} (fast before filling {fast:.3})");
    let bar = format!(">= {theirs:.3} ({TREE})");
    report.check(&line, figure, &bar, default >= theirs);
}

/// `pcc evaluate` selects by `shortest time`: a case's fastest candidate.
fn durations(report: &mut Report, name: &str, all: [&Candidates; 3], straight: &Candidates) {
    let fastest = |candidates: &Candidates, case: usize| least(&candidates.cases[case].duration);
    let cases = 0..straight.cases.len();
    for candidates in all {
        let ratios = cases
            .clone()
            .map(|case| fastest(candidates, case) / fastest(straight, case));
        let ratios: Vec<f64> = ratios.filter(|ratio| ratio.is_finite()).collect();
        let line = format!(
            "{name}: {}, fastest motion ÷ straight's fastest, median",
            candidates.planner
        );
        report.shown(&line, format!("{:.3}", median(&ratios)));
    }
    let default = all[0];
    let is_slower = |case: &usize| fastest(default, *case) > fastest(straight, *case) + 1e-9;
    let slower = cases.filter(is_slower).map(|case| {
        let [ours, theirs] = [default, straight].map(|candidates| fastest(candidates, case));
        format!("case {case}: {ours:.6} s beside {theirs:.6} s")
    });
    let slower: Vec<String> = slower.collect();
    let line =
        format!("{name}: default selects by shortest time a motion slower than straight's fastest");
    report.none_of(&line, &slower);
}

/// Time of a request against the shortest tip among its candidates, for more and more of them.
fn picture(report: &mut Report, scale: Scale, unseen: &Unseen) -> anyhow::Result<()> {
    let cases = Cases::unseen(unseen, count(scale))?.first(scale.pick(10, 100));
    let mut curves = Vec::new();
    for planner in PLANNERS {
        let mut curve = Curve {
            name: planner,
            points: Vec::new(),
        };
        let mut texts = Vec::new();
        for number in POINTS {
            let candidates = Candidates::of(report, scale, &cases, planner, number)?;
            let solved = candidates
                .cases
                .iter()
                .map(|case| least(&case.tip_length_ratio));
            let solved: Vec<f64> = solved.filter(|ratio| ratio.is_finite()).collect();
            let point = (candidates.median_ms()?, median(&solved));
            texts.push(format!("{number}: {:.2} ms, {:.3}", point.0, point.1));
            curve.points.push(point);
        }
        let line = format!(
            "{}: {planner}, time and shortest tip length ÷ distance by candidates",
            cases.name
        );
        report.shown(&line, texts.join("; "));
        curves.push(curve);
    }
    let file = folder().join(format!("fast-{}.svg", cases.name));
    draw(&file, &format!("{} scenes", cases.name), &curves)?;
    let line = format!("{}: picture of time and tip length", cases.name);
    report.shown(&line, file.display().to_string());
    Ok(())
}

#[cfg(test)]
mod unit {
    use super::*;

    /// One case for each list of tip lengths, as smooth as it is short.
    fn candidates(tip_lengths: &[&[f64]]) -> Candidates {
        let case = |lengths: &&[f64]| Figures {
            tip_length: lengths.to_vec(),
            smoothness: lengths.to_vec(),
            duration: lengths.to_vec(),
            ..Figures::default()
        };
        Candidates {
            planner: "fast",
            result: Value::Null,
            cases: tip_lengths.iter().map(case).collect(),
        }
    }

    #[test]
    fn the_share_ahead_is_of_the_cases_that_someone_solves() {
        let ours = candidates(&[&[1.0, 3.0, 3.0], &[1.0], &[], &[]]);
        let rival = candidates(&[&[2.0, 2.0, 2.0], &[], &[1.0], &[]]);
        let share = |of| ahead(&ours, &[&rival], &GOODS, of);
        assert!((share(middle) - 100.0 / 3.0).abs() < 1e-9);
        assert!((share(least) - 200.0 / 3.0).abs() < 1e-9);
        let other = candidates(&[&[0.5], &[0.5], &[], &[]]);
        assert_eq!(ahead(&ours, &[&rival, &other], &GOODS, least), 0.0);
    }
}
