//! Every file that does not hold a temporal U-Net for the robot is refused by name.
#![allow(clippy::unwrap_used)]

mod damage;

use damage::{Folder, Weights};
use denoiser::{ContentError, TemporalUnet, WeightsError};
use std::f64::consts::FRAC_PI_2;
use std::fs;

const ARCHITECTURE: &str = "temporal-unet-v1";

fn unet() -> Weights {
    Weights::fixture("unet/unet.safetensors")
}

/// Takes the weights as a planner would, with a manifest that fits the file.
fn load(weights: &Weights) -> Result<TemporalUnet, WeightsError> {
    let architecture = &weights.metadata["architecture"];
    let folder = Folder::of(&weights.content(), architecture);
    TemporalUnet::load(&folder.weights()?, FRAC_PI_2)
}

fn refusal(weights: &Weights) -> WeightsError {
    load(weights).err().expect("the weights are refused")
}

#[test]
fn sound_weights_are_taken() {
    assert!(load(&unet()).is_ok());
}

#[test]
fn a_truncated_or_altered_file_is_refused() {
    let content = unet().content();
    let folder = Folder::of(&content, ARCHITECTURE);
    let file = folder.file("tiny.safetensors");
    fs::write(&file, &content[..content.len() / 2]).unwrap();
    let found = folder.weights();
    assert!(matches!(
        found,
        Err(WeightsError::Differs { key: "bytes", .. })
    ));
    let mut altered = content;
    *altered.last_mut().unwrap() ^= 1;
    fs::write(&file, altered).unwrap();
    let found = folder.weights();
    assert!(matches!(
        found,
        Err(WeightsError::Differs { key: "sha256", .. })
    ));
}

#[test]
fn metadata_that_does_not_fit_is_named() {
    for (key, value) in [
        ("architecture", "both-ends-flow-v1"),
        ("horizon", "32"),
        ("steps", "100"),
        ("schedule", "linear"),
        ("sections", "2"),
        ("width", "24"),
        ("width", "0"),
        ("context", "none"),
        ("graph_hidden", "-1"),
        ("theta_max", "right"),
    ] {
        let refused = refusal(&unet().with(key, value));
        assert!(
            matches!(&refused, WeightsError::Content { reason: ContentError::Metadata { key: k, found: Some(f), .. }, .. } if *k == key && f == value),
            "{refused}"
        );
    }
    let mut weights = unet();
    weights.metadata.remove("width");
    let refused = refusal(&weights);
    assert!(
        matches!(
            &refused,
            WeightsError::Content {
                reason: ContentError::Metadata {
                    key: "width",
                    found: None,
                    ..
                },
                ..
            }
        ),
        "{refused}"
    );
}

#[test]
fn another_robot_is_named_with_both_limits() {
    let refused = refusal(&unet().with("theta_max", "1.2"));
    assert!(
        matches!(refused, WeightsError::Content { reason: ContentError::Robot { found, expected, .. }, .. } if found == 1.2 && expected == FRAC_PI_2)
    );
}

#[test]
fn another_width_than_the_tensors_have_is_named() {
    let refused = refusal(&unet().with("width", "32"));
    assert!(
        matches!(&refused, WeightsError::Content { reason: ContentError::Shape { expected, .. }, .. } if expected.contains(&32)),
        "{refused}"
    );
}

#[test]
fn a_tensor_of_another_shape_is_named_with_both_shapes() {
    // transposed convolutions have their inputs first
    for (tensor, shape) in [
        ("down.1.block1.conv1.weight", vec![16, 32, 3]),
        ("up.0.grow.weight", vec![16, 32, 4]),
        ("up.1.block1.skip.weight", vec![32, 64]),
        ("graph.empty", vec![1, 32]),
        ("normalisation.position_scale", vec![]),
    ] {
        let mut weights = unet();
        let needed = std::mem::replace(&mut weights.tensors.get_mut(tensor).unwrap().0, shape);
        let refused = refusal(&weights);
        assert!(
            matches!(&refused, WeightsError::Content { reason: ContentError::Shape { tensor: t, expected, .. }, .. } if t == tensor && *expected == needed),
            "{refused}"
        );
    }
}

#[test]
fn every_tensor_is_needed_and_must_be_finite() {
    let names: Vec<String> = unet().tensors.into_keys().collect();
    assert!(names.len() > 100, "the whole network");
    for name in names {
        let mut weights = unet();
        weights.tensors.remove(&name);
        let refused = refusal(&weights);
        assert!(
            matches!(&refused, WeightsError::Content { reason: ContentError::NoTensor { tensor }, .. } if *tensor == name),
            "{refused}"
        );
    }
    for value in [f32::NAN, f32::NEG_INFINITY] {
        let mut weights = unet();
        weights
            .tensors
            .get_mut("middle.block2.film.bias")
            .unwrap()
            .1[5] = value;
        let refused = refusal(&weights);
        assert!(
            matches!(&refused, WeightsError::Content { reason: ContentError::NotFinite { tensor, index: 5, .. }, .. } if tensor == "middle.block2.film.bias"),
            "{refused}"
        );
    }
}

#[test]
fn a_normalisation_that_divides_by_nothing_is_named() {
    for (name, value) in [("configuration_high", -9.0), ("position_scale", 0.0)] {
        let mut weights = unet();
        let name = format!("normalisation.{name}");
        weights.tensors.get_mut(&name).unwrap().1.fill(value);
        let refused = refusal(&weights);
        assert!(
            matches!(&refused, WeightsError::Content { reason: ContentError::Value { tensor, .. }, .. } if *tensor == name),
            "{refused}"
        );
    }
}
