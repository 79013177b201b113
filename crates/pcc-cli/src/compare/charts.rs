//! Charts of a comparison as SVG: a row a planner with its interval, and shares by number of balls.

use super::comparison::{PlannerResult, SetResult};
use super::drawing::{Area, COLOURS, Drawn, GREY as OTHERS, INK, svg};
use crate::bootstrap::Interval;
use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

const WIDTH: u32 = 520;
/// Height of a row, of the title and of the axis, pixels.
const ROW: u32 = 24;
const TITLE: u32 = 34;
const AXIS: u32 = 46;
/// Room for the names of the planners, pixels.
const NAMES: u32 = 130;
const OURS: RGBColor = COLOURS[0];
/// Planners of this project: what it serves, and its learned sampler.
const OWN: [&str; 2] = ["default", "fast"];
/// Width of a chart by number of balls ÷ that of its lines: the planners' names are beside them.
const ROOM_FOR_NAMES: f64 = 1.4;

/// A figure of every planner, a row each: a dot, and its interval as a line. Planners without a value have an empty row.
pub(super) fn rows(
    set: &SetResult,
    title: &str,
    is_logarithmic: bool,
    figure: fn(&PlannerResult) -> Interval,
) -> anyhow::Result<String> {
    let rows: Vec<(&str, Interval)> = set
        .planners
        .iter()
        .map(|it| (it.planner.as_str(), figure(it)))
        .collect();
    named_rows(title, is_logarithmic, &rows)
}

/// A row for each name.
pub(super) fn named_rows(
    title: &str,
    is_logarithmic: bool,
    rows: &[(&str, Interval)],
) -> anyhow::Result<String> {
    let height = TITLE + AXIS + ROW * rows.len() as u32;
    svg((WIDTH, height), |area| match is_logarithmic {
        true => logarithmic_rows(area, title, rows),
        false => linear_rows(area, title, rows),
    })
}

/// Draws a chart's rows over a horizontal axis of this range.
fn draw_rows<X>(
    area: &Area,
    title: &str,
    rows: &[(&str, Interval)],
    range: X,
    label: fn(&f64) -> String,
) -> Drawn
where
    X: AsRangedCoord<Value = f64>,
    X::CoordDescType: ValueFormatter<f64>,
{
    let count = rows.len() as f64;
    let mut chart = ChartBuilder::on(area)
        .caption(title, ("sans-serif", 16).into_font().color(&INK))
        .margin_right(20)
        .x_label_area_size(30)
        .y_label_area_size(NAMES)
        .build_cartesian_2d(range, 0.0..count)?;
    chart
        .configure_mesh()
        .disable_y_mesh()
        .disable_y_axis()
        .y_labels(0)
        .x_labels(8)
        .x_label_formatter(&label)
        .label_style(("sans-serif", 14).into_font().color(&INK))
        .light_line_style(TRANSPARENT)
        .bold_line_style(OTHERS.mix(0.3))
        .axis_style(OTHERS)
        .draw()?;
    for (index, (name, interval)) in rows.iter().enumerate() {
        let y = count - index as f64 - 0.5;
        let planner = name.split(' ').next().unwrap_or_default();
        let colour = if OWN.contains(&planner) { OURS } else { OTHERS };
        let (_, pixel) = chart.backend_coord(&(interval.value.unwrap_or(1.0), y));
        let style = ("sans-serif", 14).into_font().color(&INK);
        let anchored = style.pos(Pos::new(HPos::Right, VPos::Center));
        let at = (NAMES as i32 - 8, pixel);
        area.draw(&Text::new((*name).to_owned(), at, anchored))?;
        if let (Some(low), Some(high)) = (interval.low, interval.high) {
            let line = [(low, y), (high, y)];
            chart.draw_series([PathElement::new(line, colour.stroke_width(3))])?;
        }
        if let Some(value) = interval.value {
            chart.draw_series([Circle::new((value, y), 5, colour.filled())])?;
        }
    }
    Ok(())
}

/// Shares from 0 to 1, written in percent.
fn linear_rows(area: &Area, title: &str, rows: &[(&str, Interval)]) -> Drawn {
    draw_rows(area, title, rows, 0.0..1.0, |share| {
        format!("{:.0} %", 100.0 * share)
    })
}

/// Values on a logarithmic axis.
fn logarithmic_rows(area: &Area, title: &str, rows: &[(&str, Interval)]) -> Drawn {
    let ends = rows.iter().flat_map(|(_, it)| [it.low, it.value, it.high]);
    let ends = ends.flatten().filter(|value| *value > 0.0);
    let (least, most) = ends.fold((f64::INFINITY, 0.0_f64), |(least, most), it| {
        (least.min(it), most.max(it))
    });
    if least > most {
        return linear_rows(area, title, rows);
    }
    let range = (least / 1.25..most * 1.25).log_scale();
    draw_rows(area, title, rows, range, |value| format!("{value}"))
}

/// Shares by number of balls, a line a planner.
pub(super) fn by_balls(
    set: &SetResult,
    title: &str,
    planners: &[&str],
    figure: fn(&super::figures::Figures) -> Interval,
) -> anyhow::Result<String> {
    let lines: Vec<(&str, Vec<(f64, f64)>)> = planners
        .iter()
        .filter_map(|name| {
            let result = set.planners.iter().find(|it| it.planner == *name)?;
            let points = result.figures.by_balls.iter();
            let points = points.filter_map(|(balls, it)| Some((*balls as f64, figure(it).value?)));
            Some((*name, points.collect()))
        })
        .collect();
    let balls = lines.iter().flat_map(|(_, points)| points).map(|it| it.0);
    let most = balls.fold(1.0, f64::max);
    svg((WIDTH, 360), |area| {
        let mut chart = ChartBuilder::on(area)
            .caption(title, ("sans-serif", 16).into_font().color(&INK))
            .margin_right(20)
            .x_label_area_size(40)
            .y_label_area_size(55)
            .build_cartesian_2d(0.0..ROOM_FOR_NAMES * most, 0.0..1.02)?;
        chart
            .configure_mesh()
            .x_desc("balls")
            .y_label_formatter(&|share| format!("{:.0} %", 100.0 * share))
            .x_label_formatter(&|balls| match balls.fract() == 0.0 && *balls <= most {
                true => format!("{balls:.0}"),
                false => String::new(),
            })
            .x_labels(9)
            .light_line_style(TRANSPARENT)
            .bold_line_style(OTHERS.mix(0.3))
            .draw()?;
        for ((name, points), colour) in lines.iter().zip(COLOURS) {
            let line = LineSeries::new(points.clone(), colour.stroke_width(2)).point_size(3);
            let mark =
                move |(x, y)| PathElement::new([(x, y), (x + 14, y)], colour.stroke_width(2));
            chart.draw_series(line)?.label(*name).legend(mark);
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::MiddleRight)
            .background_style(WHITE.mix(0.85))
            .label_font(("sans-serif", 14))
            .draw()?;
        Ok(())
    })
}
