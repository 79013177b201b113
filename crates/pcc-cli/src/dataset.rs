//! `pcc dataset`: paths by the expert or by the paper's generator, or cases alone.

use crate::number::{self, Shard};
use crate::output_files::{make_writable, write_whole};
use crate::robot::unit_robot;
use anyhow::{Context, bail, ensure};
use clap::{Args, ValueEnum};
use datasets::scenes::{STARTS, Setting};
use datasets::{
    CASES_VERSION, Counts, Dataset, EXPERT_VERSION, GeneratorNotes, Meta, PAPER_VERSION, Recipe,
    Row, TERMINALS, generate_block, generate_cases, generate_paper_block,
};
use indicatif::{ProgressBar, ProgressStyle};
use input_files::{read_text, shortened};
use pcc_model::UnitRobot;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::Builder;

/// Targets of one block: the unit of work, of resuming and of sharding.
const BLOCK: u64 = 32;
/// Most balls of a generated scene, goal configurations of a start, and trees of a search.
const MOST_OF_A_SET: usize = 64;
/// Most targets of a set: weeks of work of a large machine.
const MOST_TARGETS: u64 = 10_000_000;
/// Longest recipe that is read, bytes.
const MAX_RECIPE_BYTES: u64 = 1 << 16;
/// Lines of progress that are printed where there is no terminal to draw a bar on.
const PROGRESS_LINES: u64 = 20;

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
    /// Certified paths with a straight tip, by this project's expert.
    Expert,
    /// The paper's own generator, with its sampled criterion of collision.
    Paper,
    /// Every case that is drawn, for evaluation, with the straight segment as its path, certified or not.
    Cases,
}

impl Method {
    /// Version of the generator.
    fn version(self) -> u32 {
        match self {
            Self::Expert => EXPERT_VERSION,
            Self::Paper => PAPER_VERSION,
            Self::Cases => CASES_VERSION,
        }
    }

    /// Refuses more goal configurations or trees than the method makes.
    fn check(self, ends: usize, trees: usize) -> anyhow::Result<()> {
        let (name, most_ends) = match self {
            Self::Expert => return Ok(()),
            Self::Paper => ("paper", TERMINALS),
            Self::Cases => ("cases", 1),
        };
        for (option, value, most) in [("ends", ends, most_ends), ("trees", trees, 1)] {
            ensure!(
                value <= most,
                "--{option} {value}: 1 to {most} are allowed with --method {name}"
            );
        }
        Ok(())
    }
}

/// Arguments of `pcc dataset`.
#[derive(Args)]
pub(crate) struct Arguments {
    /// Kind of scenes.
    #[arg(long, value_enum, default_value = "general")]
    setting: SettingName,
    /// How paths are made.
    #[arg(long, value_enum, default_value = "expert")]
    method: Method,
    /// Number of balls in every scene, instead of the cycle (general: 0 to 64, reference: 0, 1, 2 or 4).
    #[arg(long, value_parser = number::whole(0, MOST_OF_A_SET))]
    balls: Option<usize>,
    /// Targets to draw (1 to 10000000).
    #[arg(long, default_value_t = 320, value_parser = number::whole(1, MOST_TARGETS))]
    targets: u64,
    /// Starts of each target (1 to 5).
    #[arg(long, default_value_t = 5, value_parser = number::whole(1, STARTS))]
    starts: usize,
    /// Goal configurations of each start, as many of them as there are (1 to 64, else 10; the paper's generator: 1 to 10; cases: 1).
    #[arg(long, value_parser = number::whole(1, MOST_OF_A_SET))]
    ends: Option<usize>,
    /// Trees that the expert looks at where a straight segment leads it nowhere, to keep the shortest path (1 to 64; the paper's generator and cases: 1).
    #[arg(long, default_value_t = 1, value_parser = number::whole(1, MOST_OF_A_SET))]
    trees: usize,
    /// Seed (0 to 2^64 - 1); the same seed gives the same rows whatever the shards and threads.
    #[arg(long, default_value_t = 0, value_parser = number::any())]
    seed: u64,
    /// Put every row into the test split.
    #[arg(long)]
    test_only: bool,
    /// This shard of how many, as `i/n`, counted from 0; the shard that ends last merges.
    #[arg(long, default_value = "0/1", value_parser = number::shard)]
    shard: Shard,
    /// Worker threads, at most 256 (0: one a core).
    #[arg(long, default_value_t = 0, value_parser = number::threads())]
    threads: usize,
    /// Robot file; its three sections must be equally long.
    #[arg(long, default_value = "config/robots/unit.toml")]
    robot: PathBuf,
    /// Folder for the data set; finished blocks in it are not made again.
    #[arg(long)]
    out: PathBuf,
}

impl Arguments {
    fn ends(&self) -> usize {
        let by_method = match self.method {
            Method::Cases => 1,
            _ => TERMINALS,
        };
        self.ends.unwrap_or(by_method)
    }
}

/// How cases are generated that nothing was trained with.
#[derive(Debug, PartialEq)]
pub(crate) struct Unseen {
    pub(crate) setting: &'static str,
    /// `paper` keeps the cases with a path of the paper's own, `cases` every case that is drawn.
    pub(crate) method: &'static str,
    pub(crate) starts: usize,
    pub(crate) ends: usize,
    pub(crate) seed: u64,
}

