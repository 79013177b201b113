//! Several solutions of one case: scenes of none to four balls, the bodies at their ends, and two motions with their six curves.

use super::bench::Bench;
use super::figure::{Figure, Picture};
use crate::cases_hash::hash_of;
use crate::compare::case_sets::CaseSet;
use crate::compare::drawing::{Axis, COLOURS, Camera, GREY, Line, Lines, Scene3d, blend};
use crate::compare::figure_name::FigureName;
use crate::evaluate::{Asked, answer};
use crate::planner::Loaded;
use crate::sampler::PlannerName;
use anyhow::{Context, ensure};
use collision::Ball;
use datasets::Case;
use pcc_model::{Configuration, DOF, Point};
use planning::{MOST_CORRECTIONS, SampledVerdict};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::f64::consts::PI;

/// Balls of the scenes, with their anchors.
const SCENES: [(usize, &str); 5] = [
    (0, "solutions-free"),
    (1, "solutions-one-ball"),
    (2, "solutions-two-balls"),
    (3, "solutions-three-balls"),
    (4, "solutions-four-balls"),
];
/// The scene whose two motions are shown.
const TWO_OF: usize = 1;
const DRAWS: usize = 10;
/// Cases of a set that are looked through for those with so many balls.
const CASES: usize = 20;
/// Bodies of a motion.
const BODIES: usize = 6;
const ELEVATION: f64 = 0.16 * PI;

/// A case and what was drawn for it.
#[derive(Deserialize, Serialize)]
struct Solved {
    start: [f64; DOF],
    target: [f64; 3],
    /// Centre and radius, section lengths.
    balls: Vec<[f64; 4]>,
    drawn: usize,
    /// Cases before this one with as many balls and fewer than two solutions.
    passed_over: usize,
    /// Paths that succeed by the paper's criterion, 64 waypoints, rad.
    solutions: Vec<Vec<[f64; DOF]>>,
}

impl Solved {
    /// The first of these cases that has several solutions, else the last.
    fn first_of(bench: &Bench, loaded: &Loaded, cases: &[Case]) -> anyhow::Result<Self> {
        let mut solved = None;
        for (passed_over, case) in cases.iter().enumerate() {
            let this = solved.insert(Self::of(bench, loaded, case, passed_over)?);
            if this.solutions.len() > 1 {
                break;
            }
        }
        solved.context("no cases")
    }

    fn of(bench: &Bench, loaded: &Loaded, case: &Case, passed_over: usize) -> anyhow::Result<Self> {
        let asked = Asked {
            planner: PlannerName::Diffusion,
            candidates: DRAWS,
            corrections: MOST_CORRECTIONS,
        };
        let answer = answer(
            &loaded.planner,
            asked,
            bench.arguments.seed,
            case.clone(),
            None,
        )?;
        let plan = answer.plan.context("the case is refused")?;
        let drawn = plan.draws.iter().filter_map(|draw| draw.sampled.as_ref());
        let succeeds = |path: &&Vec<Configuration>| {
            SampledVerdict::of(&bench.robot, &case.scene, &case.target_tip, path).is_success()
        };
        let balls = case.scene.balls().iter();
        Ok(Self {
            start: case.start.into(),
            target: case.target_tip.into(),
            balls: balls
                .map(|it| [it.centre.x, it.centre.y, it.centre.z, it.radius])
                .collect(),
            drawn: DRAWS,
            passed_over,
            solutions: drawn
                .filter(succeeds)
                .map(|path| path.iter().map(|it| (*it).into()).collect())
                .collect(),
        })
    }

    fn balls(&self) -> Vec<Ball> {
        let ball = |it: &[f64; 4]| Ball {
            centre: Point::new(it[0], it[1], it[2]),
            radius: it[3],
        };
        self.balls.iter().map(ball).collect()
    }

    fn camera(&self, bench: &Bench) -> Camera {
        let tips = self.solutions.iter().flatten().flat_map(|it| {
            let backbone = bench.robot.backbone(&Configuration::from(*it));
            [
                backbone.tip(),
                backbone.point(1, 1.0),
                backbone.point(2, 0.5),
            ]
        });
        let balls = self.balls().into_iter().map(|it| (it.centre, it.radius));
        let way = Point::from(self.target) - bench.robot.tip(&Configuration::from(self.start));
        // The tip goes from left to right.
        let azimuth = way.y.atan2(way.x) - 0.5 * PI;
        Camera::fitting(azimuth, ELEVATION, tips.map(|tip| (tip, 0.22)).chain(balls))
    }

