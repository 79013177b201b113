//! The global allocator that gives the loop thread its arena and everyone else the system's memory.

use std::{
    alloc::{GlobalAlloc, Layout, System},
    cell::Cell,
    marker::PhantomData,
    ptr::NonNull,
    sync::atomic::{AtomicBool, AtomicU64, Ordering},
};

use super::pool::Arena;

/// Bytes of the loop's arena: a send takes one block of under 200 B, a new peer about 70 blocks.
const ARENA_BYTES: usize = 1 << 20;

static ARENA: Arena<ARENA_BYTES> = Arena::new();
static PREPARED: AtomicBool = AtomicBool::new(false);
static OWNED: AtomicBool = AtomicBool::new(false);
static ARENA_ALLOCATIONS: AtomicU64 = AtomicU64::new(0);
static SYSTEM_OPERATIONS: AtomicU64 = AtomicU64::new(0);

#[derive(Clone, Copy, PartialEq, Eq)]
enum Role {
    /// System memory; arena blocks are sent back to their owner.
    Other,
    /// The loop thread outside a cycle: system memory, arena blocks are freed at once.
    Owner,
    /// The loop thread inside a cycle: arena memory.
    InCycle,
}

thread_local! {
    // Const-initialised and without a destructor: reading it never allocates.
    static ROLE: Cell<Role> = const { Cell::new(Role::Other) };
}

/// The allocator to install with `#[global_allocator]`.
///
/// Inside [`LoopMemory::cycle`] it serves from the loop's arena; an exhausted arena falls back to the system, which is
/// counted. All other threads use the system allocator.
pub struct LoopAllocator;

/// Allocations of the loop thread inside its cycles since the process began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MemoryCounts {
    /// Blocks served from the arena.
    pub arena_allocations: u64,
    /// Blocks taken from or given to the system allocator; a healthy loop keeps this at zero.
    pub system_operations: u64,
}

/// The loop thread's claim on the arena; dropping it gives the arena up.
pub struct LoopMemory {
    /// The claim belongs to the thread that made it.
    not_send: PhantomData<*const ()>,
}

impl LoopMemory {
    /// Makes the current thread the arena's owner; `None` where another thread is.
    #[must_use]
    pub fn claim() -> Option<Self> {
        if OWNED.swap(true, Ordering::AcqRel) {
            return None;
        }
        if !PREPARED.swap(true, Ordering::AcqRel) {
            // SAFETY: the arena is a static, this thread owns it, and `PREPARED` lets one call through.
            unsafe { ARENA.prepare() };
        }
        ROLE.set(Role::Owner);
        Some(Self {
            not_send: PhantomData,
        })
    }

    /// Runs one cycle: everything it allocates comes from the arena.
    pub fn cycle<T>(&mut self, work: impl FnOnce() -> T) -> T {
        // SAFETY: `self` proves that this thread is the owner.
        unsafe { ARENA.collect_returned() };
        ROLE.set(Role::InCycle);
        let result = work();
        ROLE.set(Role::Owner);
        result
    }

    /// The counts so far; readable from any thread.
    #[must_use]
    pub fn counts() -> MemoryCounts {
        MemoryCounts {
            arena_allocations: ARENA_ALLOCATIONS.load(Ordering::Relaxed),
            system_operations: SYSTEM_OPERATIONS.load(Ordering::Relaxed),
        }
    }
}

impl Drop for LoopMemory {
    fn drop(&mut self) {
        ROLE.set(Role::Other);
        OWNED.store(false, Ordering::Release);
    }
}

fn role() -> Role {
    // A thread that is being torn down has no role any more.
    ROLE.try_with(Cell::get).unwrap_or(Role::Other)
}

fn note_system_operation(role: Role) {
    if role == Role::InCycle {
        SYSTEM_OPERATIONS.fetch_add(1, Ordering::Relaxed);
    }
}

