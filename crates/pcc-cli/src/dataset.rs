//! `pcc dataset` and `pcc features`: paths by the teacher or by the paper's generator, and training arrays.

use crate::number::threads;
use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use indicatif::{ProgressBar, ProgressStyle};
use pcc_model::Robot;
use planning::FeatureFrame;
use planning::dataset::{
    BlockReport, Dataset, Meta, PAPER_VERSION, PaperReport, Recipe, Row, TEACHER_VERSION,
    TERMINALS, generate_block, generate_paper_block, training_rows,
};
use planning::scenes::{STARTS, Setting};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

/// Targets of one block: the unit of work, of resuming and of sharding.
const BLOCK: u64 = 32;

#[derive(Clone, Copy, ValueEnum)]
enum SettingName {
    /// The paper's four fixed layouts.
    Reference,
    /// No balls.
    ObstacleFree,
    /// Random balls, counts cycled over 0, 1, 2, 3, 4, 5, 6, 8.
    General,
    /// 8 to 16 balls where straight segments collide.
    Hard,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Method {
    /// Certified paths with a straight tip, by this project's teacher.
    Teacher,
    /// The paper's own generator, with its sampled criterion of collision.
    Paper,
}

impl Method {
    /// Version of the generator.
    fn version(self) -> u32 {
        match self {
            Self::Teacher => TEACHER_VERSION,
            Self::Paper => PAPER_VERSION,
        }
    }
}

/// Arguments of `pcc dataset`.
#[derive(Args)]
pub(crate) struct Arguments {
    /// Kind of scenes.
    #[arg(long, value_enum, default_value = "general")]
    setting: SettingName,
    /// How paths are made.
    #[arg(long, value_enum, default_value = "teacher")]
    method: Method,
    /// Number of balls in every general scene, instead of the cycle (0 to 64).
    #[arg(long)]
    balls: Option<usize>,
    /// Targets to draw, at least 1.
    #[arg(long, default_value_t = 320, value_parser = clap::value_parser!(u64).range(1..))]
    targets: u64,
    /// Starts of each target (1 to 5).
    #[arg(long, default_value_t = 5)]
    starts: usize,
    /// End shapes of each start, as many of them as there are (1 to 64; the paper's generator: 1 to 10).
    #[arg(long, default_value_t = 10)]
    ends: usize,
    /// Trees that the teacher looks at where a straight segment leads it nowhere, to keep the shortest path (1 to 64).
    #[arg(long, default_value_t = 1)]
    trees: usize,
    /// Seed; the same seed gives the same rows whatever the shards and threads.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Put every row into the test split.
    #[arg(long)]
    test_only: bool,
    /// This shard of how many, as `i/n`, counted from 0; the shard that ends last merges.
    #[arg(long, default_value = "0/1")]
    shard: String,
    /// Worker threads, at most 256 (0: one a core).
    #[arg(long, default_value_t = 0, value_parser = threads())]
    threads: usize,
    /// Robot file; its three sections must be equally long.
    #[arg(long, default_value = "config/robots/unit.toml")]
    robot: PathBuf,
    /// Folder for the data set; finished blocks in it are not made again.
    #[arg(long)]
    out: PathBuf,
}

#[derive(Clone, Copy, ValueEnum)]
enum FrameName {
    /// Turned so that the goal has azimuth zero.
    Canonical,
    /// The robot's base.
    Base,
}

/// Arguments of `pcc features`.
#[derive(Args)]
pub(crate) struct FeatureArguments {
    /// Folder of a data set.
    #[arg(long)]
    dataset: PathBuf,
    /// Added to the target indices, so that the targets of several data sets stay apart.
    #[arg(long, default_value_t = 0)]
    first_group: i64,
    /// Frame of the arrays.
    #[arg(long, value_enum, default_value = "canonical")]
    frame: FrameName,
    /// Robot file.
    #[arg(long, default_value = "config/robots/unit.toml")]
    robot: PathBuf,
    /// Training archive to write.
    #[arg(long)]
    out: PathBuf,
}

/// What became of what was asked for; the part of the method that was not used stays empty.
#[derive(Default)]
struct Reports {
    teacher: BlockReport,
    paper: PaperReport,
}

struct Job<'a> {
    arguments: &'a Arguments,
    robot: Robot,
    recipe: Recipe,
    blocks: PathBuf,
}

pub(crate) fn generate(arguments: &Arguments) -> anyhow::Result<()> {
    let (shard, shards) = parse_shard(&arguments.shard)?;
    let job = Job::new(arguments)?;
    let all = arguments.targets.div_ceil(BLOCK);
    let mine: Vec<u64> = (0..all)
        .filter(|b| b % shards == shard && !job.is_done(*b))
        .collect();
    job.make(&mine)?;
    if (0..all).all(|block| job.is_done(block)) {
        job.merge(all)?;
    } else {
        say!("waiting for the other shards: the one that ends last merges");
    }
    Ok(())
}

