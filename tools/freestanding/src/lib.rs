//! Entry points of `j1939` and the planner's guard that must link where there is nothing: no standard library, no allocator,
//! and a panic handler that ends in a symbol that does not exist. If this links, no input can make
//! them panic. Nobody runs it.
#![no_std]

extern crate alloc;

// The guard is private to the planner, whose other parts may allocate: its source alone is built.
#[allow(dead_code, unused_imports)]
#[path = "../../../crates/planner/src/error.rs"]
mod error;
#[allow(dead_code)]
#[path = "../../../crates/planner/src/safety/guard.rs"]
mod guard;

use error::PlannerError;
use guard::{GuardConfig, GuardInput, GuardMemory, Inputs};

use core::hint::black_box;

use j1939::bus::{Bus, BusError};
use j1939::check::{Carrier, Checker, Policy, Sealer};
use j1939::dm::{self, DiagnosticMessage, Dtc, Lamps};
use j1939::message::{self, MESSAGES, Message, Tsc1, Xbr};
use j1939::steering::{ExampleSteering, SteeringDemand, SteeringLink};
use j1939::{
    Acknowledgment, AddressClaim, BitRate, BusLoad, Frame, Id, MessageTable, Name, Request, Slot,
    TpEvent, Transport, frame_bits, ident,
};
use tractrix_core::{EgoState, Stamped, Time, VehicleLimits, VehicleStatus};

unsafe extern "C" {
    /// Nowhere defined.
    fn __must_not_panic() -> !;
    /// Nowhere defined.
    fn __must_not_allocate() -> !;
}

/// An allocator that cannot be linked where anything calls it.
struct Nothing;

#[global_allocator]
static NOTHING: Nothing = Nothing;

// SAFETY: it is never linked, which is what is checked.
unsafe impl core::alloc::GlobalAlloc for Nothing {
    unsafe fn alloc(&self, _: core::alloc::Layout) -> *mut u8 {
        // SAFETY: as above.
        unsafe { __must_not_allocate() }
    }

    unsafe fn dealloc(&self, _: *mut u8, _: core::alloc::Layout) {
        // SAFETY: as above.
        unsafe { __must_not_allocate() }
    }
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    // SAFETY: it is never linked, which is what is checked.
    unsafe { __must_not_panic() }
}

/// Bytes that nobody knows while this is compiled.
fn outside<const N: usize>() -> [u8; N] {
    black_box([0; N])
}

/// As many of them as come from outside.
fn some(bytes: &[u8]) -> &[u8] {
    bytes.get(..black_box(0)).unwrap_or(bytes)
}

/// Decodes a message and encodes it again.
fn there_and_back<M: Message>(id: Id, bytes: &[u8]) {
    if let Ok(message) = M::decode(id, bytes) {
        let _ = black_box(message.encode());
        let _ = black_box(message.frame(black_box(0), black_box(0)));
    }
}

macro_rules! all {
    ($id:expr, $bytes:expr; $($message:ident)*) => {
        $(there_and_back::<message::$message>($id, $bytes);)*
    };
}

fn codec(id: Id, bytes: &[u8]) {
    all!(id, bytes; Tsc1 Tc1 Xbr Aebs1 Aebs2 Erc1 Ebc1 Ebc2 Ebc5 Etc1 Etc2 Etc8 Eec1 Eec2 Eec3 Ec1 Rc
        Vdc1 Vdc2 Sas Hrw Ccvs1 Cvw Vw Air1 Lfe1 Lfc1 Amb Vp1 Vds Acc1 Acc2 Adsc1 Adsc2 Adss Pcc1);
    if let Some(table) = MessageTable::of(id.pgn()) {
        let mut out = outside::<40>();
        for signal in table.signals {
            let slot = signal.decode(bytes);
            let _ = black_box(signal.write(&mut out, black_box(slot)));
        }
    }
    for table in &MESSAGES {
        let _ = black_box(table.check_length(id, bytes));
    }
}

fn protection(frame: &Frame) {
    let mut checker = Checker::new(Carrier::XBR.protection, black_box(Policy::Required));
    let mut key = Checker::new(Carrier::proprietary_xbr(black_box(5)).protection, Policy::Required);
    let _ = black_box((checker.check(frame), key.check(frame)));
    let number = Slot::Value(black_box(0.0));
    let brake = Xbr { acceleration_demand_m_s2: number, ..Xbr::default() };
    let _ = black_box(Sealer::new(Carrier::XBR).seal(brake, black_box(0), black_box(0)));
    let torque = Tsc1 { torque_request_frac: number, ..Tsc1::default() };
    let _ = black_box(Sealer::new(Carrier::TSC1).seal(torque, black_box(0), black_box(0)));
    let mut link = ExampleSteering::new(black_box(0));
    let demand = SteeringDemand {
        follow: black_box(true),
        steering_wheel_rad: black_box(0.0),
        rate_max_rad_s: black_box(0.0),
    };
    let _ = black_box(link.demand(&demand, black_box(0), black_box(0)));
    let _ = black_box(link.read(frame));
}

