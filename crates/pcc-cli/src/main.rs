//! `pcc`: the one tool that talks to the planner daemon and the controller, makes data, and evaluates planners.

mod dataset;
mod demo;
mod evaluate;
mod plan;
mod planner;
mod watch;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Plans, watches, evaluates: motion planning for three-section continuum robots.
#[derive(Parser)]
#[command(version, about)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Ask the daemon for candidates; can have one executed.
    Plan(plan::Arguments),
    /// Carry out the paper's three experiments on the running processes.
    Demo(demo::Arguments),
    /// Show the live state of controller and robot.
    Watch(watch::Arguments),
    /// Generate paths for training or evaluation, sharded and resumable.
    Dataset(dataset::Arguments),
    /// Write the training arrays of the few-step model from a data set.
    Features(dataset::FeatureArguments),
    /// Evaluate a planner on a data set and write result.json and paths.npz.
    Evaluate(evaluate::Arguments),
}

fn main() -> ExitCode {
    match run(Arguments::parse().command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("pcc: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(command: Command) -> anyhow::Result<()> {
    match command {
        Command::Plan(arguments) => plan::run(&arguments),
        Command::Demo(arguments) => demo::run(&arguments),
        Command::Watch(arguments) => watch::run(&arguments),
        Command::Dataset(arguments) => dataset::generate(&arguments),
        Command::Features(arguments) => dataset::features(&arguments),
        Command::Evaluate(arguments) => evaluate::run(&arguments),
    }
}
