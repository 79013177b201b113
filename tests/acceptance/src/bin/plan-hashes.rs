//! Prints the hash of every plan that a daemon answers to fixed requests: two daemons that plan alike print the same lines.
//!
//! `plan-hashes DAEMON [COUNT [SAMPLER…]]` starts the program `DAEMON` with this checkout's configuration and weights, asks each sampler
//! (all of them without names) the same `COUNT` requests (1,000 without it), and prints a line for each: sampler, seed, hash, candidates,
//! the selected one, outcome. The client knows only the protocol, so one build of it asks daemons of different commits.
//!
//! The requests are those of `tests::mixed_requests`, and every 11th goes on from a plan that was asked for before it.
#![allow(
    clippy::unwrap_used,
    reason = "a broken environment panics, and nothing is printed"
)]

use std::env;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use client::Client;
use shared_types::codes::Sampler;
use shared_types::valid::{PlanRequest, PreviousPlan};
use tests::mixed_requests::{is_every, mixed_requests};
use tests::process::Process;
use tests::stack::PATIENCE;
use tests::world::{Settings, World};
use toml::{Table, Value};

/// Requests of each sampler, where none are named.
const REQUESTS: usize = 1000;
/// Every so many requests go on from another plan.
const GOES_ON: usize = 11;

fn main() -> anyhow::Result<()> {
    let arguments = Arguments::read(env::args().skip(1))?;
    let (world, daemon) = start(&arguments.daemon);
    let mut client = Client::connect(&world.options)?;
    let served = client.wait_for_daemon(PATIENCE);
    served.with_context(|| daemon.log())?;
    let requests = mixed_requests(&world.unit_robot(), arguments.count);
    for sampler in arguments.samplers {
        for request in &requests {
            let line = answered(&mut client, sampler, request);
            println!("{}", line.with_context(|| daemon.log())?);
        }
    }
    Ok(())
}

/// What is asked on the command line.
struct Arguments {
    daemon: PathBuf,
    count: usize,
    samplers: Vec<Sampler>,
}

impl Arguments {
    fn read(mut words: impl Iterator<Item = String>) -> anyhow::Result<Self> {
        let usage = "usage: plan-hashes DAEMON [COUNT [SAMPLER…]]";
        let daemon = PathBuf::from(words.next().context(usage)?);
        if !daemon.is_file() {
            bail!("{}: no program; {usage}", daemon.display());
        }
        let count = words.next().map(|word| word.parse()).transpose();
        let named: anyhow::Result<Vec<Sampler>> = words.map(|word| sampler(&word)).collect();
        let named = named?;
        Ok(Self {
            daemon: daemon.canonicalize()?,
            count: count.context(usage)?.unwrap_or(REQUESTS),
            samplers: if named.is_empty() {
                Sampler::ALL.to_vec()
            } else {
                named
            },
        })
    }
}

fn sampler(name: &str) -> anyhow::Result<Sampler> {
    let known = Sampler::ALL.iter().find(|sampler| sampler.text() == name);
    let names: Vec<&str> = Sampler::ALL.iter().map(|sampler| sampler.text()).collect();
    known
        .copied()
        .with_context(|| format!("{name}: no sampler; allowed are {}", names.join(", ")))
}

/// The daemon with the shipped configuration and the paper's sampler.
fn start(program: &Path) -> (World, Process) {
    let mut diffusion = Table::new();
    diffusion.insert("model".to_owned(), "mixed".into());
    diffusion.insert("solver".to_owned(), "ddim".into());
    diffusion.insert("steps".to_owned(), 50.into());
    diffusion.insert("precision".to_owned(), "f32".into());
    let world = World::new(&Settings {
        daemon: vec![
            ("diffusion", Value::Table(diffusion)),
            ("resident_memory_budget_mb", Value::Float(500.0)),
        ],
        ..Settings::default()
    });
    let config = world.config("planner-daemon.toml");
    let config = config.to_str().unwrap();
    let daemon = Process::start_program(&world, program, &["--config", config]);
    (world, daemon)
}

/// The line of one request.
fn answered(
    client: &mut Client,
    sampler: Sampler,
    request: &PlanRequest,
) -> anyhow::Result<String> {
    let mut request = PlanRequest {
        sampler,
        ..request.clone()
    };
    let reads_previous = matches!(sampler, Sampler::Default | Sampler::Fast);
    if reads_previous && is_every(GOES_ON, request.seed as usize) {
        go_on(client, &mut request)?;
    }
    let answer = client.plan(&request, PATIENCE)?;
    let report = answer.report();
    let selected = report.selected.map_or("none".to_owned(), |i| i.to_string());
    Ok(format!(
        "{sampler} {} {:016x} {} candidates, {selected} selected, {}",
        request.seed,
        report.plan_hash,
        report.candidates.len(),
        report.outcome
    ))
}

/// Makes of a request one that goes on from the plan that it would be answered with, a third on the way along the selected motion.
fn go_on(client: &mut Client, request: &mut PlanRequest) -> anyhow::Result<()> {
    let answer = client.plan(request, PATIENCE)?;
    let Some(selected) = answer.selected() else {
        return Ok(());
    };
    let knot = &selected.knots[selected.knots.len() / 3];
    request.start_configuration_rad = knot.configuration_rad;
    request.start_velocity_rad_s = knot.velocity_rad_s;
    request.start_acceleration_rad_s2 = knot.acceleration_rad_s2;
    request.previous = Some(PreviousPlan {
        plan_id: answer.report().plan_id,
        candidate: None,
    });
    Ok(())
}
