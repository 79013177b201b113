//! Parity with PyTorch, layer by layer (`scripts/train_fast.py fixture`), and independence of the batch.

use super::*;
use std::path::PathBuf;

fn fixture(name: &str) -> WeightsFile {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("tests/fixtures")
        .join(name);
    WeightsFile::parse(&path, &std::fs::read(&path).unwrap()).unwrap()
}

struct Parity {
    model: FastModel,
    outputs: WeightsFile,
}

impl Parity {
    fn load() -> Self {
        let limit = std::f64::consts::FRAC_PI_2;
        Self {
            model: FastModel::from_weights(&fixture("tiny.safetensors"), limit).unwrap(),
            outputs: fixture("tiny_outputs.safetensors"),
        }
    }

    fn given(&self, name: &str, shape: &[usize]) -> &[f32] {
        self.outputs.tensor(name, shape).unwrap()
    }

    fn candidates(&self) -> Vec<CandidateInput<'_>> {
        let (ends, balls) = (
            self.given("ends", &[3, 36]),
            self.given("balls", &[3, 5, 28]),
        );
        let counts = self.given("counts", &[3]);
        let candidate = |i: usize| CandidateInput {
            ends: &ends[36 * i..][..36],
            balls: &balls[5 * 28 * i..][..28 * counts[i] as usize],
        };
        (0..3).map(candidate).collect()
    }
}

fn assert_close(found: &[f32], expected: &[f32], what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let scale = expected.iter().fold(0.0_f32, |m, v| m.max(v.abs()));
    let worst = found
        .iter()
        .zip(expected)
        .fold(0.0_f32, |m, (a, b)| m.max((a - b).abs()));
    assert!(
        scale > 0.1 && worst <= 1e-5 * scale,
        "{what}: {worst} of {scale}"
    );
}

#[test]
fn every_layer_agrees_with_pytorch() {
    let parity = Parity::load();
    let mut s = FastScratch::default();
    parity.model.condition(&parity.candidates(), &mut s);
    assert_close(&s.context, parity.given("context", &[3, 32]), "context");
    let noise = parity.given("noise", &[3, 72]);
    let mut shallow = Parity::load().model;
    for depth in 0..=2 {
        shallow.blocks = Parity::load().model.blocks;
        shallow.blocks.truncate(depth);
        shallow.velocity(noise, 0.5, &mut s);
        let name = if depth == 0 {
            "trunk_input".to_owned()
        } else {
            format!("block_{}", depth - 1)
        };
        assert_close(&s.trunk, parity.given(&name, &[3, 32]), &name);
    }
    parity.model.velocity(noise, 0.5, &mut s);
    assert_close(&s.velocity, parity.given("velocity", &[3, 72]), "velocity");
}

#[test]
fn a_whole_sample_agrees_with_pytorch() {
    let parity = Parity::load();
    let mut out = vec![0.0; 3 * 72];
    parity.model.sample(
        &parity.candidates(),
        parity.given("noise", &[3, 72]),
        2,
        &mut FastScratch::default(),
        &mut out,
    );
    assert_close(&out, parity.given("sample", &[3, 72]), "sample");
}

#[test]
fn a_candidate_does_not_notice_its_batch() {
    let parity = Parity::load();
    let candidates = parity.candidates();
    let noise = parity.given("noise", &[3, 72]);
    let order = [2, 0, 1, 2, 2, 0, 1];
    let batch: Vec<CandidateInput> = order.iter().map(|i| candidates[*i]).collect();
    let batch_noise: Vec<f32> = order
        .iter()
        .flat_map(|i| noise[72 * i..][..72].to_vec())
        .collect();
    let mut together = vec![0.0; 7 * 72];
    let mut scratch = FastScratch::default();
    parity
        .model
        .sample(&batch, &batch_noise, 2, &mut scratch, &mut together);
    for (slot, &i) in order.iter().enumerate() {
        let mut alone = vec![0.0; 72];
        parity.model.sample(
            &candidates[i..=i],
            &noise[72 * i..][..72],
            2,
            &mut scratch,
            &mut alone,
        );
        assert_eq!(
            alone,
            together[72 * slot..][..72],
            "candidate {i} in slot {slot}"
        );
    }
}

#[test]
fn another_robot_or_shape_is_refused_by_name() {
    let file = fixture("tiny.safetensors");
    assert!(matches!(
        FastModel::from_weights(&file, 1.2),
        Err(WeightsError::Robot {
            quantity: "bending limit (rad)",
            ..
        })
    ));
    let outputs = fixture("tiny_outputs.safetensors");
    assert!(matches!(
        FastModel::from_weights(&outputs, 1.2),
        Err(WeightsError::Metadata {
            key: "architecture",
            found: None,
            ..
        })
    ));
    assert!(matches!(
        file.tensor("input.weight", &[32, 71]),
        Err(WeightsError::Shape { .. })
    ));
    assert!(matches!(
        file.tensor("nothing", &[1]),
        Err(WeightsError::NoTensor { .. })
    ));
}
