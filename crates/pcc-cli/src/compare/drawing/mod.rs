//! What the page's pictures are drawn with.

mod bars;
mod lines;
mod scene;

pub(super) use self::bars::{Bar, Bars};
pub(super) use self::lines::{Axis, Line, Lines};
pub(super) use self::scene::{Camera, Scene3d};

use anyhow::anyhow;
use plotters::coord::Shift;
use plotters::prelude::*;
use std::error::Error;

pub(super) type Drawn = Result<(), Box<dyn Error>>;
pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

pub(super) const INK: RGBColor = RGBColor(28, 39, 51);
pub(super) const GREY: RGBColor = RGBColor(128, 138, 148);
/// Colours of what is told apart.
pub(super) const COLOURS: [RGBColor; 10] = [
    RGBColor(31, 105, 178),
    RGBColor(194, 87, 26),
    RGBColor(47, 143, 91),
    RGBColor(138, 79, 176),
    RGBColor(181, 138, 0),
    RGBColor(20, 134, 140),
    RGBColor(194, 59, 107),
    RGBColor(107, 122, 31),
    RGBColor(77, 87, 196),
    RGBColor(140, 90, 60),
];

/// A picture of so many pixels as SVG.
pub(super) fn svg(size: (u32, u32), draw: impl FnOnce(&Area) -> Drawn) -> anyhow::Result<String> {
    let mut text = String::new();
    let drawn = (|| {
        let area = SVGBackend::with_string(&mut text, size).into_drawing_area();
        area.fill(&WHITE)?;
        draw(&area)?;
        area.present()?;
        Drawn::Ok(())
    })();
    drawn.map_err(|error| anyhow!("no picture: {error}"))?;
    Ok(text)
}

/// Text in this size.
pub(super) fn font(size: u32) -> TextStyle<'static> {
    ("sans-serif", size).into_font().color(&INK)
}

/// A number as an axis says it.
fn label(value: f64) -> String {
    let size = value.abs();
    match size {
        0.0..1e-9 => "0".to_owned(),
        1000.0.. => format!("{:.0}k", value / 1000.0),
        _ => format!("{}", (value * 1e6).round() / 1e6),
    }
}
