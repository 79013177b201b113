//! Buffers on large pages.
//!
//! A network goes through all its weights at every step, which is more memory than the processor keeps addresses for in
//! pages of 4 KiB: looking them up took a good part of the time. Buffers made here lie together in chunks for which the
//! system is asked for its large pages; where it has none, they are plain memory. A chunk is given back when all of its
//! buffers are gone: this is for weights and for buffers that stay.
#![allow(unsafe_code)] // buffers in memory of their own

use std::alloc::{Layout, alloc, dealloc, handle_alloc_error};
use std::ops::{Deref, DerefMut};
use std::ptr::NonNull;
use std::sync::{Arc, Mutex, PoisonError};

/// Bytes of a large page of x86-64.
const PAGE: usize = 2 << 20;
/// Bytes that are asked for at a time.
const CHUNK: usize = 4 * PAGE;
/// Bytes of a cache line, on which every buffer starts.
const LINE: usize = 64;

/// The message of a panic over a buffer that is too large.
const TOO_LARGE: &str = "no buffer is near the size of the address space";

/// Memory that buffers share; each has its own part of it.
struct Chunk {
    first: NonNull<u8>,
    layout: Layout,
}

// SAFETY: a chunk itself never reads or writes its memory.
unsafe impl Send for Chunk {}
// SAFETY: as above.
unsafe impl Sync for Chunk {}

impl Chunk {
    fn new(bytes: usize) -> Self {
        let layout = Layout::from_size_align(bytes, PAGE).expect(TOO_LARGE);
        let layout = layout.pad_to_align();
        // SAFETY: the size is not 0.
        let first = unsafe { alloc(layout) };
        let first = NonNull::new(first).unwrap_or_else(|| handle_alloc_error(layout));
        #[cfg(target_os = "linux")]
        // SAFETY: the memory is ours, in whole pages; the advice changes nothing but its pages, and may be refused.
        unsafe {
            libc::madvise(first.as_ptr().cast(), layout.size(), libc::MADV_HUGEPAGE);
        }
        Self { first, layout }
    }
}

impl Drop for Chunk {
    fn drop(&mut self) {
        // SAFETY: it was allocated with this layout, and the last buffer in it is gone.
        unsafe { dealloc(self.first.as_ptr(), self.layout) };
    }
}

/// The chunk whose memory is being handed out, and how many of its bytes are taken.
static FILLING: Mutex<Option<(Arc<Chunk>, usize)>> = Mutex::new(None);

/// Memory of its own for a layout in a chunk, from a cache line on.
fn take(layout: Layout) -> (Arc<Chunk>, NonNull<u8>) {
    // A layout's size, rounded up to its alignment, does not overflow; so its use below a chunk's size does not either.
    let layout = layout.align_to(LINE).expect(TOO_LARGE).pad_to_align();
    let bytes = layout.size();
    let mut filling = FILLING.lock().unwrap_or_else(PoisonError::into_inner);
    let (chunk, used) = match filling.take() {
        Some((chunk, used)) if bytes <= chunk.layout.size() - used => (chunk, used),
        _ => (Arc::new(Chunk::new(bytes.max(CHUNK))), 0),
    };
    *filling = Some((Arc::clone(&chunk), used + bytes));
    // SAFETY: the chunk has these bytes.
    let first = unsafe { chunk.first.add(used) };
    (chunk, first)
}

/// A buffer of fixed length on large pages, from a cache line on.
pub(crate) struct Paged<T> {
    first: NonNull<T>,
    length: usize,
    /// Keeps the chunk's memory while the buffer lives.
    _chunk: Option<Arc<Chunk>>,
}

// SAFETY: a buffer owns its values, which lie in memory that nothing else uses.
unsafe impl<T: Send> Send for Paged<T> {}
// SAFETY: as above; shared, it only gives out shared references.
unsafe impl<T: Sync> Sync for Paged<T> {}

impl<T: Copy> Paged<T> {
    pub(crate) fn filled(value: T, length: usize) -> Self {
        const { assert!(align_of::<T>() <= LINE) };
        let (chunk, first) = take(Layout::array::<T>(length).expect(TOO_LARGE));
        let first = first.cast::<T>();
        for i in 0..length {
            // SAFETY: this memory is large enough for `length` values, aligned for them, and nothing else uses it.
            unsafe { first.add(i).write(value) };
        }
        Self {
            first,
            length,
            _chunk: Some(chunk),
        }
    }
}

impl<T> Default for Paged<T> {
    fn default() -> Self {
        Self {
            first: NonNull::dangling(),
            length: 0,
            _chunk: None,
        }
    }
}

impl<T> Deref for Paged<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        // SAFETY: `length` values were written from `first` on.
        unsafe { std::slice::from_raw_parts(self.first.as_ptr(), self.length) }
    }
}

impl<T> DerefMut for Paged<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        // SAFETY: as above, and this buffer alone refers to them.
        unsafe { std::slice::from_raw_parts_mut(self.first.as_ptr(), self.length) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buffers_start_on_cache_lines_and_do_not_overlap() {
        let mut buffers: Vec<Paged<u32>> = (0..40).map(|i| Paged::filled(i, 1 << 16)).collect();
        buffers.retain(|buffer| buffer[0] % 3 != 1);
        buffers.push(Paged::filled(40, CHUNK));
        buffers.push(Paged::filled(41, 1));
        for buffer in &mut buffers {
            assert_eq!(buffer.as_ptr().align_offset(LINE), 0);
            buffer[0] += 100;
        }
        for buffer in &buffers {
            let value = buffer[0] - 100;
            assert!(buffer[1..].iter().all(|v| *v == value), "{value}");
        }
        assert_eq!(buffers.len(), 40 - 13 + 2);
    }

    #[test]
    fn an_empty_buffer_is_empty() {
        assert!(Paged::<f32>::default().is_empty());
        assert!(Paged::filled(1.0_f32, 0).is_empty());
    }
}
