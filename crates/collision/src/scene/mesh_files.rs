//! Files of meshes: STL, as text or binary, and OBJ.
//!
//! A file is read from end to end: text that is no part of a mesh is refused with its line and with what is needed there, since a
//! part that is skipped would be an obstacle that nobody sees.

use pcc_model::Point;
use std::fmt::Display;
use std::iter::Enumerate;
use std::str::Lines;

/// Bytes before the number of triangles of a binary STL file: text that means nothing.
const STL_TEXT: usize = 80;
/// Bytes of a binary STL file before its first triangle.
const STL_HEADER: usize = 84;
/// Bytes of each triangle of a binary STL file: a normal and three corners as f32, and two bytes that mean nothing.
const STL_TRIANGLE: usize = 50;
/// Bytes of a triangle's normal in a binary STL file, which is not read.
const STL_NORMAL: usize = 12;
/// Statements of an OBJ file that say nothing of its shape.
const OBJ_UNREAD: [&str; 9] = ["o", "g", "s", "vn", "vt", "mtllib", "usemtl", "l", "p"];
/// Most characters of a line that a message quotes.
const QUOTED: usize = 60;

/// Vertices in the file's own unit, and triangles by their numbers; a vertex may be there several times.
pub(crate) type Mesh = (Vec<Point>, Vec<[u32; 3]>);

/// Reads an STL file. A binary file is told from text by its size, since its own text may begin with `solid`, too.
pub(crate) fn stl(bytes: &[u8]) -> Result<Mesh, String> {
    let count = bytes.get(STL_TEXT..STL_HEADER);
    let triangles = count.and_then(|count| Some(u32::from_le_bytes(count.try_into().ok()?)));
    let size_for = |triangles| STL_HEADER as u64 + STL_TRIANGLE as u64 * u64::from(triangles);
    if triangles.map(size_for) == Some(bytes.len() as u64) {
        return Ok(binary_stl(&bytes[STL_HEADER..]));
    }
    let needed = triangles.map_or(
        "at least 84 are needed by a binary STL file".into(),
        |triangles| {
            let size = size_for(triangles);
            format!("{size} are needed by a binary STL file of `triangles` {triangles}, as it says")
        },
    );
    let size = format!("it has {} bytes; {needed}", bytes.len());
    if !bytes.trim_ascii_start().starts_with(b"solid") {
        return Err(format!("{size}, and one of text begins with `solid`"));
    }
    match std::str::from_utf8(bytes) {
        Ok(text) => NumberedLines::new(text).stl(),
        Err(error) => Err(format!(
            "{size}, and it is no text in UTF-8 at byte {}",
            error.valid_up_to()
        )),
    }
}

fn binary_stl(triangles: &[u8]) -> Mesh {
    let number =
        |bytes: &[u8]| f64::from(f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]));
    let triangles = triangles.chunks_exact(STL_TRIANGLE);
    let corners =
        triangles.flat_map(|triangle| triangle[STL_NORMAL..STL_TRIANGLE - 2].chunks_exact(12));
    let vertices = corners.map(|corner| Point::from_fn(|axis, _| number(&corner[4 * axis..])));
    unshared(vertices.collect())
}

/// A mesh of triangles that share no vertices: three after three.
fn unshared(vertices: Vec<Point>) -> Mesh {
    let triangles = (0..vertices.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
    let triangles = triangles.collect();
    (vertices, triangles)
}

/// The lines of a text that are not empty, counted from 1.
struct NumberedLines<'a> {
    lines: Enumerate<Lines<'a>>,
    last: usize,
}

impl<'a> NumberedLines<'a> {
    fn new(text: &'a str) -> Self {
        Self {
            lines: text.lines().enumerate(),
            last: 0,
        }
    }

    /// The next line that is not empty, by its words.
    fn next(&mut self) -> Option<Vec<&'a str>> {
        for (index, line) in self.lines.by_ref() {
            self.last = index + 1;
            let words: Vec<&str> = line.split_whitespace().collect();
            if !words.is_empty() {
                return Some(words);
            }
        }
        None
    }

    /// The message that the line read last, or the end of the file, is wrong, and what is needed instead.
    fn wrong(&self, found: Option<&[&str]>, needed: impl Display) -> String {
        match found {
            Some(words) => format!(
                "line {}: {} is not allowed; {needed} is needed",
                self.last,
                quoted(&words.join(" "))
            ),
            None => format!(
                "it ends with line {}; {needed} is needed behind it",
                self.last
            ),
        }
    }
}

