//! Decoding asks for no memory.
#![expect(unsafe_code, reason = "an allocator cannot be written without")]

mod typed;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static REQUESTS: Cell<usize> = const { Cell::new(0) };
}

/// The system's allocator, counting the requests of each thread.
struct Counting;

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

#[test]
fn no_frame_of_a_log_costs_an_allocation() {
    let before_reading = REQUESTS.with(Cell::get);
    let frames = typed::frames("t270_normal");
    let before = REQUESTS.with(Cell::get);
    assert!(before > before_reading, "the counter counts");
    let decoded = frames.iter().filter(|frame| typed::decode(frame)).count();
    assert_eq!(REQUESTS.with(Cell::get) - before, 0);
    assert_eq!(decoded, 15_582);
}
