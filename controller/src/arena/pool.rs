//! A constant-time pool of memory with one owner thread, to which every thread can give blocks back.

use std::{
    alloc::Layout,
    cell::UnsafeCell,
    mem::MaybeUninit,
    ptr::{NonNull, null_mut},
    sync::atomic::{AtomicPtr, AtomicUsize, Ordering},
};

use rlsf::Tlsf;

/// First-level lists: 32 B << 16 = 2 MiB is the largest region this pool can manage.
const FIRST_LEVELS: usize = 16;
const SECOND_LEVELS: usize = 16;
type Pool = Tlsf<'static, u16, u16, FIRST_LEVELS, SECOND_LEVELS>;

/// Blocks taken back from other threads in one collection, so that a cycle's work stays bounded.
const COLLECTED_AT_ONCE: usize = 32;

/// The content of a block that another thread has freed, until its owner takes it back.
struct ReturnedBlock {
    next: *mut ReturnedBlock,
    align: usize,
}

#[repr(align(64))]
struct Region<const BYTES: usize>(UnsafeCell<MaybeUninit<[u8; BYTES]>>);

/// A TLSF pool over an embedded region, with one owner thread and frees from any thread.
pub(super) struct Arena<const BYTES: usize> {
    region: Region<BYTES>,
    pool: UnsafeCell<Pool>,
    /// Blocks already taken off `returned` and not yet given to the pool (owner only).
    collected: UnsafeCell<*mut ReturnedBlock>,
    returned: AtomicPtr<ReturnedBlock>,
    blocks_in_use: AtomicUsize,
}

// SAFETY: `pool` and `collected` are reached only through the functions whose contract is "the owner thread calls
// this"; everything else is atomic.
unsafe impl<const BYTES: usize> Sync for Arena<BYTES> {}

impl<const BYTES: usize> Arena<BYTES> {
    /// An arena without memory: [`Arena::prepare`] gives it its region.
    pub(super) const fn new() -> Self {
        Self {
            region: Region(UnsafeCell::new(MaybeUninit::uninit())),
            pool: UnsafeCell::new(Pool::new()),
            collected: UnsafeCell::new(null_mut()),
            returned: AtomicPtr::new(null_mut()),
            blocks_in_use: AtomicUsize::new(0),
        }
    }

    /// Touches every page of the region and hands it to the pool.
    ///
    /// # Safety
    /// To be called exactly once, by the owner, before any other owner function, on an arena that never moves again.
    pub(super) unsafe fn prepare(&self) {
        let start = self.region.0.get().cast::<u8>();
        // SAFETY: the region is ours, `BYTES` long, and nothing refers to it before `prepare`.
        unsafe {
            start.write_bytes(0, BYTES);
            let block = NonNull::slice_from_raw_parts(NonNull::new_unchecked(start), BYTES);
            (*self.pool.get()).insert_free_block_ptr(block);
        }
    }

    /// Whether `pointer` lies in this arena's region.
    pub(super) fn contains(&self, pointer: *const u8) -> bool {
        let start = self.region.0.get() as usize;
        (pointer as usize).wrapping_sub(start) < BYTES
    }

    /// Blocks handed out and not yet back in the pool.
    #[cfg(test)]
    pub(super) fn blocks_in_use(&self) -> usize {
        self.blocks_in_use.load(Ordering::Relaxed)
    }

    /// A block for `layout` in constant time, or null where the pool has none.
    ///
    /// # Safety
    /// Only the owner thread may call this, after [`Arena::prepare`].
    pub(super) unsafe fn allocate(&self, layout: Layout) -> *mut u8 {
        let Ok(layout) = returnable(layout) else {
            return null_mut();
        };
        // SAFETY: only the owner reaches the pool.
        let block = unsafe { (*self.pool.get()).allocate(layout) };
        if block.is_some() {
            self.blocks_in_use.fetch_add(1, Ordering::Relaxed);
        }
        block.map_or(null_mut(), NonNull::as_ptr)
    }

    /// Gives a block back to the pool at once.
    ///
    /// # Safety
    /// Only the owner thread may call this; `block` came from [`Arena::allocate`] with alignment `align` and is not
    /// used any more.
    pub(super) unsafe fn free_as_owner(&self, block: NonNull<u8>, align: usize) {
        // SAFETY: passed on to the caller; `returnable` raises the alignment in the same way as `allocate` did.
        unsafe { (*self.pool.get()).deallocate(block, align.max(align_of::<ReturnedBlock>())) };
        self.blocks_in_use.fetch_sub(1, Ordering::Relaxed);
    }

    /// Sends a block back to its owner without a lock.
    ///
    /// # Safety
    /// `block` came from [`Arena::allocate`] with alignment `align` and is not used any more.
    pub(super) unsafe fn free_from_elsewhere(&self, block: NonNull<u8>, align: usize) {
        let node = block.cast::<ReturnedBlock>().as_ptr();
        let mut head = self.returned.load(Ordering::Relaxed);
        loop {
            // SAFETY: every block is at least as large and as aligned as a `ReturnedBlock` (`returnable`), and ours
            // alone until the exchange below publishes it.
            unsafe { node.write(ReturnedBlock { next: head, align }) };
            match self.returned.compare_exchange_weak(
                head,
                node,
                Ordering::Release,
                Ordering::Relaxed,
            ) {
                Ok(_) => return,
                Err(now) => head = now,
            }
        }
    }