/// A part of a file in a message: escaped, and not longer than a line.
fn quoted(text: &str) -> String {
    let mut shown: String = text.chars().take(QUOTED).collect();
    if shown.len() < text.len() {
        shown.push('…');
    }
    format!("{shown:?}")
}

/// What an STL file of text consists of.
impl NumberedLines<'_> {
    /// Reads `solid NAME`, facets, `endsolid NAME`, once or several times.
    fn stl(mut self) -> Result<Mesh, String> {
        let mut vertices = Vec::new();
        while let Some(words) = self.next() {
            if words[0] != "solid" {
                return Err(self.wrong(Some(&words), "`solid NAME` or the end of the file"));
            }
            self.facets(&mut vertices)?;
        }
        Ok(unshared(vertices))
    }

    /// Reads the facets up to `endsolid`.
    fn facets(&mut self, vertices: &mut Vec<Point>) -> Result<(), String> {
        loop {
            let words = self.next();
            match words.as_deref() {
                Some(["endsolid", ..]) => return Ok(()),
                Some(["facet", "normal", normal @ ..]) if numbers::<f32>(normal).is_some() => {
                    self.expect(&["outer", "loop"])?;
                    for _ in 0..3 {
                        vertices.push(self.vertex()?);
                    }
                    self.expect(&["endloop"])?;
                    self.expect(&["endfacet"])?;
                }
                found => {
                    return Err(
                        self.wrong(found, "`facet normal` with three numbers, or `endsolid`,")
                    );
                }
            }
        }
    }

    fn vertex(&mut self) -> Result<Point, String> {
        let words = self.next();
        let found = match words.as_deref() {
            Some(["vertex", place @ ..]) => numbers::<f32>(place),
            _ => None,
        };
        let place =
            found.ok_or_else(|| self.wrong(words.as_deref(), "`vertex` with three numbers"))?;
        Ok(Point::from(place.map(f64::from)))
    }

    fn expect(&mut self, needed: &[&str]) -> Result<(), String> {
        let words = self.next();
        if words.as_deref() == Some(needed) {
            return Ok(());
        }
        Err(self.wrong(words.as_deref(), format!("`{}`", needed.join(" "))))
    }
}

/// Three numbers that are finite.
fn numbers<T: std::str::FromStr + Into<f64> + Copy + Default>(words: &[&str]) -> Option<[T; 3]> {
    let mut numbers = [T::default(); 3];
    if words.len() != numbers.len() {
        return None;
    }
    for (number, word) in numbers.iter_mut().zip(words) {
        *number = word.parse().ok()?;
        if !(*number).into().is_finite() {
            return None;
        }
    }
    Some(numbers)
}

/// Reads an OBJ file: its vertices and faces; faces of more than three corners are cut into triangles from their first one.
pub(crate) fn obj(bytes: &[u8]) -> Result<Mesh, String> {
    let text = std::str::from_utf8(bytes).map_err(|error| {
        format!(
            "it is not UTF-8 at byte {}; text in UTF-8 is needed",
            error.valid_up_to()
        )
    })?;
    let (mut vertices, mut triangles): Mesh = (Vec::new(), Vec::new());
    let first_words = text.lines().map(|line| line.split_whitespace().next());
    let count = first_words.filter(|word| *word == Some("v")).count();
    let mut lines = NumberedLines::new(text);
    while let Some(words) = lines.next() {
        match words[0] {
            "v" => {
                // A weight or a colour may follow.
                let place = words.get(1..4).and_then(numbers::<f64>);
                let place = place
                    .ok_or_else(|| lines.wrong(Some(&words), "`v` with three finite numbers"))?;
                vertices.push(Point::from(place));
            }
            "f" => {
                let corners = face(&words[1..], vertices.len(), count);
                let corners = corners.ok_or_else(|| {
                    let needed =
                        format!("`f` with at least three of the {count} vertices, from 1 on,");
                    lines.wrong(Some(&words), needed)
                })?;
                let pairs = corners[1..].windows(2);
                triangles.extend(pairs.map(|pair| [corners[0], pair[0], pair[1]]));
            }
            word if word.starts_with('#') || OBJ_UNREAD.contains(&word) => {}
            _ => {
                let needed = format!("`v`, `f`, `#` or one of {}", OBJ_UNREAD.join(", "));
                return Err(lines.wrong(Some(&words), needed));
            }
        }
    }
    Ok((vertices, triangles))
}

