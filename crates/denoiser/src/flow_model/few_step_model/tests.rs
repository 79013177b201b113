//! Parity with PyTorch, layer by layer (`scripts/train_fast.py fixture`), and independence of the batch.

use super::*;
use crate::Manifest;
use crate::gemm::presence::{has_bf16, precisions};
use crate::weights::error::ContentError;
use std::f64::consts::FRAC_PI_2;
use std::path::PathBuf;

const WIDTH: usize = 32;

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures")
}

fn weights() -> WeightsFile {
    Manifest::open(&folder()).unwrap().weights("tiny").unwrap()
}

fn model(precision: Precision) -> FastModel {
    let model = FastModel::from_weights(&weights(), FRAC_PI_2).unwrap();
    model.with_precision(precision)
}

struct Parity {
    model: FastModel,
    recorded: WeightsFile,
}

impl Parity {
    fn load() -> Self {
        let path = folder().join("tiny_layers.safetensors");
        Self {
            model: model(Precision::F32),
            recorded: WeightsFile::parse(&path, &std::fs::read(&path).unwrap()).unwrap(),
        }
    }

    fn recorded(&self, name: &str, width: usize) -> &[f32] {
        self.recorded.tensor(name, &[3, width]).unwrap()
    }

    fn noise(&self) -> &[f32] {
        self.recorded("noise", COEFFICIENTS)
    }

    /// Three candidates with 0, 1 and 5 balls.
    fn candidates(&self) -> [CandidateInput<'_>; 3] {
        let counts = self.recorded.tensor("ball_counts", &[3]).unwrap();
        assert_eq!(counts, [0.0, 1.0, 5.0]);
        let ends = self.recorded("ends", END_FEATURES);
        let balls = self.recorded.tensor("balls", &[6, BALL_FEATURES]).unwrap();
        let (one, five) = balls.split_at(BALL_FEATURES);
        let of = |i: usize, balls| CandidateInput {
            ends: &ends[END_FEATURES * i..][..END_FEATURES],
            balls,
            warm_start: None,
        };
        [of(0, &[]), of(1, one), of(2, five)]
    }

    fn assert_close(&self, found: &[f32], name: &str, width: usize) {
        let expected = self.recorded(name, width);
        assert_eq!(found.len(), expected.len(), "{name}");
        let scale = expected.iter().fold(0.0_f32, |m, v| m.max(v.abs()));
        assert!(scale > 0.1, "{name} is not trivial");
        let errors = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
        let worst = errors.fold(0.0_f32, f32::max);
        assert!(worst <= 1e-5 * scale, "{name}: {worst} of {scale}");
    }
}

/// Puts a time, which no step has, into the trunk of three rows.
fn write_time(model: &FastModel, s: &mut FastScratch) {
    s.trunk.resize(3 * WIDTH, 0.0);
    for row in s.trunk.chunks_exact_mut(WIDTH) {
        model.flow.write_time(0, 0.3, row);
    }
}

#[test]
fn every_layer_agrees_with_pytorch() {
    let parity = Parity::load();
    let (model, mut s) = (&parity.model, FastScratch::default());
    model.condition(&parity.candidates(), &mut s);
    let joined = s.joined.chunks_exact(2 * BALL_WIDTH + END_FEATURES);
    let pooled: Vec<f32> = joined
        .flat_map(|row| row[..2 * BALL_WIDTH].to_vec())
        .collect();
    parity.assert_close(&pooled, "pooled", 2 * BALL_WIDTH);
    parity.assert_close(&s.context, "context", WIDTH);
    write_time(model, &mut s);
    parity.assert_close(&s.trunk, "time", WIDTH);
    model.enter_trunk(parity.noise(), &mut s);
    parity.assert_close(&s.trunk, "input", WIDTH);
    for (index, block) in model.blocks.iter().enumerate() {
        block.apply(&mut s);
        parity.assert_close(&s.trunk, &format!("block_{index}"), WIDTH);
    }
    assert_eq!(model.blocks.len(), 2);
    write_time(model, &mut s);
    model.estimate(parity.noise(), &mut s);
    parity.assert_close(&s.estimate, "estimate", COEFFICIENTS);
}