    /// Takes up to [`COLLECTED_AT_ONCE`] blocks that other threads freed back into the pool.
    ///
    /// # Safety
    /// Only the owner thread may call this, after [`Arena::prepare`].
    pub(super) unsafe fn collect_returned(&self) {
        let pending = self.collected.get();
        for _ in 0..COLLECTED_AT_ONCE {
            // SAFETY: only the owner reads `collected`; nodes on it were published with Release and taken with
            // Acquire, all at once, so no other thread refers to them.
            unsafe {
                if (*pending).is_null() {
                    *pending = self.take_returned();
                }
                let Some(node) = NonNull::new(*pending) else {
                    return;
                };
                let ReturnedBlock { next, align } = node.as_ptr().read();
                *pending = next;
                self.free_as_owner(node.cast(), align);
            }
        }
    }

    fn take_returned(&self) -> *mut ReturnedBlock {
        if self.returned.load(Ordering::Relaxed).is_null() {
            return null_mut();
        }
        self.returned.swap(null_mut(), Ordering::Acquire)
    }
}

/// `layout` grown so that the freed block can hold a [`ReturnedBlock`].
fn returnable(layout: Layout) -> Result<Layout, std::alloc::LayoutError> {
    Layout::from_size_align(
        layout.size().max(size_of::<ReturnedBlock>()),
        layout.align().max(align_of::<ReturnedBlock>()),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{sync::mpsc, thread};

    const SMALL: usize = 64 * 1024;

    fn prepared() -> &'static Arena<SMALL> {
        let arena: &'static Arena<SMALL> = Box::leak(Box::new(Arena::new()));
        // SAFETY: leaked, so it never moves; this is the only call.
        unsafe { arena.prepare() };
        arena
    }

    fn layout(size: usize, align: usize) -> Layout {
        Layout::from_size_align(size, align).unwrap()
    }

    #[test]
    fn blocks_are_distinct_aligned_and_writable() {
        let arena = prepared();
        let mut blocks = Vec::new();
        for size in 1..200 {
            let layout = layout(size, 1 << (size % 8));
            // SAFETY: this thread is the owner.
            let block = unsafe { arena.allocate(layout) };
            assert!(!block.is_null() && arena.contains(block));
            assert_eq!(block as usize % layout.align(), 0);
            // SAFETY: the block is `size` bytes long and ours.
            unsafe { block.write_bytes(u8::try_from(size).unwrap(), size) };
            blocks.push((block, layout));
        }
        for (index, (block, layout)) in blocks.iter().enumerate() {
            for offset in 0..layout.size() {
                // SAFETY: as above.
                assert_eq!(unsafe { block.add(offset).read() } as usize, index + 1);
            }
        }
        for (block, layout) in blocks {
            // SAFETY: each block is freed once, by the owner.
            unsafe { arena.free_as_owner(NonNull::new(block).unwrap(), layout.align()) };
        }
        assert_eq!(arena.blocks_in_use(), 0);
    }

    #[test]
    fn an_exhausted_pool_says_so_and_recovers() {
        let arena = prepared();
        let layout = layout(1024, 16);
        let mut blocks = Vec::new();
        // SAFETY: this thread is the owner.
        while let Some(block) = NonNull::new(unsafe { arena.allocate(layout) }) {
            blocks.push(block);
        }
        assert!(blocks.len() > 40, "only {} blocks of 1 KiB", blocks.len());
        for block in blocks {
            // SAFETY: each block is freed once, by the owner.
            unsafe { arena.free_as_owner(block, layout.align()) };
        }
        // SAFETY: this thread is the owner.
        assert!(!unsafe { arena.allocate(layout) }.is_null());
    }

    #[test]
    fn blocks_freed_by_other_threads_under_load_all_come_back() {
        struct Handed(NonNull<u8>, usize);
        // SAFETY: a block is handed over as a whole.
        unsafe impl Send for Handed {}
        let arena = prepared();
        let senders: Vec<_> = (0..4)
            .map(|_| {
                let (sender, receiver) = mpsc::sync_channel::<Handed>(64);
                let thread = thread::spawn(move || {
                    for Handed(block, align) in receiver {
                        // SAFETY: handed over by the owner, freed once.
                        unsafe { arena.free_from_elsewhere(block, align) };
                    }
                });
                (sender, thread)
            })
            .collect();
        let mut handed = 0;
        for turn in 0..40_000_usize {
            let layout = layout(1 + turn % 300, 1 << (turn % 7));
            // SAFETY: this thread is the owner.
            let block = unsafe {
                arena.collect_returned();
                arena.allocate(layout)
            };
            let Some(block) = NonNull::new(block) else {
                thread::yield_now();
                continue;
            };
            let (sender, _) = &senders[turn % senders.len()];
            sender.send(Handed(block, layout.align())).unwrap();
            handed += 1;
        }
        assert!(handed > 20_000, "the premise: only {handed} blocks");
        for (sender, thread) in senders {
            drop(sender);
            thread.join().unwrap();
        }
        // Nobody frees any more: what is out now comes back in so many collections, or never.
        for _ in 0..=arena.blocks_in_use().div_ceil(COLLECTED_AT_ONCE) {
            // SAFETY: this thread is the owner.
            unsafe { arena.collect_returned() };
        }
        assert_eq!(arena.blocks_in_use(), 0);
    }
}