fn lists_and_texts(id: Id, bytes: &[u8]) {
    let mut room = outside::<64>();
    if let Ok(message) = DiagnosticMessage::decode(id, bytes) {
        for dtc in message.dtcs() {
            black_box(dtc);
        }
    }
    let dtc = Dtc {
        spn: black_box(0),
        fmi: black_box(0),
        occurrences: black_box(None),
        old_order: black_box(false),
    };
    let _ = black_box(dm::write(black_box(dm::DM1), &Lamps::default(), &[dtc; 3], &mut room));
    for field in ident::fields(id, bytes) {
        let _ = black_box(field);
    }
    if let Ok((count, fields)) = ident::software(id, bytes) {
        black_box(count);
        for field in fields {
            let _ = black_box(field);
        }
    }
    let _ = black_box(ident::write(id, &black_box(["a", "b"]), &mut room));
}

/// A bus that takes and gives what nobody knows.
struct Outside;

impl Bus for Outside {
    fn send(&mut self, now: Time, frame: &Frame) -> Result<(), BusError> {
        black_box((now, frame));
        black_box(Ok(()))
    }

    fn receive(&mut self, time: Time) -> Result<Option<Stamped<Frame>>, BusError> {
        let id = Id::from_raw(black_box(0));
        black_box(Ok(Some(Stamped { time, value: Frame::of(id, outside()) })))
    }
}

fn network(now: Time, frame: &Frame, bytes: &[u8], bus: &mut Outside) {
    let mut claim = AddressClaim::new(Name(black_box(0)), black_box(0), black_box(0));
    let mut transport = Transport::<4, 1_785>::new(black_box(255));
    claim.on_frame(now, frame);
    let _ = black_box(claim.poll(now, bus));
    transport.set_address(claim.address());
    transport.on_frame(now, frame);
    let _ = black_box(transport.send(now, black_box(6), black_box(0), black_box(0), bytes));
    let _ = black_box(transport.poll(now, bus));
    while let Some(event) = transport.event() {
        if let TpEvent::Received(message) = &event {
            claim.on_message(message);
        }
        black_box(event);
    }
    if let Some(request) = Request::of(frame) {
        let _ = black_box(request.frame());
    }
    if let Some(answer) = Acknowledgment::of(frame) {
        black_box(answer.frame(black_box(0)));
    }
    let mut load = BusLoad::new(black_box(BitRate::Kbit250));
    load.add(now, frame);
    black_box((load.share(now), frame_bits(frame)));
}

/// Everything, with input from outside.
#[unsafe(no_mangle)]
pub extern "C" fn _start() {
    let id = Id::from_raw(black_box(0));
    let bytes = outside::<64>();
    let bytes = some(&bytes);
    let _ = black_box(Id::new(black_box(0), black_box(0), black_box(0), black_box(0)));
    if let Ok(frame) = Frame::new(id, bytes) {
        codec(frame.id(), frame.bytes());
        protection(&frame);
        network(Time(black_box(0)), &frame, bytes, &mut Outside);
    }
    codec(id, bytes);
    lists_and_texts(id, bytes);
}

/// What a tick of the guard is given.
pub struct Tick {
    config: GuardConfig,
    memory: GuardMemory,
    now: Time,
    ego: Option<Stamped<EgoState>>,
    status: VehicleStatus,
    scene_time: Option<Time>,
    demand_time: Option<Time>,
    input: GuardInput,
    limits: VehicleLimits,
}

/// A tick of the guard.
#[unsafe(no_mangle)]
pub extern "C" fn guard_tick(tick: &Tick) {
    let Tick { config, memory, now, ego, status, scene_time, demand_time, input, limits } = tick;
    let (scene_time, demand_time) = (*scene_time, *demand_time);
    let inputs = Inputs { ego: ego.as_ref(), status, scene_time, demand_time };
    black_box(guard::inspect(config, memory, *now, &inputs));
    black_box(guard::limit(config, memory, input, limits));
}
