//! Success of the paper's model against the updates of its training, as it was measured on the checkpoints of the committed weights.

use super::figure::{Figure, Picture};
use crate::compare::drawing::{Axis, COLOURS, Line, Lines};
use crate::compare::figure_name::FigureName;
use anyhow::Context;

/// Comments, and then lines of updates and success, %.
const MEASURED: &str = include_str!("../../../../../docs/results/updates.csv");

pub(super) fn figure() -> anyhow::Result<Figure> {
    let chart = Lines {
        x: Axis::linear("updates of 512 rows"),
        y: Axis::share("success"),
        lines: vec![Line::measured("diffusion-post", measured()?, COLOURS[0])],
        marks: Vec::new(),
    };
    let said = MEASURED.lines().filter_map(|line| line.strip_prefix("# "));
    let (command, text): (Vec<_>, Vec<_>) = said.partition(|line| line.starts_with("$ "));
    Ok(Figure {
        name: FigureName::Updates,
        title: "Success against updates of the training",
        pictures: vec![Picture::new(chart.svg()?, "by updates")],
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

/// Updates and success as a share.
fn measured() -> anyhow::Result<Vec<(f64, f64)>> {
    let rows = MEASURED
        .lines()
        .filter(|line| !line.starts_with('#'))
        .skip(1);
    let row = |line: &str| {
        let (updates, percent) = line.split_once(',').context("two numbers are needed")?;
        Ok((updates.parse()?, percent.parse::<f64>()? / 100.0))
    };
    rows.map(row).collect()
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_measured_curve_is_read() {
        let points = super::measured().unwrap();
        assert!(points.len() >= 5 && points.iter().all(|it| it.1 > 0.0 && it.1 <= 1.0));
        assert!(
            super::figure()
                .unwrap()
                .made_by
                .unwrap()
                .contains("pcc evaluate")
        );
    }
}
