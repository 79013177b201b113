//! Weights files that can be damaged, and folders with a manifest that fits them.

use denoiser::{Manifest, WeightsError, WeightsFile};
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use sha2::{Digest, Sha256};
use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A fixture's weights in memory, to be damaged.
pub(crate) struct Weights {
    pub(crate) metadata: HashMap<String, String>,
    pub(crate) tensors: HashMap<String, (Vec<usize>, Vec<f32>)>,
}

impl Weights {
    /// The weights of a file under `tests/fixtures`.
    pub(crate) fn fixture(file: &str) -> Self {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures");
        let content = fs::read(folder.join(file)).unwrap();
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

    pub(crate) fn with(mut self, key: &str, value: &str) -> Self {
        assert!(
            self.metadata.insert(key.into(), value.into()).is_some(),
            "{key} was there"
        );
        self
    }

    pub(crate) fn content(&self) -> Vec<u8> {
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
}

/// A folder with `tiny.safetensors` and a manifest that describes it.
pub(crate) struct Folder(TempDir);

impl Folder {
    pub(crate) fn of(content: &[u8], architecture: &str) -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        fs::write(folder.file("tiny.safetensors"), content).unwrap();
        let hash: String = Sha256::digest(content)
            .iter()
            .map(|b| format!("{b:02x}"))
            .collect();
        folder.manifest(&format!(
            "[tiny]\nfile = \"tiny.safetensors\"\nsha256 = \"{hash}\"\nbytes = {}\narchitecture = \"{architecture}\"\n\
             description = \"a test\"\nupdates = 0\ntraining_seconds = 0\n",
            content.len()
        ));
        folder
    }

    pub(crate) fn file(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn manifest(&self, text: &str) {
        fs::write(self.file("MANIFEST.toml"), text).unwrap();
    }

    pub(crate) fn open(&self) -> Result<Manifest, WeightsError> {
        Manifest::open(self.0.path())
    }

    /// The weights, as a planner opens them.
    pub(crate) fn weights(&self) -> Result<WeightsFile, WeightsError> {
        self.open()?.weights("tiny")
    }
}
