//! Rivals with as many candidates as take them the time of ours, measured in turns with ours.

use serde_json::Value;

use crate::fast_candidates::Candidates;
use crate::fast_cases::Cases;
use crate::report::Report;
use crate::runs::{CANDIDATES, Evaluation, number};
use crate::scale::Scale;
use crate::spread::median;

/// Most candidates of a request.
const MOST_CANDIDATES: usize = 64;
/// Share of our time that a rival is to have taken, unless it had as many candidates as there can be.
const RIVAL_AT_LEAST: f64 = 0.95;
/// Numbers of candidates that are tried at the most.
const TRIES: usize = 6;

/// A rival's candidates in our time.
pub(crate) struct EqualTime {
    pub(crate) rival: Candidates,
    turns: Turns,
}

/// Both in turns: medians of a request, ms.
struct Turns {
    count: usize,
    rival_ms: f64,
    ours_ms: f64,
}

impl Turns {
    fn is_fair(&self) -> bool {
        self.rival_ms >= RIVAL_AT_LEAST * self.ours_ms || self.count == MOST_CANDIDATES
    }

    /// The candidates that our time suggests for the rival, rounded up.
    fn suggested(&self) -> usize {
        let count = self.count as f64 * self.ours_ms / self.rival_ms;
        (count.ceil() as usize).clamp(1, MOST_CANDIDATES)
    }
}

impl EqualTime {
    /// As many candidates of the rival as its time for ten suggests, and more where they are not enough.
    pub(crate) fn of(
        scale: Scale,
        cases: &Cases,
        ours: &'static str,
        rival: &'static str,
    ) -> anyhow::Result<Self> {
        let cases = cases.labelled("turns");
        let ours = cases.evaluation(ours);
        let of_count = |count| {
            let theirs = cases.evaluation(rival).candidates(count);
            let (turns, result) = in_turns(scale, &ours, &theirs, count)?;
            Ok::<_, anyhow::Error>((turns, result, theirs))
        };
        let mut count = of_count(CANDIDATES)?.0.suggested();
        let mut found = of_count(count)?;
        for _ in 1..TRIES {
            if found.0.is_fair() {
                break;
            }
            count = found.0.suggested().max(count + 1);
            found = of_count(count)?;
        }
        let (turns, result, theirs) = found;
        let motions = cases.motions(&theirs)?;
        Ok(Self {
            rival: Candidates::new(scale, rival, result, &motions)?,
            turns,
        })
    }

    /// The check that the rival had our time.
    pub(crate) fn check(&self, report: &mut Report, name: &str, ours: &str) {
        let Turns {
            count,
            rival_ms,
            ours_ms,
        } = self.turns;
        let line = format!(
            "{name}, equal time: {} with {count} candidates, ms beside {ours} with {CANDIDATES}, in turns",
            self.rival.planner
        );
        let bar = format!(">= {RIVAL_AT_LEAST} of {ours}'s, or {MOST_CANDIDATES} candidates");
        let figure = format!("{rival_ms:.3} and {ours_ms:.3}");
        report.check(&line, figure, &bar, self.turns.is_fair());
    }
}

/// The medians over rounds in which both plan all cases, one after the other, and the rival's last `result.json`.
fn in_turns(
    scale: Scale,
    ours: &Evaluation,
    theirs: &Evaluation,
    count: usize,
) -> anyhow::Result<(Turns, Value)> {
    let (mut ours_ms, mut rival_ms) = (Vec::new(), Vec::new());
    let mut last = Value::Null;
    // Medians of few cases differ more from one round to the next.
    for _ in 0..scale.pick(5, 3) {
        ours_ms.push(median_ms(&ours.repeat()?)?);
        last = theirs.repeat()?;
        rival_ms.push(median_ms(&last)?);
    }
    let turns = Turns {
        count,
        rival_ms: median(&rival_ms),
        ours_ms: median(&ours_ms),
    };
    Ok((turns, last))
}

/// The median time of a request, ms.
fn median_ms(result: &Value) -> anyhow::Result<f64> {
    Ok(1e3 * number(result, "/seconds/median")?)
}

#[cfg(test)]
mod unit {
    use super::*;

    fn turns(count: usize, rival_ms: f64) -> Turns {
        Turns {
            count,
            rival_ms,
            ours_ms: 1.0,
        }
    }

    #[test]
    fn a_rival_is_given_candidates_until_it_had_our_time() {
        assert_eq!(turns(10, 0.49).suggested(), 21);
        assert_eq!(turns(10, 0.1).suggested(), MOST_CANDIDATES);
        assert_eq!(turns(10, 30.0).suggested(), 1);
        assert!(!turns(20, 0.94).is_fair() && turns(20, 0.96).is_fair());
        assert!(turns(MOST_CANDIDATES, 0.5).is_fair());
    }
}
