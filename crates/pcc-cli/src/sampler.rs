//! Samplers, planners and selection rules by their names on the command line.

use clap::ValueEnum;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use planning::{Sampler, Selection};
use rivals::{Anytime, Rival};

/// A planner as `pcc evaluate --planner` names it, and a sampler as `pcc plan --sampler` does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PlannerName {
    /// The learned sampler, filled by classical candidates where it does not deliver.
    Default,
    /// The learned few-step sampler alone.
    Fast,
    /// Straight segments in configuration space.
    Straight,
    /// Straight segments with everything that a learned path gets after sampling.
    StraightDrawn,
    /// RRT-Connect on certified edges.
    RrtConnect,
    /// RRT-Connect, whose paths get everything that a learned path gets after sampling.
    RrtSmooth,
    /// The paper's diffusion model; the daemon needs a deadline of some hundred milliseconds for it.
    Diffusion,
    /// The paper's diffusion model with post correction in its last steps.
    DiffusionPost,
    /// The paper's diffusion model with guided prediction in its last steps.
    DiffusionGuided,
    /// RRT in configuration space, as the paper compares with.
    CRrt,
    /// RRT* in configuration space, as the paper compares with.
    CRrtStar,
    /// RRT on tip positions, as the paper compares with.
    WRrt,
    /// RRT* on tip positions, as the paper compares with.
    WRrtStar,
    /// An artificial potential field, as the paper compares with.
    Apf,
    /// RRT* on certified edges for 50 ms an attempt, whose paths get everything that a learned path gets after sampling.
    RrtStar,
    /// BIT* on certified edges for 50 ms an attempt, likewise.
    BitStar,
    /// Paths that another program drew.
    Proposed,
}

impl PlannerName {
    /// Where the planner draws paths from; nothing where they are given, or a rival's.
    pub(crate) fn sampler(self) -> Option<Sampler> {
        let name = name_of(&self);
        let found = Sampler::ALL.iter().find(|sampler| sampler.text() == name);
        found.copied()
    }

    /// The paper's rival that draws the paths.
    pub(crate) fn rival(self) -> Option<Rival> {
        match self {
            Self::CRrt => Some(Rival::CRrt),
            Self::CRrtStar => Some(Rival::CRrtStar),
            Self::WRrt => Some(Rival::WRrt),
            Self::WRrtStar => Some(Rival::WRrtStar),
            Self::Apf => Some(Rival::Apf),
            _ => None,
        }
    }

    /// The expert's planner that goes on after its first path.
    pub(crate) fn anytime(self) -> Option<Anytime> {
        match self {
            Self::RrtStar => Some(Anytime::RrtStar),
            Self::BitStar => Some(Anytime::BitStar),
            _ => None,
        }
    }
}

/// Reads one of some values by its name.
pub(crate) fn choice<T: Clone + Send + Sync + 'static>(
    choices: impl IntoIterator<Item = (impl Into<PossibleValue>, T)>,
) -> impl TypedValueParser<Value = T> {
    let named = choices
        .into_iter()
        .map(|(name, value)| (name.into(), value));
    let named: Vec<(PossibleValue, T)> = named.collect();
    let names: Vec<PossibleValue> = named.iter().map(|(name, _)| name.clone()).collect();
    PossibleValuesParser::new(names).try_map(move |given| {
        let chosen = named.iter().find(|(name, _)| name.get_name() == given);
        chosen
            .map(|(_, value)| value.clone())
            .ok_or("no such choice")
    })
}

/// Reads a sampler of a request by its name: that of every planner that the daemon serves.
pub(crate) fn samplers() -> impl TypedValueParser<Value = Sampler> {
    let named = |planner: &PlannerName| Some((planner.to_possible_value()?, planner.sampler()?));
    choice(PlannerName::value_variants().iter().filter_map(named))
}

/// Selection rules with their names and a line of help.
const SELECTIONS: [(&str, Selection, &str); 5] = {
    use Selection::{
        LargestClearance, NearestGoalConfiguration, ShortestTime, ShortestTipPath, Smoothest,
    };
    [
        ("shortest-time", ShortestTime, "Shortest duration"),
        (
            "shortest-tip-path",
            ShortestTipPath,
            "Shortest path of the tip",
        ),
        (
            "largest-clearance",
            LargestClearance,
            "Largest clearance over the motion",
        ),
        (
            "smoothest",
            Smoothest,
            "Smallest third derivative of the tip's path",
        ),
        (
            "nearest-goal-configuration",
            NearestGoalConfiguration,
            "Goal configuration nearest to the start",
        ),
    ]
};

/// Reads a rule for selecting a candidate by its name.
pub(crate) fn selections() -> impl TypedValueParser<Value = Selection> {
    choice(SELECTIONS.map(|(name, rule, help)| (PossibleValue::new(name).help(help), rule)))
}

/// The name of a choice on the command line.
pub(crate) fn name_of(choice: &impl ValueEnum) -> String {
    let value = choice.to_possible_value();
    value.map_or_else(String::new, |v| v.get_name().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::{Arg, Command};

    #[test]
    fn every_sampler_of_the_protocol_has_a_name_and_is_a_planner() {
        let (command, option) = (Command::new("pcc"), Arg::new("sampler").num_args(1));
        let read = |name: &str| samplers().parse_ref(&command, Some(&option), name.as_ref());
        for code in Sampler::ALL {
            assert_eq!(read(code.text()).unwrap(), *code);
        }
        let others = PlannerName::value_variants().iter();
        let others = others.filter(|planner| planner.sampler().is_none());
        let others = others.filter(|planner| planner.rival().is_none());
        assert_eq!(others.filter(|it| it.anytime().is_none()).count(), 1);
        read("proposed").unwrap_err();
    }
}
