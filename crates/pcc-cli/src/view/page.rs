//! What the page shows, and the page: a template, its style and its script, none of which needs a network.

use super::samples::Samples;
use super::surroundings::{BallTrack, Surface, Surroundings};
use crate::html::escaped;
use pcc_model::{Backbone, Configuration, SECTIONS};
use serde::Serialize;
use trajectory::Trajectory;

const TEMPLATE: &str = include_str!("../../viewer/page.html");
const STYLE: &str = include_str!("../../viewer/viewer.css");
const SCRIPT: &str = include_str!("../../viewer/viewer.bundle.js");

/// Everything that the page shows; positions in the base frame.
#[derive(Serialize)]
pub(super) struct View {
    pub(super) title: String,
    /// Unit of lengths: `m`, or `L` for section lengths.
    pub(super) unit: &'static str,
    pub(super) robot: Body,
    pub(super) duration_s: f64,
    /// Clearances at the ends of the colour scale.
    pub(super) clearance_range: [f64; 2],
    pub(super) balls: Vec<BallTrack>,
    pub(super) solids: Vec<Surface>,
    pub(super) motions: Vec<Motion>,
    pub(super) curves: Vec<Curves>,
    pub(super) marks: Vec<Mark>,
}

/// The robot's body.
#[derive(Clone, Copy, Serialize)]
pub(super) struct Body {
    pub(super) section_lengths: [f64; SECTIONS],
    pub(super) tube_radii: [f64; SECTIONS],
}

/// A motion of the robot, sampled.
#[derive(Serialize)]
pub(super) struct Motion {
    pub(super) name: String,
    /// Whether it is shown from the beginning, and solid.
    pub(super) is_selected: bool,
    /// Whether the body is shown after its end, too.
    pub(super) stays: bool,
    pub(super) time_s: Samples,
    /// Six radians a sample.
    pub(super) configurations_rad: Samples,
    /// NaN without obstacles.
    pub(super) clearance: Samples,
}

/// Curves over time that are shown together.
#[derive(Serialize)]
pub(super) struct Curves {
    pub(super) name: &'static str,
    pub(super) unit: &'static str,
    pub(super) labels: Vec<String>,
    pub(super) time_s: Samples,
    pub(super) values: Vec<Samples>,
}

/// A vertical line in the curves.
#[derive(Clone, Copy, Serialize)]
pub(super) struct Mark {
    pub(super) time_s: f64,
}

impl Body {
    /// Least clearance of a configuration (rad); NaN where there are no obstacles.
    pub(super) fn clearance(
        &self,
        configuration: &Configuration,
        around: &Surroundings,
        time_s: f64,
    ) -> f64 {
        let Ok(scene) = around.at(time_s) else {
            return f64::NAN;
        };
        let backbone = Backbone::new(&self.section_lengths, configuration);
        let clearance = scene.clearance(&backbone, &self.tube_radii);
        if clearance.is_finite() {
            clearance
        } else {
            f64::NAN
        }
    }
}

impl Motion {
    /// A motion by its samples.
    pub(super) fn new(
        name: String,
        samples: &[(f64, Configuration)],
        body: &Body,
        around: &Surroundings,
    ) -> Self {
        let clearance = |(time_s, configuration): &(f64, Configuration)| {
            body.clearance(configuration, around, *time_s)
        };
        Self {
            name,
            is_selected: false,
            stays: true,
            time_s: samples.iter().map(|it| it.0).collect(),
            configurations_rad: samples.iter().flat_map(|it| it.1.iter().copied()).collect(),
            clearance: samples.iter().map(clearance).collect(),
        }
    }
}

/// A motion at equal steps of time from its begin (s) to its end.
pub(super) fn sampled(
    motion: &Trajectory,
    begins_s: f64,
    count: usize,
) -> Vec<(f64, Configuration)> {
    let step = motion.duration() / (count - 1) as f64;
    let samples = motion.sample(count).into_iter().enumerate();
    samples
        .map(|(index, configuration)| (begins_s + index as f64 * step, configuration))
        .collect()
}

/// The ends of the colour scale: from contact, or the deepest one, to a tube's radius of room; equal where there are no obstacles.
pub(super) fn clearance_range(motions: &[Motion], body: &Body) -> [f64; 2] {
    let all = motions.iter().flat_map(|motion| &motion.clearance.0);
    let least = all.copied().fold(f64::INFINITY, f64::min);
    if least.is_infinite() {
        return [0.0; 2];
    }
    let room = body.tube_radii.iter().copied().fold(0.0, f64::max);
    [least.min(0.0), room]
}

/// The page as HTML: of a view, or, without one, of what is told at the address `live` beside it.
pub(super) fn html(title: &str, view: Option<&View>) -> anyhow::Result<String> {
    // In a script element only `</` could end the data, and JSON allows the slash to be escaped.
    let data = serde_json::to_string(&view)?.replace("</", "<\\/");
    let title = escaped(title);
    let parts = [
        ("{title}", title.as_str()),
        ("{style}", STYLE),
        ("{data}", &data),
        ("{script}", SCRIPT),
    ];
    let mut page = String::with_capacity(TEMPLATE.len() + STYLE.len() + SCRIPT.len() + data.len());
    let mut rest = TEMPLATE;
    while let Some(at) = rest.find('{') {
        let (before, from) = rest.split_at(at);
        page += before;
        let part = parts.iter().find(|(name, _)| from.starts_with(name));
        let (name, text) = part.copied().unwrap_or(("{", "{"));
        page += text;
        rest = &from[name.len()..];
    }
    Ok(page + rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_title_cannot_leave_its_place_and_data_cannot_end_its_element() {
        let view = View {
            title: "</script><b>{data}".to_owned(),
            unit: "m",
            robot: Body {
                section_lengths: [1.0; SECTIONS],
                tube_radii: [0.2; SECTIONS],
            },
            duration_s: 1.0,
            clearance_range: [0.0; 2],
            balls: Vec::new(),
            solids: Vec::new(),
            motions: Vec::new(),
            curves: Vec::new(),
            marks: Vec::new(),
        };
        let page = html(&view.title, Some(&view)).unwrap();
        assert!(page.contains("&lt;/script>&lt;b>{data}"));
        assert!(page.contains("<\\/script><b>{data}"));
        assert_eq!(page.matches("id=\"data\"").count(), 1);
    }
}
