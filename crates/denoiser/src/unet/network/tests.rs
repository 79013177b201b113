//! Parity with PyTorch, layer by layer (`scripts/fixtures_unet.py`), and independence of the batch.

use super::*;
use crate::Manifest;
use crate::gemm::presence::{has_bf16, precisions};
use std::f64::consts::FRAC_PI_2;
use std::path::PathBuf;

const CASES: usize = 3;
/// Balls of each case.
const BALLS: [usize; CASES] = [0, 1, 4];
/// Of the largest value of a layer.
const TOLERANCE: f32 = 1e-4;

/// The committed fixture, or that of another size in the folder that the variable names.
fn folder() -> PathBuf {
    let fixture = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/unet");
    std::env::var_os("UNET_FIXTURE").map_or(fixture, PathBuf::from)
}

struct Parity {
    context: usize,
    hidden: usize,
    unet: TemporalUnet,
    recorded: WeightsFile,
}

impl Parity {
    fn load() -> Self {
        let weights = Manifest::open(&folder()).unwrap().weights("unet").unwrap();
        let path = folder().join("layers.safetensors");
        Self {
            context: weights.count("context").unwrap(),
            hidden: weights.count("graph_hidden").unwrap(),
            unet: TemporalUnet::load(&weights, FRAC_PI_2).unwrap(),
            recorded: WeightsFile::parse(&path, &std::fs::read(&path).unwrap()).unwrap(),
        }
    }

    /// What is recorded of a case.
    fn of_case<const N: usize>(&self, name: &str, case: usize, shape: [usize; N]) -> &[f32] {
        let whole: Vec<usize> = std::iter::once(CASES).chain(shape).collect();
        let values = self.recorded.tensor(name, &whole).unwrap();
        &values[case * values.len() / CASES..][..values.len() / CASES]
    }

    fn paths(&self, name: &str, case: usize) -> &[f32] {
        self.of_case(name, case, [HORIZON, FRAME])
    }

    fn step(&self, case: usize) -> f32 {
        self.of_case("input.step", case, [])[0]
    }

    fn balls(&self, case: usize) -> &[[f32; 4]] {
        let balls = self.recorded.tensor("input.balls", &[5, 4]).unwrap();
        let first: usize = BALLS[..case].iter().sum();
        &balls.as_chunks().0[first..][..BALLS[case]]
    }

    fn condition(&self, case: usize) -> UnetCondition {
        let start = self
            .of_case("input.start", case, [FRAME])
            .try_into()
            .unwrap();
        let target = self.of_case("input.target", case, [3]).try_into().unwrap();
        self.unet.condition(start, target, self.balls(case))
    }

    /// The noise of a case, and the scratch that it leaves.
    fn predict(&self, case: usize) -> (Vec<f32>, UnetScratch) {
        let (mut scratch, mut noise) = (UnetScratch::default(), vec![0.0; PATH]);
        self.unet.predict(
            &self.condition(case),
            self.step(case),
            self.paths("input.paths", case),
            Precision::F32,
            &mut scratch,
            &mut noise,
        );
        (noise, scratch)
    }

    /// The noise of several cases' paths under the condition of case 2, and the gradient for their cotangents.
    fn together(
        &self,
        cases: &[usize],
        precision: Precision,
        s: &mut UnetScratch,
    ) -> [Vec<f32>; 2] {
        let joined = |name| {
            cases
                .iter()
                .flat_map(move |c| self.paths(name, *c))
                .copied()
        };
        let paths: Vec<f32> = joined("input.paths").collect();
        let cotangent: Vec<f32> = joined("input.cotangent").collect();
        let [mut noise, mut gradient] = [(); 2].map(|()| vec![f32::NAN; paths.len()]);
        let condition = self.condition(2);
        let unet = &self.unet;
        unet.predict(&condition, 500.0, &paths, precision, s, &mut noise);
        unet.pull_back(s, &cotangent, &mut gradient);
        [noise, gradient]
    }
}

fn assert_close(found: &[f32], expected: &[f32], name: &str) {
    assert_eq!(found.len(), expected.len(), "{name}");
    let scale = expected.iter().fold(0.0_f32, |m, v| m.max(v.abs()));
    assert!(scale > 0.01, "{name} is not trivial");
    // The largest of errors passes over those that are not numbers.
    assert!(found.iter().all(|v| v.is_finite()), "{name} is finite");
    let errors = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
    let worst = errors.fold(0.0_f32, f32::max) / scale;
    assert!(worst <= TOLERANCE, "{name}: off by {worst}");
    println!("parity of {name}: {worst:.1e}");
}

