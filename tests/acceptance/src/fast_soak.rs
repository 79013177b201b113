//! A hundred thousand random requests from two clients: what the daemon must never do.
//!
//! Two clients and two workers want two processors, and the system's own threads some more: for deadlines to hold, all of ours
//! have real-time priorities, as `realtime_priority` allows (decision 0016). Beside it the daemon as it ships, whose clients have no
//! priorities either.

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::sync::Barrier;
use std::thread;
use std::time::{Duration, Instant};

use anyhow::Context;
use client::{Client, ClientError, PlanAnswer};
use pcc_model::Robot;
use rand::RngExt;
use rand_pcg::Pcg64;
use shared_types::capacity::MAX_CANDIDATES;
use shared_types::codes::{Outcome, Stage};
use shared_types::message;
use shared_types::valid::{PlanReport, PlanRequest};
use tests::priority::{OF_A_CLIENT, OF_PLANNING};
use tests::raw::RawClient;
use tests::stack::{NO_DEADLINE, PATIENCE};
use tests::world::World;
use toml::Value;

use crate::fast_growth::most_candidates;
use crate::fast_kept::Kept;
use crate::fast_random::{Pool, Treatment, spoil, treatment};
use crate::fast_scenes::Served;
use crate::machine::{Disturbance, memory_mb};
use crate::report::Report;
use crate::scale::Scale;
use crate::second_look::Judged;
use crate::stolen::StolenTimes;

const CLIENTS: usize = 2;
/// Requests for as many candidates as there can be, before memory is read for the first time: more than the plans that the
/// daemon keeps.
const LARGEST: usize = 40;
/// Between two legs memory is read: the first leg is a tenth of all.
const LEGS: usize = 10;
/// Requests of one client between two pauses in which nobody waits and motions are judged: judging takes processors.
const BATCH: usize = 250;
/// One of so many answers has all of its motions judged; of every one, both ends are.
const JUDGED_SHARE: u32 = 20;
/// An answer may be this much later than its deadline.
const LATE_AT_MOST: Duration = Duration::from_millis(1);
/// Growth of the resident memory after the first leg: a share, and MB.
const MEMORY_SHARE: f64 = 0.02;
const MEMORY_MB: f64 = 2.0;

pub(crate) fn run(report: &mut Report, scale: Scale) {
    let command = "acceptance fast, two clients of planner-daemon";
    report.group("random requests", command, |report| {
        random_requests(report, scale.pick(300, 100_000), &PRIORITIES)
    });
    report.group("random requests as shipped", command, |report| {
        random_requests(report, scale.pick(300, 100_000), &AS_SHIPPED)
    });
}

/// A daemon and its clients.
struct Arrangement {
    /// In the lines.
    name: &'static str,
    has_priorities: bool,
    /// Most candidates of a request.
    candidates: usize,
}

const PRIORITIES: Arrangement = Arrangement {
    name: "random requests",
    has_priorities: true,
    candidates: MAX_CANDIDATES,
};
/// The shipped configuration in every key.
const AS_SHIPPED: Arrangement = Arrangement {
    name: "random requests as shipped",
    has_priorities: false,
    candidates: 16,
};

impl Arrangement {
    fn keys(&self) -> Vec<(&'static str, Value)> {
        if !self.has_priorities {
            return Vec::new();
        }
        let mut keys = most_candidates();
        keys.push(("realtime_priority", Value::Integer(OF_PLANNING.into())));
        keys
    }
}

/// What came of requests.
#[derive(Default)]
struct Findings {
    sent: usize,
    dropped: usize,
    refused_as_spoiled: usize,
    spoiled: usize,
    motions: usize,
    judged: Judged,
    outcomes: BTreeMap<&'static str, usize>,
    /// Answers that came late: when the request was sent, when the answer was there, by how much too late.
    late: Vec<Late>,
    /// Requests without an answer, spoiled ones that were not refused, internal errors.
    unexpected: Vec<String>,
    /// To be judged when nobody waits, and whether over their whole duration, or where they start and end.
    kept: Vec<(Kept, bool)>,
    /// Requests to be dropped that were not taken, because those dropped before were still being let go of.
    not_taken: usize,
}

