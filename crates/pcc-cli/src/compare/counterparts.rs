//! The paper's figures, and where on the page each has its counterpart.

use super::experiments::Figure;
use crate::sampler::name_of;
use anyhow::{Context, ensure};

/// Comments, and then a line for each figure and part of a figure of the paper: its label there, its counterpart's anchor, what it shows.
const LIST: &str = include_str!("../../../../docs/results/paper-figures.csv");

/// A figure of the paper, or a part of one.
pub(super) struct Counterpart {
    pub(super) label: &'static str,
    /// Anchor on the page.
    pub(super) anchor: &'static str,
    pub(super) shows: &'static str,
}

/// The list, in the paper's order.
///
/// # Errors
/// Where a line has no three columns.
pub(super) fn list() -> anyhow::Result<Vec<Counterpart>> {
    let lines = LIST.lines().filter(|line| !line.starts_with('#')).skip(1);
    let row = |line: &'static str| {
        let mut columns = line.splitn(3, ',');
        let mut column = || {
            columns
                .next()
                .with_context(|| format!("three columns are needed: {line}"))
        };
        Ok(Counterpart {
            label: column()?,
            anchor: column()?,
            shows: column()?,
        })
    };
    lines.map(row).collect()
}

/// # Errors
/// Where a figure of the paper has no counterpart among these, or one without picture.
pub(super) fn check(figures: &[Figure]) -> anyhow::Result<()> {
    for Counterpart { label, anchor, .. } in list()? {
        let has_anchor = |it: &&Figure| {
            name_of(&it.name) == anchor || it.pictures.iter().any(|it| it.id == Some(anchor))
        };
        let figure = figures.iter().find(has_anchor);
        let figure =
            figure.with_context(|| format!("{label} of the paper has no counterpart #{anchor}"))?;
        ensure!(
            !figure.pictures.is_empty(),
            "the counterpart of {label} has no picture"
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compare::experiments::Picture;
    use crate::compare::figure_name::FigureName;
    use clap::ValueEnum;

    /// All figures; the last, which the paper does not have, has the pictures of all parts that are no figures by themselves.
    fn figures() -> Vec<Figure> {
        let names = FigureName::value_variants();
        let is_part = |it: &Counterpart| names.iter().all(|name| name_of(name) != it.anchor);
        let parts: Vec<_> = list().unwrap().into_iter().filter(is_part).collect();
        let picture = |id| Picture {
            id: Some(id),
            begins_row: false,
            svg: "<svg></svg>".to_owned(),
            caption: String::new(),
        };
        let figure = |(index, name): (usize, &FigureName)| Figure {
            name: *name,
            title: "",
            pictures: match index + 1 {
                count if count == names.len() => {
                    parts.iter().map(|it| picture(it.anchor)).collect()
                }
                _ => vec![picture("")],
            },
            caption: String::new(),
            made_by: None,
        };
        names.iter().enumerate().map(figure).collect()
    }

    #[test]
    fn every_figure_of_the_paper_is_in_the_list() {
        let labels: Vec<&str> = list().unwrap().iter().map(|it| it.label).collect();
        for (label, parts) in [
            ("fig:teaser", ""),
            ("fig:network", ""),
            ("fig:denoising", "ab"),
            ("fig:multisolution", "abcdefg"),
            ("fig:ablation", "ab"),
            ("fig:comparison", ""),
            ("fig:real_world_consecutive", "ab"),
            ("fig:real_world_multisolution", "ab"),
        ] {
            assert!(labels.contains(&label), "{label}");
            for part in parts.chars() {
                let part = format!("{label}_{part}");
                assert!(labels.contains(&part.as_str()), "{part}");
            }
        }
    }

    #[test]
    fn a_figure_of_the_paper_without_a_counterpart_is_refused() {
        check(&figures()).unwrap();
        for missing in list().unwrap().iter().map(|it| it.anchor) {
            let mut fewer = figures();
            fewer.retain(|it| name_of(&it.name) != missing);
            let with_parts = fewer.last_mut().unwrap();
            with_parts.pictures.retain(|it| it.id != Some(missing));
            let said = check(&fewer).unwrap_err().to_string();
            assert!(
                said.contains(&format!("has no counterpart #{missing}")),
                "{said}"
            );
        }
        let mut without_picture = figures();
        without_picture[0].pictures.clear();
        assert!(check(&without_picture).is_err());
    }
}
