//! Faults of the bus in the closed loop, from the third second on:
//! `cargo run --release -p sim --example bus_faults -- [SCENARIO] [SECONDS]` (default medium-15, 30 s).
#![expect(clippy::disallowed_macros, reason = "an example prints")]

use j1939::bus::Bus;
use j1939::bus::faults::{FaultPlan, Faults, babble};
use j1939::bus::loopback::{Loopback, LoopbackNode};
use j1939::{BitRate, Frame, Id, Name};
use sim::ecu::{Ahead, EcuFault, Unit};
use sim::{Scenario, SimError, Status, World};
use tractrix_core::{Recorder, Tick, Time, Vehicle};

/// When faults begin, s.
const FROM_S: f64 = 3.0;

/// What the third node on the bus does at a tick, counted from the beginning of the fault.
type Attack = fn(&mut LoopbackNode, Time, i64) -> Result<(), j1939::bus::BusError>;

/// A fault by its name.
struct Case {
    name: &'static str,
    plan: FaultPlan,
    broken: Option<EcuFault>,
    attack: Option<Attack>,
    /// The driver's clock jumps, ns.
    jump_ns: i64,
}

impl Case {
    const fn of_plan(name: &'static str, plan: FaultPlan) -> Self {
        Self { name, plan, broken: None, attack: None, jump_ns: 0 }
    }

    fn broken(name: &'static str, fault: EcuFault) -> Self {
        Self { broken: Some(fault), ..Self::of_plan(name, FaultPlan::default()) }
    }

    fn jump(name: &'static str, jump_ns: i64) -> Self {
        Self { jump_ns, ..Self::of_plan(name, FaultPlan::default()) }
    }

    fn attack(name: &'static str, attack: Attack) -> Self {
        Self { attack: Some(attack), ..Self::of_plan(name, FaultPlan::default()) }
    }
}

/// An 8-byte frame with this identifier.
fn frame(raw: u32, data: [u8; 8]) -> Frame {
    Frame::of(Id::from_raw(raw), data)
}

fn cases() -> Vec<Case> {
    let from = Time::from_seconds(FROM_S);
    let plan = FaultPlan { from, ..FaultPlan::default() };
    vec![
        Case::of_plan("none", FaultPlan::default()),
        Case::of_plan("loss 1 %", FaultPlan { loss: 0.01, ..plan }),
        Case::of_plan("loss 10 %", FaultPlan { loss: 0.1, ..plan }),
        Case::of_plan("loss 50 %", FaultPlan { loss: 0.5, ..plan }),
        Case::of_plan("delay 100 ms", FaultPlan { delay_nanos: 100_000_000, ..plan }),
        Case::of_plan("every tenth doubled", FaultPlan { duplicate: 0.1, ..plan }),
        Case::of_plan("every tenth corrupted", FaultPlan { corrupt: 0.1, ..plan }),
        Case::of_plan("bus-off", FaultPlan { bus_off: true, ..plan }),
        Case::attack("babbling node", |bus, now, _| {
            babble(bus, now, &frame(0x00FF_0001, [0; 8])).map(|_| ())
        }),
        Case::broken("engine silent", EcuFault::Silent(Unit::Engine)),
        Case::broken("brakes silent", EcuFault::Silent(Unit::Brakes)),
        Case::attack("spoofed TSC1 at 31 Hz", |bus, now, tick| match tick % 3 {
            0 => bus.send(now, &frame(0x0C00_000B, [0xC1, 0, 0, 0xFA, 0, 0, 0, 0])),
            _ => Ok(()),
        }),
        Case::attack("claim of the engine's address, NAME 0", |bus, now, tick| match tick {
            0 => bus.send(now, &Name(0).claim(Unit::Engine.address())),
            _ => Ok(()),
        }),
        Case::attack("BAM of 100 sources", |bus, now, tick| {
            let sa = 0x80 + (tick % 100) as u32;
            bus.send(now, &frame(0x1CEC_FF00 | sa, [32, 0xF9, 6, 36, 0xFF, 0xCA, 0xFE, 0]))
        }),
        Case::attack("RTS to the driver, 300 a second", |bus, now, tick| {
            for k in 0..3 {
                let sa = 0x80 + ((3 * tick + k) % 100) as u32;
                bus.send(now, &frame(0x1CEC_2700 | sa, [16, 0xF9, 6, 36, 0xFF, 0xCA, 0xFE, 0]))?;
            }
            Ok(())
        }),
        Case::broken("frozen wheel speeds", EcuFault::FrozenWheels),
        Case::jump("clock jumps 1 s ahead", 1_000_000_000),
        Case::jump("clock jumps 1 s back", -1_000_000_000),
    ]
}