struct Late {
    sent: Instant,
    answered: Instant,
    by: Duration,
    /// What was asked, and what took longest.
    what: String,
}

/// Names a request, and the stage of its answer that took longest.
fn what_was_late(request: &PlanRequest, report: &PlanReport) -> String {
    let longest = Stage::ALL
        .iter()
        .max_by_key(|stage| report.stage_ns(**stage));
    let longest = longest.map(|stage| (stage, 1e-6 * report.stage_ns(*stage) as f64));
    let longest = longest.map_or(String::new(), |(stage, ms)| {
        format!("{stage} took {ms:.2} ms")
    });
    let all = Stage::ALL.iter().map(|stage| report.stage_ns(*stage));
    let all = 1e-6 * all.sum::<u64>() as f64;
    format!(
        "{}, {} candidates, {} balls, deadline {:.2} ms, {}, {longest} of {all:.2} ms in the daemon",
        request.sampler,
        request.candidate_count,
        request.balls.len(),
        1e3 * request.deadline.unwrap_or_default().as_secs_f64(),
        report.outcome,
    )
}

impl Findings {
    fn merge(&mut self, other: Self) {
        self.sent += other.sent;
        self.dropped += other.dropped;
        self.refused_as_spoiled += other.refused_as_spoiled;
        self.spoiled += other.spoiled;
        self.motions += other.motions;
        self.judged.merge(other.judged);
        for (outcome, count) in other.outcomes {
            *self.outcomes.entry(outcome).or_default() += count;
        }
        self.late.extend(other.late);
        self.unexpected.extend(other.unexpected);
        self.kept.extend(other.kept);
        self.not_taken += other.not_taken;
    }
}

fn random_requests(
    report: &mut Report,
    count: usize,
    arrangement: &Arrangement,
) -> anyhow::Result<()> {
    let mut served = Served::start(arrangement.keys())?;
    let pool = Pool::draw(&served.world.unit_robot(), arrangement.candidates);
    let stolen = StolenTimes::watch()?;
    let disturbance = Disturbance::count(served.daemon.pid())?;
    largest_requests(&mut served, &pool)?;
    let Served {
        client,
        mut daemon,
        world,
    } = served;
    // Its place is wanted.
    drop(client);
    let mut findings = Findings::default();
    let mut memory = Vec::new();
    let begin = Instant::now();
    for leg in 0..LEGS {
        findings.merge(ask(&world, &pool, arrangement, [leg, count / LEGS]));
        memory.push(memory_mb(daemon.pid(), "VmRSS:")?);
        eprintln!(
            "  {}: {} of {count} after {:.0} s, {} motions, {:.1} MB",
            arrangement.name,
            findings.sent,
            begin.elapsed().as_secs_f64(),
            findings.motions,
            memory[leg],
        );
    }
    if !daemon.is_running() {
        let log = daemon.log();
        findings.unexpected.push(format!("the daemon ended: {log}"));
    }
    let name = arrangement.name;
    let line = format!("{name}: disturbed meanwhile");
    report.shown(&line, disturbance.text()?);
    show(report, name, &findings);
    lateness(report, arrangement, findings.late, &stolen);
    flat_memory(report, name, &memory);
    Ok(())
}

/// Requests that take as much memory as any: what they leave behind is no growth afterwards.
fn largest_requests(served: &mut Served, pool: &Pool) -> anyhow::Result<()> {
    let mut rng = Pcg64::new(LEGS as u128, 0);
    for _ in 0..LARGEST {
        let request = PlanRequest {
            candidate_count: pool.most_candidates(),
            deadline: Some(NO_DEADLINE),
            ..pool.request(&mut rng)
        };
        served.ask(&request)?;
    }
    Ok(())
}

