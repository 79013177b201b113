//! Thousands of damaged files and options: each is refused with a message that names file, key, value and what is allowed.
//!
//! Every variant says beforehand what must come of it, by rules that share nothing with the programs' own checks. The real
//! programs are started with it, from outside, with a limit on time and memory.

mod arrays;
mod blocks;
mod bombs;
mod closed;
mod configurations;
mod damage;
mod dataset_files;
mod datasets;
mod environment;
mod keys;
mod listed_option;
mod made_files;
mod models;
mod npz;
mod option_rules;
mod options;
mod proposals;
mod rules;
mod shapes;
mod variant;
mod wanted;
mod weights;

use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64;
use tests::programs::{program, repository};
use tests::stack::{Part, Stack};
use tests::trial::{Ending, Outcome, remove_shared_memory};
use tests::world::Settings;

use self::variant::{Kind, LIMIT, Variant, is_not_started, judge};
use crate::report::Report;
use crate::scale::Scale;

/// Seed of the choice of the quick form's variants.
const SEED: u64 = 18;
/// Variants of the quick form that must be refused.
const QUICK: usize = 300;
/// Least number of variants of the full form that must be refused, or change nothing.
const LEAST: usize = 3000;
/// Variants after which progress is told.
const TOLD_EVERY: usize = 200;
/// Programs that run at once.
const AT_ONCE: usize = 2;
/// What is ordered of the one robot, one after the other: a goal takes the place of another one.
const ORDERS: [&str; 4] = [
    "options of execute",
    "options of goal",
    "options of orders",
    "options of plan",
];

/// What is wrong with one variant.
struct Violation {
    kind: Kind,
    family: &'static str,
    name: String,
    what: String,
    outcome: Outcome,
}

pub(crate) fn run(report: &mut Report, scale: Scale) {
    let command =
        "the four programs with damaged robot, scene, process, weights and data files and options";
    let only = std::env::var("BAD_INPUT_ONLY").ok();
    // A part has a record of its own, so that it never stands for the whole.
    let group = only.as_ref().map_or("bad input".to_owned(), |only| {
        format!("bad input, {only} alone")
    });
    report.group(&group, command, |report| {
        let mut stack = Stack::running(&Settings::default())?;
        let (mut variants, without_rule) = all_variants(&stack);
        report.none_of(
            "commands and options of pcc that the harness has no rule for",
            &without_rule,
        );
        let mut gaps = configurations::all_gaps();
        gaps.extend(weights::manifest_gaps());
        report.none_of(
            "rules without a key in their file, keys without a rule",
            &gaps,
        );
        let there_are = variants.len();
        if let Some(only) = &only {
            variants.retain(|variant| variant.family.contains(only));
        } else if !scale.full {
            variants.shuffle(&mut Pcg64::seed_from_u64(SEED));
            let mut refusals = 0;
            variants.retain(|variant| {
                let is_kept = refusals < QUICK;
                refusals += usize::from(is_kept && variant.expected.is_refusal());
                is_kept
            });
        }
        let tried = try_all(&variants);
        report.none_of(
            "parts of the running stack that ended or panicked meanwhile",
            &ended(&mut stack),
        );
        write_all(&tried.violations, &variants);
        count(report, scale, &variants, tried.not_started, there_are);
        report.shown("longest message, bytes", tried.longest.to_string());
        for (kind, text) in Kind::ALL {
            let offenders: Vec<String> = tried
                .violations
                .iter()
                .filter(|violation| violation.kind == kind)
                .map(Violation::line)
                .collect();
            report.none_of(&format!("bad input: {text}"), &offenders);
        }
        Ok(())
    });
}

/// Whether enough was tried of what must be refused, and of every kind.
fn count(
    report: &mut Report,
    scale: Scale,
    variants: &[Variant],
    not_started: usize,
    there_are: usize,
) {
    let refusals = variants.iter().filter(|v| v.expected.is_refusal());
    // Whatever the system does not start counts as one of them.
    let tried = refusals.count().saturating_sub(not_started);
    let least = if scale.full {
        LEAST
    } else {
        QUICK - QUICK / 10
    };
    report.check(
        &format!(
            "variants that must be refused or change nothing tried, of {there_are} of all kinds"
        ),
        tried.to_string(),
        &format!(">= {least}"),
        tried >= least,
    );
    report.shown(
        "variants that the system does not start (not counted)",
        not_started.to_string(),
    );
    let obstacle = closed::obstacle();
    report.check(
        "files closed to the user",
        obstacle.unwrap_or("tried").to_owned(),
        "tried",
        obstacle.is_none(),
    );
    report.shown(
        "variants tried, by what must come of them",
        classes(variants),
    );
}

