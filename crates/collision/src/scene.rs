//! Sets of obstacles, the files that they come from, and clearances of one configuration.

pub(crate) mod clearance;
pub(crate) mod file_error;
pub(crate) mod mesh_files;
pub(crate) mod relevant_balls;
pub(crate) mod scene_file;
pub(crate) mod solid_files;
pub(crate) mod static_scene;
