//! Shared memory that is in RAM before it is needed.

use std::ffi::c_void;
use std::io;

use rustix::io::Errno;
use rustix::mm::{Advice, madvise};

/// Brings shared memory of this process, whose names begin with `prefix`, into RAM; how many bytes it is.
///
/// # Errors
/// If `/proc` is not there, or the system's answer (before Linux 5.14: that it cannot).
pub fn prefault_shared_memory(prefix: &str) -> io::Result<usize> {
    let mut total = 0;
    for [begin, end] in shared_ranges(&std::fs::read_to_string("/proc/self/maps")?, prefix) {
        // SAFETY: populating changes no content, and of a range that is not mapped any more it is refused.
        let populated = unsafe {
            madvise(
                begin as *mut c_void,
                end - begin,
                Advice::LinuxPopulateWrite,
            )
        };
        match populated {
            // Another thread has given the mapping back since: where there is no room the answer is EFAULT.
            Err(Errno::NOMEM) => continue,
            populated => populated?,
        }
        total += end - begin;
    }
    Ok(total)
}

/// Begin and end of the writable mappings of shared memory whose names begin with `prefix`.
fn shared_ranges(maps: &str, prefix: &str) -> Vec<[usize; 2]> {
    let range = |line: &str| {
        let mut fields = line.split_whitespace();
        let (range, rights) = (fields.next()?, fields.next()?);
        let name = fields.nth(3)?.strip_prefix("/dev/shm/")?;
        let (begin, end) = range.split_once('-')?;
        let address = |text| usize::from_str_radix(text, 16).ok();
        let is_wanted = rights == "rw-s" && name.starts_with(prefix);
        is_wanted.then_some([address(begin)?, address(end)?])
    };
    maps.lines().filter_map(range).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shared_memory_is_found_by_its_name_and_rights() {
        let maps = "7f0000001000-7f0000003000 rw-s 00000000 00:1a 5  /dev/shm/pcc_answers\n\
            7f0000004000-7f0000005000 r--s 00000000 00:1a 6  /dev/shm/pcc_read\n\
            7f0000006000-7f0000007000 rw-s 00000000 00:1a 7  /dev/shm/other_answers\n\
            7f0000008000-7f0000009000 rw-p 00000000 00:00 0 \n";
        assert_eq!(
            shared_ranges(maps, "pcc_"),
            [[0x7f00_0000_1000, 0x7f00_0000_3000]]
        );
        assert_eq!(prefault_shared_memory("no_such_name").unwrap(), 0);
    }
}
