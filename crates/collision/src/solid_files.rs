//! Files of solids: meshes (STL, OBJ) and voxel grids (npy).

use crate::scene_file::EntryError;
use crate::solid::MAX_TRIANGLES;
use crate::voxels::MAX_CELLS;
use arrays::{DType, NpyArray, TypeChar};
use pcc_model::Point;
use std::fs::File;
use std::io::{BufReader, Cursor, Read};
use std::path::Path;

/// Bytes before the number of triangles of a binary STL file: text that means nothing.
const STL_TEXT: usize = 80;
/// Bytes before its first triangle.
const STL_HEADER: u64 = 84;
/// Bytes of each triangle.
const STL_TRIANGLE: u64 = 50;
/// Longest mesh file that is read: that of a mesh with the most triangles, as text.
const MAX_BYTES: u64 = 512 * MAX_TRIANGLES as u64;

pub(crate) type Mesh = (Vec<Point>, Vec<[u32; 3]>);

/// Reads an STL or OBJ file, in its own unit.
pub(crate) fn read_mesh(path: &Path) -> Result<Mesh, EntryError> {
    let extension = path.extension().and_then(|e| e.to_str());
    let extension = extension.unwrap_or_default().to_ascii_lowercase();
    let read = match extension.as_str() {
        "stl" => stl,
        "obj" => obj,
        _ => {
            let reason = "the names of mesh files end in .stl or .obj";
            return Err(not_understood(path, reason.into()));
        }
    };
    let (file, size) = open(path)?;
    if size > MAX_BYTES {
        let reason = format!("it has {size} bytes; at most {MAX_BYTES} are allowed");
        return Err(not_understood(path, reason));
    }
    let mut bytes = Vec::new();
    let reading = file.take(MAX_BYTES).read_to_end(&mut bytes);
    reading.map_err(|source| EntryError::Unreadable {
        path: path.into(),
        source,
    })?;
    read(bytes).map_err(|reason| not_understood(path, reason))
}

/// A binary file is told from text by its size, since its own text may begin with `solid`, too.
fn stl(mut bytes: Vec<u8>) -> Result<Mesh, String> {
    let size = bytes.len() as u64;
    let count = bytes.get(STL_TEXT..STL_HEADER as usize);
    let count = count.and_then(|count| count.try_into().ok());
    let binary_size = count.map(|count| {
        let triangles = u64::from(u32::from_le_bytes(count));
        STL_HEADER + STL_TRIANGLE * triangles
    });
    if binary_size == Some(size) {
        bytes[..STL_TEXT].fill(0);
    } else if !bytes.starts_with(b"solid ") {
        let needed = binary_size.map_or("at least 84".into(), |size| size.to_string());
        return Err(format!(
            "it has {size} bytes; a binary STL file of so many triangles has {needed}, and text begins with `solid `"
        ));
    }
    let mesh = stl_io::read_stl(&mut Cursor::new(bytes)).map_err(|error| error.to_string())?;
    let vertex = |v: &stl_io::Vertex| Point::from(v.0.map(f64::from));
    let triangle = |t: &stl_io::IndexedTriangle| t.vertices.map(|v| v as u32);
    Ok((
        mesh.vertices.iter().map(vertex).collect(),
        mesh.faces.iter().map(triangle).collect(),
    ))
}

fn obj(bytes: Vec<u8>) -> Result<Mesh, String> {
    let options = tobj::LoadOptions {
        triangulate: true,
        ..tobj::LoadOptions::default()
    };
    let no_materials = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
    let (models, _) = tobj::load_obj_buf(&mut Cursor::new(bytes), &options, no_materials)
        .map_err(|error| error.to_string())?;
    Ok(joined(&models))
}

/// The parts of an OBJ file as one mesh.
fn joined(models: &[tobj::Model]) -> Mesh {
    let (mut vertices, mut triangles): Mesh = (Vec::new(), Vec::new());
    for model in models {
        let first = vertices.len() as u32;
        let positions = model.mesh.positions.chunks_exact(3);
        vertices.extend(positions.map(Point::from_column_slice));
        let corners = model.mesh.indices.chunks_exact(3);
        triangles.extend(corners.map(|t| [t[0] + first, t[1] + first, t[2] + first]));
    }
    (vertices, triangles)
}

/// Reads a grid of bytes or booleans: not zero is filled.
pub(crate) fn read_grid(path: &Path) -> Result<([usize; 3], Vec<bool>), EntryError> {
    let content = |reason: String| not_understood(path, reason);
    let (file, size) = open(path)?;
    let grid = NpyArray::open(file, size).map_err(|error| content(error.to_string()))?;
    let (dtype, shape) = (grid.dtype(), grid.shape().to_vec());
    let &[x, y, z] = shape.as_slice() else {
        return Err(content(format!(
            "it has shape {shape:?}; three dimensions are needed"
        )));
    };
    let is_bytes = matches!(&dtype, DType::Plain(t)
        if matches!(t.type_char(), TypeChar::Uint | TypeChar::Bool) && t.size_field() == 1);
    if !is_bytes {
        return Err(content(format!(
            "it holds {}; u1 or b1 is needed",
            dtype.descr()
        )));
    }
    // That many bytes are there: the product was not beyond what can be counted.
    let cells: u64 = shape.iter().product();
    if cells > MAX_CELLS as u64 {
        return Err(content(format!(
            "it has shape {shape:?}; at most {MAX_CELLS} voxels are allowed"
        )));
    }
    let is_bool = matches!(&dtype, DType::Plain(t) if t.type_char() == TypeChar::Bool);
    let filled = if is_bool {
        grid.into_vec::<bool>()
    } else {
        grid.into_vec::<u8>()
            .map(|bytes| bytes.iter().map(|b| *b != 0).collect())
    };
    let filled = filled.map_err(|error| content(error.to_string()))?;
    Ok(([x, y, z].map(|n| n as usize), filled))
}

/// A file and its size, bytes.
fn open(path: &Path) -> Result<(BufReader<File>, u64), EntryError> {
    let open = || {
        let file = File::open(path)?;
        let size = file.metadata()?.len();
        Ok((BufReader::new(file), size))
    };
    open().map_err(|source| EntryError::Unreadable {
        path: path.into(),
        source,
    })
}

fn not_understood(path: &Path, reason: String) -> EntryError {
    EntryError::Content {
        path: path.into(),
        reason,
    }
}
