//! Sets of cases: generated ones that nothing was trained with, and folders.

use crate::dataset;
use anyhow::{Context, ensure};
use datasets::{Case, Dataset, Split};
use std::fmt::{self, Display};
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Where cases come from.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum CaseSet {
    /// A set of this name that is generated.
    Generated(&'static Recipe),
    /// A folder with a data set.
    Folder(PathBuf),
}

/// How cases are generated (docs/evaluation.md "Cases").
#[derive(Debug, PartialEq)]
pub(crate) struct Recipe {
    pub(super) name: &'static str,
    /// Generator: `paper` keeps the cases with a path of the paper's own, `cases` every case that is drawn.
    pub(crate) method: &'static str,
    pub(crate) starts: usize,
    pub(crate) ends: usize,
    pub(crate) seed: u64,
    /// Targets that make at least ten cases.
    targets_for_ten_cases: usize,
}

static RECIPES: [Recipe; 3] = [
    Recipe {
        name: "reference",
        method: "paper",
        starts: 5,
        ends: 10,
        seed: 9003,
        targets_for_ten_cases: 4,
    },
    Recipe {
        name: "general",
        method: "cases",
        starts: 3,
        ends: 1,
        seed: 9001,
        targets_for_ten_cases: 5,
    },
    Recipe {
        name: "hard",
        method: "cases",
        starts: 3,
        ends: 1,
        seed: 9002,
        targets_for_ten_cases: 9,
    },
];

impl CaseSet {
    /// The sets that are generated.
    pub(super) const GENERATED: [Self; 3] = [
        Self::Generated(&RECIPES[0]),
        Self::Generated(&RECIPES[1]),
        Self::Generated(&RECIPES[2]),
    ];

    /// The first so many cases; what is generated stays in a folder, beside its blocks.
    pub(super) fn cases(
        &self,
        count: usize,
        robot: &Path,
        out: &Path,
    ) -> anyhow::Result<Vec<Case>> {
        let folder = match self {
            Self::Folder(folder) => folder.clone(),
            Self::Generated(recipe) => {
                let targets = (count * recipe.targets_for_ten_cases).div_ceil(10) as u64;
                let folder = out.join("sets").join(format!("{}-{targets}", recipe.name));
                dataset::generate_unseen(recipe.name, recipe, targets, robot, &folder)?;
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
        Ok(cases)
    }
}

impl Display for CaseSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Generated(recipe) => f.write_str(recipe.name),
            Self::Folder(folder) => folder.display().fmt(f),
        }
    }
}

impl FromStr for CaseSet {
    type Err = std::convert::Infallible;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let recipe = RECIPES.iter().find(|recipe| recipe.name == text);
        Ok(recipe.map_or_else(|| Self::Folder(text.into()), Self::Generated))
    }
}