/// Smallest gap to the vehicle ahead since the fault, m.
struct Gap(f64, tractrix_core::Geometry);

impl Recorder for Gap {
    fn record(&mut self, tick: &Tick<'_>) {
        if tick.now.seconds() >= FROM_S
            && let Some(ahead) = Ahead::of(tick.ego, &self.1, tick.scene)
        {
            self.0 = self.0.min(ahead.gap_m);
        }
    }
}

fn drive(scenario: &Scenario, case: &Case) -> Result<(), SimError> {
    let wire = Loopback::new(BitRate::Kbit250, 3);
    let mut world = World::new(scenario, 1)?;
    let driver = Box::new(Faults::new(wire.node(1), case.plan, 1));
    world.put_on_bus(BitRate::Kbit250, Box::new(wire.node(0)), driver)?;
    let mut intruder = wire.node(2);
    let mut gap = Gap(f64::INFINITY, world.geometry());
    let (mut ticks, mut seen, mut reacted) = (0, None, None);
    while world.status() == Status::Running {
        let now = world.now();
        if now.seconds() >= FROM_S {
            if let (0, Some(fault), Some(bus)) = (ticks, case.broken, world.bus_mut()) {
                bus.ecu().set_fault(fault, true);
            }
            if let (0, Some(bus)) = (ticks, world.bus_mut()) {
                bus.jump_clock(case.jump_ns);
            }
            if let Some(attack) = case.attack {
                // A full send queue is the attacker's affair
                let _ = attack(&mut intruder, now, ticks);
            }
            ticks += 1;
        }
        world.tick(&mut gap)?;
        let status = world.bus_mut().map(|bus| bus.status()).unwrap_or_default();
        if let (None, Some(fault)) = (seen, status.faults().next()) {
            seen = Some((fault.fault, now.seconds() - FROM_S));
        }
        if reacted.is_none() && !world.stack().plan().guard.is_empty() {
            reacted = Some(now.seconds() - FROM_S);
        }
    }
    let (s, figures) = (world.summary(), world.bus().unwrap_or_default());
    println!(
        "| {} | {} | {} | {} | {} | {:.1} | {} | {} | {:.1} | {:.3} |",
        case.name,
        seen.map_or("none".to_owned(), |(fault, _)| format!("{fault:?}")),
        seen.map_or("-".to_owned(), |(_, after_s)| format!("{:.0}", 1e3 * after_s)),
        reacted.map_or("-".to_owned(), |after_s| format!("{:.0}", 1e3 * after_s)),
        figures.ticks_not_driven,
        if gap.0.is_finite() { gap.0 } else { f64::NAN },
        s.collisions,
        figures.refused,
        world.truck().state().speed_m_s,
        s.max_lateral_error_m,
    );
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let mut scenario = Scenario::builtin(&args.next().unwrap_or_else(|| "medium-15".to_owned()))?;
    scenario.run.duration_s = args.next().map_or(Ok(30.0), |s| s.parse())?;
    scenario.run.allow_off_road = true;
    println!(
        "| fault | first noticed as | after, ms | guard acts after, ms | ticks not driven as \
         planned | smallest gap, m | collisions | refused by the truck | speed at the end, m/s | \
         lateral error max, m |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for case in cases() {
        drive(&scenario, &case)?;
    }
    Ok(())
}
