//! What planners did with each case, kept as lines of JSON, so that a comparison that was cut off goes on.

use crate::evaluate::Answer;
use anyhow::{Context, ensure};
use pcc_model::{Configuration, UnitRobot};
use planning::{Candidate, SampledVerdict, Source, modes};
use serde::{Deserialize, Serialize};
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;

/// What a planner did with a case.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub(super) struct CaseRecord {
    /// Number of the case in its set.
    pub(super) case: usize,
    pub(super) balls: usize,
    /// Time of the whole request, s.
    pub(super) seconds: f64,
    /// Time until the paths were there that the paper's criterion judges, s.
    pub(super) drawing_s: f64,
    /// Candidates asked for.
    pub(super) asked: usize,
    /// Candidates that succeed by the paper's criterion as they were drawn.
    pub(super) successes: usize,
    /// Terminal modes of the certified motions.
    pub(super) modes: usize,
    /// The certified motions.
    pub(super) motions: Vec<MotionRecord>,
}

/// Figures of a certified motion.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub(super) struct MotionRecord {
    /// Tip length ÷ distance.
    pub(super) tip_length_ratio: f64,
    /// ∫‖p‴‖² over the normalised arc length, section lengths².
    pub(super) tip_smoothness: f64,
    pub(super) duration_s: f64,
}

impl CaseRecord {
    pub(super) fn of(robot: &UnitRobot, case: usize, asked: usize, answer: &Answer) -> Self {
        let plan = answer.plan.as_ref().ok();
        let draws = plan.into_iter().flat_map(|plan| &plan.draws);
        let drawn = draws
            .filter(|draw| draw.source != Source::Explored)
            .filter_map(|draw| draw.sampled.as_ref().or(draw.path.as_ref()));
        let is_success = |path: &&Vec<Configuration>| {
            let Answer { case, .. } = answer;
            SampledVerdict::of(robot, &case.scene, &case.target_tip, path).is_success()
        };
        let candidates = plan.into_iter().flat_map(|plan| &plan.candidates);
        let certified: Vec<&Candidate> = candidates
            .filter(|candidate| candidate.source != Source::Explored)
            .collect();
        let ends: Vec<Configuration> = certified.iter().map(|it| it.end()).collect();
        Self {
            case,
            balls: answer.case.scene.balls().len(),
            seconds: answer.seconds,
            drawing_s: answer.drawing_s,
            asked,
            successes: drawn.filter(is_success).count(),
            modes: modes(&ends),
            motions: certified.into_iter().map(MotionRecord::of).collect(),
        }
    }
}

impl MotionRecord {
    fn of(candidate: &Candidate) -> Self {
        let metrics = &candidate.metrics;
        Self {
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
        let name = file.display();
        let open = OpenOptions::new()
            .read(true)
            .append(true)
            .create(true)
            .open(file);
        let opened = open.with_context(|| format!("cannot open {name}"))?;
        let mut log = Self {
            records: Vec::new(),
            file: opened,
        };
        let mut lines = BufReader::new(&log.file).lines();
        let (mut whole_bytes, mut is_whole) = (0, true);
        match lines.next().transpose()? {
            None => log.append(settings)?,
            Some(first) => {
                let found: serde_json::Value = serde_json::from_str(&first).unwrap_or_default();
                ensure!(
                    found == *settings,
                    "{name} is of another comparison: {found}\nthis one is: {settings}\nchoose another --out, or remove the file"
                );
                whole_bytes += first.len() as u64 + 1;
                for line in lines {
                    let line = line?;
                    let Ok(record) = serde_json::from_str(&line) else {
                        is_whole = false;
                        break;
                    };
                    whole_bytes += line.len() as u64 + 1;
                    log.records.push(record);
                }
            }
        }
        if !is_whole {
            log.file.set_len(whole_bytes)?;
        }
        Ok(log)
    }

    pub(super) fn add(&mut self, record: CaseRecord) -> anyhow::Result<()> {
        self.append(&record)?;
        self.records.push(record);
        Ok(())
    }

    fn append(&mut self, line: &impl Serialize) -> anyhow::Result<()> {
        let mut line = serde_json::to_string(line)?;
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
            tip_length_ratio: 1.5,
            tip_smoothness: 3.25,
            duration_s: 0.125,
        };
        CaseRecord {
            case,
            balls: 2,
            seconds: 0.5,
            drawing_s: 0.25,
            asked: 10,
            successes: 7,
            modes: 3,
            motions: vec![motion],
        }
    }

    #[test]
    fn a_log_goes_on_after_a_line_that_was_cut_off_and_refuses_other_settings() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("fast.jsonl");
        let settings = json!({ "seed": 1 });
        let mut log = CaseLog::open(&file, &settings).unwrap();
        log.add(record(0)).unwrap();
        log.add(record(1)).unwrap();
        let length = log.file.metadata().unwrap().len();
        log.file.set_len(length - 5).unwrap();
        let mut log = CaseLog::open(&file, &settings).unwrap();
        assert_eq!(log.records, [record(0)]);
        log.add(record(1)).unwrap();
        let records = CaseLog::open(&file, &settings).unwrap().records;
        assert_eq!(records, [record(0), record(1)]);
        let refused = CaseLog::open(&file, &json!({ "seed": 2 }));
        assert!(
            refused
                .err()
                .unwrap()
                .to_string()
                .contains("another comparison")
        );
    }
}
