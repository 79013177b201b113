//! Whether triangles are the closed surface of a solid.

use crate::obstacle::solid_error::SolidError;
use pcc_model::Point;
use std::collections::{HashMap, HashSet};

/// The triangles over vertices that are all different.
pub(crate) fn merged(
    vertices: &[Point],
    triangles: &[[u32; 3]],
) -> Result<(Vec<Point>, Vec<[u32; 3]>), SolidError> {
    let mut known = HashMap::new();
    let mut different: Vec<Point> = Vec::new();
    let new_index: Vec<u32> = vertices
        .iter()
        .map(|vertex| {
            // Adding zero makes −0 and 0 the same bits.
            *known
                .entry([0, 1, 2].map(|i| (vertex[i] + 0.0).to_bits()))
                .or_insert_with(|| {
                    different.push(*vertex);
                    different.len() as u32 - 1
                })
        })
        .collect();
    let renamed = |(triangle, corners): (usize, &[u32; 3])| {
        let missing = corners.iter().find(|&&v| v as usize >= vertices.len());
        match missing {
            None => Ok(corners.map(|v| new_index[v as usize])),
            Some(&vertex) => Err(SolidError::Vertex {
                triangle,
                vertex,
                vertices: vertices.len(),
            }),
        }
    };
    let triangles = triangles
        .iter()
        .enumerate()
        .map(renamed)
        .collect::<Result<_, _>>()?;
    Ok((different, triangles))
}

/// Refuses triangles of which an edge is open, or whose vertices are not all there; in any unit.
pub(crate) fn check_edges(vertices: &[Point], triangles: &[[u32; 3]]) -> Result<(), SolidError> {
    let (vertices, triangles) = merged(vertices, triangles)?;
    check_closed(&vertices, &triangles)
}

fn edges(triangles: &[[u32; 3]]) -> impl Iterator<Item = (u32, u32)> {
    triangles
        .iter()
        .flat_map(|[a, b, c]| [(*a, *b), (*b, *c), (*c, *a)])
}

pub(crate) fn check_closed(vertices: &[Point], triangles: &[[u32; 3]]) -> Result<(), SolidError> {
    let open = |(a, b): (u32, u32)| SolidError::Open {
        from: vertices[a as usize].into(),
        to: vertices[b as usize].into(),
    };
    let mut seen = HashSet::new();
    for edge in edges(triangles) {
        if edge.0 == edge.1 || !seen.insert(edge) {
            return Err(open(edge));
        }
    }
    match edges(triangles).find(|&(a, b)| !seen.contains(&(b, a))) {
        None => Ok(()),
        Some(edge) => Err(open(edge)),
    }
}

/// Signed volume, by the divergence theorem.
pub(crate) fn volume(vertices: &[Point], triangles: &[[u32; 3]]) -> f64 {
    let origin = vertices[0];
    let six = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| vertices[v as usize] - origin);
        a.dot(&b.cross(&c))
    };
    triangles.iter().map(six).sum::<f64>() / 6.0
}
