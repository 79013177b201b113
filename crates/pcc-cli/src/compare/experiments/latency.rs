//! How long plans take through the daemon.

use super::bench::Bench;
use super::figure::{Figure, Picture};
use super::processes::{self, Processes};
use crate::compare::drawing::{Axis, COLOURS, Line, Lines};
use crate::compare::figure_name::FigureName;
use crate::sampler::PlannerName;
use anyhow::Context;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::fs;

/// Bins of a tenfold time.
const BINS: f64 = 25.0;

/// What `pcc latency` measured.
#[derive(Deserialize, Serialize)]
struct Measured {
    round_trips_ms: Vec<f64>,
    /// Time by percentile, of the round trip and the longest stages.
    by_percentile_svg: String,
}

pub(super) fn figure(bench: &Bench) -> anyhow::Result<Figure> {
    let requests = bench.scale(2_000, 20_000);
    let records = bench.planner(PlannerName::Default)?.records;
    let settings = json!({ "requests": requests, "processes": processes::identity()? });
    let measured: Measured = bench.keep("latency", &records, &settings, || {
        let folder = bench.arguments.out.join("latency");
        let processes = Processes::start(bench.arguments, &folder)?;
        let [stamps, plot] = ["stamps.txt", "plot.svg"].map(|name| folder.join(name));
        let [stamps_text, plot_text] =
            [&stamps, &plot].map(|it| it.to_str().context("a path that is no text"));
        let (count, seed) = (requests.to_string(), bench.arguments.seed.to_string());
        processes.pcc(&[
            "latency",
            "--requests",
            &count,
            "--seed",
            &seed,
            "--stamps",
            stamps_text?,
            "--plot",
            plot_text?,
        ])?;
        Ok(Measured {
            round_trips_ms: round_trips_ms(&fs::read_to_string(&stamps)?)?,
            by_percentile_svg: fs::read_to_string(&plot)?,
        })
    })?;
    let mut sorted = measured.round_trips_ms.clone();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted[((sorted.len() - 1) as f64 * share).round() as usize];
    let [median, p99, p999] = [0.5, 0.99, 0.999].map(at);
    let chart = Lines {
        x: Axis::logarithmic("round trip, ms"),
        y: Axis::linear("requests"),
        lines: vec![Line::curve("", histogram(&sorted), COLOURS[0])],
        marks: vec![median, p99, p999],
    };
    Ok(Figure {
        name: FigureName::Latency,
        title: "Latency of plans through the daemon",
        pictures: vec![
            Picture::new(chart.svg()?, "histogram of the round trips"),
            Picture::new(
                measured.by_percentile_svg,
                "by percentile, with the longest stages",
            ),
        ],
        caption: format!(
            "{requests} requests of ten candidates, one after the other, from a client's request to its answer. Dashed lines: median {median:.2} ms, \
             99th percentile {p99:.2} ms, 99.9th {p999:.2} ms; the longest took {:.2} ms.",
            at(1.0)
        ),
        made_by: None,
    })
}

/// Times from sent to answered, of lines of three stamps.
fn round_trips_ms(text: &str) -> anyhow::Result<Vec<f64>> {
    let rows = text.lines().skip(1);
    let row = |line: &str| {
        let stamps: Vec<i64> = line.split(' ').map(str::parse).collect::<Result<_, _>>()?;
        let [_, sent, answered] = stamps[..] else {
            anyhow::bail!("three stamps are needed: {line}")
        };
        Ok((answered - sent) as f64 * 1e-6)
    };
    rows.map(row).collect()
}

/// The outline of a histogram with bins of equal width on a logarithmic axis.
fn histogram(sorted: &[f64]) -> Vec<(f64, f64)> {
    let bin = |value: f64| (BINS * value.log10()).floor();
    let edge = |bin: f64| 10.0_f64.powf(bin / BINS);
    let (Some(first), Some(last)) = (sorted.first(), sorted.last()) else {
        return Vec::new();
    };
    let mut outline = vec![(edge(bin(*first)), 0.0)];
    let mut at = bin(*first);
    while at <= bin(*last) {
        let count = sorted.iter().filter(|it| bin(**it) == at).count() as f64;
        outline.extend([(edge(at), count), (edge(at + 1.0), count)]);
        at += 1.0;
    }
    outline.push((edge(at), 0.0));
    outline
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_histogram_counts_every_value_once_and_stamps_are_differences() {
        let values = [0.5, 0.6, 0.61, 2.0];
        let outline = histogram(&values);
        let counted: f64 = outline.chunks(2).map(|it| it[0].1).sum::<f64>();
        assert!(
            counted <= 4.0 && outline.first().unwrap().1 == 0.0 && outline.last().unwrap().1 == 0.0
        );
        let counts: f64 = outline[1..outline.len() - 1]
            .chunks(2)
            .map(|it| it[0].1)
            .sum();
        assert_eq!(counts, 4.0);
        let text = "due_ns sent_ns answered_ns\n0 1000000 3000000\n";
        assert_eq!(round_trips_ms(text).unwrap(), [2.0]);
        assert!(round_trips_ms("due\n1 2\n").is_err());
    }
}
