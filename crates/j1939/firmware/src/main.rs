//! The J1939 stack and the planner on a Cortex-M4 in QEMU: known frames, the longest message, the
//! guard, and the ticks of three drives with what each costs. It fails when a check does, or when
//! something costs more than its bound.
//!
//! | file | holds |
//! |---|---|
//! | `work` | what is computed, here and by a test on the host, with the same bits |
//! | `guarding` | the planner's guard alone |
//! | `bounds` | what a tick may cost |
//! | `meter`, `heap` | instructions, stack and heap |
#![no_std]
#![no_main]

extern crate alloc;
// the planner's data sheet is written for tests with a standard library and uses its `Vec` alone
extern crate alloc as std;

mod bounds;
#[allow(dead_code, reason = "the planner's other parts use them")]
#[path = "../../../planner/src/error.rs"]
mod error;
// The guard is private to the planner: its source is built here as well
#[allow(dead_code, reason = "the planner's other parts use them")]
#[path = "../../../planner/src/safety/guard.rs"]
mod guard;
mod guarding;
mod heap;
mod meter;
#[path = "../../tests/vectors/mod.rs"]
mod vectors;
mod work;

pub use error::PlannerError;

use bounds::{CRUISE, Cost, HILLS, PREDICTIVE, STACK_BYTES, TEXT_BYTES};
use core::panic::PanicInfo;
use cortex_m_rt::{ExceptionFrame, entry, exception};
use cortex_m_semihosting::debug::{self, EXIT_FAILURE, EXIT_SUCCESS};
use cortex_m_semihosting::hprintln;
use meter::Meter;
use work::drive::{Drive, TICKS, reference_limits};
use work::{codec, transfer};

/// Runs the ticks of a drive and compares what they cost with their bounds.
fn drive(
    meter: &Meter,
    name: &str,
    new: fn() -> Result<Drive, &'static str>,
    bounds: &Cost,
) -> Result<(), &'static str> {
    heap::forget_peak();
    let mut drive = new()?;
    let mut cost = Cost::NONE;
    let mut sum = 0;
    for _ in 0..TICKS {
        let (plans, before) = (drive.plans(), heap::allocations());
        let (instructions, result) = meter.instructions(|| drive.tick());
        result?;
        let allocations = heap::allocations() - before;
        let worst = if drive.plans() > plans { &mut cost.worst_plan } else { &mut cost.worst_tick };
        *worst = (*worst).max(instructions);
        sum += instructions;
        cost.allocating_ticks += usize::from(allocations > 0);
        cost.allocations += allocations;
        drive.step();
    }
    cost.mean = sum / TICKS as u64;
    cost.heap_bytes = heap::peak_bytes();
    hprintln!("{}: {} speed plans in {} ticks, {:#?}", name, drive.plans(), TICKS, cost);
    hprintln!("bits {} {:016x}", name, drive.bits().0);
    cost.within(bounds)
}

fn run(meter: &Meter) -> Result<(), &'static str> {
    hprintln!("known frames: {} right", codec::known_frames()?);
    let (instructions, signals) = meter.instructions(codec::every_signal);
    let (signals, bits) = signals?;
    hprintln!(
        "signals: {} read and written, {} instructions each",
        signals,
        instructions / u64::from(signals)
    );
    hprintln!("bits signals {:016x}", bits.0);
    let (instructions, message) = meter.instructions(transfer::longest_message);
    let (frames, bits) = message?;
    hprintln!("1785 bytes: {} frames, both ends {} instructions", frames, instructions);
    hprintln!("bits message {:016x}", bits.0);
    let (cases, instructions) = guarding::all_cases(meter, &reference_limits())?;
    hprintln!("guard: {} ticks right, at most {} instructions", cases, instructions);
    drive(meter, "cruise", Drive::cruise, &CRUISE)?;
    drive(meter, "predictive", Drive::predictive, &PREDICTIVE)?;
    drive(meter, "hills", Drive::hills, &HILLS)?;
    let (text, stack) = (meter::text_bytes(), meter::stack_bytes());
    hprintln!("code and constants {} bytes, stack {} bytes", text, stack);
    if text > TEXT_BYTES || stack > STACK_BYTES {
        return Err("more code or stack than its bound");
    }
    Ok(())
}

#[entry]
fn main() -> ! {
    heap::init();
    let result = match cortex_m::Peripherals::take() {
        Some(peripherals) => run(&Meter::new(peripherals.SYST)),
        None => Err("the timer is taken"),
    };
    match result {
        Ok(()) => debug::exit(EXIT_SUCCESS),
        Err(what) => {
            hprintln!("FAILED: {}", what);
            debug::exit(EXIT_FAILURE);
        }
    }
    halt()
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    hprintln!("FAILED: {}", info);
    debug::exit(EXIT_FAILURE);
    halt()
}

// SAFETY: it touches nothing and does not return
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    hprintln!("FAILED: {:?}", frame);
    debug::exit(EXIT_FAILURE);
    halt()
}

/// Where QEMU ends the run before it comes here.
fn halt() -> ! {
    loop {
        cortex_m::asm::wfi();
    }
}
