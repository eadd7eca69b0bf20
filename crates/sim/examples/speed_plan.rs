//! Cruise control and the receding-horizon speed planner in the full truck on the same road:
//! fuel, trip time and brakes against each other and against the ghost, what the plan of the whole
//! trip promises, and the time of a tick.
//!
//! `cargo run --release -p sim --example speed_plan -- SCENARIO [KM] [--truck NAME] [--payload-kg KG]
//! [--only-predictive] [--no-eco-roll] [--no-gears] [--trace] [--trace-cruise]`
#![allow(clippy::unwrap_used, clippy::disallowed_macros, missing_docs)]

use planner::SpeedPlannerKind;
use planner::pcc::model::profile_of;
use planner::pcc::{Leg, Price, SpeedBand, TripRequest, Tuning, plan_trip};
use rustix::time::{ClockId, clock_gettime};
use sim::{GhostReport, Scenario, Status, World};
use tractrix_core::{Tick, Vehicle};

/// What a run came to.
#[derive(Default, Clone)]
struct Figures {
    start_m: f64,
    end_m: f64,
    end_m_s: f64,
    time_s: f64,
    fuel_g: f64,
    brake_mj: f64,
    retarder_mj: f64,
    shifts: usize,
    late_s: f64,
    price_g_s: f64,
    ghost: Option<GhostReport>,
    tick_us: Vec<f64>,
    replan_us: Vec<f64>,
}

/// Time that this thread has had on a core, us: other programs do not count.
fn cpu_us() -> f64 {
    let t = clock_gettime(ClockId::ThreadCPUTime);
    t.tv_sec as f64 * 1e6 + t.tv_nsec as f64 * 1e-3
}

fn drive(scenario: &Scenario, to_m: f64, trace: bool) -> Figures {
    let mut world = World::new(scenario, 1).unwrap();
    world.attach_ghost().unwrap();
    let mut f = Figures { start_m: world.truck().state().s_m, ..Figures::default() };
    let (mut gear, mut plans) = (0, 0u64);
    let mut next_trace_m = 0.0;
    while world.status() == Status::Running && world.truck().state().s_m < to_m {
        let mut shape = String::new();
        let begun = cpu_us();
        let mut look = |tick: &Tick<'_>| {
            if trace && tick.ego.s_m >= next_trace_m {
                next_trace_m = tick.ego.s_m + 50.0;
                let (e, p) = (tick.ego, tick.plan);
                shape = format!(
                    "{:.0} v {:.2} ref {:.2} acc {:.2}/{:.2} gear {} {:?} pedal {:.2} ret {:.2} xbr {:.2} {:?} fol {:?} n {:.0}",
                    e.s_m,
                    e.speed_m_s,
                    p.reference_speed_m_s,
                    e.accel_x_m_s2,
                    p.target_accel_m_s2,
                    e.powertrain.gear,
                    p.command.gear,
                    p.command.accelerator_pedal_frac,
                    p.command.retarder_frac,
                    p.command.xbr_decel_m_s2,
                    p.speed_status,
                    p.following,
                    e.powertrain.engine_speed_rad_s * 9.549,
                );
            }
        };
        world.tick(&mut Look(&mut look)).unwrap();
        let us = cpu_us() - begun;
        let made = world.stack_mut().speed_plans_made();
        if made > plans {
            f.replan_us.push(us);
        } else {
            f.tick_us.push(us);
        }
        plans = made;
        if !shape.is_empty() {
            println!("{shape}");
        }
        let signals = world.truck().state().powertrain;
        if signals.gear != 0 && signals.gear != gear {
            f.shifts += usize::from(gear != 0);
            gear = signals.gear;
        }
        f.retarder_mj +=
            signals.retarder_force_n * world.truck().state().speed_m_s * scenario.run.tick_s * 1e-6;
    }
    let summary = world.summary();
    f.end_m = world.truck().state().s_m;
    f.end_m_s = world.truck().state().speed_m_s;
    f.time_s = summary.duration_s;
    f.fuel_g = summary.fuel_g;
    f.brake_mj = summary.brake_energy_j * 1e-6;
    if let Some(plan) = world.stack_mut().speed_plan() {
        f.price_g_s = plan.beta_g_s;
    }
    f.late_s = world.stack_mut().speed_plan_late_s();
    f.ghost = world.ghost();
    f
}

struct Look<'a>(&'a mut dyn FnMut(&Tick<'_>));

impl tractrix_core::Recorder for Look<'_> {
    fn record(&mut self, tick: &Tick<'_>) {
        (self.0)(tick);
    }
}

fn percentiles(name: &str, us: &mut [f64]) {
    if us.is_empty() {
        return;
    }
    us.sort_by(f64::total_cmp);
    let at = |q: f64| us[((us.len() - 1) as f64 * q) as usize];
    println!(
        "{name}: {} of them, p50 {:.1} us, p90 {:.1}, p99 {:.1}, p99.9 {:.1}, max {:.1}",
        us.len(),
        at(0.5),
        at(0.9),
        at(0.99),
        at(0.999),
        at(1.0)
    );
}

