//! The paper's network, as the weights' tensors say it.

use super::bench::Bench;
use super::figure::{Figure, Picture};
use crate::compare::drawing::{COLOURS, Drawn, GREY, INK, font, svg};
use crate::compare::figure_name::FigureName;
use crate::html::escaped;
use denoiser::{Manifest, WeightsFile};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

const SIZE: (u32, u32) = (1140, 460);

/// A part of the network: the tensors whose names begin so, and where it is drawn.
struct Part {
    tensors: &'static str,
    name: &'static str,
    corner: (i32, i32),
    size: (i32, i32),
    colour: usize,
}

const fn part(
    tensors: &'static str,
    name: &'static str,
    corner: (i32, i32),
    size: (i32, i32),
    colour: usize,
) -> Part {
    Part {
        tensors,
        name,
        corner,
        size,
        colour,
    }
}

const PARTS: [Part; 14] = [
    part("time.", "diffusion step", (20, 20), (170, 60), 4),
    part("start.", "start", (20, 100), (170, 60), 4),
    part("goal.", "target tip", (20, 180), (170, 60), 4),
    part("graph.", "obstacle graph", (20, 260), (170, 60), 4),
    part("context.", "context (sum)", (260, 140), (150, 60), 5),
    part("stem.", "stem", (260, 350), (110, 60), 0),
    part("down.0.", "down 0", (410, 350), (110, 60), 0),
    part("down.1.", "down 1", (560, 350), (110, 60), 0),
    part("down.2.", "down 2", (710, 350), (110, 60), 0),
    part("middle.", "middle", (860, 350), (110, 60), 0),
    part("up.1.", "up 1", (860, 140), (110, 60), 2),
    part("up.0.", "up 0", (1010, 140), (110, 60), 2),
    part("final.", "final: noise", (1010, 20), (110, 60), 2),
    part("normalisation.", "normalisation", (260, 20), (150, 60), 6),
];

/// What feeds what: lines that end in a dot. The context goes along a line of its own to every block.
const FEEDS: [&[(i32, i32)]; 17] = [
    &[(190, 50), (260, 155)],
    &[(190, 130), (260, 165)],
    &[(190, 210), (260, 175)],
    &[(190, 290), (260, 185)],
    &[(370, 380), (410, 380)],
    &[(520, 380), (560, 380)],
    &[(670, 380), (710, 380)],
    &[(820, 380), (860, 380)],
    &[(930, 350), (930, 200)],
    &[(970, 170), (1010, 170)],
    &[(1065, 140), (1065, 80)],
    &[(335, 200), (335, 275), (450, 275), (450, 350)],
    &[(450, 275), (600, 275), (600, 350)],
    &[(600, 275), (750, 275), (750, 350)],
    &[(750, 275), (890, 275), (890, 350)],
    &[(890, 275), (890, 200)],
    &[(890, 275), (1065, 275), (1065, 200)],
];

pub(super) fn figure(bench: &Bench) -> anyhow::Result<Figure> {
    let (weights, name) = (&bench.models().weights, bench.models().diffusion_weights());
    let manifest = Manifest::open(weights)?;
    let file = manifest.weights(name)?;
    let entry = manifest.entry(name)?;
    let width = file.count("width")?;
    let total: usize = file.shapes().map(|(_, shape)| numbers(shape)).sum();
    let drawn = svg(SIZE, |area| {
        for feed in FEEDS {
            area.draw(&PathElement::new(feed.to_vec(), GREY.stroke_width(2)))?;
            area.draw(&Circle::new(feed[feed.len() - 1], 4, GREY.filled()))?;
        }
        for part in &PARTS {
            let (x, y) = part.corner;
            let corners = [part.corner, (x + part.size.0, y + part.size.1)];
            let colour = COLOURS[part.colour];
            area.draw(&Rectangle::new(corners, WHITE.filled()))?;
            area.draw(&Rectangle::new(corners, colour.mix(0.2).filled()))?;
            area.draw(&Rectangle::new(corners, INK.stroke_width(1)))?;
            for (text, row) in [(part.name.to_owned(), 20), (part.count(&file), 42)] {
                let style = font(15).pos(Pos::new(HPos::Center, VPos::Center));
                let at = (x + part.size.0 / 2, y + row);
                area.draw(&Text::new(text, at, style))?;
            }
        }
        Drawn::Ok(())
    })?;
    Ok(Figure {
        name: FigureName::Network,
        title: "The paper's network, from its weights",
        pictures: vec![Picture::new(
            drawn,
            "parts with their numbers of parameters; what feeds what ends in a dot",
        )],
        caption: format!(
            "Diffusion step, start, target tip and obstacle graph are embedded and added to one context, which scales and shifts every block of a temporal \
             U-Net over 64 waypoints (channels {width}, {}, {}; blocks down pass what they have on to those up). It estimates the noise. Each number is counted from the tensors of \
             <code>{}</code>: {total} numbers in all, trained for {} updates.",
            2 * width,
            4 * width,
            escaped(&weights.join(&entry.file).display().to_string()),
            entry.updates
        ),
        made_by: None,
    })
}

fn numbers(shape: &[usize]) -> usize {
    shape.iter().product()
}

impl Part {
    fn count(&self, file: &WeightsFile) -> String {
        let tensors = file
            .shapes()
            .filter(|(name, _)| name.starts_with(self.tensors));
        let count: usize = tensors.map(|(_, shape)| numbers(shape)).sum();
        match count {
            1000.. => format!("{:.0}k", count as f64 / 1000.0),
            _ => count.to_string(),
        }
    }
}