fn sample(model: &FastModel, candidates: &[CandidateInput], noise: &[f32]) -> Vec<f32> {
    let mut out = vec![f32::NAN; noise.len()];
    model.sample(candidates, noise, &mut FastScratch::default(), &mut out);
    out
}

/// Root mean square of the differences, in that of the second.
fn relative_error(found: &[f32], expected: &[f32]) -> f32 {
    assert_eq!(found.len(), expected.len());
    let errors: f32 = found
        .iter()
        .zip(expected)
        .map(|(f, e)| (f - e).powi(2))
        .sum();
    let size: f32 = expected.iter().map(|e| e * e).sum();
    assert!(size > 0.0, "not trivial");
    (errors / size).sqrt()
}

#[test]
fn a_whole_sample_agrees_with_pytorch() {
    let parity = Parity::load();
    let out = sample(&parity.model, &parity.candidates(), parity.noise());
    parity.assert_close(&out, "sample", COEFFICIENTS);
}

#[test]
fn reduced_precision_stays_near() {
    if !has_bf16() {
        return;
    }
    let parity = Parity::load();
    let exact = sample(&parity.model, &parity.candidates(), parity.noise());
    let reduced = model(Precision::Bf16);
    let found = sample(&reduced, &parity.candidates(), parity.noise());
    let error = relative_error(&found, &exact);
    assert!(error > 1e-6, "other products, not {error}");
    assert!(error < 1e-2, "{error}");
}

#[test]
fn a_candidate_does_not_notice_its_batch() {
    let parity = Parity::load();
    let (mut candidates, noise) = (parity.candidates(), parity.noise());
    let data = noise[..COEFFICIENTS].to_vec();
    candidates[1].warm_start = Some(WarmStart {
        coefficients: &data,
        time: 0.7,
    });
    let noise_of = |i: usize| noise[COEFFICIENTS * i..][..COEFFICIENTS].to_vec();
    for precision in precisions() {
        let model = model(precision);
        let mut scratch = FastScratch::default();
        let alone = [0, 1, 2].map(|i| sample(&model, &candidates[i..=i], &noise_of(i)));
        for count in [1, 2, 3, 5, 10, 12, 13, 16, 17, 25, 64] {
            let order: Vec<usize> = (0..count).map(|i| (i * i + count) % 3).collect();
            let batch: Vec<CandidateInput> = order.iter().map(|i| candidates[*i]).collect();
            let batch_noise: Vec<f32> = order.iter().flat_map(|i| noise_of(*i)).collect();
            let mut together = vec![f32::NAN; batch_noise.len()];
            model.sample(&batch, &batch_noise, &mut scratch, &mut together);
            for (slot, &i) in order.iter().enumerate() {
                let here = &together[COEFFICIENTS * slot..][..COEFFICIENTS];
                assert_eq!(alone[i], here, "candidate {i} in slot {slot} of {count}");
            }
        }
    }
}

#[test]
fn other_numbers_of_evaluations_are_other_samples_and_some_are_refused() {
    let parity = Parity::load();
    let as_trained = sample(&parity.model, &parity.candidates(), parity.noise());
    assert_eq!(parity.model.evaluations(), 2);
    for evaluations in [1, 2, 4, 8] {
        let other = model(Precision::F32).with_evaluations(evaluations).unwrap();
        assert_eq!(other.evaluations(), evaluations);
        let found = sample(&other, &parity.candidates(), parity.noise());
        assert_eq!(found == as_trained, evaluations == 2, "{evaluations}");
    }
    for evaluations in [0, 3, 16] {
        let refused = model(Precision::F32).with_evaluations(evaluations).err();
        assert_eq!(refused, Some(EvaluationsRefused(evaluations)));
    }
    let text = EvaluationsRefused(3).to_string();
    assert!(
        text.contains('3') && text.contains("1, 2, 4 and 8"),
        "{text}"
    );
}

/// The candidates of a parity test, begun from coefficients at a time.
fn warm<'a>(parity: &'a Parity, coefficients: &'a [f32], time: f32) -> [CandidateInput<'a>; 3] {
    let mut candidates = parity.candidates();
    let coefficients = coefficients.chunks_exact(COEFFICIENTS);
    for (candidate, coefficients) in candidates.iter_mut().zip(coefficients) {
        candidate.warm_start = Some(WarmStart { coefficients, time });
    }
    candidates
}

