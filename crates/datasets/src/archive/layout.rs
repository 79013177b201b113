//! That every byte of an archive belongs to its arrays, and that its arrays are not endless.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::os::unix::fs::FileExt;
use zip::ZipArchive;

/// Bytes of the record that ends a zip file without a comment.
const END_RECORD: u64 = 22;
/// How many times as many bytes as the archive its arrays may have; arrays of measured numbers have less than twice as many.
const MAX_EXPANSION: u64 = 100;
/// Bytes that the arrays of any archive may have.
const SMALL: u64 = 1 << 25;
/// Versions of the format that a member may ask for: stored, compressed, larger than 4 GB.
const VERSIONS: [u16; 3] = [10, 20, 45];
/// Most bytes of a record of sizes behind a member, where its header does not tell them.
const LONGEST_DESCRIPTOR: u64 = 24;

/// The record that ends a zip file.
pub(super) struct EndRecord {
    is_there: bool,
    /// Bytes of the directory before the record; none where another record tells them (zip64).
    directory: Option<u64>,
}

/// Reads the last bytes of a file of `size` bytes as the record that ends a zip file.
pub(super) fn end_record(file: &mut File, size: u64) -> std::io::Result<EndRecord> {
    let mut record = [0; END_RECORD as usize];
    if size >= END_RECORD {
        file.seek(SeekFrom::Start(size - END_RECORD))?;
        file.read_exact(&mut record)?;
        file.rewind()?;
    }
    let [.., a, b, c, d, _, _, _, _, low, high] = record;
    let directory = u32::from_le_bytes([a, b, c, d]);
    Ok(EndRecord {
        is_there: record.starts_with(b"PK\x05\x06") && [low, high] == [0, 0],
        directory: (directory != u32::MAX).then_some(u64::from(directory)),
    })
}

/// Refuses a member whose two headers name a version of the format that no archive of arrays needs: nothing else tells that they
/// are damaged.
pub(super) fn check_versions(
    zip: &mut ZipArchive<BufReader<File>>,
    raw: &File,
) -> Result<(), String> {
    for index in 0..zip.len() {
        let member = zip.by_index_raw(index).map_err(|error| error.to_string())?;
        for at in [member.header_start() + 4, member.central_header_start() + 6] {
            let mut version = [0; 2];
            raw.read_exact_at(&mut version, at)
                .map_err(|error| error.to_string())?;
            let version = u16::from_le_bytes(version);
            if !VERSIONS.contains(&version) {
                return Err(format!(
                    "byte {at} asks for version {version} of the format; {VERSIONS:?} are allowed"
                ));
            }
        }
    }
    Ok(())
}

/// Refuses bytes that belong to no member: before, between and behind them.
pub(super) fn check_layout(
    zip: &mut ZipArchive<BufReader<File>>,
    size: u64,
    end: &EndRecord,
) -> Result<(), String> {
    let mut members = Vec::with_capacity(zip.len());
    for index in 0..zip.len() {
        let member = zip.by_index_raw(index).map_err(|error| error.to_string())?;
        let data = member.data_start().unwrap_or(u64::MAX);
        let end = data.saturating_add(member.compressed_size());
        let has_descriptor = member.flags().is_using_data_descriptor();
        let behind = if has_descriptor {
            LONGEST_DESCRIPTOR
        } else {
            0
        };
        members.push((member.header_start(), end, behind));
    }
    members.sort_unstable();
    let directory = zip.central_directory_start();
    let (mut from, mut allowed) = (0, 0);
    for (start, end, behind) in members.into_iter().chain([(directory, directory, 0)]) {
        if start < from {
            return Err(format!("byte {start} belongs to two of its arrays"));
        }
        if start > from + allowed {
            return Err(format!(
                "bytes {from} to {start} belong to none of its arrays"
            ));
        }
        (from, allowed) = (end, behind);
    }
    let ends = end
        .directory
        .is_none_or(|bytes| directory + bytes + END_RECORD == size);
    if zip.offset() != 0 || !end.is_there || !ends {
        return Err("there are bytes behind its directory".into());
    }
    Ok(())
}

/// Refuses an archive that a few bytes make endless: it would take the memory of whatever reads it.
pub(super) fn check_expansion(
    zip: &mut ZipArchive<BufReader<File>>,
    size: u64,
) -> Result<(), String> {
    let mut total = 0_u64;
    for index in 0..zip.len() {
        let member = zip.by_index_raw(index).map_err(|error| error.to_string())?;
        total = total.saturating_add(member.size());
    }
    let most = size.saturating_mul(MAX_EXPANSION).max(SMALL);
    if total <= most {
        return Ok(());
    }
    Err(format!(
        "its arrays have {total} bytes in a file of {size}; at most {most}, {MAX_EXPANSION} times as many, are allowed"
    ))
}
