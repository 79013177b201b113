//! Bars of a mean with the 5th and 95th percentiles.

use super::canvas::{Drawn, GREY, INK, font, label, svg};
use crate::averages::percentile;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

const SIZE: (u32, u32) = (380, 320);
/// Half of a bar's width, of the distance between two.
const HALF: f64 = 0.32;
/// Room above the highest value, as a factor.
const ROOM: f64 = 1.12;

/// A bar.
pub(crate) struct Bar {
    pub(crate) name: &'static str,
    pub(crate) mean: f64,
    pub(crate) p5: f64,
    pub(crate) p95: f64,
    pub(crate) colour: RGBColor,
}

impl Bar {
    /// The bar of some values; none where there are none.
    pub(crate) fn of(name: &'static str, values: &[f64], colour: RGBColor) -> Option<Self> {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        Some(Self {
            name,
            mean: values.iter().sum::<f64>() / values.len() as f64,
            p5: percentile(&sorted, 0.05)?,
            p95: percentile(&sorted, 0.95)?,
            colour,
        })
    }
}

/// A picture of bars.
pub(crate) struct Bars {
    pub(crate) title: &'static str,
    pub(crate) unit: &'static str,
    pub(crate) bars: Vec<Bar>,
}

impl Bars {
    pub(crate) fn svg(&self) -> anyhow::Result<String> {
        let ends = self.bars.iter().flat_map(|bar| [bar.mean, bar.p5, bar.p95]);
        let (least, most) = ends.fold((0.0_f64, 0.0_f64), |(least, most), it| {
            (least.min(it), most.max(it))
        });
        let most = if most > least { most } else { 1.0 };
        svg(SIZE, |area| {
            let count = self.bars.len() as f64;
            let mut chart = ChartBuilder::on(area)
                .caption(self.title, font(17))
                .margin_right(12)
                .x_label_area_size(28)
                .y_label_area_size(72)
                .build_cartesian_2d(0.0..count, ROOM * least..ROOM * most)?;
            chart
                .configure_mesh()
                .disable_x_mesh()
                .disable_x_axis()
                .y_desc(self.unit)
                .y_labels(6)
                .y_label_formatter(&|value| label(*value))
                .axis_desc_style(font(15))
                .label_style(font(14))
                .light_line_style(TRANSPARENT)
                .bold_line_style(GREY.mix(0.3))
                .axis_style(GREY)
                .draw()?;
            for (index, bar) in self.bars.iter().enumerate() {
                let x = index as f64 + 0.5;
                let corners = [(x - HALF, 0.0), (x + HALF, bar.mean)];
                chart.draw_series([Rectangle::new(corners, bar.colour.mix(0.75).filled())])?;
                let whisker = [(x, bar.p5), (x, bar.p95)];
                chart.draw_series([PathElement::new(whisker, INK.stroke_width(2))])?;
                for end in [bar.p5, bar.p95] {
                    let cap = [(x - 0.08, end), (x + 0.08, end)];
                    chart.draw_series([PathElement::new(cap, INK.stroke_width(2))])?;
                }
                let (pixel, _) = chart.backend_coord(&(x, 0.0));
                let style = font(15).pos(Pos::new(HPos::Center, VPos::Bottom));
                area.draw(&Text::new(bar.name, (pixel, SIZE.1 as i32 - 6), style))?;
            }
            Drawn::Ok(())
        })
    }
}
