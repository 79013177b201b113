//! A picture of the distributions: time by percentile, both on logarithmic axes, so that the slowest of ten, a hundred, a thousand are as
//! wide as each other.

use anyhow::anyhow;
use plotters::prelude::*;

use super::summary::Summary;

const SIZE: (u32, u32) = (900, 600);
const COLOURS: [RGBColor; 6] = [
    BLACK,
    RED,
    BLUE,
    RGBColor(90, 170, 255),
    RGBColor(0, 130, 0),
    RGBColor(200, 130, 0),
];
/// Points of a curve for each tenfold number of requests.
const POINTS: usize = 60;
/// Room beside the curves, as a factor.
const ROOM: f64 = 1.2;

/// The picture as SVG: round trips and the stages that take longest.
pub(super) fn svg(summary: &Summary, caption: &str) -> anyhow::Result<String> {
    let mut text = String::new();
    draw(summary, caption, &mut text).map_err(|error| anyhow!("no picture: {error}"))?;
    Ok(text)
}

fn draw(
    summary: &Summary,
    caption: &str,
    text: &mut String,
) -> Result<(), Box<dyn std::error::Error>> {
    let requests = summary.planned().max(10) as f64;
    let count = (requests.log10() * POINTS as f64) as usize;
    // One in so many requests takes longer.
    let one_in = |index: usize| requests.powf(index as f64 / count as f64);
    let curves = summary.longest(COLOURS.len()).map(|(name, times)| {
        let ms = |one_in: f64| times.value_at_quantile(1.0 - 1.0 / one_in).max(1) as f64 * 1e-6;
        let points = (0..=count).map(|index| (one_in(index), ms(one_in(index))));
        (name, points.collect::<Vec<_>>())
    });
    let curves: Vec<_> = curves.collect();
    let times = || curves.iter().flat_map(|(_, points)| points).map(|it| it.1);
    let least = times().fold(f64::INFINITY, f64::min);
    let most = times().fold(0.0, f64::max);
    let root = SVGBackend::with_string(text, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .caption(caption, ("sans-serif", 20))
        .margin(12)
        .x_label_area_size(45)
        .y_label_area_size(60)
        .build_cartesian_2d(
            (1.0..requests).log_scale(),
            (least / ROOM..most * ROOM).log_scale(),
        )?;
    chart
        .configure_mesh()
        .x_desc("percentile")
        .x_label_formatter(&|one_in| format!("{} %", 100.0 - 100.0 / one_in))
        .y_desc("ms")
        .draw()?;
    for ((name, points), colour) in curves.into_iter().zip(COLOURS) {
        let series = chart.draw_series(LineSeries::new(points, colour.stroke_width(2)))?;
        let mark = move |(x, y)| PathElement::new([(x, y), (x + 14, y)], colour.stroke_width(2));
        series.label(name).legend(mark);
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .background_style(WHITE)
        .border_style(BLACK)
        .draw()?;
    root.present()?;
    Ok(())
}