/// Generates such a set, or goes on with it, in a folder.
pub(crate) fn generate_unseen(
    recipe: &Unseen,
    targets: u64,
    robot: &Path,
    out: &Path,
) -> anyhow::Result<()> {
    let named = |text: &str| anyhow::anyhow!("no such setting or method: {text}");
    let arguments = Arguments {
        setting: SettingName::from_str(recipe.setting, false).map_err(|_| named(recipe.setting))?,
        method: Method::from_str(recipe.method, false).map_err(|_| named(recipe.method))?,
        balls: None,
        targets,
        starts: recipe.starts,
        ends: Some(recipe.ends),
        trees: 1,
        seed: recipe.seed,
        test_only: true,
        shard: Shard { index: 0, count: 1 },
        threads: 0,
        robot: robot.to_owned(),
        out: out.to_owned(),
    };
    // Also a finished set is refused where its recipe, generator or robot is another one.
    Job::new(&arguments)?;
    match Meta::is_in(out) {
        true => Ok(()),
        false => generate(&arguments),
    }
}

struct Job<'a> {
    arguments: &'a Arguments,
    robot: UnitRobot,
    recipe: Recipe,
    blocks: PathBuf,
}

pub(crate) fn generate(arguments: &Arguments) -> anyhow::Result<()> {
    let Shard { index, count } = arguments.shard;
    let job = Job::new(arguments)?;
    let all = arguments.targets.div_ceil(BLOCK);
    let mut mine = Vec::new();
    for block in (0..all).filter(|b| b % count == index) {
        if !job.is_done(block)? {
            mine.push(block);
        }
    }
    say!(
        "{}: {} of {all} blocks of {BLOCK} targets to make",
        arguments.out.display(),
        mine.len()
    );
    job.make(&mine)?;
    for block in 0..all {
        if !job.is_done(block)? {
            say!("waiting for the other shards: the one that ends last merges");
            return Ok(());
        }
    }
    job.merge(all)
}

impl<'a> Job<'a> {
    fn new(arguments: &'a Arguments) -> anyhow::Result<Self> {
        let setting = match (arguments.setting, arguments.balls) {
            (SettingName::General, balls) => Setting::General(balls),
            (SettingName::Reference, None | Some(0 | 1 | 2 | 4)) => {
                Setting::Reference(arguments.balls)
            }
            (SettingName::Reference, Some(balls)) => {
                bail!("--balls {balls}: the reference has layouts of 0, 1, 2 and 4")
            }
            (_, Some(balls)) => bail!("--balls {balls} goes with --setting general or reference"),
            (SettingName::ObstacleFree, None) => Setting::ObstacleFree,
            (SettingName::Hard, None) => Setting::Hard,
        };
        if arguments.method == Method::Paper && setting == Setting::Hard {
            bail!("--method paper makes the settings reference, obstacle-free and general");
        }
        let ends = arguments.ends();
        arguments.method.check(ends, arguments.trees)?;
        let recipe = Recipe {
            setting,
            seed: arguments.seed,
            starts: arguments.starts,
            ends,
            trees: arguments.trees,
            test_only: arguments.test_only,
        };
        let job = Self {
            arguments,
            robot: unit_robot(&arguments.robot)?,
            recipe,
            blocks: arguments.out.join("blocks"),
        };
        make_writable(&job.blocks)?;
        job.check_recipe()?;
        Ok(job)
    }

    /// Writes the recipe; an error where the folder has blocks of another recipe, generator or robot, or another data set.
    fn check_recipe(&self) -> anyhow::Result<()> {
        let out = &self.arguments.out;
        let file = out.join("recipe.json");
        let text = serde_json::to_string_pretty(&self.recipe_json())?;
        match read_text(&file, MAX_RECIPE_BYTES) {
            Ok(found) if found != text => bail!(
                "{} was made with another recipe, by {}: {}\nthis one is needed: {text}\nchoose another --out, or remove the folder",
                out.display(),
                file.display(),
                shortened(&found)
            ),
            Ok(_) => Ok(()),
            Err(_) if !file.exists() => {
                ensure!(
                    !Meta::is_in(out),
                    "{} has a data set without recipe.json, which would be replaced: choose another --out",
                    out.display()
                );
                write_whole(&file, &text)
            }
            Err(error) => Err(error.into()),
        }
    }

    fn recipe_json(&self) -> serde_json::Value {
        let a = self.arguments;
        let robot = &self.robot;
        json!({
            "method": format!("{:?}", a.method), "generator": a.method.version(),
            "setting": format!("{:?}", self.recipe.setting), "targets": a.targets, "starts": a.starts, "ends": a.ends(),
            "trees": a.trees, "seed": a.seed, "test_only": a.test_only, "robot": robot.name, "section_lengths": robot.section_lengths,
            "bending_limit_rad": robot.bending_limit, "tube_radius": robot.largest_tube_radius(),
        })
    }

