//! Every weights file that does not fit is refused by name.
#![allow(clippy::unwrap_used)]

use denoiser::{FastModel, Manifest, WeightsError};
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use sha2::{Digest, Sha256};
use std::collections::HashMap;
use std::f64::consts::FRAC_PI_2;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// The fixture's weights in memory, to be damaged.
struct Weights {
    metadata: HashMap<String, String>,
    tensors: HashMap<String, (Vec<usize>, Vec<f32>)>,
}

impl Weights {
    fn tiny() -> Self {
        let fixture = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/tiny.safetensors");
        let content = fs::read(fixture).unwrap();
        let (_, header) = SafeTensors::read_metadata(&content).unwrap();
        let file = SafeTensors::deserialize(&content).unwrap();
        let values = |view: &TensorView| {
            let (bytes, _) = view.data().as_chunks::<4>();
            bytes.iter().map(|b| f32::from_le_bytes(*b)).collect()
        };
        let tensors = file.tensors().into_iter();
        Self {
            metadata: header.metadata().clone().unwrap(),
            tensors: tensors
                .map(|(name, view)| (name, (view.shape().to_vec(), values(&view))))
                .collect(),
        }
    }

    fn with(mut self, key: &str, value: &str) -> Self {
        assert!(
            self.metadata.insert(key.into(), value.into()).is_some(),
            "{key} was there"
        );
        self
    }

    fn content(&self) -> Vec<u8> {
        let bytes: HashMap<_, Vec<u8>> = self
            .tensors
            .iter()
            .map(|(name, (_, v))| (name, v.iter().flat_map(|v| v.to_le_bytes()).collect()))
            .collect();
        let view = |name: &String, shape: &Vec<usize>| {
            TensorView::new(Dtype::F32, shape.clone(), &bytes[name]).unwrap()
        };
        let views = self
            .tensors
            .iter()
            .map(|(name, (shape, _))| (name.clone(), view(name, shape)));
        safetensors::serialize(views, Some(self.metadata.clone())).unwrap()
    }

    /// Loads the weights as a planner would, with a manifest that fits the file.
    fn load(&self) -> Result<FastModel, WeightsError> {
        load(&Folder::of(&self.content()))
    }
}

/// A folder with `tiny.safetensors` and a manifest that describes it.
struct Folder(TempDir);

impl Folder {
    fn of(content: &[u8]) -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        fs::write(folder.file("tiny.safetensors"), content).unwrap();
        let hash: String = Sha256::digest(content)
            .iter()
            .map(|b| format!("{b:02x}"))
            .collect();
        folder.manifest(&format!(
            "[tiny]\nfile = \"tiny.safetensors\"\nsha256 = \"{hash}\"\nbytes = {}\narchitecture = \"both-ends-flow-v1\"\n\
             description = \"a test\"\nupdates = 0\ntraining_seconds = 0\n",
            content.len()
        ));
        folder
    }

    fn file(&self, name: &str) -> std::path::PathBuf {
        self.0.path().join(name)
    }

    fn manifest(&self, text: &str) {
        fs::write(self.file("MANIFEST.toml"), text).unwrap();
    }
}

fn load(folder: &Folder) -> Result<FastModel, WeightsError> {
    let file = Manifest::open(folder.0.path())?.weights("tiny")?;
    FastModel::from_weights(&file, FRAC_PI_2)
}

fn refusal(result: Result<FastModel, WeightsError>) -> WeightsError {
    result.err().expect("the weights are refused")
}

#[test]
fn sound_weights_are_taken() {
    assert!(Weights::tiny().load().is_ok());
}

#[test]
fn files_that_are_not_there_are_named() {
    let nowhere = tempfile::tempdir().unwrap();
    assert!(
        matches!(Manifest::open(nowhere.path()), Err(WeightsError::Missing { path, .. }) if path.ends_with("MANIFEST.toml"))
    );
    let folder = Folder::of(&Weights::tiny().content());
    fs::remove_file(folder.file("tiny.safetensors")).unwrap();
    assert!(
        matches!(refusal(load(&folder)), WeightsError::Missing { path, .. } if path.ends_with("tiny.safetensors"))
    );
}

#[test]
fn a_manifest_that_is_not_understood_or_lacks_the_name_is_refused() {
    let folder = Folder::of(&Weights::tiny().content());
    let manifest = Manifest::open(folder.0.path()).unwrap();
    let refused = manifest.weights("fast").err().unwrap();
    assert!(
        matches!(&refused, WeightsError::NotInManifest { name, known } if name == "fast" && known == &["tiny"]),
        "{refused}"
    );
    folder.manifest("[tiny]\nfile = \"tiny.safetensors\"\nhash = \"0\"\n");
    assert!(
        matches!(refusal(load(&folder)), WeightsError::Manifest { reason, .. } if reason.contains("hash"))
    );
}

#[test]
fn a_truncated_or_altered_file_is_refused() {
    let content = Weights::tiny().content();
    let folder = Folder::of(&content);
    fs::write(
        folder.file("tiny.safetensors"),
        &content[..content.len() - 1],
    )
    .unwrap();
    let expected = content.len() as u64;
    assert!(
        matches!(refusal(load(&folder)), WeightsError::Size { found, expected: e, .. } if found == expected - 1 && e == expected)
    );
    let mut altered = content;
    *altered.last_mut().unwrap() ^= 1;
    fs::write(folder.file("tiny.safetensors"), altered).unwrap();
    assert!(matches!(refusal(load(&folder)), WeightsError::Hash { .. }));
}

#[test]
fn what_is_not_a_weights_file_is_refused() {
    for content in [&b""[..], b"{}", &[0xff; 64]] {
        assert!(matches!(
            refusal(load(&Folder::of(content))),
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
    ] {
        let refused = refusal(Weights::tiny().with(key, value).load());
        assert!(
            matches!(&refused, WeightsError::Metadata { key: k, found: Some(f), .. } if *k == key && f == value),
            "{refused}"
        );
    }
}

#[test]
fn another_robot_is_named_with_both_limits() {
    let refused = refusal(Weights::tiny().with("theta_max", "1.2").load());
    assert!(
        matches!(refused, WeightsError::Robot { found, expected, .. } if found == 1.2 && expected == FRAC_PI_2)
    );
}

#[test]
fn a_tensor_of_another_shape_is_named_with_both_shapes() {
    let mut weights = Weights::tiny();
    weights.tensors.get_mut("blocks.1.inner.weight").unwrap().0 = vec![16, 64];
    let refused = refusal(weights.load());
    assert!(
        matches!(&refused, WeightsError::Shape { tensor, found, expected }
            if tensor == "blocks.1.inner.weight" && found == "f32 [16, 64]" && expected == &[32, 32]),
        "{refused}"
    );
}

#[test]
fn a_tensor_that_is_missing_or_not_finite_is_named() {
    let mut weights = Weights::tiny();
    weights.tensors.remove("output.bias");
    assert!(
        matches!(refusal(weights.load()), WeightsError::NoTensor { tensor } if tensor == "output.bias")
    );
    for value in [f32::NAN, f32::INFINITY] {
        let mut weights = Weights::tiny();
        weights.tensors.get_mut("time.weight").unwrap().1[17] = value;
        assert!(
            matches!(refusal(weights.load()), WeightsError::NotFinite { tensor, index: 17 } if tensor == "time.weight")
        );
    }
}