// SAFETY: blocks come from the arena or from the system and are given back to where their address belongs; the arena's
// owner functions run only on the thread whose role says that it is the owner.
unsafe impl GlobalAlloc for LoopAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let role = role();
        if role == Role::InCycle {
            // SAFETY: this thread is the owner and the arena was prepared when it became so.
            let block = unsafe { ARENA.allocate(layout) };
            if !block.is_null() {
                ARENA_ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
                return block;
            }
        }
        note_system_operation(role);
        // SAFETY: the caller's contract is that of `System`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        let role = role();
        let Some(in_arena) = NonNull::new(block).filter(|_| ARENA.contains(block)) else {
            note_system_operation(role);
            // SAFETY: blocks outside the arena came from `System` with this layout.
            return unsafe { System.dealloc(block, layout) };
        };
        // SAFETY: the block came from the arena with this layout; the role says who may touch the pool.
        unsafe {
            match role {
                Role::Other => ARENA.free_from_elsewhere(in_arena, layout.align()),
                Role::Owner | Role::InCycle => ARENA.free_as_owner(in_arena, layout.align()),
            }
        }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        if role() != Role::InCycle {
            // SAFETY: the caller's contract is that of `System`.
            return unsafe { System.alloc_zeroed(layout) };
        }
        // SAFETY: the block, where there is one, is `layout.size()` bytes long.
        unsafe {
            let block = self.alloc(layout);
            if !block.is_null() {
                block.write_bytes(0, layout.size());
            }
            block
        }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        if role() != Role::InCycle && !ARENA.contains(block) {
            // SAFETY: the block came from `System`; the caller's contract is that of `System`.
            return unsafe { System.realloc(block, layout, new_size) };
        }
        // SAFETY: `new_size` with this alignment is a valid layout by the caller's contract; the blocks do not overlap
        // and both hold at least the bytes copied.
        unsafe {
            let moved = self.alloc(Layout::from_size_align_unchecked(new_size, layout.align()));
            if !moved.is_null() {
                moved.copy_from_nonoverlapping(block, layout.size().min(new_size));
                self.dealloc(block, layout);
            }
            moved
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{hint::black_box, sync::Mutex, thread};

    /// The arena has one owner at a time, and the counts are the process's: these tests take turns.
    static TURN: Mutex<()> = Mutex::new(());

    fn on_loop_thread<T: Send>(work: impl FnOnce(&mut LoopMemory) -> T + Send) -> T {
        let _turn = TURN
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner);
        thread::scope(|scope| {
            scope
                .spawn(|| work(&mut LoopMemory::claim().unwrap()))
                .join()
                .unwrap()
        })
    }

    #[test]
    fn a_cycle_allocates_from_the_arena_and_nothing_from_the_system() {
        on_loop_thread(|memory| {
            let before = LoopMemory::counts();
            let outside = black_box(Box::new(1_u64));
            assert!(!ARENA.contains(std::ptr::from_ref(&*outside).cast()));
            for _ in 0..10_000 {
                memory.cycle(|| {
                    let mut inside = black_box(vec![1_u8; 100]);
                    assert!(ARENA.contains(inside.as_ptr()));
                    inside.resize(1_000, 2);
                    assert_eq!((inside[99], inside[100]), (1, 2));
                });
            }
            let after = LoopMemory::counts();
            assert_eq!(after.arena_allocations - before.arena_allocations, 20_000);
            assert_eq!(after.system_operations, before.system_operations);
        });
    }

    #[test]
    fn system_memory_touched_inside_a_cycle_is_counted() {
        on_loop_thread(|memory| {
            let before = LoopMemory::counts().system_operations;
            let outside = black_box(Box::new([0_u8; 64]));
            memory.cycle(|| drop(outside));
            assert_eq!(LoopMemory::counts().system_operations, before + 1);
            // More than the arena holds: served by the system, and counted.
            let large = memory.cycle(|| black_box(vec![0_u8; 2 * ARENA_BYTES]));
            assert_eq!(LoopMemory::counts().system_operations, before + 2);
            assert!(!ARENA.contains(large.as_ptr()));
        });
    }

    #[test]
    fn blocks_dropped_by_another_thread_return_to_the_arena() {
        on_loop_thread(|memory| {
            let before = LoopMemory::counts().system_operations;
            // 20 000 blocks of 4 KiB are 80 times the arena: they fit only because freed ones come back.
            let (sender, receiver) = std::sync::mpsc::sync_channel::<Vec<u8>>(16);
            let dropper =
                thread::spawn(move || receiver.into_iter().map(|block| block.len()).sum::<usize>());
            for _ in 0..20_000 {
                let block = memory.cycle(|| black_box(Vec::with_capacity(4096)));
                sender.send(block).unwrap();
            }
            drop(sender);
            dropper.join().unwrap();
            assert_eq!(LoopMemory::counts().system_operations, before);
        });
    }

    #[test]
    fn the_arena_has_one_owner_at_a_time() {
        on_loop_thread(|_| assert!(LoopMemory::claim().is_none()));
    }
}