    fn block_folder(&self, block: u64) -> PathBuf {
        self.blocks.join(format!("block-{block:06}"))
    }

    /// The configuration that a block's metadata records.
    fn block_config(&self, block: u64) -> serde_json::Value {
        json!({ "block": block, "recipe": self.recipe_json() })
    }

    /// Whether a block is finished; an error where it was made by another recipe.
    fn is_done(&self, block: u64) -> anyhow::Result<bool> {
        let folder = self.block_folder(block);
        if !Meta::is_in(&folder) {
            return Ok(false);
        }
        let found = Meta::read(&folder)?.config;
        let expected = self.block_config(block);
        ensure!(
            found == expected,
            "{} was made with another recipe, or as another block, by its dataset_meta.json: {}\nthis one is needed: {expected}\nchoose another --out, or remove the folder",
            folder.display(),
            shortened(&found.to_string())
        );
        Ok(true)
    }

    fn make(&self, blocks: &[u64]) -> anyhow::Result<()> {
        let bar = progress_bar(blocks.len() as u64);
        let (next, total) = (AtomicU64::new(0), Mutex::new(Counts::default()));
        let threads = match self.arguments.threads {
            0 => std::thread::available_parallelism()?.get(),
            n => n,
        };
        std::thread::scope(|scope| {
            let work = || -> anyhow::Result<()> {
                while let Some(block) = blocks.get(next.fetch_add(1, Ordering::Relaxed) as usize) {
                    let counts = self.make_block(*block)?;
                    let mut total = total
                        .lock()
                        .map_err(|_| anyhow::anyhow!("a worker stopped"))?;
                    *total += &counts;
                    show_progress(&bar, &total);
                }
                Ok(())
            };
            let mut workers = Vec::new();
            for _ in 0..threads.min(blocks.len()) {
                let spawned = Builder::new().spawn_scoped(scope, work);
                workers.push(spawned.with_context(|| {
                    format!("--threads {threads}: not so many can be started, fewer are needed")
                })?);
            }
            workers
                .into_iter()
                .try_for_each(|w| w.join().map_err(|_| anyhow::anyhow!("a worker stopped"))?)
        })?;
        bar.finish();
        if !blocks.is_empty() {
            say!("{}", total.into_inner().unwrap_or_default());
        }
        Ok(())
    }

    fn make_block(&self, block: u64) -> anyhow::Result<Counts> {
        let end = ((block + 1) * BLOCK).min(self.arguments.targets);
        let targets = block * BLOCK..end;
        let (rows, counts) = match self.arguments.method {
            Method::Expert => generate_block(&self.robot, &self.recipe, targets),
            Method::Paper => generate_paper_block(&self.robot, &self.recipe, targets),
            Method::Cases => generate_cases(&self.robot, &self.recipe, targets),
        };
        let meta = self.meta(self.block_config(block), counts.clone());
        let folder = self.block_folder(block);
        match rows.is_empty() {
            true => meta.write(&folder)?,
            false => Dataset { rows, meta }.write(&folder)?,
        }
        Ok(counts)
    }

    fn meta(&self, config: serde_json::Value, counts: Counts) -> Meta {
        let setting = self.recipe.setting;
        Meta {
            clearance_margin: self.robot.largest_tube_radius(),
            counts: Some(counts),
            generator: match self.arguments.method {
                Method::Expert | Method::Cases => GeneratorNotes::of_expert(setting),
                Method::Paper => GeneratorNotes::of_paper(setting),
            },
            ..Meta::new(config)
        }
    }

    fn merge(&self, blocks: u64) -> anyhow::Result<()> {
        let mut rows: Vec<Row> = Vec::new();
        let mut counts = Counts::default();
        for block in 0..blocks {
            let folder = self.block_folder(block);
            let of_block = Meta::read(&folder)?;
            // The counts in the metadata may be damaged: where there are arrays, they are read.
            let has_arrays = of_block.arrays.is_some();
            let of_block = of_block.counts.unwrap_or_default();
            if has_arrays || of_block.actual_paths > 0 {
                let block = Dataset::read(&folder);
                rows.extend(block.with_context(|| folder.display().to_string())?.rows);
            }
            counts += &of_block;
        }
        let count = rows.len();
        let meta = self.meta(self.recipe_json(), counts);
        let out = &self.arguments.out;
        let written = Dataset { rows, meta }.write(out);
        written.with_context(|| format!("no data set in {}", out.display()))?;
        say!("{}: {count} paths", out.display());
        Ok(())
    }
}

/// Draws the progress bar; where there is no terminal, prints a line now and then.
fn show_progress(bar: &ProgressBar, total: &Counts) {
    bar.set_message(format!("{} paths kept", total.actual_paths));
    bar.inc(1);
    let (done, all) = (bar.position(), bar.length().unwrap_or(0));
    let lines = |blocks: u64| blocks * PROGRESS_LINES / all.max(1);
    if bar.is_hidden() && done < all && lines(done) > lines(done - 1) {
        say!("{done} of {all} blocks, {} paths kept", total.actual_paths);
    }
}

fn progress_bar(length: u64) -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} blocks, {msg}, {eta} left");
    ProgressBar::new(length).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}
