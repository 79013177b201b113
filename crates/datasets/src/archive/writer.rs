//! Writing archives.

use super::error::ArchiveError;
use arrays::{Number, write_npy};
use collision::Ball;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Writes named arrays; the file appears whole, or not at all.
pub struct ArchiveWriter {
    path: PathBuf,
    part: PartFile,
    zip: ZipWriter<BufWriter<File>>,
}

/// Where an archive is written before it is whole; of this process alone. Removed when dropped.
struct PartFile(PathBuf);

impl Drop for PartFile {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

impl ArchiveWriter {
    /// Starts an archive beside `path`; [`finish`](Self::finish) puts it there, in place of a file of that name.
    ///
    /// # Errors
    /// [`ArchiveError::Write`].
    pub fn create(path: &Path) -> Result<Self, ArchiveError> {
        let mut name = path.file_name().unwrap_or_default().to_owned();
        name.push(format!(".{}.part", std::process::id()));
        let part = path.with_file_name(name);
        let file = File::create(&part).map_err(|source| ArchiveError::Write {
            path: path.into(),
            source,
        })?;
        Ok(Self {
            path: path.into(),
            part: PartFile(part),
            zip: ZipWriter::new(BufWriter::new(file)),
        })
    }

    /// Adds one array given in row-major order.
    ///
    /// # Errors
    /// [`ArchiveError::Array`] if the values do not fill the shape or cannot be written.
    pub fn write<T: Number>(
        &mut self,
        array: &str,
        shape: &[usize],
        values: impl IntoIterator<Item = T>,
    ) -> Result<(), ArchiveError> {
        let fail = |e: std::io::Error| ArchiveError::Array {
            path: self.path.clone(),
            array: array.into(),
            reason: e.to_string(),
        };
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Deflated)
            .compression_level(Some(1))
            .large_file(true);
        self.zip
            .start_file(format!("{array}.npy"), options)
            .map_err(|e| fail(e.into()))?;
        write_npy(&mut self.zip, shape, values).map_err(fail)
    }

    /// Adds the balls of each row as `obstacle_centres` and `obstacle_radii`, and as `obstacle_offsets` where those of each row begin.
    ///
    /// # Errors
    /// [`ArchiveError::Array`] as [`Self::write`].
    pub fn write_balls<'a, T: Number>(
        &mut self,
        rows: impl Iterator<Item = &'a [Ball]> + Clone,
        number: impl Fn(f64) -> T,
    ) -> Result<(), ArchiveError> {
        let balls = rows.clone().flatten();
        let count = balls.clone().count();
        let centres = balls.clone().flat_map(|ball| <[f64; 3]>::from(ball.centre));
        self.write("obstacle_centres", &[count, 3], centres.map(&number))?;
        let radii = balls.map(|ball| number(ball.radius));
        self.write("obstacle_radii", &[count], radii)?;
        let ends = rows.clone().scan(0_i64, |end, balls| {
            *end += balls.len() as i64;
            Some(*end)
        });
        let offsets = std::iter::once(0).chain(ends);
        self.write("obstacle_offsets", &[rows.count() + 1], offsets)
    }

    /// Ends the archive and gives it its name.
    ///
    /// # Errors
    /// [`ArchiveError::Write`].
    pub fn finish(self) -> Result<(), ArchiveError> {
        let Self { path, part, zip } = self;
        let written = zip
            .finish()
            .map_err(std::io::Error::from)
            .and_then(|buffered| {
                buffered.into_inner()?;
                Ok(())
            })
            .and_then(|()| std::fs::rename(&part.0, &path));
        written.map_err(|source| ArchiveError::Write { path, source })
    }
}
