//! Success of the paper's model against the updates of its training, as it was measured on checkpoints up to the committed weights and beyond.

use super::figure::{Figure, Picture};
use crate::compare::drawing::{Axis, COLOURS, Line, Lines};
use crate::compare::figure_name::FigureName;
use anyhow::Context;

/// Comments, and then lines of updates, rows of an update since the line before, and success, %.
const MEASURED: &str = include_str!("../../../../../docs/results/updates.csv");
/// Rows of the paper's updates.
const ROWS_OF_THE_PAPER: f64 = 64.0;

/// The success of a checkpoint's weights.
struct Point {
    updates: f64,
    /// Rows of each update since the point before.
    rows_of_an_update: f64,
    /// Rows of all updates so far.
    rows: f64,
    success: f64,
}

pub(super) fn figure() -> anyhow::Result<Figure> {
    let points = measured()?;
    let chart = |name, x| Lines {
        x: Axis::linear(name),
        y: Axis::share("success"),
        lines: lines(&points, x),
        marks: Vec::new(),
    };
    let by_updates = chart("updates", |it| it.updates);
    let by_rows = chart("rows, in updates of the paper's 64", |it| {
        it.rows / ROWS_OF_THE_PAPER
    });
    let said = MEASURED.lines().filter_map(|line| line.strip_prefix("# "));
    let (command, text): (Vec<_>, Vec<_>) = said.partition(|line| line.starts_with("$ "));
    Ok(Figure {
        name: FigureName::Updates,
        title: "Success against updates of the training",
        pictures: vec![
            Picture::new(by_updates.svg()?, "by updates"),
            Picture::new(by_rows.svg()?, "by rows"),
        ],
        caption: text.join(" "),
        made_by: Some(
            command
                .iter()
                .map(|line| &line[2..])
                .collect::<Vec<_>>()
                .join("\n"),
        ),
    })
}

/// A line for each number of rows an update, which begins where the one before ends.
fn lines(points: &[Point], x: fn(&Point) -> f64) -> Vec<Line> {
    let runs = points.chunk_by(|a, b| a.rows_of_an_update == b.rows_of_an_update);
    let mut before = None;
    let line = |(run, colour)| {
        let run: &[Point] = run;
        let points = before.into_iter().chain(run);
        let name = format!("{} rows an update", run[0].rows_of_an_update);
        let line = Line::measured(
            &name,
            points.map(|it| (x(it), it.success)).collect(),
            colour,
        );
        before = run.last();
        line
    };
    runs.zip(COLOURS).map(line).collect()
}

fn measured() -> anyhow::Result<Vec<Point>> {
    let lines = MEASURED
        .lines()
        .filter(|line| !line.starts_with('#'))
        .skip(1);
    let (mut updates, mut rows) = (0.0, 0.0);
    let point = |line: &str| {
        let mut numbers = line.split(',').map(str::parse::<f64>);
        let mut next = || anyhow::Ok(numbers.next().context("three numbers are needed")??);
        let ([now, rows_of_an_update], percent) = ([next()?, next()?], next()?);
        rows += (now - updates) * rows_of_an_update;
        updates = now;
        Ok(Point {
            updates,
            rows_of_an_update,
            rows,
            success: percent / 100.0,
        })
    };
    lines.map(point).collect()
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_measured_curve_is_read() {
        let points = super::measured().unwrap();
        assert!(points.len() >= 5);
        assert!(
            points
                .iter()
                .all(|it| it.success > 0.0 && it.success <= 1.0)
        );
        assert!(points.is_sorted_by(|a, b| a.updates < b.updates && a.rows < b.rows));
        let command = super::figure().unwrap().made_by.unwrap();
        assert!(command.contains("pcc evaluate"));
    }
}
