//! The heap, and how much of it is used.

use core::alloc::{GlobalAlloc, Layout};
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use embedded_alloc::LlffHeap;

/// Bytes of the heap.
const SIZE: usize = 2 << 20;

#[unsafe(link_section = ".uninit.heap")]
static mut MEMORY: [MaybeUninit<u8>; SIZE] = [MaybeUninit::uninit(); SIZE];

#[global_allocator]
static HEAP: Counting = Counting {
    heap: LlffHeap::empty(),
    allocations: AtomicUsize::new(0),
    used: AtomicUsize::new(0),
    peak: AtomicUsize::new(0),
};

/// Counts what it hands out.
struct Counting {
    heap: LlffHeap,
    allocations: AtomicUsize,
    used: AtomicUsize,
    peak: AtomicUsize,
}

// SAFETY: the inner heap does all the work.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // One core without interrupts: no other allocation comes between these
        self.allocations.store(self.allocations.load(Relaxed) + 1, Relaxed);
        let used = self.used.load(Relaxed) + layout.size();
        self.used.store(used, Relaxed);
        self.peak.store(self.peak.load(Relaxed).max(used), Relaxed);
        // SAFETY: the caller's layout, as it is
        unsafe { self.heap.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        self.used.store(self.used.load(Relaxed) - layout.size(), Relaxed);
        // SAFETY: the caller's pointer and layout, as they are
        unsafe { self.heap.dealloc(memory, layout) }
    }
}

/// Gives the heap its memory; once, before anything is allocated.
pub fn init() {
    // SAFETY: nobody else has the memory, and this is called once
    unsafe { HEAP.heap.init((&raw mut MEMORY) as usize, SIZE) }
}

/// Allocations since the start.
pub fn allocations() -> usize {
    HEAP.allocations.load(Relaxed)
}

/// Begins to look for a new peak.
pub fn forget_peak() {
    HEAP.peak.store(HEAP.used.load(Relaxed), Relaxed);
}

/// Most bytes in use at once since then, without the allocator's own.
pub fn peak_bytes() -> usize {
    HEAP.peak.load(Relaxed)
}
