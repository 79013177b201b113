//! What all pictures are drawn on: a canvas that becomes SVG, its colours and its texts.

use anyhow::anyhow;
use plotters::coord::Shift;
use plotters::prelude::*;
use std::error::Error;

pub(crate) type Drawn = Result<(), Box<dyn Error>>;
pub(crate) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

pub(crate) const INK: RGBColor = RGBColor(28, 39, 51);
pub(crate) const GREY: RGBColor = RGBColor(128, 138, 148);
/// Colours of what is told apart.
pub(crate) const COLOURS: [RGBColor; 12] = [
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
    RGBColor(90, 90, 90),
    RGBColor(232, 120, 150),
];

/// A picture of so many pixels as SVG.
pub(crate) fn svg(size: (u32, u32), draw: impl FnOnce(&Area) -> Drawn) -> anyhow::Result<String> {
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
pub(crate) fn font(size: u32) -> TextStyle<'static> {
    ("sans-serif", size).into_font().color(&INK)
}

/// A number as an axis says it.
pub(crate) fn label(value: f64) -> String {
    let size = value.abs();
    match size {
        0.0..1e-9 => "0".to_owned(),
        1000.0.. => format!("{}k", (value / 100.0).round() / 10.0),
        _ => format!("{}", (value * 1e6).round() / 1e6),
    }
}

/// A colour between two.
pub(crate) fn blend(from: RGBColor, to: RGBColor, share: f64) -> RGBColor {
    let part =
        |from: u8, to: u8| (f64::from(from) * (1.0 - share) + f64::from(to) * share).round() as u8;
    RGBColor(part(from.0, to.0), part(from.1, to.1), part(from.2, to.2))
}
