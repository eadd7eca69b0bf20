//! Cruise control and the receding-horizon speed planner in the full truck on the same road:
//! fuel, trip time and brakes, what the plan of the whole trip promises, and the time of a tick.
//!
//! `cargo run --release -p sim --example speed_plan -- SCENARIO [KM] [--eco-roll] [--trace]`
#![allow(clippy::unwrap_used, missing_docs)]

use planner::SpeedPlannerKind;
use planner::pcc::model::profile_of;
use planner::pcc::{SpeedBand, TripRequest, Tuning, plan_trip};
use rustix::time::{ClockId, clock_gettime};
use sim::{Scenario, Status, World};
use tractrix_core::{Tick, Vehicle};

/// Marginal fuel of a joule at the wheels, g/J (0.0505 g/s per kW, 95 % driveline).
const FUEL_G_J: f64 = 5.3e-5;

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
}

fn main() {
    let mut args = std::env::args().skip(1);
    let name = args.next().unwrap_or_else(|| "test-site".into());
    let rest: Vec<String> = args.collect();
    let km: f64 = rest.iter().find_map(|a| a.parse().ok()).unwrap_or(1e3);
    let flag = |f: &str| rest.iter().any(|a| a == f);
    let mut cruise = Scenario::builtin(&name).unwrap();
    cruise.stack.speed_plan.eco_roll = flag("--eco-roll");
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
    // Seconds at the price of the whole trip's plan, kinetic energy at the fuel that makes it.
    let mass_kg = world.truck().limits().road_load.mass_kg;
    let energy_g = |v_m_s: f64| 0.5 * mass_kg * v_m_s * v_m_s * FUEL_G_J;
    let late_g = trip.beta_g_s * (p.time_s - b.time_s);
    let equal_g = p.fuel_g + late_g - energy_g(p.end_m_s) + energy_g(b.end_m_s);
    println!("saved at equal trip time and end speed: {:.2} %", 100.0 * (1.0 - equal_g / b.fuel_g));
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
