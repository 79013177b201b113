//! What planners' candidates of the same cases are worth, by the rules by which a request can select one.

use std::fmt::{self, Display, Formatter};

use anyhow::Context;
use collision::minimum_clearance;
use pcc_model::{Configuration, Robot, UnitRobot};
use planning::{PathMetrics, modes};
use serde_json::Value;
use tests::programs::repository;

use crate::fast_cases::Cases;
use crate::motions::Motions;
use crate::report::Report;
use crate::runs::number;
use crate::scale::Scale;
use crate::second_look::Judged;
use crate::spread::median;

/// Accuracy of a clearance, section lengths.
const CLEARANCE_TOLERANCE: f64 = 1e-3;
/// Accuracy of any other figure.
const ROUNDING: f64 = 1e-9;

/// Figures of a case's certified candidates, one value each.
#[derive(Default)]
pub(crate) struct Figures {
    pub(crate) tip_length: Vec<f64>,
    pub(crate) tip_length_ratio: Vec<f64>,
    pub(crate) smoothness: Vec<f64>,
    pub(crate) duration: Vec<f64>,
    /// The clearance times -1: less is better.
    pub(crate) nearness: Vec<f64>,
    /// From the start to the goal configuration, rad.
    pub(crate) distance: Vec<f64>,
    pub(crate) ends: Vec<Configuration>,
}

/// The figures of every case's certified candidates.
fn figures(robot: &UnitRobot, motions: &Motions) -> anyhow::Result<Vec<Figures>> {
    let case = |case: usize| {
        let mut figures = Figures::default();
        for slot in motions.certified(case) {
            let motion = motions.motion(slot)?;
            let clearance =
                minimum_clearance(robot, motions.scene(case), &motion, CLEARANCE_TOLERANCE);
            let metrics = PathMetrics::of(robot, &motion, clearance);
            let end = motion.at(motion.duration()).position;
            figures.tip_length.push(metrics.tip_length);
            let ratio = metrics.tip_length / metrics.tip_distance;
            figures.tip_length_ratio.push(ratio);
            figures.smoothness.push(metrics.tip_smoothness);
            figures.duration.push(metrics.duration_s);
            figures.nearness.push(-metrics.clearance);
            figures.distance.push((end - motions.start(case)).norm());
            figures.ends.push(end);
        }
        Ok(figures)
    };
    (0..motions.cases()).map(case).collect()
}

/// What a planner did with all cases.
pub(crate) struct Candidates {
    pub(crate) planner: &'static str,
    pub(crate) result: Value,
    pub(crate) cases: Vec<Figures>,
    pub(crate) judged: Judged,
}

impl Candidates {
    /// So many candidates a case.
    pub(crate) fn of(
        report: &Report,
        scale: Scale,
        cases: &Cases,
        planner: &'static str,
        candidates: usize,
    ) -> anyhow::Result<Self> {
        let evaluation = cases.evaluation(planner).candidates(candidates);
        let (result, motions) = cases.run(report, scale, &evaluation)?;
        Self::new(scale, planner, result, &motions)
    }

    /// The candidates of a run that has come to its end.
    pub(crate) fn new(
        scale: Scale,
        planner: &'static str,
        result: Value,
        motions: &Motions,
    ) -> anyhow::Result<Self> {
        let robot = Robot::from_file(&repository().join("config/robots/unit.toml"))?;
        let robot = robot.to_unit().context("equal sections are needed")?;
        Ok(Self {
            planner,
            result,
            cases: figures(&robot, motions)?,
            judged: motions.judge(&robot, scale.pick(1, 10)),
        })
    }

    /// The median time of a request, ms.
    pub(crate) fn median_ms(&self) -> anyhow::Result<f64> {
        Ok(1e3 * number(&self.result, "/seconds/median")?)
    }

    /// The mean number of modes that a case's candidates end in.
    pub(crate) fn mean_modes(&self) -> f64 {
        let modes = self.cases.iter().map(|case| modes(&case.ends));
        modes.sum::<usize>() as f64 / self.cases.len() as f64
    }
}

/// A rule by which a request can select a candidate: that of least cost.
pub(crate) struct Rule {
    pub(crate) name: &'static str,
    cost: fn(&Figures) -> &[f64],
    /// Costs that differ by less are equal.
    tolerance: f64,
}

pub(crate) const SHORTEST_TIP_PATH: Rule = Rule {
    name: "shortest tip path",
    cost: |figures| &figures.tip_length,
    tolerance: ROUNDING,
};
pub(crate) const SMOOTHEST: Rule = Rule {
    name: "smoothest",
    cost: |figures| &figures.smoothness,
    tolerance: ROUNDING,
};
pub(crate) const SHORTEST_TIME: Rule = Rule {
    name: "shortest time",
    cost: |figures| &figures.duration,
    tolerance: ROUNDING,
};
pub(crate) const LARGEST_CLEARANCE: Rule = Rule {
    name: "largest clearance",
    cost: |figures| &figures.nearness,
    tolerance: CLEARANCE_TOLERANCE,
};
pub(crate) const NEAREST_END: Rule = Rule {
    name: "nearest goal configuration",
    cost: |figures| &figures.distance,
    tolerance: ROUNDING,
};

