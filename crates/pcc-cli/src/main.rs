//! `pcc`: the one tool that talks to the planner daemon and the controller, makes data, and evaluates planners.

#[macro_use]
mod output;

mod averages;
mod bootstrap;
mod cases_hash;
mod command_line;
mod compare;
mod dataset;
mod demo;
mod evaluate;
mod execute;
mod features;
mod follow;
mod foreign_orders;
mod goal;
mod hash_text;
mod home;
mod html;
mod latency;
mod number;
mod option_faults;
mod order;
mod output_files;
mod plan;
mod planner;
mod record;
mod replay;
mod robot;
mod sampler;
mod scene;
mod services;
mod trace;
mod view;
mod watch;

use clap::{Parser, Subcommand};
use shared_types::valid::Command as Order;
use std::io::Write;
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
    /// Give the daemon a goal, to which it keeps the robot on its way, until `pcc stop` or another one.
    Goal(goal::Arguments),
    /// Have a candidate of an earlier plan executed, after it was looked at.
    Execute(execute::Arguments),
    /// Carry out four experiments on the running processes: the paper's three, and a target that moves.
    Demo(demo::Arguments),
    /// Show the live state of controller and robot.
    Watch(watch::Arguments),
    /// Order the controller to stop the robot along its path, and hold.
    Stop,
    /// Clear the controller's latched fault; it then holds where the robot is.
    Reset,
    /// Stop on the path and keep the motion, until resume.
    Pause,
    /// Go on after a pause.
    Resume,
    /// Set the speed at which motions are followed; a controller that is restarted begins at 1.
    Speed(order::SpeedArguments),
    /// Wind the tendons of a straight robot with Dynamixel servos to their pre-tension, and note where the servos are.
    Home(home::Arguments),
    /// List the services that are there, who uses them, and who is daemon, controller and robot.
    Services(services::Arguments),
    /// Measure how long plans take, in a closed loop or at a fixed rate of requests, and the controller's loop beside them.
    Latency(latency::Arguments),
    /// Answer as `pcc latency --baselines` wants it.
    #[command(hide = true)]
    LatencyServer(latency::ServerArguments),
    /// Record what the processes tell each other, and every request and answer, as an MCAP file.
    Record(record::Arguments),
    /// Ask the daemon again what a record says it was asked, or check recorded motions against a robot file.
    Replay(replay::Arguments),
    /// Sign off sources of live scenes.
    Scene(scene::Arguments),
    /// Generate paths for training or evaluation, sharded and resumable.
    Dataset(dataset::Arguments),
    /// Write the training arrays of the few-step model from a data set.
    Features(features::Arguments),
    /// Evaluate a planner on a data set and write result.json and paths.npz.
    Evaluate(evaluate::Arguments),
    /// Show motions in 3D: write one self-contained page of an evaluation or a record.
    View(view::Arguments),
    /// Compare planners over the same cases, with confidence intervals, and write compare.json, compare.csv and a page.
    Compare(compare::Arguments),
    /// Write how noise becomes a path, step by step, as an archive for pictures.
    Trace(trace::Arguments),
}

fn main() -> ExitCode {
    match run(command_line::read::<Arguments>().command) {
        Ok(()) if output::is_lost() => ExitCode::FAILURE,
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let _ = writeln!(
                std::io::stderr(),
                "pcc: {}",
                logging::with_causes(error.as_ref())
            );
            ExitCode::FAILURE
        }
    }
}

fn run(command: Command) -> anyhow::Result<()> {
    match command {
        Command::Plan(arguments) => plan::run(&arguments),
        Command::Goal(arguments) => goal::run(&arguments),
        Command::Execute(arguments) => execute::run(&arguments),
        Command::Demo(arguments) => demo::run(&arguments),
        Command::Watch(arguments) => watch::run(&arguments),
        Command::Stop => order::stop(),
        Command::Reset => order::give(Order::ResetFault),
        Command::Pause => order::give(Order::Pause),
        Command::Resume => order::give(Order::Resume),
        Command::Speed(arguments) => order::give(Order::SetSpeed(arguments.rate)),
        Command::Home(arguments) => home::run(&arguments),
        Command::Services(arguments) => services::run(&arguments),
        Command::Latency(arguments) => latency::run(&arguments),
        Command::LatencyServer(arguments) => latency::serve(&arguments),
        Command::Record(arguments) => record::run(&arguments),
        Command::Replay(arguments) => replay::run(&arguments),
        Command::Scene(arguments) => scene::run(&arguments),
        Command::Dataset(arguments) => dataset::generate(&arguments),
        Command::Features(arguments) => features::run(&arguments),
        Command::Evaluate(arguments) => evaluate::run(&arguments),
        Command::View(arguments) => view::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        Command::Trace(arguments) => trace::run(&arguments),
    }
}

#[cfg(test)]
mod tests {
    use anyhow::Context;

    #[test]
    fn a_cause_is_said_once() {
        let refused = || std::io::Error::from(std::io::ErrorKind::PermissionDenied);
        let once = anyhow::Error::from(refused()).context(format!("cannot read x: {}", refused()));
        assert_eq!(
            logging::with_causes(once.as_ref()),
            format!("cannot read x: {}", refused())
        );
        let Err(chain) = Err::<(), _>(refused()).context("robot file x") else {
            unreachable!("it was an error");
        };
        assert_eq!(
            logging::with_causes(chain.as_ref()),
            format!("robot file x: {}", refused())
        );
    }
}
