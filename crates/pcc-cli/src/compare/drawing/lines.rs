//! Curves and points over an axis, their names beside them.

use super::canvas::{Area, Drawn, GREY, INK, font, label, svg};
use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Height of a picture, pixels.
const HEIGHT: u32 = 340;
/// Width of the curves and of their names, pixels.
const WIDTH: u32 = 470;
const NAMES: u32 = 130;
/// Height of a name, pixels.
const ROW: i32 = 22;
/// Room beyond the values of an axis, as a share of them.
const ROOM: f64 = 0.04;

/// What is along a side of a picture.
pub(crate) struct Axis {
    pub(crate) name: &'static str,
    pub(crate) is_logarithmic: bool,
    /// Percent, of shares.
    pub(crate) is_share: bool,
    /// Values that must be seen, beside those of the curves.
    pub(crate) shown: Vec<f64>,
}

impl Axis {
    pub(crate) fn linear(name: &'static str) -> Self {
        Self {
            name,
            is_logarithmic: false,
            is_share: false,
            shown: Vec::new(),
        }
    }

    pub(crate) fn logarithmic(name: &'static str) -> Self {
        Self {
            is_logarithmic: true,
            ..Self::linear(name)
        }
    }

    /// From 0 to 100 %.
    pub(crate) fn share(name: &'static str) -> Self {
        Self {
            is_share: true,
            shown: vec![0.0, 1.0],
            ..Self::linear(name)
        }
    }

    fn range(&self, values: impl Iterator<Item = f64>) -> [f64; 2] {
        let all = values.chain(self.shown.iter().copied());
        let all = all.filter(|it| it.is_finite() && (!self.is_logarithmic || *it > 0.0));
        let (least, most) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), it| {
            (least.min(it), most.max(it))
        });
        match (least < most, self.is_logarithmic) {
            (true, false) => [least - ROOM * (most - least), most + ROOM * (most - least)],
            (true, true) => {
                let room = (most / least).powf(ROOM);
                [least / room, most * room]
            }
            (false, true) => [0.1, 10.0],
            (false, false) => [0.0, 1.0],
        }
    }

    fn label(&self, value: f64) -> String {
        match self.is_share {
            true => format!("{:.0} %", 100.0 * value),
            false => label(value),
        }
    }
}

/// A curve, or points where it has no line.
pub(crate) struct Line {
    pub(crate) name: String,
    pub(crate) points: Vec<(f64, f64)>,
    pub(crate) colour: RGBColor,
    /// Radius of a dot at each point, pixels; 0: none.
    pub(crate) dots: u32,
    /// Width of the line, pixels; 0: none.
    pub(crate) width: u32,
}

impl Line {
    /// A line with a dot at each point.
    pub(crate) fn measured(name: &str, points: Vec<(f64, f64)>, colour: RGBColor) -> Self {
        Self {
            name: name.to_owned(),
            points,
            colour,
            dots: 4,
            width: 2,
        }
    }

    /// A curve.
    pub(crate) fn curve(name: &str, points: Vec<(f64, f64)>, colour: RGBColor) -> Self {
        Self {
            dots: 0,
            ..Self::measured(name, points, colour)
        }
    }

    /// Points alone.
    pub(crate) fn scatter(name: &str, points: Vec<(f64, f64)>, colour: RGBColor) -> Self {
        Self {
            dots: 3,
            width: 0,
            ..Self::measured(name, points, colour)
        }
    }
}

/// A picture of lines.
pub(crate) struct Lines {
    pub(crate) x: Axis,
    pub(crate) y: Axis,
    pub(crate) lines: Vec<Line>,
    /// Vertical dashed lines.
    pub(crate) marks: Vec<f64>,
}

impl Lines {
    pub(crate) fn svg(&self) -> anyhow::Result<String> {
        let points = || self.lines.iter().flat_map(|line| &line.points);
        let [x_low, x_high] = self.x.range(points().map(|it| it.0));
        let [y_low, y_high] = self.y.range(points().map(|it| it.1));
        let (x, y) = (x_low..x_high, y_low..y_high);
        svg((WIDTH + NAMES, HEIGHT), |area| {
            let (curves, names) = area.split_horizontally(WIDTH);
            match (self.x.is_logarithmic, self.y.is_logarithmic) {
                (false, false) => self.draw(&curves, x, y),
                (false, true) => self.draw(&curves, x, y.log_scale()),
                (true, false) => self.draw(&curves, x.log_scale(), y),
                (true, true) => self.draw(&curves, x.log_scale(), y.log_scale()),
            }?;
            self.draw_names(&names)
        })
    }

    fn draw<X, Y>(&self, area: &Area, x: X, y: Y) -> Drawn
    where
        X: AsRangedCoord<Value = f64>,
        Y: AsRangedCoord<Value = f64>,
        X::CoordDescType: ValueFormatter<f64>,
        Y::CoordDescType: ValueFormatter<f64>,
    {
        let mut chart = ChartBuilder::on(area)
            .margin_top(12)
            .margin_right(16)
            .x_label_area_size(48)
            .y_label_area_size(72)
            .build_cartesian_2d(x, y)?;
        chart
            .configure_mesh()
            .x_desc(self.x.name)
            .y_desc(self.y.name)
            .axis_desc_style(font(16))
            .label_style(font(14))
            .x_labels(6)
            .y_labels(7)
            .x_label_formatter(&|value| self.x.label(*value))
            .y_label_formatter(&|value| self.y.label(*value))
            .light_line_style(TRANSPARENT)
            .bold_line_style(GREY.mix(0.3))
            .axis_style(GREY)
            .draw()?;
        let [low, high] = {
            let range = chart.y_range();
            [range.start, range.end]
        };
        for &mark in &self.marks {
            let line = [(mark, low), (mark, high)];
            chart.draw_series(DashedLineSeries::new(line, 6, 4, INK.stroke_width(1)))?;
        }
        for line in &self.lines {
            let points = || line.points.iter().copied();
            let style = line.colour.stroke_width(line.width);
            if line.width > 0 {
                let points = points().collect::<Vec<_>>();
                chart.draw_series([PathElement::new(points, style)])?;
            }
            if line.dots > 0 {
                let dot = |point| Circle::new(point, line.dots, line.colour.filled());
                chart.draw_series(points().map(dot))?;
            }
        }
        Ok(())
    }

    fn draw_names(&self, area: &Area) -> Drawn {
        let named = self.lines.iter().filter(|line| !line.name.is_empty());
        for (line, row) in named.zip(1..) {
            let y = ROW * row;
            match line.width {
                0 => area.draw(&Circle::new((10, y), 4, line.colour.filled()))?,
                _ => area.draw(&PathElement::new(
                    [(0, y), (20, y)],
                    line.colour.stroke_width(3),
                ))?,
            }
            let style = font(14).pos(Pos::new(HPos::Left, VPos::Center));
            area.draw(&Text::new(line.name.clone(), (26, y), style))?;
        }
        Ok(())
    }
}