#[test]
fn every_layer_of_the_paths_agrees_with_pytorch() {
    let parity = Parity::load();
    let names = ["down.0", "down.1", "down.2", "middle", "up.1", "up.0"];
    let entries = ["stem", "down.0.shrink", "down.1.shrink"];
    for case in 0..CASES {
        let (_, scratch) = parity.predict(case);
        for (index, (name, tape)) in names.iter().zip(&scratch.tapes).enumerate() {
            let assert_rows = |rows: &Rows, name: &str| {
                let shape = [rows.height(), rows.channels()];
                let found = rows.each().next().unwrap();
                assert_close(found, parity.of_case(name, case, shape), name);
            };
            if let Some(name) = entries.get(index) {
                assert_rows(&tape.entry, name);
            }
            if name.starts_with("up") {
                let mut grown = Rows::default();
                let channels = tape.entry.channels() / 2;
                grown.shape(1, tape.entry.height(), channels);
                grown.copy_channels(0, &tape.entry, 0, channels);
                assert_rows(&grown, &format!("{name}.grow"));
            }
            assert_rows(&tape.blocks[0].out, &format!("{name}.block1"));
            assert_rows(&tape.blocks[1].out, &format!("{name}.block2"));
        }
    }
}

#[test]
fn every_layer_of_the_embeddings_agrees_with_pytorch() {
    let parity = Parity::load();
    let unet = &parity.unet;
    let recorded_nodes = |name: &str, case: usize| {
        let hidden = parity.hidden;
        let values = parity.recorded.tensor(name, &[5, hidden]).unwrap();
        let first: usize = BALLS[..case].iter().sum();
        values[first * hidden..][..BALLS[case] * hidden].to_vec()
    };
    for case in 0..CASES {
        let context = |name| parity.of_case(name, case, [parity.context]);
        let balls = parity.balls(case).iter();
        let nodes: Vec<Node> = balls.map(|b| unet.normalisation.ball(b)).collect();
        let mut after = unet.graph.first_nodes(&nodes);
        if !nodes.is_empty() {
            assert_close(&after, &recorded_nodes("graph.node", case), "nodes");
            for (index, layer) in unet.graph.layers.iter().enumerate() {
                layer.apply(&nodes, &mut after);
                let name = format!("graph.layers.{index}");
                assert_close(&after, &recorded_nodes(&name, case), &name);
            }
        }
        assert_close(&unet.graph.apply(&nodes), context("graph.pool"), "pool");
        let start = parity
            .of_case("input.start", case, [FRAME])
            .try_into()
            .unwrap();
        let target = *parity
            .of_case("input.target", case, [3])
            .as_array()
            .unwrap();
        let start = unet.normalisation.configuration(start);
        let goal = unet.normalisation.position(target);
        let mut ends = context("start").to_vec();
        ends.iter_mut()
            .zip(context("goal"))
            .for_each(|(s, g)| *s += g);
        assert_close(&unet.embedding.ends(&start, &goal), &ends, "start + goal");
        let mut work = EmbeddingWork::default();
        unet.embedding.times(&[parity.step(case)], &mut work);
        assert_close(&work.sum, context("time"), "time");
        let (_, scratch) = parity.predict(case);
        assert_close(&scratch.contexts, context("context"), "context");
    }
}

#[test]
fn the_noise_agrees_with_pytorch() {
    let parity = Parity::load();
    for case in 0..CASES {
        let (noise, _) = parity.predict(case);
        assert_close(&noise, parity.paths("noise", case), "noise");
    }
}

#[test]
fn the_gradient_agrees_with_pytorch() {
    let parity = Parity::load();
    for case in 0..CASES {
        let (_, mut scratch) = parity.predict(case);
        let mut gradient = vec![0.0; PATH];
        let cotangent = parity.paths("input.cotangent", case);
        parity
            .unet
            .pull_back(&mut scratch, cotangent, &mut gradient);
        assert_close(&gradient, parity.paths("gradient", case), "gradient");
    }
}

