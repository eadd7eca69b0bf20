//! Instructions and memory. QEMU with `-icount shift=0` takes one nanosecond for an instruction, and
//! the timer of this board runs at 25 MHz: one count is 40 instructions.

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::STACK_PAINT_VALUE;

const INSTRUCTIONS_PER_COUNT: u64 = 40;
/// The timer has 24 bits: 671 million instructions.
const COUNTS: u32 = 0x00FF_FFFF;

unsafe extern "C" {
    static __stext: u8;
    static __etext: u8;
    static __srodata: u8;
    static __erodata: u8;
    static _stack_end: u32;
    static _stack_start: u32;
}

/// A running timer.
pub struct Meter(());

impl Meter {
    /// Starts the timer.
    pub fn new(mut timer: SYST) -> Self {
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(COUNTS);
        timer.clear_current();
        timer.enable_counter();
        Self(())
    }

    /// Instructions of a piece of work of at most 671 million.
    pub fn instructions<T>(&self, work: impl FnOnce() -> T) -> (u64, T) {
        let before = SYST::get_current();
        let result = work();
        // it counts down
        let counts = before.wrapping_sub(SYST::get_current()) & COUNTS;
        (u64::from(counts) * INSTRUCTIONS_PER_COUNT, result)
    }
}

/// Code and constants, bytes.
pub fn text_bytes() -> usize {
    let between = |from: *const u8, to: *const u8| to as usize - from as usize;
    between(&raw const __stext, &raw const __etext)
        + between(&raw const __srodata, &raw const __erodata)
}

/// Stack that was ever used, bytes: what is no longer painted.
pub fn stack_bytes() -> usize {
    let (mut lowest, top) = (&raw const _stack_end, &raw const _stack_start);
    // SAFETY: the words between the two symbols are the stack's; cortex-m-rt has written them all
    while lowest < top && unsafe { lowest.read_volatile() } == STACK_PAINT_VALUE {
        lowest = lowest.wrapping_add(1);
    }
    top as usize - lowest as usize
}
