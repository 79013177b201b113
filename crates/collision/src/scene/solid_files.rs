//! Files of solids: meshes (STL, OBJ) and voxel grids (npy).

use crate::obstacle::limits::{MAX_CELLS, MAX_TRIANGLES};
use crate::scene::file_error::EntryError;
use crate::scene::mesh_files::{Mesh, obj, stl};
use arrays::{NpyArray, Number};
use input_files::read_bytes;
use std::path::Path;

/// Longest mesh file that is read: that of a mesh with the most triangles, as text.
const MAX_MESH_BYTES: u64 = 512 * MAX_TRIANGLES as u64;
/// Longest grid file that is read: the most cells, and more than a header has.
const MAX_GRID_BYTES: u64 = MAX_CELLS as u64 + (1 << 16);

/// Reads an STL or OBJ file, in its own unit.
pub(crate) fn read_mesh(path: &Path) -> Result<Mesh, EntryError> {
    let extension = path.extension().and_then(|e| e.to_str());
    let extension = extension.unwrap_or_default().to_ascii_lowercase();
    let read: fn(&[u8]) -> Result<Mesh, String> = match extension.as_str() {
        "stl" => stl,
        "obj" => obj,
        _ => {
            let reason = "a mesh file whose name ends in .stl or .obj is needed";
            return Err(not_understood(path, reason.into()));
        }
    };
    let bytes = read_bytes(path, MAX_MESH_BYTES)?;
    read(&bytes).map_err(|reason| not_understood(path, reason))
}

/// Reads a grid of bytes or booleans: not zero is filled.
pub(crate) fn read_grid(path: &Path) -> Result<([usize; 3], Vec<bool>), EntryError> {
    let content = |reason: String| not_understood(path, reason);
    let bytes = read_bytes(path, MAX_GRID_BYTES)?;
    let grid = NpyArray::open(&bytes[..], bytes.len() as u64)
        .map_err(|error| content(error.to_string()))?;
    let (descr, shape) = (grid.descr().to_owned(), grid.shape().to_vec());
    let &[x, y, z] = shape.as_slice() else {
        return Err(content(format!(
            "it has shape {shape:?}; three dimensions are needed"
        )));
    };
    if ![u8::DESCR, bool::DESCR].contains(&&*descr) {
        return Err(content(format!(
            "its descr is '{descr}'; '|u1' or '|b1' is needed"
        )));
    }
    // That many bytes are there: the product was not beyond what can be counted.
    let cells: u64 = shape.iter().product();
    if cells > MAX_CELLS as u64 {
        return Err(content(format!(
            "it has shape {shape:?}; at most {MAX_CELLS} voxels are allowed"
        )));
    }
    let filled = if descr == bool::DESCR {
        grid.into_vec::<bool>()
    } else {
        grid.into_vec::<u8>()
            .map(|bytes| bytes.iter().map(|b| *b != 0).collect())
    };
    let filled = filled.map_err(|error| content(error.to_string()))?;
    Ok(([x, y, z].map(|n| n as usize), filled))
}

fn not_understood(path: &Path, reason: String) -> EntryError {
    EntryError::Content {
        path: path.into(),
        reason,
    }
}