fn parse_shard(text: &str) -> anyhow::Result<(u64, u64)> {
    let (shard, shards) = text.split_once('/').context("--shard must look like 0/4")?;
    let number = |part: &str| -> anyhow::Result<u64> {
        let number = part.parse();
        number.with_context(|| format!("--shard {text}: two whole numbers are needed, like 0/4"))
    };
    let (shard, shards) = (number(shard)?, number(shards)?);
    if shard >= shards {
        bail!("--shard {text}: the first number must be below the second");
    }
    Ok((shard, shards))
}

impl<'a> Job<'a> {
    fn new(arguments: &'a Arguments) -> anyhow::Result<Self> {
        let setting = match (arguments.setting, arguments.balls) {
            (SettingName::General, balls) if balls.unwrap_or(0) <= 64 => Setting::General(balls),
            (SettingName::General, Some(balls)) => bail!("--balls {balls}: 0 to 64 are allowed"),
            (_, Some(_)) => bail!("--balls goes with --setting general"),
            (SettingName::Reference, None) => Setting::Reference,
            (SettingName::ObstacleFree, None) => Setting::ObstacleFree,
            (SettingName::Hard, None) => Setting::Hard,
            (SettingName::General, None) => Setting::General(None),
        };
        let is_paper = arguments.method == Method::Paper;
        if is_paper && setting == Setting::Hard {
            bail!("--method paper makes the settings reference, obstacle-free and general");
        }
        for (name, value, most) in [
            ("starts", arguments.starts, STARTS),
            (
                "ends",
                arguments.ends,
                if is_paper { TERMINALS } else { 64 },
            ),
            ("trees", arguments.trees, if is_paper { 1 } else { 64 }),
        ] {
            if !(1..=most).contains(&value) {
                bail!("--{name} {value}: 1 to {most} are allowed");
            }
        }
        let recipe = Recipe {
            setting,
            seed: arguments.seed,
            starts: arguments.starts,
            ends: arguments.ends,
            trees: arguments.trees,
            test_only: arguments.test_only,
        };
        let blocks = arguments.out.join("blocks");
        std::fs::create_dir_all(&blocks)
            .with_context(|| format!("cannot make {}", blocks.display()))?;
        let job = Self {
            arguments,
            robot: unit_robot(&arguments.robot)?,
            recipe,
            blocks,
        };
        job.check_recipe()?;
        Ok(job)
    }

    /// Refuses to mix blocks of different recipes, generators or robots in one folder.
    fn check_recipe(&self) -> anyhow::Result<()> {
        let file = self.arguments.out.join("recipe.json");
        let text = serde_json::to_string_pretty(&self.recipe_json())?;
        match std::fs::read_to_string(&file) {
            Ok(found) if found != text => bail!(
                "{} was made with another recipe: {found}\nthis one is: {text}\nchoose another --out, or remove the folder",
                self.arguments.out.display()
            ),
            Ok(_) => Ok(()),
            Err(_) => write_whole(&file, &text)
                .with_context(|| format!("cannot write {}", file.display())),
        }
    }

    fn recipe_json(&self) -> serde_json::Value {
        let a = self.arguments;
        let robot = &self.robot;
        json!({
            "method": format!("{:?}", a.method), "generator": a.method.version(),
            "setting": format!("{:?}", self.recipe.setting), "targets": a.targets, "starts": a.starts, "ends": a.ends,
            "trees": a.trees, "seed": a.seed, "test_only": a.test_only, "robot": robot.name, "section_lengths": robot.section_lengths,
            "bending_limit_rad": robot.bending_limit, "tube_radius": robot.largest_tube_radius(),
        })
    }

    fn block_folder(&self, block: u64) -> PathBuf {
        self.blocks.join(format!("block-{block:06}"))
    }

    fn is_done(&self, block: u64) -> bool {
        self.block_folder(block).join("dataset_meta.json").exists()
    }

    fn make(&self, blocks: &[u64]) -> anyhow::Result<()> {
        let bar = progress_bar(blocks.len() as u64);
        let (next, total) = (AtomicU64::new(0), Mutex::new(Reports::default()));
        let threads = match self.arguments.threads {
            0 => std::thread::available_parallelism()?.get(),
            n => n,
        };
        std::thread::scope(|scope| {
            let work = || -> anyhow::Result<()> {
                while let Some(block) = blocks.get(next.fetch_add(1, Ordering::Relaxed) as usize) {
                    let reports = self.make_block(*block)?;
                    let mut total = total
                        .lock()
                        .map_err(|_| anyhow::anyhow!("a worker stopped"))?;
                    total.teacher += reports.teacher;
                    total.paper += reports.paper;
                    let kept = total.teacher.kept + total.paper.actual_paths;
                    bar.set_message(format!("{kept} paths kept"));
                    bar.inc(1);
                }
                Ok(())
            };
            let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
            workers
                .into_iter()
                .try_for_each(|w| w.join().map_err(|_| anyhow::anyhow!("a worker stopped"))?)
        })?;
        bar.finish();
        let total = total.into_inner().unwrap_or_default();
        match self.arguments.method {
            Method::Teacher => print_teacher_report(&total.teacher),
            Method::Paper => print_paper_report(&total.paper),
        }
        Ok(())
    }

