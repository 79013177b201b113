//! `pcc latency`: how long plans take as a client sees it, under load that N clients make, beside the controller's loop.

mod baselines;
mod compare;
mod load;
mod loop_lateness;
mod machine;
mod plot;
mod priorities;
mod requests;
mod summary;

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use client::Client;
use serde_json::json;
use shared_types::ipc::IpcOptions;

use self::baselines::Baselines;
pub(crate) use self::baselines::{ServerArguments, serve};
use self::load::{Load, Pace};
use self::loop_lateness::LoopLateness;
use self::machine::Machine;
use self::priorities::Priorities;
use self::requests::Requests;
use self::summary::Summary;
use crate::number;
use crate::output_files::{make_writable_for, write_whole};

/// How long a daemon may take to show up.
const TIMEOUT: Duration = Duration::from_secs(5);

/// Arguments of `pcc latency`.
#[derive(Args)]
pub(crate) struct Arguments {
    /// Clients that ask at once (1 to 64); the daemon's `clients` bounds them.
    #[arg(long, default_value_t = 1, value_parser = number::whole(1_usize, 64))]
    clients: usize,
    /// Requests of all clients together.
    #[arg(long, default_value_t = 1_000, value_parser = number::whole(1_u64, 10_000_000))]
    requests: u64,
    /// Requests before those that count, of each client.
    #[arg(long, default_value_t = 50, value_parser = number::whole(0_u64, 1_000_000))]
    warm_up: u64,
    /// Open loop: requests per second of all clients, whether or not earlier ones are answered; times count from when a request was to be
    /// sent. Without it, closed loop: each client asks as soon as it has its answer.
    #[arg(long, value_parser = number::real(0.1, 1e6, "requests per second"))]
    rate: Option<f64>,
    /// Candidates of a request.
    #[arg(long, default_value_t = 10, value_parser = number::candidates())]
    candidates: usize,
    /// Deadline of a request, milliseconds.
    #[arg(long, default_value_t = 1_000, value_parser = number::whole(1_u64, 60_000))]
    deadline_ms: u64,
    /// Seed of the tips that are asked for.
    #[arg(long, default_value_t = 0, value_parser = number::any())]
    seed: u64,
    /// Write the figures as a JSON object.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Draw the distributions as an SVG picture, time by percentile.
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Write each request that counts: when it was due, before it was sent and after its answer was read, nanoseconds of CLOCK_MONOTONIC.
    #[arg(long, value_name = "FILE")]
    stamps: Option<PathBuf>,
    /// Measure the transport, too: raw iceoryx2 and a Unix socket with the same payload, so many round trips of each in five windows. Of the
    /// transport alone where the daemon has `planner = "null"`.
    #[arg(long, value_name = "COUNT", value_parser = number::whole(1_u64, 1_000_000))]
    baselines: Option<u64>,
    /// Compare with a file that `--json` wrote.
    #[arg(long, value_name = "FILE")]
    compare: Option<PathBuf>,
}

/// Measures, and writes what was asked for; fails where no request had a candidate, and where the controller was lost meanwhile.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let written = [&arguments.json, &arguments.plot, &arguments.stamps];
    for file in written.into_iter().flatten() {
        make_writable_for(file)?;
    }
    let before = arguments
        .compare
        .as_deref()
        .map(compare::read)
        .transpose()?;
    let options = IpcOptions::from_env();
    let mut first = Client::connect(&options)?;
    first.wait_for_daemon(TIMEOUT)?;
    let robot = requests::robot(&options)?;
    drop(first);
    let load = Load {
        clients: arguments.clients,
        requests: arguments.requests,
        warm_up: arguments.warm_up,
        pace: arguments.rate.map_or(Pace::Closed, Pace::Open),
        asked: Requests::new(
            &robot,
            arguments.candidates,
            arguments.deadline_ms,
            arguments.seed,
        ),
    };
    let (machine, lateness) = (Machine::watch(), LoopLateness::watch(&options)?);
    let replies = load.run(&options)?;
    let priorities = Priorities::now(&options);
    let summary = Summary::of(&replies, load.pace);
    let (machine, lateness) = (machine.figures(), lateness.figures()?);
    let baselines = arguments
        .baselines
        .map(|count| Baselines::measure(&options, &load.asked.request(0), count));
    let baselines = baselines.transpose()?;
    say!("{}", load.text());
    summary.show();
    lateness.show();
    machine.show();
    priorities.show();
    baselines.iter().for_each(Baselines::show);
    if let Some(before) = &before {
        compare::show(before, &load.json(), &summary);
    }
    let figures = json!({
        "load": load.json(),
        "plans": summary.json(),
        "controller_loop": lateness.json(),
        "machine": machine.json(),
        "priorities": priorities.json(),
        "baselines": baselines.as_ref().map(Baselines::json),
    });
    if let Some(file) = &arguments.json {
        write_whole(file, &format!("{figures:#}\n"))?;
    }
    if let Some(file) = &arguments.stamps {
        write_whole(file, &load::stamps(&replies))?;
    }
    anyhow::ensure!(summary.planned() > 0, "no request had a candidate");
    if let Some(file) = &arguments.plot {
        write_whole(file, &plot::svg(&summary, &load.text())?)?;
    }
    lateness.check()?;
    Ok(())
}
