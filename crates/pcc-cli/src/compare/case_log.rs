//! What planners did with each case, kept as lines of JSON, so that a comparison that was cut off goes on.

use super::subject::check;
use crate::evaluate::Answer;
use anyhow::{Context, ensure};
use pcc_model::{Configuration, DOF, UnitRobot};
use planning::{Candidate, SampledVerdict, Source, Stage, modes};
use serde::{Deserialize, Serialize};
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::Path;

/// What a planner did with a case.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub(super) struct CaseRecord {
    /// Number of the case in its set.
    pub(super) case: usize,
    /// Index of the case's target; cases of one target have target and scene in common.
    pub(super) target: i32,
    pub(super) balls: usize,
    /// Where the times were measured: processor and number of cores.
    pub(super) machine: String,
    /// Time of the whole request, s.
    pub(super) seconds: f64,
    /// Time until the paths were there that the paper's criterion judges, s.
    pub(super) drawing_s: f64,
    /// Candidates asked for.
    pub(super) asked: usize,
    /// Time of the sampler alone, s; none where the request was refused.
    pub(super) sampling_s: Option<f64>,
    /// The paths that were drawn, as the paper's criterion judges them.
    pub(super) drawn: Vec<DrawnRecord>,
    /// Candidates that succeed by the paper's criterion as they were drawn.
    pub(super) successes: usize,
    /// Terminal modes of the certified motions.
    pub(super) modes: usize,
    /// The certified motions.
    pub(super) motions: Vec<MotionRecord>,
    /// What a planner that ends by the clock drew: corners of certified edges, rad.
    pub(super) polylines: Vec<Vec<[f64; DOF]>>,
}

/// What the paper's criterion sees of a path.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
pub(super) struct DrawnRecord {
    /// Distance of the tip from the target, section lengths.
    pub(super) tip_error: f64,
    /// Smallest clearance of the points that it looks at, section lengths; none without balls.
    pub(super) clearance: Option<f64>,
    pub(super) is_success: bool,
}

/// Figures of a certified motion.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub(super) struct MotionRecord {
    /// Length of the tip's path, section lengths.
    pub(super) tip_length: f64,
    /// Tip length ÷ distance.
    pub(super) tip_length_ratio: f64,
    /// ∫‖p‴‖² over the normalised arc length, section lengths².
    pub(super) tip_smoothness: f64,
    pub(super) duration_s: f64,
}

impl CaseRecord {
    pub(super) fn of(
        robot: &UnitRobot,
        machine: &str,
        case: usize,
        asked: usize,
        answer: &Answer,
    ) -> Self {
        let plan = answer.plan.as_ref().ok();
        let draws = plan.into_iter().flat_map(|plan| &plan.draws);
        let drawn = draws
            .filter(|draw| draw.source != Source::Explored)
            .filter_map(|draw| draw.sampled.as_ref().or(draw.path.as_ref()));
        let judged = drawn.map(|path| {
            let Answer { case, .. } = answer;
            DrawnRecord::of(&SampledVerdict::of(
                robot,
                &case.scene,
                &case.target_tip,
                path,
            ))
        });
        let drawn: Vec<DrawnRecord> = judged.collect();
        let candidates = plan.into_iter().flat_map(|plan| &plan.candidates);
        let certified: Vec<&Candidate> = candidates
            .filter(|candidate| candidate.source != Source::Explored)
            .collect();
        let ends: Vec<Configuration> = certified.iter().map(|it| it.end()).collect();
        let polylines = answer.polylines.iter();
        let polylines = polylines.map(|it| it.iter().map(|corner| (*corner).into()).collect());
        Self {
            case,
            target: answer.case.target_index,
            balls: answer.case.scene.balls().len(),
            machine: machine.to_owned(),
            seconds: answer.seconds,
            drawing_s: answer.drawing_s,
            asked,
            sampling_s: plan.map(|plan| plan.stages[Stage::Sample]),
            successes: drawn.iter().filter(|it| it.is_success).count(),
            drawn,
            modes: modes(&ends),
            motions: certified.into_iter().map(MotionRecord::of).collect(),
            polylines: polylines.collect(),
        }
    }
}

impl DrawnRecord {
    pub(super) fn of(verdict: &SampledVerdict) -> Self {
        Self {
            tip_error: verdict.tip_error,
            clearance: Some(verdict.clearance).filter(|it| it.is_finite()),
            is_success: verdict.is_success(),
        }
    }
}