/// The vertices of a face, counted from 0, where it has three or more and all of them are there: `before` it, `count` in all.
fn face(words: &[&str], before: usize, count: usize) -> Option<Vec<u32>> {
    let corner = |word: &&str| {
        let number: i64 = word.split('/').next()?.parse().ok()?;
        // A number below 0 counts back from the last vertex before it.
        let index = match number {
            0 => return None,
            1.. => number - 1,
            _ => number + i64::try_from(before).ok()?,
        };
        let index = usize::try_from(index).ok().filter(|index| *index < count);
        index.and_then(|index| u32::try_from(index).ok())
    };
    let corners: Option<Vec<u32>> = words.iter().map(corner).collect();
    corners.filter(|corners| corners.len() >= 3)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FACET: &str = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";

    #[test]
    fn text_and_binary_give_the_same_mesh() {
        let (vertices, triangles) =
            stl(format!("solid a b\n{FACET}\nendsolid\n").as_bytes()).unwrap();
        assert_eq!(triangles, [[0, 1, 2]]);
        assert_eq!(vertices[1], Point::new(1.0, 0.0, 0.0));
        let mut bytes = b"solid of another kind".to_vec();
        bytes.resize(80, 0);
        bytes.extend(1_u32.to_le_bytes());
        bytes.extend([0; 12]);
        bytes.extend(
            vertices
                .iter()
                .flat_map(|v| v.iter().flat_map(|c| (*c as f32).to_le_bytes())),
        );
        bytes.extend([0; 2]);
        assert_eq!(stl(&bytes).unwrap(), (vertices, triangles));
    }

    #[test]
    fn what_is_no_part_of_an_stl_file_is_refused_with_its_line_and_what_is_needed() {
        let whole = format!("solid a\n{FACET}endsolid a\n");
        for (from, to, said) in [
            (
                "normal",
                "norma|",
                "line 2: \"facet norma| 0 0 1\" is not allowed",
            ),
            (
                "vertex 1 0 0",
                "vertex 1 0",
                "`vertex` with three numbers is needed",
            ),
            ("vertex 1 0 0", "vertex 1 nan 0", "line 5"),
            ("outer loop", "outer", "`outer loop` is needed"),
            ("endloop\n", "", "`endloop` is needed"),
            ("endsolid a\n", "", "it ends with line 8; `facet normal`"),
            (
                "endsolid a\n",
                "endsolid a\n\0",
                "line 10: \"\\0\" is not allowed; `solid NAME` or the end",
            ),
            (
                "solid a\n",
                "solid a\nsolid b\n",
                "line 2: \"solid b\" is not allowed",
            ),
        ] {
            let text = whole.replacen(from, to, 1);
            let error = stl(text.as_bytes()).unwrap_err();
            assert!(error.contains(said), "{said}: {error}");
        }
        let behind = [whole.as_bytes(), &[0xff]].concat();
        for bytes in [&behind[..], b"", b"sol", &[0; 84 + 49]] {
            let error = stl(bytes).unwrap_err();
            assert!(error.contains("need"), "{error}");
        }
    }

    #[test]
    fn faces_of_an_obj_file_are_cut_into_triangles() {
        let text =
            "# a\no b\nv 0 0 0\nv 1 0 0 1.0\nv 1 1 0\nv 0 1 0\nf 1/1 2/2/2 3//3 4\nf -1 -2 -3\n";
        let (vertices, triangles) = obj(text.as_bytes()).unwrap();
        assert_eq!(vertices.len(), 4);
        assert_eq!(triangles, [[0, 1, 2], [0, 2, 3], [3, 2, 1]]);
    }

    #[test]
    fn what_is_no_part_of_an_obj_file_is_refused_with_its_line_and_what_is_needed() {
        for (text, said) in [
            (
                "v 0 0",
                "line 1: \"v 0 0\" is not allowed; `v` with three finite numbers is needed",
            ),
            ("v 0 0 inf", "finite"),
            ("v 0 0 0\nf 1 1 2", "line 2"),
            ("v 0 0 0\nf 1 1", "at least three of the 1 vertices"),
            ("v 0 0 0\nf 0 1 1", "from 1 on"),
            ("v 0 0 0\nf -2 1 1", "from 1 on"),
            ("w 0 0 0", "`v`, `f`, `#`"),
            ("\0", "line 1"),
        ] {
            let error = obj(text.as_bytes()).unwrap_err();
            assert!(error.contains(said), "{said}: {error}");
        }
        assert!(obj(b"v 0\xff").unwrap_err().contains("UTF-8 at byte 3"));
    }
}