#[test]
fn the_gradient_agrees_with_finite_differences() {
    const CHANGE: f32 = 1e-2;
    let parity = Parity::load();
    let unet = &parity.unet;
    let dot = |a: &[f32], b: &[f32]| -> f64 {
        let products = a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b));
        products.sum()
    };
    let mut scratch = UnetScratch::default();
    for case in 0..CASES {
        let (paths, cotangent) = (
            parity.paths("input.paths", case),
            parity.paths("input.cotangent", case),
        );
        let along = parity.paths("input.cotangent", (case + 1) % CASES);
        let condition = parity.condition(case);
        let mut value_at = |change: f32| {
            let moved: Vec<f32> = paths
                .iter()
                .zip(along)
                .map(|(p, a)| p + change * a)
                .collect();
            let mut noise = vec![0.0; PATH];
            unet.predict(
                &condition,
                40.0,
                &moved,
                Precision::F32,
                &mut scratch,
                &mut noise,
            );
            dot(&noise, cotangent)
        };
        let difference = (value_at(CHANGE) - value_at(-CHANGE)) / f64::from(2.0 * CHANGE);
        value_at(0.0);
        let mut gradient = vec![0.0; PATH];
        unet.pull_back(&mut scratch, cotangent, &mut gradient);
        let slope = dot(&gradient, along);
        let scale = dot(&gradient, &gradient).sqrt() * dot(along, along).sqrt();
        assert!(
            slope.abs() > 1e-3 * scale,
            "case {case} says something: {slope} of {scale}"
        );
        let error = (difference - slope).abs() / scale;
        assert!(
            error < 1e-3,
            "case {case}: {slope}, by differences {difference}"
        );
    }
}

#[test]
fn a_candidate_does_not_notice_its_batch() {
    let parity = Parity::load();
    for precision in precisions() {
        let fresh = |case| parity.together(&[case], precision, &mut UnetScratch::default());
        let alone: Vec<_> = (0..CASES).map(fresh).collect();
        let mut scratch = UnetScratch::default();
        for count in [1, 2, 3, 5, 8, 13, 4] {
            let cases: Vec<usize> = (0..count).map(|i| (i * i + count) % CASES).collect();
            let together = parity.together(&cases, precision, &mut scratch);
            for (what, values) in together.iter().enumerate() {
                for (found, case) in values.chunks_exact(PATH).zip(&cases) {
                    assert_eq!(
                        found, alone[*case][what],
                        "{case} of {count}, {precision:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn prepared_steps_change_nothing() {
    let parity = Parity::load();
    let (paths, unet) = (parity.paths("input.paths", 0), &parity.unet);
    let mut condition = parity.condition(1);
    let steps = [999.0, 400.0, 0.0];
    let mut scratch = UnetScratch::default();
    let mut predict = |condition: &UnetCondition, step| {
        let mut noise = vec![0.0; PATH];
        unet.predict(
            condition,
            step,
            paths,
            Precision::F32,
            &mut scratch,
            &mut noise,
        );
        noise
    };
    let unprepared = steps.map(|step| predict(&condition, step));
    assert_ne!(unprepared[0], unprepared[1], "the step matters");
    unet.prepare(&mut condition, &steps);
    assert_eq!(unprepared, steps.map(|step| predict(&condition, step)));
}

#[test]
fn reduced_precision_stays_near() {
    if !has_bf16() {
        return;
    }
    let parity = Parity::load();
    let of = |precision| parity.together(&[0, 1, 2], precision, &mut UnetScratch::default());
    let (in_f32, in_bf16) = (of(Precision::F32), of(Precision::Bf16));
    for (in_f32, in_bf16) in in_f32.iter().zip(&in_bf16) {
        let error: f32 = in_f32
            .iter()
            .zip(in_bf16)
            .map(|(a, b)| (a - b).powi(2))
            .sum();
        let share = (error / in_f32.iter().map(|v| v.powi(2)).sum::<f32>()).sqrt();
        assert!(share > 1e-4 && share < 0.03, "off by {share}");
    }
}

#[test]
fn a_request_for_no_candidates_changes_nothing_of_the_next_one() {
    let parity = Parity::load();
    let of = |cases: &[usize], scratch: &mut UnetScratch| {
        parity.together(cases, Precision::F32, scratch)
    };
    let alone = of(&[0, 1, 2], &mut UnetScratch::default());
    let mut scratch = UnetScratch::default();
    for _ in 0..2 {
        assert!(of(&[], &mut scratch).iter().all(Vec::is_empty));
        assert_eq!(of(&[0, 1, 2], &mut scratch), alone);
    }
}

#[test]
#[should_panic(expected = "384 values a candidate")]
fn a_path_of_another_length_is_refused() {
    let parity = Parity::load();
    let mut scratch = UnetScratch::default();
    let unet = &parity.unet;
    unet.predict(
        &parity.condition(0),
        0.0,
        &[0.0; 383],
        Precision::F32,
        &mut scratch,
        &mut [0.0; 383],
    );
}