    fn scene<'a>(&self, bench: &'a Bench, camera: Camera) -> Scene3d<'a> {
        let mut scene = Scene3d::new(&bench.robot, camera);
        self.balls().iter().for_each(|ball| scene.ball(ball));
        let start = Configuration::from(self.start);
        scene.ends(&bench.robot.tip(&start), &Point::from(self.target));
        scene
    }

    /// The bodies at the ends of all solutions, the body at the start, and the tip paths.
    fn picture(&self, bench: &Bench) -> anyhow::Result<Picture> {
        let mut scene = self.scene(bench, self.camera(bench));
        scene.body(&Configuration::from(self.start), GREY);
        for (solution, colour) in self.solutions.iter().zip(COLOURS) {
            let path: Vec<Configuration> =
                solution.iter().map(|it| Configuration::from(*it)).collect();
            scene.path(&bench.robot.tips(&path), colour, 4);
            scene.body(&path[path.len() - 1], colour);
        }
        let (found, balls) = (self.solutions.len(), self.balls.len());
        let passed_over = match self.passed_over {
            0 => String::new(),
            count => format!(" ({count} before it with fewer than two are passed over)"),
        };
        let caption = format!(
            "{balls} balls: {found} of {} paths succeed{passed_over}; start in grey",
            self.drawn
        );
        Ok(Picture::new(scene.svg()?, caption))
    }

    /// The two solutions whose ends are farthest from each other.
    fn two(&self) -> Option<[usize; 2]> {
        let end = |index: usize| {
            self.solutions[index]
                .last()
                .map(|it| Configuration::from(*it))
        };
        let count = self.solutions.len();
        let pairs = (0..count).flat_map(|a| (a + 1..count).map(move |b| [a, b]));
        let distance = |[a, b]: &[usize; 2]| Some((end(*a)? - end(*b)?).norm());
        pairs.max_by(|a, b| {
            distance(a)
                .partial_cmp(&distance(b))
                .unwrap_or(std::cmp::Ordering::Equal)
        })
    }

    fn motion(&self, bench: &Bench, index: usize) -> anyhow::Result<Picture> {
        let mut scene = self.scene(bench, self.camera(bench));
        let path: Vec<Configuration> = self.solutions[index]
            .iter()
            .map(|it| Configuration::from(*it))
            .collect();
        scene.path(&bench.robot.tips(&path), COLOURS[0], 4);
        for body in 0..BODIES {
            let share = body as f64 / (BODIES - 1) as f64;
            let at = (share * (path.len() - 1) as f64).round() as usize;
            scene.body(
                &path[at],
                blend(GREY, COLOURS[index % COLOURS.len()], share),
            );
        }
        Ok(Picture::new(
            scene.svg()?,
            format!("solution {index}: the body at {BODIES} waypoints"),
        ))
    }

    fn curves(&self, index: usize) -> anyhow::Result<Picture> {
        let path = &self.solutions[index];
        let last = (path.len() - 1) as f64;
        let line = |component: usize| {
            let points = path.iter().zip(0..);
            let points = points
                .map(|(it, at)| (f64::from(at) / last, it[component]))
                .collect();
            Line::curve(&component_name(component), points, COLOURS[component])
        };
        let chart = Lines {
            x: Axis::linear("place on the path"),
            y: Axis::linear("configuration, rad"),
            lines: (0..DOF).map(line).collect(),
            marks: Vec::new(),
        };
        Ok(Picture::new(
            chart.svg()?,
            format!("solution {index}: its six configuration curves"),
        ))
    }
}

/// The name of a component of the configuration.
pub(super) fn component_name(component: usize) -> String {
    format!("ξ{}{}", component / 2 + 1, component % 2 + 1)
}

pub(super) fn figure(bench: &Bench) -> anyhow::Result<Figure> {
    let loaded = bench.planner(PlannerName::Diffusion)?;
    let cases = SCENES.iter().map(|(balls, _)| cases_of(bench, *balls));
    let cases = cases.collect::<anyhow::Result<Vec<Vec<Case>>>>()?;
    let settings = json!({ "draws": DRAWS, "cases_hash": hash_of(&cases.concat()) });
    let solved: Vec<Solved> = bench.keep("solutions", &loaded.records, &settings, || {
        let solved = cases
            .iter()
            .map(|cases| Solved::first_of(bench, &loaded, cases));
        solved.collect()
    })?;
    let sampling = bench.models().sampling();
    let mut pictures = Vec::new();
    for (solved, (_, id)) in solved.iter().zip(SCENES) {
        pictures.push(solved.picture(bench)?.with_id(id));
    }
    let two = &solved[TWO_OF];
    let chosen = two
        .two()
        .context("fewer than two solutions among one ball")?;
    let ids = [
        ["solution-one", "solution-one-curves"],
        ["solution-two", "solution-two-curves"],
    ];
    for (index, [motion, curves]) in chosen.into_iter().zip(ids) {
        pictures.push(two.motion(bench, index)?.in_new_row().with_id(motion));
        pictures.push(two.curves(index)?.with_id(curves));
    }
    Ok(Figure {
        name: FigureName::Solutions,
        title: "Several solutions among none to four balls",
        pictures,
        caption: format!(
            "{DRAWS} paths each of <code>diffusion</code> ({sampling}, no guidance) for the first unseen case with so many balls for which at least two of them succeed \
             (the last one where there is none): reference cases, and a general one for three balls, which the model was not trained with. Drawn are the paths that succeed by the paper's criterion: the body at their end, and the \
             tip's way from the diamond to the star. Below, the two solutions with one ball whose ends are farthest apart, as bodies and as curves of their \
             six components."
        ),
        made_by: None,
    })
}

/// The cases with so many balls among the first [`CASES`] of their set, at least one.
fn cases_of(bench: &Bench, balls: usize) -> anyhow::Result<Vec<Case>> {
    let set = if balls == 3 {
        CaseSet::GENERAL
    } else {
        CaseSet::REFERENCE
    };
    let mut cases = bench.cases(&set, CASES)?;
    cases.retain(|case| case.scene.balls().len() == balls);
    ensure!(
        !cases.is_empty(),
        "none of the first {CASES} cases of {set} has {balls} balls"
    );
    Ok(cases)
}
