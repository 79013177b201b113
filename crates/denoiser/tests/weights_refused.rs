//! Every weights file that does not fit is refused by name.
#![allow(clippy::unwrap_used)]

mod damage;

use damage::{Folder, Weights};
use denoiser::{ContentError, FastModel, FeatureFrame, Manifest, WeightsError};
use std::f64::consts::FRAC_PI_2;
use std::fs;

const ARCHITECTURE: &str = "both-ends-flow-v1";

fn tiny() -> Weights {
    Weights::fixture("tiny.safetensors")
}

/// Takes the weights as a planner would, with a manifest that fits the file.
fn load_weights(weights: &Weights) -> Result<FastModel, WeightsError> {
    load(&Folder::of(&weights.content(), ARCHITECTURE))
}

fn load(folder: &Folder) -> Result<FastModel, WeightsError> {
    FastModel::from_weights(&folder.weights()?, FRAC_PI_2)
}

fn refusal(result: Result<FastModel, WeightsError>) -> WeightsError {
    result.err().expect("the weights are refused")
}

#[test]
fn sound_weights_are_taken() {
    let frame = |weights: &Weights| load_weights(weights).unwrap().frame();
    assert_eq!(frame(&tiny()), FeatureFrame::Canonical);
    assert_eq!(frame(&tiny().with("frame", "base")), FeatureFrame::Base);
}

#[test]
fn files_that_are_not_there_are_named() {
    let nowhere = tempfile::tempdir().unwrap();
    assert!(
        matches!(Manifest::open(nowhere.path()), Err(error @ WeightsError::Manifest(_)) if error.to_string().contains("MANIFEST.toml"))
    );
    let folder = Folder::of(&tiny().content(), ARCHITECTURE);
    fs::remove_file(folder.file("tiny.safetensors")).unwrap();
    assert!(
        matches!(refusal(load(&folder)), error @ WeightsError::File { .. } if error.to_string().contains("tiny.safetensors"))
    );
}

#[test]
fn a_manifest_that_is_not_understood_or_lacks_the_name_is_refused() {
    let folder = Folder::of(&tiny().content(), ARCHITECTURE);
    let manifest = folder.open().unwrap();
    let refused = manifest.weights("fast").err().unwrap();
    assert!(
        matches!(&refused, WeightsError::NotInManifest { name, known, .. } if name == "fast" && known == &["tiny"]),
        "{refused}"
    );
    folder.manifest("[tiny]\nfile = \"tiny.safetensors\"\nhash = \"0\"\n");
    assert!(
        matches!(refusal(load(&folder)), error @ WeightsError::Manifest(_) if error.to_string().contains("hash"))
    );
}

#[test]
fn a_truncated_or_altered_file_is_refused() {
    let content = tiny().content();
    let folder = Folder::of(&content, ARCHITECTURE);
    fs::write(
        folder.file("tiny.safetensors"),
        &content[..content.len() - 1],
    )
    .unwrap();
    let expected = content.len() as u64;
    assert!(
        matches!(refusal(load(&folder)), WeightsError::Differs { key: "bytes", found, expected: e, .. } if found == (expected - 1).to_string() && e == expected.to_string())
    );
    let mut altered = content;
    *altered.last_mut().unwrap() ^= 1;
    fs::write(folder.file("tiny.safetensors"), altered).unwrap();
    assert!(matches!(
        refusal(load(&folder)),
        WeightsError::Differs { key: "sha256", .. }
    ));
}

#[test]
fn what_is_not_a_weights_file_is_refused() {
    for content in [&b""[..], b"{}", &[0xff; 64]] {
        assert!(matches!(
            refusal(load(&Folder::of(content, ARCHITECTURE))),
            WeightsError::Format { .. }
        ));
    }
}

#[test]
fn metadata_that_does_not_fit_is_named() {
    for (key, value) in [
        ("architecture", "paper-unet-v1"),
        ("estimates", "velocity"),
        ("coefficients", "96"),
        ("sections", "2"),
        ("width", "0"),
        ("blocks", "many"),
        ("evaluations", "3"),
        ("frame", "world"),
    ] {
        let refused = refusal(load_weights(&tiny().with(key, value)));
        let told = match &refused {
            WeightsError::Content {
                reason:
                    ContentError::Metadata {
                        key,
                        found: Some(found),
                        ..
                    },
                ..
            } => (*key, found.as_str()),
            // The manifest names it, too.
            WeightsError::Differs { key, found, .. } => (*key, found.as_str()),
            _ => ("", ""),
        };
        assert_eq!(told, (key, value), "{refused}");
    }
}

#[test]
fn another_robot_is_named_with_both_limits() {
    let refused = refusal(load_weights(&tiny().with("theta_max", "1.2")));
    assert!(
        matches!(refused, WeightsError::Content { reason: ContentError::Robot { found, expected, .. }, .. } if found == 1.2 && expected == FRAC_PI_2)
    );
}

#[test]
fn a_tensor_of_another_shape_is_named_with_both_shapes() {
    let mut weights = tiny();
    weights.tensors.get_mut("blocks.1.inner.weight").unwrap().0 = vec![16, 64];
    let refused = refusal(load_weights(&weights));
    assert!(
        matches!(&refused, WeightsError::Content { reason: ContentError::Shape { tensor, found, expected }, .. }
            if tensor == "blocks.1.inner.weight" && found == "f32 [16, 64]" && expected == &[32, 32]),
        "{refused}"
    );
}

#[test]
fn a_tensor_that_is_missing_or_not_finite_is_named() {
    let mut weights = tiny();
    weights.tensors.remove("output.bias");
    assert!(
        matches!(refusal(load_weights(&weights)), WeightsError::Content { reason: ContentError::NoTensor { tensor }, .. } if tensor == "output.bias")
    );
    for value in [f32::NAN, f32::INFINITY] {
        let mut weights = tiny();
        weights.tensors.get_mut("time.weight").unwrap().1[17] = value;
        assert!(
            matches!(refusal(load_weights(&weights)), WeightsError::Content { reason: ContentError::NotFinite { tensor, index: 17, .. }, .. } if tensor == "time.weight")
        );
    }
}
