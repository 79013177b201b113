//! The paper's network, as the weights' tensors say it.

use super::{Bench, Figure, Picture};
use crate::compare::drawing::{COLOURS, Drawn, GREY, INK, font, svg};
use denoiser::{Manifest, WeightsFile};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

const SIZE: (u32, u32) = (1120, 470);

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
    part("context.", "context (added)", (240, 140), (160, 60), 5),
    part("stem.", "stem", (240, 330), (110, 60), 0),
    part("down.0.", "down 0", (380, 330), (110, 60), 0),
    part("down.1.", "down 1", (520, 350), (110, 60), 0),
    part("down.2.", "down 2", (660, 370), (110, 60), 0),
    part("middle.", "middle", (800, 370), (110, 60), 0),
    part("up.1.", "up 1", (800, 220), (110, 60), 2),
    part("up.0.", "up 0", (930, 220), (110, 60), 2),
    part("final.", "final: noise", (930, 80), (150, 60), 2),
    part("normalisation.", "normalisation", (240, 20), (160, 60), 6),
];

/// What feeds what, by the parts' tensors.
const ARROWS: [(&str, &str); 16] = [
    ("time.", "context."),
    ("start.", "context."),
    ("goal.", "context."),
    ("graph.", "context."),
    ("stem.", "down.0."),
    ("down.0.", "down.1."),
    ("down.1.", "down.2."),
    ("down.2.", "middle."),
    ("middle.", "up.1."),
    ("up.1.", "up.0."),
    ("up.0.", "final."),
    ("context.", "down.0."),
    ("context.", "down.1."),
    ("context.", "down.2."),
    ("context.", "middle."),
    ("context.", "up.1."),
];

pub(super) fn figure(bench: &Bench) -> anyhow::Result<Figure> {
    let manifest = Manifest::open(&bench.models().weights)?;
    let file = manifest.weights("mixed")?;
    let updates = manifest.entry("mixed")?.updates;
    let total: usize = file.shapes().map(|(_, shape)| numbers(shape)).sum();
    let drawn = svg(SIZE, |area| {
        let find = |tensors| PARTS.iter().find(|part| part.tensors == tensors);
        for (from, to) in ARROWS {
            if let (Some(from), Some(to)) = (find(from), find(to)) {
                let arrow = [from.edge(to), to.edge(from)];
                area.draw(&PathElement::new(arrow, GREY.stroke_width(2)))?;
                area.draw(&Circle::new(arrow[1], 4, GREY.filled()))?;
            }
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
        id: "network",
        title: "The paper's network, from the committed weights",
        pictures: vec![Picture::new(drawn, "parts with their numbers of parameters; dots mark where arrows end")],
        caption: format!(
            "Diffusion step, start, target tip and obstacle graph are embedded and added to one context, which scales and shifts every block of a temporal \
             U-Net over 64 waypoints (channels 64, 128, 256). It estimates the noise. Each number is counted from the tensors of \
             <code>weights/mixed.safetensors</code>: {total} numbers in all, trained for {updates} updates."
        ),
        command: "python3 -c \"import json, struct; f = open('weights/mixed.safetensors', 'rb'); \
                  print(json.dumps(json.loads(f.read(struct.unpack('<Q', f.read(8))[0])), indent=1))\""
            .to_owned(),
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

    /// The middle of the side that is nearest to another part.
    fn edge(&self, other: &Self) -> (i32, i32) {
        let middle = |it: &Self| (it.corner.0 + it.size.0 / 2, it.corner.1 + it.size.1 / 2);
        let (own, theirs) = (middle(self), middle(other));
        let (x, y) = (theirs.0 - own.0, theirs.1 - own.1);
        let is_beside = x.abs() * self.size.1 > y.abs() * self.size.0;
        match is_beside {
            true => (own.0 + x.signum() * self.size.0 / 2, own.1),
            false => (own.0, own.1 + y.signum() * self.size.1 / 2),
        }
    }
}
