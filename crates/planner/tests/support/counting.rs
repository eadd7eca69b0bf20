//! An allocator that counts the requests of each thread.
#![expect(unsafe_code, reason = "an allocator cannot be written without")]
#![allow(unreachable_pub, reason = "tests of three crates share it")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static REQUESTS: Cell<usize> = const { Cell::new(0) };
}

/// The system's allocator, counted.
struct Counting;

// Every call is handed on to the system's allocator as it came; counting touches no memory of it.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let _ = REQUESTS.try_with(|r| r.set(r.get() + 1));
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Requests of this thread while something runs.
pub fn requests_of(run: impl FnOnce()) -> usize {
    let before = REQUESTS.with(Cell::get);
    run();
    REQUESTS.with(Cell::get) - before
}
