//! Sets of cases: generated ones that nothing was trained with, and folders.

use crate::dataset::{Unseen, generate_unseen};
use crate::robot::unit_robot;
use anyhow::{Context, bail, ensure};
use datasets::{Case, Dataset, Split};
use pcc_model::UnitRobot;
use std::fmt::{self, Display};
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Distance of a tip from its target that is none, section lengths.
const NO_WAY: f64 = 1e-6;

/// Where cases come from.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum CaseSet {
    /// A set of this name that is generated.
    Generated(&'static Generated),
    /// A folder with a data set.
    Folder(PathBuf),
}

/// A set that is generated.
#[derive(Debug, PartialEq)]
pub(crate) struct Generated {
    recipe: Unseen,
    /// Targets that make at least ten cases.
    targets_for_ten_cases: usize,
}

/// docs/evaluation.md "Cases". Nothing was trained, and no planner or setting was chosen, on these seeds.
static SETS: [Generated; 4] = [
    generated("reference", "paper", 5, 10, 9023, 4),
    generated("general", "cases", 3, 1, 9021, 5),
    generated("hard", "cases", 3, 1, 9022, 9),
    generated("obstacle-free", "paper", 5, 10, 9024, 4),
];

const fn generated(
    setting: &'static str,
    method: &'static str,
    starts: usize,
    ends: usize,
    seed: u64,
    targets_for_ten_cases: usize,
) -> Generated {
    let recipe = Unseen {
        setting,
        method,
        starts,
        ends,
        seed,
    };
    Generated {
        recipe,
        targets_for_ten_cases,
    }
}

impl CaseSet {
    /// The sets that all planners are compared on.
    pub(super) const COMPARED: [Self; 3] = [Self::REFERENCE, Self::GENERAL, Self::HARD];
    pub(super) const REFERENCE: Self = Self::Generated(&SETS[0]);
    pub(super) const GENERAL: Self = Self::Generated(&SETS[1]);
    pub(super) const HARD: Self = Self::Generated(&SETS[2]);
    pub(super) const OBSTACLE_FREE: Self = Self::Generated(&SETS[3]);

    /// What the set of this name leaves out, as a paragraph of HTML; nothing where it has every case that is drawn.
    pub(super) fn left_out_html(name: &str) -> &'static str {
        match name {
            "reference" => {
                "<p>A start for which the authors' generator keeps no path gives no case. That happens more often with balls, so that scenes without balls \
                 weigh more in figures over all cases; figures by number of balls are not affected.</p>"
            }
            "hard" => {
                "<p>Cases are kept only where straight segments collide and <code>rrt-connect</code> finds a path, so that its own share is high by \
                 definition.</p>"
            }
            _ => "",
        }
    }

    /// The first so many cases; what is generated stays in a folder, beside its blocks.
    pub(super) fn cases(
        &self,
        count: usize,
        robot: &Path,
        out: &Path,
    ) -> anyhow::Result<Vec<Case>> {
        let folder = match self {
            Self::Folder(folder) => folder.clone(),
            Self::Generated(set) => {
                let targets = (count * set.targets_for_ten_cases).div_ceil(10) as u64;
                let name = format!("{}-{targets}", set.recipe.setting);
                let folder = out.join("sets").join(name);
                generate_unseen(&set.recipe, targets, robot, &folder)?;
                folder
            }
        };
        let cases = Dataset::read(&folder)
            .and_then(|dataset| dataset.cases(Split::Test, Some(count)))
            .with_context(|| format!("data set {}", folder.display()))?;
        ensure!(
            cases.len() >= 2,
            "{} has {} cases in split test, at least 2 are needed",
            folder.display(),
            cases.len()
        );
        let there = first_there(&cases, &unit_robot(robot)?);
        if let Some(case) = there {
            bail!(
                "case {case} of {} begins with the tip at its target: there is no tip length ÷ distance of it",
                folder.display()
            );
        }
        Ok(cases)
    }
}

/// The first case whose start has the tip at the target, as near as a data set's numbers of four bytes are.
fn first_there(cases: &[Case], robot: &UnitRobot) -> Option<usize> {
    let is_there = |case: &Case| (robot.tip(&case.start) - case.target_tip).norm() <= NO_WAY;
    cases.iter().position(is_there)
}

/// The name of a set, or of a figure, as a part of a file's name.
pub(super) fn file_name(name: &str) -> String {
    let last = Path::new(name).file_name().and_then(|it| it.to_str());
    last.unwrap_or(name).to_owned()
}

impl Display for CaseSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Generated(set) => f.write_str(set.recipe.setting),
            Self::Folder(folder) => folder.display().fmt(f),
        }
    }
}

impl FromStr for CaseSet {
    type Err = std::convert::Infallible;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let set = SETS.iter().find(|set| set.recipe.setting == text);
        Ok(set.map_or_else(|| Self::Folder(text.into()), Self::Generated))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use collision::Scene;
    use pcc_model::Configuration;

    #[test]
    fn a_start_at_its_target_is_found() {
        let robot = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/robots/unit.toml");
        let robot = unit_robot(Path::new(robot)).unwrap();
        let start = Configuration::from([0.3, -0.2, 0.5, 0.1, -0.4, 0.2]);
        let case = |end: Configuration| Case {
            target_index: 0,
            start_index: 0,
            start,
            target_tip: robot.tip(&end).map(|it| f64::from(it as f32)),
            scene: Scene::default(),
        };
        let cases = [case(Configuration::zeros()), case(start)];
        assert_eq!(first_there(&cases, &robot), Some(1));
        assert_eq!(first_there(&cases[..1], &robot), None);
    }
}