    fn make_block(&self, block: u64) -> anyhow::Result<Reports> {
        let end = ((block + 1) * BLOCK).min(self.arguments.targets);
        let targets = block * BLOCK..end;
        let mut reports = Reports::default();
        let (rows, meta);
        match self.arguments.method {
            Method::Teacher => {
                (rows, reports.teacher) = generate_block(&self.robot, &self.recipe, targets);
                let report = format!("{:?}", reports.teacher);
                meta = self.meta(json!({ "block": block, "report": report }), None);
            }
            Method::Paper => {
                (rows, reports.paper) = generate_paper_block(&self.robot, &self.recipe, targets);
                meta = self.meta(json!({ "block": block }), Some(reports.paper));
            }
        }
        Dataset { rows, meta }.write(&self.block_folder(block))?;
        Ok(reports)
    }

    fn meta(&self, config: serde_json::Value, report: Option<PaperReport>) -> Meta {
        Meta {
            clearance_margin: self.robot.largest_tube_radius(),
            report,
            ..Meta::new(config)
        }
    }

    fn merge(&self, blocks: u64) -> anyhow::Result<()> {
        let mut rows: Vec<Row> = Vec::new();
        let mut report = PaperReport::default();
        for block in 0..blocks {
            let block = Dataset::read(&self.block_folder(block))?;
            rows.extend(block.rows);
            report += block.meta.report.unwrap_or_default();
        }
        let count = rows.len();
        let is_paper = self.arguments.method == Method::Paper;
        let meta = self.meta(self.recipe_json(), is_paper.then_some(report));
        Dataset { rows, meta }.write(&self.arguments.out)?;
        say!("{}: {count} paths", self.arguments.out.display());
        Ok(())
    }
}

fn print_teacher_report(r: &BlockReport) {
    say!(
        "{} targets ({} dropped), {} starts without an end shape; {} paths kept ({} with the tree's help), {} dropped",
        r.targets,
        r.dropped_targets,
        r.dropped_starts,
        r.kept,
        r.from_tree,
        r.dropped_paths
    );
}

fn print_paper_report(r: &PaperReport) {
    let (targets, paths) = (&r.target_discarded_counts, &r.path_failure_counts);
    say!(
        "{} of {} targets (dropped: {} without ten terminal solutions, {} without starts, {} without a path)",
        r.actual_targets,
        r.requested_targets,
        targets.terminal_ik,
        targets.start_sampling,
        targets.zero_retained_paths
    );
    say!(
        "{} of {} paths kept, {:.1} % (dropped: {} not followed, {} with too large steps, {} colliding)",
        r.actual_paths,
        r.requested_paths,
        100.0 * r.actual_paths as f64 / r.requested_paths.max(1) as f64,
        paths.workspace_ik,
        paths.path_constraints,
        paths.collision_repair
    );
}

/// Writes a file that others, such as another shard, see whole or not at all.
fn write_whole(file: &Path, text: &str) -> std::io::Result<()> {
    let part = file.with_extension(format!("{}.part", std::process::id()));
    std::fs::write(&part, text)?;
    std::fs::rename(part, file)
}

pub(crate) fn features(arguments: &FeatureArguments) -> anyhow::Result<()> {
    if let Some(folder) = arguments.out.parent() {
        std::fs::create_dir_all(folder)
            .with_context(|| format!("cannot make {}", folder.display()))?;
    }
    let robot = unit_robot(&arguments.robot)?;
    let dataset = Dataset::read(&arguments.dataset)?;
    let frame = match arguments.frame {
        FrameName::Canonical => FeatureFrame::Canonical,
        FrameName::Base => FeatureFrame::Base,
    };
    let rows = training_rows(&robot, &dataset.rows, arguments.first_group, frame)?;
    rows.write(&arguments.out)?;
    say!("{}: {} rows", arguments.out.display(), rows.len());
    Ok(())
}

/// Loads a robot in units of its section length.
pub(crate) fn unit_robot(file: &Path) -> anyhow::Result<Robot> {
    let robot = Robot::from_file(file).with_context(|| format!("robot file {}", file.display()))?;
    let length = robot
        .equal_section_length()
        .context("the three sections must be equally long")?;
    Ok(robot.scaled(1.0 / length))
}

fn progress_bar(length: u64) -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} blocks, {msg}, {eta} left");
    ProgressBar::new(length).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}
