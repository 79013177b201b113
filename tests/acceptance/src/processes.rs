//! Several clients at once, kills, and roles of which there is only one.

use shared_types::codes::LoopFault;
use tests::concurrency::{Answers, CLIENTS, ask_at_once, general_requests};
use tests::disturbance::Kind;
use tests::kills::disturb;
use tests::stack::{PATIENCE, Part, Stack};
use tests::world::Settings;
use toml::Value;

use crate::report::Report;
use crate::safe::kills::{limits, listed, phases, stuck, supervision};
use crate::scale::Scale;

pub(crate) fn run(report: &mut Report, scale: Scale) {
    let command = "acceptance chain, processes";
    report.group("several clients", command, |report| clients(report, scale));
    report.group("kills", command, |report| kills(report, scale));
    report.group("roles", command, roles);
}

fn ask_with_threads(
    threads: i64,
    requests: usize,
    rounds: usize,
) -> anyhow::Result<(Answers, LoopFault)> {
    let settings = Settings {
        daemon: vec![("threads", Value::Integer(threads))],
        ..Settings::default()
    };
    let mut stack = Stack::running(&settings)?;
    stack.disconnect_client();
    let pool = general_requests(&stack.world.robot, requests, stack.world.sampler());
    let answers = ask_at_once(&stack.world, &pool, rounds);
    let fault = stack.controller_state().fault;
    Ok((answers, fault))
}

fn clients(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let (requests, rounds) = scale.pick((25, 2), (50, 5));
    let (two, fault) = ask_with_threads(2, requests, rounds)?;
    let name = format!("requests of {CLIENTS} clients at once answered");
    report.all_of(&name, two.sent - two.lost.len(), two.sent);
    report.none_of("requests lost", &two.lost);
    report.none_of(
        "answers mixed up (id, start to the bit, tip)",
        &two.mixed_up,
    );
    let figure = format!("{} of {}", two.with_candidates, two.sent);
    let enough = two.with_candidates * 10 >= two.sent * 9;
    report.check(
        "answers with a certified candidate",
        figure,
        ">= 90 %",
        enough,
    );
    let moved = two.executed > 0 && fault == LoopFault::None;
    let figure = format!("{} motions executed, fault: {fault}", two.executed);
    report.check(
        "controller runs meanwhile",
        figure,
        "motions, no fault",
        moved,
    );
    let name = "motions on the side that were refused";
    report.none_of(name, &two.refused);
    let name = "motions on the side that did not reach their goals";
    report.none_of(name, &two.cut_short);
    let name = "repeated requests with another answer (same seed, bit for bit)";
    report.check(name, two.differing.to_string(), "0", two.differing == 0);
    let (one, _) = ask_with_threads(1, requests, 1)?;
    let differing = two
        .fingerprints
        .iter()
        .filter(|(seed, print)| one.fingerprints.get(seed) != Some(print))
        .count();
    let same = two.fingerprints.len() - differing;
    report.all_of(
        "distinct requests answered the same with 1 and 2 threads",
        same,
        requests,
    );
    Ok(())
}

fn kills(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut stack = Stack::running(&Settings::default())?;
    let count = scale.pick(18, 72);
    let survival = disturb(&mut stack, &[Kind::Kill], count, 1)?;
    let killed = &survival.disturbances;
    let enough = killed.len() == 3 && killed.values().all(|kills| kills * 3 == count);
    report.check(
        "kill -9 of daemon, controller, robot",
        listed(killed),
        &format!("{} each", count / 3),
        enough,
    );
    phases(report, &survival, &[Kind::Kill], count);
    limits(report, &survival);
    supervision(report, &survival);
    stuck(report, &survival);
    Ok(())
}

fn roles(report: &mut Report) -> anyhow::Result<()> {
    let mut stack = Stack::running(&Settings::fast_robot())?;
    for part in [Part::Daemon, Part::Controller] {
        let mut second = part.start(&stack.world);
        let status = second.wait(PATIENCE)?;
        let log = second.log();
        let named = log.contains(part.program())
            && log.contains("already runs")
            && log.contains(&stack.process(part).pid().to_string());
        let figure = format!("{status}, {}", log.lines().last().unwrap_or_default());
        let name = format!("a second {} refuses to start", part.program());
        report.check(
            &name,
            figure,
            "by name, status 1",
            named && status.code() == Some(1),
        );
    }
    let motion = stack.move_tip([0.0, -1.55, 2.25])?;
    report.at_most(
        "the first ones go on: tip error m",
        motion.commanded_tip_error,
        0.01,
    );
    Ok(())
}