fn all_variants(stack: &Stack) -> (Vec<Variant>, Vec<String>) {
    let (mut all, without_rule) = options::variants(stack);
    all.extend(configurations::variants());
    all.extend(shapes::variants());
    all.extend(weights::variants());
    all.extend(models::variants());
    all.extend(datasets::variants());
    all.extend(proposals::variants());
    all.extend(blocks::variants());
    all.extend(bombs::variants());
    all.extend(closed::variants());
    all.extend(environment::variants());
    (all, without_rule)
}

impl Violation {
    fn line(&self) -> String {
        format!("{}: {} {}", self.family, self.name, self.what)
            .trim_end()
            .to_owned()
    }
}

/// Parts of the stack, which the options of `pcc` speak to, that did not outlive them.
fn ended(stack: &mut Stack) -> Vec<String> {
    let mut all = Vec::new();
    for part in Part::ALL {
        let process = stack.process(part);
        if !process.is_running() {
            all.push(format!("{part:?} ended: {}", process.log()));
        } else if process.log().contains("panicked") {
            all.push(format!("{part:?} panicked: {}", process.log()));
        }
    }
    all
}

/// What came of all variants.
struct Tried {
    violations: Vec<Violation>,
    /// Length of the longest refusal, bytes.
    longest: usize,
    /// Variants that the system did not start.
    not_started: usize,
}

/// Tries every variant, several at once.
fn try_all(variants: &[Variant]) -> Tried {
    // Built before the clock of the first one runs.
    let _ = program("pcc");
    let [next, longest, not_started] = [0; 3].map(AtomicUsize::new);
    let violations = Mutex::new(Vec::new());
    let robot = Mutex::new(());
    let work = || {
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(variant) = variants.get(index) else {
                return;
            };
            let orders = ORDERS.contains(&variant.family);
            let turn = orders.then(|| robot.lock().unwrap());
            let (outcome, found) = try_one(variant);
            drop(turn);
            if is_not_started(&outcome) {
                not_started.fetch_add(1, Ordering::Relaxed);
            }
            if !matches!(outcome.ending, Ending::Exited(0) | Ending::Served) {
                longest.fetch_max(outcome.text.len(), Ordering::Relaxed);
            }
            let mut violations = violations.lock().unwrap();
            violations.extend(found);
            if index > 0 && index.is_multiple_of(TOLD_EVERY) {
                let (tried, found) = (variants.len(), violations.len());
                eprintln!("bad input: {index} of {tried} variants, {found} findings");
            }
        }
    };
    thread::scope(|scope| {
        for _ in 0..AT_ONCE {
            scope.spawn(work);
        }
    });
    Tried {
        violations: violations.into_inner().unwrap(),
        longest: longest.into_inner(),
        not_started: not_started.into_inner(),
    }
}

fn try_one(variant: &Variant) -> (Outcome, Vec<Violation>) {
    let folder = tempfile::Builder::new()
        .prefix("pccb")
        .tempdir_in("/dev/shm")
        .unwrap();
    let prefix = folder
        .path()
        .file_name()
        .unwrap()
        .to_str()
        .unwrap()
        .replace('.', "-");
    let start = (variant.make)(folder.path());
    let outcome = start.run(folder.path(), &prefix, LIMIT);
    let wrong = judge(&variant.expected, &outcome, folder.path());
    remove_shared_memory(&prefix);
    let violation = |(kind, what)| Violation {
        kind,
        family: variant.family,
        name: variant.name.clone(),
        what,
        outcome: outcome.clone(),
    };
    let violations = wrong.into_iter().map(violation).collect();
    (outcome, violations)
}

fn classes(variants: &[Variant]) -> String {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for variant in variants {
        *counts.entry(variant.expected.class()).or_default() += 1;
    }
    let text = |(class, count): (&&str, &usize)| format!("{class} {count}");
    counts.iter().map(text).collect::<Vec<_>>().join(", ")
}

/// All violations with what the programs said, for reading.
fn write_all(violations: &[Violation], variants: &[Variant]) {
    let mut text = format!(
        "{} variants tried, {} findings\n",
        variants.len(),
        violations.len()
    );
    let mut families: BTreeMap<&str, usize> = BTreeMap::new();
    for variant in variants {
        *families.entry(variant.family).or_default() += 1;
    }
    for (family, count) in families {
        let found = violations.iter().filter(|v| v.family == family).count();
        let _ = writeln!(text, "{family}: {count} tried, {found} findings");
    }
    for (kind, name) in Kind::ALL {
        for violation in violations.iter().filter(|violation| violation.kind == kind) {
            let said: String = violation.outcome.text.chars().take(1500).collect();
            let (line, ending) = (violation.line(), violation.outcome.ending);
            let _ = writeln!(
                text,
                "\n== {name}: {line} [{ending:?}]\n{}",
                said.trim_end()
            );
        }
    }
    let folder = repository().join("target/acceptance");
    fs::create_dir_all(&folder).unwrap();
    fs::write(folder.join("bad_input.txt"), text).unwrap();
}
