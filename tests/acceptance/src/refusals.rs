//! Malformed input of every kind, and the memory that good input takes.

use tests::borders::send_malformed;
use tests::concurrency::{ask_at_once, general_requests};
use tests::raw::RawClient;
use tests::stack::{PATIENCE, Part, Stack};
use tests::starts::{BadStarts, configurations, robot_files, weights};
use tests::world::{Settings, World};

use crate::machine::memory_mb;
use crate::report::Report;

pub(crate) fn run(report: &mut Report) {
    let command = "acceptance chain, refusals";
    report.group("malformed requests", command, malformed_requests);
    report.group("bad starts", command, bad_starts);
    report.group("memory", command, memory);
}

fn malformed_requests(report: &mut Report) -> anyhow::Result<()> {
    for without_weights in [false, true] {
        let settings = Settings {
            without_weights,
            ..Settings::default()
        };
        let world = World::new(&settings);
        let mut daemon = Part::Daemon.start(&world);
        let client = RawClient::connect(&world.options, PATIENCE)?;
        let refusals = send_malformed(&client, world.has_weights)?;
        let model = if world.has_weights {
            "with a model"
        } else {
            "without a model"
        };
        let name = format!("malformed requests named, daemon {model}");
        report.all_of(&name, refusals.named, refusals.sent);
        let name = format!("good requests served after them, daemon {model}");
        report.all_of(&name, refusals.good_after, refusals.sent);
        report.none_of("answers other than expected", &refusals.unexpected);
        let alive = daemon.is_running();
        report.check("daemon alive after them", alive.to_string(), "true", alive);
    }
    Ok(())
}

fn bad_starts(report: &mut Report) -> anyhow::Result<()> {
    type Kind = (&'static str, fn() -> BadStarts);
    let kinds: [Kind; 3] = [
        ("weights files", weights),
        ("robot files", robot_files),
        ("configurations", configurations),
    ];
    for (kind, run) in kinds {
        let starts = run();
        let name = format!("bad {kind} refused by name, status 1");
        report.all_of(&name, starts.named, starts.tried);
        report.none_of(&format!("bad {kind} not refused so"), &starts.unexpected);
    }
    Ok(())
}

/// Shared and resident memory while everything runs and four clients ask.
fn memory(report: &mut Report) -> anyhow::Result<()> {
    let mut stack = Stack::running(&Settings::default())?;
    stack.disconnect_client();
    let pool = general_requests(&stack.world.robot, 20, stack.world.sampler());
    let answers = ask_at_once(&stack.world, &pool, 1);
    report.none_of("requests lost while memory is measured", &answers.lost);
    let shared_mb = stack.world.shared_memory_bytes() as f64 * 1e-6;
    report.at_most("shared memory of all services, MB", shared_mb, 48.0);
    let pid = stack.process(Part::Daemon).pid();
    let (resident, peak) = (memory_mb(pid, "VmRSS:")?, memory_mb(pid, "VmHWM:")?);
    report.at_most(
        "daemon's resident memory after 80 requests, MB",
        resident,
        250.0,
    );
    report.at_most("daemon's largest resident memory, MB", peak, 250.0);
    Ok(())
}