/// A leg: so many requests, of all clients together.
fn ask(
    world: &World,
    pool: &Pool,
    arrangement: &Arrangement,
    [leg, count]: [usize; 2],
) -> Findings {
    let of_each = count / CLIENTS;
    let batches = (0..of_each).step_by(BATCH);
    let batches: Vec<usize> = batches.map(|begin| BATCH.min(of_each - begin)).collect();
    let together = Barrier::new(CLIENTS);
    let run = |client| {
        let (batches, together) = (&batches, &together);
        move || {
            let mut asker = Asker::new(world, pool, arrangement, Pcg64::new(leg as u128, client));
            for &batch in batches {
                let asker = asker.as_mut();
                let findings = asker.map(|asker| asker.ask_many(batch));
                together.wait();
                if let Ok(findings) = findings {
                    judge(&world.robot, findings);
                }
                together.wait();
            }
            asker.map(|asker| asker.findings)
        }
    };
    thread::scope(|scope| {
        let clients: Vec<_> = (0..CLIENTS).map(|i| scope.spawn(run(i as u128))).collect();
        let mut all = Findings::default();
        for client in clients {
            match client.join().expect("a client does not panic") {
                Ok(found) => all.merge(found),
                Err(error) => all.unexpected.push(format!("{error:#}")),
            }
        }
        all
    })
}

/// One client.
struct Asker<'a> {
    pool: &'a Pool,
    client: Client,
    raw: RawClient,
    rng: Pcg64,
    findings: Findings,
}

impl<'a> Asker<'a> {
    fn new(
        world: &'a World,
        pool: &'a Pool,
        arrangement: &Arrangement,
        rng: Pcg64,
    ) -> anyhow::Result<Self> {
        let mut client = Client::connect(&world.options)?;
        client.wait_for_daemon(PATIENCE)?;
        let raw = RawClient::connect(&world.options, PATIENCE)?;
        // What the connections start keeps the ordinary one.
        if arrangement.has_priorities {
            realtime::use_fifo_priority(OF_A_CLIENT)?;
        }
        Ok(Self {
            pool,
            client,
            raw,
            rng,
            findings: Findings::default(),
        })
    }

    /// So many requests, one after the other.
    fn ask_many(&mut self, count: usize) -> &mut Findings {
        if let Err(error) = (0..count).try_for_each(|_| self.next()) {
            self.findings.unexpected.push(format!("{error:#}"));
        }
        &mut self.findings
    }

    fn next(&mut self) -> anyhow::Result<()> {
        let request = self.pool.request(&mut self.rng);
        self.findings.sent += 1;
        match treatment(&mut self.rng) {
            Treatment::Ask => self.ask(request),
            Treatment::Drop(after) => self.drop_after(&request, after),
            Treatment::Spoil => self.spoil(&request),
        }
    }

    fn ask(&mut self, request: PlanRequest) -> anyhow::Result<()> {
        let sent = Instant::now();
        let answer = self.client.plan(&request, PATIENCE)?;
        let answered = Instant::now();
        let deadline = request.deadline.context("they all have one")?;
        let by = (answered - sent).saturating_sub(deadline);
        let report = answer.report();
        if by > LATE_AT_MOST {
            let what = what_was_late(&request, report);
            self.findings.late.push(Late {
                sent,
                answered,
                by,
                what,
            });
        }
        *self
            .findings
            .outcomes
            .entry(report.outcome.text())
            .or_default() += 1;
        if report.reason.contains("internal error") {
            self.findings.unexpected.push(report.reason.clone());
        }
        self.keep(request, &answer);
        Ok(())
    }

    /// Keeps the motions to be judged.
    fn keep(&mut self, request: PlanRequest, answer: &PlanAnswer) {
        let kept = Kept::of(request, answer);
        let findings = &mut self.findings;
        findings.motions += kept.motions.len();
        if !kept.motions.is_empty() {
            let wholly = self.rng.random_ratio(1, JUDGED_SHARE);
            findings.kept.push((kept, wholly));
        }
    }

    fn drop_after(&mut self, request: &PlanRequest, after: Duration) -> anyhow::Result<()> {
        match self.client.submit(request) {
            Ok(pending) => {
                thread::sleep(after);
                drop(pending);
                self.findings.dropped += 1;
                Ok(())
            }
            // What was dropped before is still being let go of.
            Err(ClientError::TooManyRequests) => {
                self.findings.not_taken += 1;
                Ok(())
            }
            Err(error) => Err(error.into()),
        }
    }