#[test]
fn a_warm_start_at_the_end_of_the_flow_is_the_result_and_at_its_beginning_does_not_matter() {
    let parity = Parity::load();
    let given: Vec<f32> = (0..3 * COEFFICIENTS).map(|i| (i as f32).sin()).collect();
    let end = sample(&parity.model, &warm(&parity, &given, 1.0), parity.noise());
    assert!(relative_error(&end, &given) < 1e-6);
    let cold = sample(&parity.model, &parity.candidates(), parity.noise());
    let beginning = sample(&parity.model, &warm(&parity, &given, 0.0), parity.noise());
    assert_eq!(beginning, cold);
    assert!(relative_error(&cold, &given) > 0.1);
}

/// The first step moves towards the estimate at time 0, which is what one evaluation alone returns: begun from that
/// estimate where the first step ends, the other steps lead where all steps do.
#[test]
fn a_warm_start_takes_the_steps_that_remain() {
    let parity = Parity::load();
    let with = |evaluations| model(Precision::F32).with_evaluations(evaluations).unwrap();
    let first = sample(&with(1), &parity.candidates(), parity.noise());
    for (evaluations, time) in [(2, 0.5), (4, 0.25), (8, 0.125)] {
        let model = with(evaluations);
        let all = sample(&model, &parity.candidates(), parity.noise());
        let rest = sample(&model, &warm(&parity, &first, time), parity.noise());
        let error = relative_error(&rest, &all);
        assert!(error < 1e-5, "{evaluations} evaluations: {error}");
        assert!(relative_error(&rest, &first) > 1e-3, "steps remain");
    }
}

#[test]
fn a_perfect_estimate_is_kept_from_any_time_on() {
    let parity = Parity::load();
    // the last step ends at the network's estimate: the output layer alone, with weights of zero, is a known one
    let mut constant = model(Precision::F32);
    let bias: Vec<f32> = (0..COEFFICIENTS).map(|i| (i as f32).cos()).collect();
    constant.output = Linear::pack(&vec![0.0; COEFFICIENTS * WIDTH], &bias);
    let known = bias.iter().zip(&constant.coefficient_deviation);
    let known: Vec<f32> = known.map(|(b, d)| b * d).collect::<Vec<_>>().repeat(3);
    for time in [0.0, 0.3, 0.5, 0.9, 0.999, 1.0] {
        let found = sample(&constant, &warm(&parity, &known, time), parity.noise());
        assert!(relative_error(&found, &known) < 1e-6, "from {time}");
    }
}

#[test]
#[should_panic(expected = "time 1.5 in [0, 1]")]
fn a_warm_start_beyond_the_flow_is_refused() {
    let parity = Parity::load();
    let given = vec![0.0; 3 * COEFFICIENTS];
    sample(&parity.model, &warm(&parity, &given, 1.5), parity.noise());
}

#[test]
fn calls_of_any_size_leave_nothing_behind_for_the_next_one() {
    let parity = Parity::load();
    let (candidates, noise) = (parity.candidates(), parity.noise());
    let mut scratch = FastScratch::default();
    for count in [3, 0, 1, 3, 2, 0, 3] {
        let (candidates, noise) = (&candidates[..count], &noise[..count * COEFFICIENTS]);
        let mut found = vec![f32::NAN; noise.len()];
        parity
            .model
            .sample(candidates, noise, &mut scratch, &mut found);
        let alone = sample(&parity.model, candidates, noise);
        assert_eq!(found, alone, "{count} candidates");
    }
}

#[test]
#[should_panic(expected = "36 end features")]
fn ends_of_another_length_are_refused() {
    let candidate = CandidateInput {
        ends: &[0.0; 35],
        balls: &[],
        warm_start: None,
    };
    let mut out = [0.0; COEFFICIENTS];
    let noise = [0.0; COEFFICIENTS];
    let mut scratch = FastScratch::default();
    Parity::load()
        .model
        .sample(&[candidate], &noise, &mut scratch, &mut out);
}

#[test]
fn another_bending_limit_is_refused() {
    let refused = FastModel::from_weights(&weights(), 1.2).err().unwrap();
    assert!(
        matches!(refused, WeightsError::Content { reason: ContentError::Robot { expected, .. }, .. } if expected == 1.2),
        "{refused}"
    );
}