/// One value for all candidates of a case; without candidates it is infinite.
pub(crate) type Summary = fn(&[f64]) -> f64;

/// The value in the middle.
pub(crate) fn middle(values: &[f64]) -> f64 {
    if values.is_empty() {
        return f64::INFINITY;
    }
    median(values)
}

/// The best value.
pub(crate) fn least(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::INFINITY, f64::min)
}

/// On how many cases a planner is ahead.
#[derive(Clone, Copy)]
pub(crate) struct Lead {
    /// The share that it is ahead on, of the cases that someone solves, %; a case counts half where the least lead is none.
    pub(crate) percent: f64,
    cases: usize,
    /// Solved by nobody: they do not count.
    unsolved: usize,
}

impl Display for Lead {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        let Self {
            percent,
            cases,
            unsolved,
        } = self;
        write!(
            formatter,
            "{percent:.1} % of {cases} cases, {unsolved} of them solved by nobody, which do not count"
        )
    }
}

/// How often `ours` is ahead of all rivals by all of these rules at once.
pub(crate) fn ahead(
    ours: &Candidates,
    rivals: &[&Candidates],
    rules: &[&Rule],
    of: Summary,
) -> Lead {
    let is_solved = |case: &usize| {
        let mut all = rivals.iter().copied().chain([ours]);
        all.any(|candidates| !candidates.cases[*case].ends.is_empty())
    };
    let score = |case: usize| {
        let pairs = rivals
            .iter()
            .flat_map(|rival| rules.iter().map(move |rule| (rival, rule)));
        let scores =
            pairs.map(|(rival, rule)| rule.score([&ours.cases[case], &rival.cases[case]], of));
        scores.fold(1.0, f64::min)
    };
    let cases = ours.cases.len();
    let solved = (0..cases).filter(is_solved);
    let scores: Vec<f64> = solved.map(score).collect();
    Lead {
        percent: 100.0 * scores.iter().sum::<f64>() / scores.len().max(1) as f64,
        cases,
        unsolved: cases - scores.len(),
    }
}

impl Rule {
    /// 1 where the first is ahead, 0 where the second is, else a half.
    fn score(&self, both: [&Figures; 2], of: Summary) -> f64 {
        let [ours, theirs] = both.map(|figures| of((self.cost)(figures)));
        if ours == theirs || (ours - theirs).abs() <= self.tolerance {
            0.5
        } else {
            f64::from(ours < theirs)
        }
    }
}

#[cfg(test)]
mod unit {
    use super::*;

    /// One case for each list of costs.
    fn candidates(costs: &[&[f64]]) -> Candidates {
        let case = |costs: &&[f64]| Figures {
            tip_length: costs.to_vec(),
            smoothness: costs.to_vec(),
            nearness: costs.to_vec(),
            ends: vec![Configuration::zeros(); costs.len()],
            ..Figures::default()
        };
        Candidates {
            planner: "fast",
            result: Value::Null,
            cases: costs.iter().map(case).collect(),
            judged: Judged::default(),
        }
    }

    #[test]
    fn the_share_ahead_is_of_the_cases_that_someone_solves() {
        let ours = candidates(&[&[1.0, 3.0, 3.0], &[1.0], &[], &[]]);
        let rival = candidates(&[&[2.0, 2.0, 2.0], &[], &[1.0], &[]]);
        let lead = |of| ahead(&ours, &[&rival], &[&SHORTEST_TIP_PATH, &SMOOTHEST], of);
        let share = |of| lead(of).percent;
        assert!((share(middle) - 100.0 / 3.0).abs() < 1e-9);
        assert!((share(least) - 200.0 / 3.0).abs() < 1e-9);
        assert_eq!((lead(least).cases, lead(least).unsolved), (4, 1));
    }

    #[test]
    fn what_is_as_good_counts_half() {
        let ours = candidates(&[&[1.0], &[f64::NEG_INFINITY], &[1.0]]);
        let rival = candidates(&[&[1.0005], &[f64::NEG_INFINITY], &[0.9]]);
        let share = |rule| ahead(&ours, &[&rival], &[rule], least).percent;
        assert!((share(&LARGEST_CLEARANCE) - 100.0 / 3.0).abs() < 1e-9);
        assert!((share(&SMOOTHEST) - 50.0).abs() < 1e-9);
    }
}