    fn spoil(&mut self, request: &PlanRequest) -> anyhow::Result<()> {
        let mut wire = message::PlanRequest::try_from(request)?;
        spoil(&mut wire, &mut self.rng);
        let answer = self.raw.ask(&wire, PATIENCE)?.report;
        let findings = &mut self.findings;
        findings.spoiled += 1;
        let is_refused = answer.outcome == Outcome::InvalidRequest.code()
            && answer.candidate_count == 0
            && answer.invalid_field != 0;
        findings.refused_as_spoiled += usize::from(is_refused);
        if !is_refused {
            let text = format!("outcome {}: {}", answer.outcome, answer.reason.text());
            findings.unexpected.push(text);
        }
        Ok(())
    }
}

/// Judges the motions that were kept, and lets go of them.
fn judge(robot: &Robot, findings: &mut Findings) {
    for (kept, wholly) in std::mem::take(&mut findings.kept) {
        for index in 0..kept.motions.len() {
            let suspect = kept.suspect(robot, index);
            findings.judged.add(&suspect, wholly);
        }
    }
}

fn show(report: &mut Report, name: &str, findings: &Findings) {
    let outcomes = findings.outcomes.iter();
    let outcomes: Vec<String> = outcomes
        .map(|(outcome, count)| format!("{count} {outcome}"))
        .collect();
    let line = format!(
        "{name}: {} of {CLIENTS} clients, {} dropped before their answer, {} more not taken while those dropped before were let go of: outcomes",
        findings.sent, findings.dropped, findings.not_taken
    );
    report.shown(&line, outcomes.join(", "));
    let line = format!(
        "{name}: the daemon ended, answers lost, internal errors, spoiled ones not refused"
    );
    report.none_of(&line, &findings.unexpected);
    report.all_of(
        &format!("{name}: spoiled ones refused with their field"),
        findings.refused_as_spoiled,
        findings.spoiled,
    );
    findings.judged.check(report, name);
}

/// Later than the deadline by more than a millisecond and what was stolen meanwhile. With priorities none may be (decision 0016);
/// without, the system decides who waits for a processor, and their number is shown.
fn lateness(
    report: &mut Report,
    arrangement: &Arrangement,
    mut late: Vec<Late>,
    stolen: &StolenTimes,
) {
    let name = arrangement.name;
    let ms = |duration: Duration| 1e3 * duration.as_secs_f64();
    late.sort_by_key(|late| Reverse(late.by));
    let worst = late.first().map_or(Duration::ZERO, |late| late.by);
    let line =
        format!("{name}: answers later than their deadline by more than 1 ms, and the latest");
    report.shown(&line, format!("{}, {:.2} ms", late.len(), ms(worst)));
    let beyond = late.iter().filter_map(|late| {
        let stolen = stolen.between(late.sent, late.answered);
        let (by, stolen_ms) = (ms(late.by), ms(stolen));
        let text = format!("{by:.2} ms late, {stolen_ms:.2} ms stolen: {}", late.what);
        (late.by > LATE_AT_MOST + stolen).then_some(text)
    });
    let beyond: Vec<String> = beyond.collect();
    let line = format!(
        "{name}: answers later than their deadline by more than 1 ms and the time stolen meanwhile"
    );
    if arrangement.has_priorities {
        report.none_of(&line, &beyond);
    } else {
        report.shown(&line, beyond.len().to_string());
    }
}

fn flat_memory(report: &mut Report, name: &str, memory: &[f64]) {
    let (first, last) = (memory[0], memory[memory.len() - 1]);
    let curve: Vec<String> = memory.iter().map(|mb| format!("{mb:.1}")).collect();
    let line = format!("{name}: the daemon's resident memory after every tenth of them, MB");
    let bar = first * (1.0 + MEMORY_SHARE) + MEMORY_MB;
    report.check(
        &line,
        curve.join(", "),
        &format!("the last <= {bar:.1}"),
        last <= bar,
    );
}
