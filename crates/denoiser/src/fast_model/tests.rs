//! Parity with PyTorch, layer by layer (`scripts/train_fast.py fixture`), and independence of the batch.

use super::*;
use crate::Manifest;
use std::f64::consts::FRAC_PI_2;
use std::path::PathBuf;

const WIDTH: usize = 32;

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures")
}

fn weights() -> WeightsFile {
    Manifest::open(&folder()).unwrap().weights("tiny").unwrap()
}

struct Parity {
    model: FastModel,
    recorded: WeightsFile,
}

impl Parity {
    fn load() -> Self {
        let path = folder().join("tiny_layers.safetensors");
        Self {
            model: FastModel::from_weights(&weights(), FRAC_PI_2).unwrap(),
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
    model.enter_trunk(parity.noise(), 0.3, &mut s);
    parity.assert_close(&s.time.repeat(3), "time", WIDTH);
    parity.assert_close(&s.trunk, "input", WIDTH);
    for (index, block) in model.blocks.iter().enumerate() {
        block.apply(&mut s);
        parity.assert_close(&s.trunk, &format!("block_{index}"), WIDTH);
    }
    assert_eq!(model.blocks.len(), 2);
    model.estimate(parity.noise(), 0.3, &mut s);
    parity.assert_close(&s.estimate, "estimate", COEFFICIENTS);
}

#[test]
fn a_whole_sample_agrees_with_pytorch() {
    let parity = Parity::load();
    let mut out = vec![0.0; 3 * COEFFICIENTS];
    let mut scratch = FastScratch::default();
    let candidates = parity.candidates();
    parity
        .model
        .sample(&candidates, parity.noise(), 2, &mut scratch, &mut out);
    parity.assert_close(&out, "sample", COEFFICIENTS);
}

#[test]
fn a_candidate_does_not_notice_its_batch() {
    let parity = Parity::load();
    let (model, candidates, noise) = (&parity.model, parity.candidates(), parity.noise());
    let mut scratch = FastScratch::default();
    let noise_of = |i: usize| noise[COEFFICIENTS * i..][..COEFFICIENTS].to_vec();
    for count in [1, 2, 3, 5, 10, 12, 13, 25, 64] {
        let order: Vec<usize> = (0..count).map(|i| (i * i + count) % 3).collect();
        let batch: Vec<CandidateInput> = order.iter().map(|i| candidates[*i]).collect();
        let batch_noise: Vec<f32> = order.iter().flat_map(|i| noise_of(*i)).collect();
        let mut together = vec![f32::NAN; batch_noise.len()];
        model.sample(&batch, &batch_noise, 2, &mut scratch, &mut together);
        for (slot, &i) in order.iter().enumerate() {
            let mut alone = vec![0.0; COEFFICIENTS];
            let mut fresh = FastScratch::default();
            model.sample(&candidates[i..=i], &noise_of(i), 2, &mut fresh, &mut alone);
            let here = &together[COEFFICIENTS * slot..][..COEFFICIENTS];
            assert_eq!(alone, here, "candidate {i} in slot {slot} of {count}");
        }
    }
}

#[test]
fn no_candidates_are_no_samples() {
    let mut out = [];
    Parity::load()
        .model
        .sample(&[], &[], 2, &mut FastScratch::default(), &mut out);
}

#[test]
#[should_panic(expected = "36 end features")]
fn ends_of_another_length_are_refused() {
    let candidate = CandidateInput {
        ends: &[0.0; 35],
        balls: &[],
    };
    let mut out = [0.0; COEFFICIENTS];
    let noise = [0.0; COEFFICIENTS];
    let mut scratch = FastScratch::default();
    Parity::load()
        .model
        .sample(&[candidate], &noise, 2, &mut scratch, &mut out);
}

#[test]
fn another_bending_limit_is_refused() {
    let refused = FastModel::from_weights(&weights(), 1.2).err().unwrap();
    assert!(
        matches!(refused, WeightsError::Robot { expected, .. } if expected == 1.2),
        "{refused}"
    );
}
