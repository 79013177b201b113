//! Weights files and the manifest that names them, checked before anything is computed with them.

pub(crate) mod error;
pub(crate) mod file;
pub(crate) mod manifest;
pub(crate) mod manifest_entry;
mod safetensors_header;
