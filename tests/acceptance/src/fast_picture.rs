//! A picture of time and tip length: what more time buys.

use std::path::Path;

use anyhow::Context;
use plotters::prelude::*;

const SIZE: (u32, u32) = (900, 600);
const COLOURS: [RGBColor; 6] = [
    BLACK,
    RED,
    BLUE,
    RGBColor(90, 170, 255),
    RGBColor(0, 130, 0),
    RGBColor(150, 200, 90),
];
/// Room around the points, as a factor.
const ROOM: f64 = 1.1;

/// A planner's points: ms, and tip length ÷ distance.
pub(crate) struct Curve {
    pub(crate) name: &'static str,
    pub(crate) points: Vec<(f64, f64)>,
}

/// Draws up to six curves into an SVG file.
pub(crate) fn draw(file: &Path, caption: &str, curves: &[Curve]) -> anyhow::Result<()> {
    let points = || curves.iter().flat_map(|curve| curve.points.iter().copied());
    let range = |of: fn((f64, f64)) -> f64| {
        let values = || points().map(of).filter(|value| value.is_finite());
        let (least, most) = (values().reduce(f64::min), values().reduce(f64::max));
        least.zip(most).context("nothing to draw")
    };
    let (times, lengths) = (range(|p| p.0)?, range(|p| p.1)?);
    let root = SVGBackend::new(file, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .caption(caption, ("sans-serif", 22))
        .margin(12)
        .x_label_area_size(45)
        .y_label_area_size(60)
        .build_cartesian_2d(
            (times.0 / ROOM..times.1 * ROOM).log_scale(),
            1.0..1.0 + (lengths.1 - 1.0) * ROOM,
        )?;
    chart
        .configure_mesh()
        .x_desc("time of a request, median, ms")
        .y_desc("shortest tip length of its candidates ÷ distance, median")
        .draw()?;
    for (curve, colour) in curves.iter().zip(COLOURS) {
        let line = LineSeries::new(curve.points.iter().copied(), colour).point_size(4);
        let series = chart.draw_series(line)?;
        let mark = move |(x, y)| Circle::new((x + 8, y), 4, colour.filled());
        series.label(curve.name).legend(mark);
    }
    chart
        .configure_series_labels()
        .background_style(WHITE)
        .border_style(BLACK)
        .draw()?;
    root.present()?;
    Ok(())
}

#[cfg(test)]
mod unit {
    use super::*;

    #[test]
    fn a_picture_names_its_curves_and_nothing_makes_none() {
        let file = tempfile::tempdir().unwrap().keep().join("picture.svg");
        let points = vec![(1.0, 1.02), (10.0, f64::NAN), (20.0, 1.01)];
        let curve = Curve {
            name: "fast",
            points,
        };
        draw(&file, "scenes", &[curve]).unwrap();
        let text = std::fs::read_to_string(&file).unwrap();
        assert!(text.contains("fast") && text.contains("polyline"));
        std::fs::remove_dir_all(file.parent().unwrap()).unwrap();
        assert!(draw(&file, "scenes", &[]).is_err());
    }
}