impl MotionRecord {
    fn of(candidate: &Candidate) -> Self {
        let metrics = &candidate.metrics;
        Self {
            tip_length: metrics.tip_length,
            tip_length_ratio: metrics.tip_length / metrics.tip_distance,
            tip_smoothness: metrics.tip_smoothness,
            duration_s: metrics.duration_s,
        }
    }
}

/// The records of one planner on one set.
pub(super) struct CaseLog {
    pub(super) records: Vec<CaseRecord>,
    file: File,
}

impl CaseLog {
    /// Opens a log, whose first line says what it is of; an error where it is of something else. A last line that was cut off is dropped.
    pub(super) fn open(file: &Path, settings: &serde_json::Value) -> anyhow::Result<Self> {
        let open = OpenOptions::new()
            .read(true)
            .append(true)
            .create(true)
            .open(file);
        let opened = open.with_context(|| format!("cannot open {}", file.display()))?;
        let text = io::read_to_string(&opened)?;
        let whole = text.rfind('\n').map_or(0, |last| last + 1);
        opened.set_len(whole as u64)?;
        let mut log = Self {
            records: Vec::new(),
            file: opened,
        };
        let mut lines = text[..whole].lines();
        match lines.next() {
            None => log.append(settings.to_string())?,
            Some(first) => {
                let found = serde_json::from_str(first).unwrap_or_default();
                check(file, &found, settings)?;
            }
        }
        let records = lines.map(serde_json::from_str).collect::<Result<_, _>>();
        log.records = records.with_context(|| format!("{} is damaged", file.display()))?;
        let is_in_place = |(place, record): (usize, &CaseRecord)| record.case == place;
        ensure!(
            log.records.iter().enumerate().all(is_in_place),
            "{} is damaged: its cases are not in order, each once",
            file.display()
        );
        Ok(log)
    }

    /// Adds a record, as a comparison that goes on would read it.
    pub(super) fn add(&mut self, record: &CaseRecord) -> anyhow::Result<()> {
        let line = serde_json::to_string(record)?;
        self.records.push(serde_json::from_str(&line)?);
        self.append(line)
    }

    fn append(&mut self, mut line: String) -> anyhow::Result<()> {
        line.push('\n');
        Ok(self.file.write_all(line.as_bytes())?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn record(case: usize) -> CaseRecord {
        let motion = MotionRecord {
            tip_length: 2.5,
            tip_length_ratio: 1.5,
            tip_smoothness: 3.25,
            duration_s: 0.125,
        };
        let drawn = DrawnRecord {
            tip_error: 0.0625,
            clearance: None,
            is_success: true,
        };
        CaseRecord {
            case,
            target: 4,
            balls: 2,
            machine: "one, 2 cores".to_owned(),
            seconds: 0.5,
            drawing_s: 0.25,
            asked: 10,
            sampling_s: Some(0.125),
            drawn: vec![drawn],
            successes: 7,
            modes: 3,
            motions: vec![motion],
            polylines: vec![vec![[0.25; DOF]; 2]],
        }
    }

    #[test]
    fn a_log_goes_on_after_a_line_that_was_cut_off_and_refuses_other_settings() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("fast.jsonl");
        let settings = json!({ "seed": 1 });
        let mut log = CaseLog::open(&file, &settings).unwrap();
        log.add(&record(0)).unwrap();
        log.add(&record(1)).unwrap();
        let length = log.file.metadata().unwrap().len();
        log.file.set_len(length - 5).unwrap();
        let mut log = CaseLog::open(&file, &settings).unwrap();
        assert_eq!(log.records, [record(0)]);
        log.add(&record(1)).unwrap();
        let mut log = CaseLog::open(&file, &settings).unwrap();
        assert_eq!(log.records, [record(0), record(1)]);
        log.add(&record(1)).unwrap();
        let twice = CaseLog::open(&file, &settings).err().unwrap();
        assert!(twice.to_string().contains("not in order"), "{twice}");
        File::options()
            .write(true)
            .open(&file)
            .unwrap()
            .set_len(5)
            .unwrap();
        assert!(CaseLog::open(&file, &settings).unwrap().records.is_empty());
        let refused = CaseLog::open(&file, &json!({ "seed": 2 }));
        assert!(
            refused
                .err()
                .unwrap()
                .to_string()
                .contains("seed is 1 there and 2 here")
        );
    }
}