fn show(name: &str, f: &Figures) {
    println!(
        "{name}: {:.1} g, {:.1} s, brakes {:.2} MJ, retarder {:.2} MJ, {} shifts, end {:.2} m/s, late {:.1} s, price {:.2} g/s",
        f.fuel_g, f.time_s, f.brake_mj, f.retarder_mj, f.shifts, f.end_m_s, f.late_s, f.price_g_s
    );
    let Some(g) = f.ghost else { return };
    let percent = |frac: Option<f64>| frac.map_or(f64::NAN, |f| 100.0 * f);
    println!(
        "  against the ghost ({:.1} g, {:.1} s, at {:.2} g/s): {:.2} % saved, {:.2} % where free, held up {:.0} s, {:.0} m",
        g.fuel_g,
        g.time_s,
        g.price_of_time_g_s.unwrap_or(f64::NAN),
        percent(g.saving_frac),
        percent(g.free_saving_frac),
        g.held_up_s,
        g.held_up_m
    );
}

fn main() {
    let mut args = std::env::args().skip(1);
    let name = args.next().unwrap_or_else(|| "test-site".into());
    let rest: Vec<String> = args.collect();
    let km: f64 = rest.first().and_then(|a| a.parse().ok()).unwrap_or(1e3);
    let flag = |f: &str| rest.iter().any(|a| a == f);
    let after = |f: &str| rest.iter().skip_while(|a| *a != f).nth(1);
    let mut cruise = Scenario::builtin(&name).unwrap();
    cruise.stack.speed_planner = SpeedPlannerKind::Cruise;
    cruise.stack.speed_plan.eco_roll &= !flag("--no-eco-roll");
    if let Some(truck) = after("--truck") {
        cruise.truck.file.clone_from(truck);
    }
    if let Some(kg) = after("--payload-kg") {
        cruise.truck.payload_kg = kg.parse().unwrap();
    }
    cruise.stack.speed_plan.request_gears = !flag("--no-gears");
    let mut predictive = cruise.clone();
    predictive.stack.speed_planner = SpeedPlannerKind::Predictive;
    let to_m = cruise.ego.s_m + km * 1e3;
    let b = if flag("--only-predictive") {
        Figures::default()
    } else {
        drive(&cruise, to_m, flag("--trace-cruise"))
    };
    let mut p = drive(&predictive, to_m, flag("--trace"));
    show("cruise control", &b);
    show("predictive", &p);
    percentiles("ticks", &mut p.tick_us);
    percentiles("ticks with a plan", &mut p.replan_us);

    let world = World::new(&cruise, 1).unwrap();
    let profile: Vec<_> = profile_of(world.road(), 12.5)
        .into_iter()
        .filter(|q| q.s_m >= p.start_m && q.s_m <= p.end_m)
        .collect();
    let set = cruise.stack.set_speed_m_s;
    let horizon = cruise.stack.speed_plan;
    let band = SpeedBand {
        set_m_s: set,
        min_m_s: set - horizon.below_m_s,
        max_m_s: set + horizon.above_m_s,
    };
    let trip = plan_trip(&TripRequest {
        profile: &profile,
        truck: world.truck().limits(),
        band,
        trip_time_s: None,
        eco_roll: horizon.eco_roll,
        tuning: Tuning::default(),
    })
    .unwrap();
    let mass_kg = world.truck().limits().road_load.mass_kg;
    let leg = |f: &Figures| Leg {
        fuel_g: f.fuel_g,
        time_s: f.time_s,
        kinetic_j: 0.5 * mass_kg * f.end_m_s * f.end_m_s,
    };
    let energy_g_j = p.ghost.and_then(|g| g.price_of_energy_g_j).unwrap();
    let price = Price { time_g_s: trip.beta_g_s, energy_g_j };
    let saved = price.saving_frac(&leg(&p), &leg(&b)).unwrap_or(f64::NAN);
    println!(
        "saved against this cruise control at equal trip time and end speed: {:.2} %",
        100.0 * saved
    );
    let promised = trip.plan;
    let base = trip.baseline_set_speed;
    println!(
        "promised: {:.1} g in {:.1} s ({} shifts, brakes {:.1} MJ) against {:.1} g in {:.1} s ({} shifts, {:.1} MJ): {:.2} %, price {:.2} g/s",
        promised.fuel_g,
        promised.trip_time_s,
        promised.shifts,
        promised.brake_energy_j * 1e-6,
        base.fuel_g,
        base.trip_time_s,
        base.shifts,
        base.brake_energy_j * 1e-6,
        100.0 * trip.saving_vs_set_speed_frac,
        trip.beta_g_s
    );
}
