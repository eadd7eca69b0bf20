//! Plans against dynamic programming at equal trip time, on the corpus of roads, with two engines.
//!
//! The reference (`support/pcc/dp.rs`) shares no code with the planner. It solves Eq. 18 with the
//! map's jump at fuel cut-off charged (else the optimum on a flat road is full power and cut-off by
//! turns, a profile that no plan should ask for), so on rolling roads a plan may beat it.

use crate::pcc::{
    Audit, BANDS_KM_H, Engine, MASSES_KG, audited, corpus, descents, dp, planned, request, task,
    truck,
};
use planner::pcc::model::Drive;
use planner::pcc::trip::{Trip, TripRequest, TripStatus, plan_trip};
use road::ProfilePoint;
use tractrix_core::VehicleLimits;

/// One row of a campaign.
#[derive(Clone, Copy)]
struct Case<'a> {
    name: &'a str,
    profile: &'a [ProfilePoint],
    limits: &'a VehicleLimits,
    band_km_h: (f64, f64),
    /// Plan and reference may open the driveline.
    eco_roll: bool,
}

struct Row {
    fuel_g: f64,
    time_s: f64,
    shifts: usize,
    rolled_frac: f64,
    below_m_s: f64,
    reference: dp::Trip,
    ratio: f64,
}

impl Case<'_> {
    /// Plans, audits and compares.
    fn row(&self, r: dp::Resolution) -> Row {
        let Self { name, limits, band_km_h, .. } = *self;
        let request =
            TripRequest { eco_roll: self.eco_roll, ..request(self.profile, limits, band_km_h) };
        let trip = Trip::new(&request).unwrap();
        let (driven, beta) = planned(&trip);
        let may_roll = self.eco_roll.then(|| descents(&trip));
        let task = dp::Task { may_roll, ..task(&trip, limits) };
        let Audit { fuel_g, time_s, violation, below_m_s } = audited(&task, &driven);
        let mass = limits.road_load.mass_kg / 1e3;
        assert!((fuel_g / driven.total_fuel_g() - 1.0).abs() < 1e-6, "{name} {mass} t: {fuel_g} g");
        assert!((time_s / driven.trip_time_s() - 1.0).abs() < 1e-9, "{name} {mass} t: {time_s} s");
        assert!(violation < 2e-3, "{name} {mass} t {band_km_h:?}: violation {violation}");
        let goal = trip.cruise.trip_time_s();
        assert!(time_s < 1.002 * goal, "{name} {mass} t {band_km_h:?}: {time_s} s for {goal} s");
        let reference = dp::reference(&task, time_s, beta, r);
        let ratio = fuel_g / reference.fuel_at(time_s);
        let rolled = driven.drive.iter().filter(|d| **d == Drive::Neutral).count();
        let rolled_frac = rolled as f64 / driven.drive.len() as f64;
        Row { fuel_g, time_s, shifts: driven.shifts(), rolled_frac, below_m_s, reference, ratio }
    }
}

#[test]
fn plans_are_as_good_as_dynamic_programming_on_a_few_short_roads() {
    for (name, profile) in corpus::roads() {
        let (length_m, mass) = match name {
            "rolling4" => (4_000.0, 19_000.0),
            "hilly5" => (4_000.0, 55_000.0),
            "test_site" => (5_000.0, 55_000.0),
            _ => continue,
        };
        let start = profile[0].s_m;
        let profile: Vec<ProfilePoint> =
            profile.into_iter().take_while(|p| p.s_m <= start + length_m).collect();
        for engine in [Engine::Continuous, Engine::BenchMap] {
            let limits = truck(mass, engine);
            let (band_km_h, eco_roll) = (BANDS_KM_H[1], false);
            let case = Case { name, profile: &profile, limits: &limits, band_km_h, eco_roll };
            let r = case.row(dp::QUICK);
            assert!(r.below_m_s < 0.01, "{name} {mass}: {} m/s below the lowest", r.below_m_s);
            let bar = if r.reference.shifts == 0 { 1.003 } else { 1.01 };
            assert!(r.ratio < bar, "{name} {mass}: {:.5} of the reference", r.ratio);
            // The reference has to be one: a plan that beats it by more shows a weak reference.
            assert!(r.ratio > 0.98, "{name} {mass}: {:.5} of the reference", r.ratio);
        }
    }
}

/// The story: an interval's fuel was one parabola over all tractions, and on a map that bends at the
/// torques of its test bench a plan took 0.9 % more than the reference; with a kink at each plan's own
/// traction it was 0.31 % on this road.
#[test]
fn a_plan_on_a_measured_map_sits_on_its_bends_as_the_reference_does() {
    let (name, profile) = corpus::unseen().swap_remove(3);
    let limits = truck(19_000.0, Engine::Measured);
    let (band_km_h, eco_roll) = (BANDS_KM_H[1], false);
    let case = Case { name: &name, profile: &profile, limits: &limits, band_km_h, eco_roll };
    let ratio = case.row(dp::QUICK).ratio;
    assert!(ratio < 1.0025, "{ratio:.5} of the reference");
    assert!(ratio > 0.997, "{ratio:.5}: a weak reference");
}

const HEAD: &str = "| road | mass, t | band, km/h | plan, g | time, s | shifts | rolled, % | reference, g | its shifts | plan / reference |\n|---|---|---|---|---|---|---|---|---|---|";

/// Roads times masses times bands with one engine, as a table; the ratios in rising order and
/// the largest speed below the lowest one, m/s.
fn table(
    roads: &[(String, Vec<ProfilePoint>)],
    engine: Engine,
    bands_km_h: &[(f64, f64)],
    eco_roll: bool,
) -> (Vec<(f64, String)>, f64) {
    let (mut ratios, mut below_m_s) = (Vec::new(), 0.0_f64);
    println!("{HEAD}");
    for (name, profile) in roads {
        for mass in MASSES_KG {
            let limits = truck(mass, engine);
            for &band_km_h in bands_km_h {
                let r = Case { name, profile, limits: &limits, band_km_h, eco_roll }.row(dp::QUICK);
                println!(
                    "| {name} | {:.0} | {:.0}-{:.0} | {:.1} | {:.2} | {} | {:.0} | {:.1} | {} | {:.5} |",
                    mass / 1e3,
                    band_km_h.0,
                    band_km_h.1,
                    r.fuel_g,
                    r.time_s,
                    r.shifts,
                    100.0 * r.rolled_frac,
                    r.reference.fuel_at(r.time_s),
                    r.reference.shifts,
                    r.ratio
                );
                ratios.push((r.ratio, format!("{name} {mass} {band_km_h:?}")));
                below_m_s = below_m_s.max(r.below_m_s);
            }
        }
    }
    ratios.sort_by(|a, b| a.0.total_cmp(&b.0));
    let worst = &ratios[ratios.len() - 1];
    println!(
        "{engine:?}, eco-roll {eco_roll}: median {:.5}, worst {:.5} ({}), least {:.5}, at most {below_m_s:.3} m/s below the lowest speed",
        ratios[ratios.len() / 2].0,
        worst.0,
        worst.1,
        ratios[0].0
    );
    (ratios, below_m_s)
}

/// Every road, mass and band with one engine, held against the bars.
fn campaign(engine: Engine, eco_roll: bool, median_bar: f64, bar: f64) {
    let roads: Vec<_> = corpus::roads().into_iter().map(|(n, p)| (n.to_owned(), p)).collect();
    let (ratios, below_m_s) = table(&roads, engine, &BANDS_KM_H, eco_roll);
    assert!(below_m_s < 0.01, "{engine:?}: {below_m_s} m/s below the lowest speed");
    let (median, worst) = (ratios[ratios.len() / 2].0, &ratios[ratios.len() - 1]);
    assert!(median < median_bar, "{engine:?}: median {median:.5}");
    assert!(worst.0 < bar, "{engine:?}, {}: {:.5} of the reference", worst.1, worst.0);
}

#[test]
#[ignore = "campaign: cargo test --release -p planner --test all -- --ignored --nocapture willans"]
fn campaign_against_dynamic_programming_willans_line() {
    campaign(Engine::Willans, false, 1.0005, 1.003);
}

#[test]
#[ignore = "campaign: cargo test --release -p planner --test all -- --ignored --nocapture continuous"]
fn campaign_against_dynamic_programming_continuous_line() {
    campaign(Engine::Continuous, false, 1.0005, 1.003);
}

#[test]
#[ignore = "campaign: cargo test --release -p planner --test all -- --ignored --nocapture bench_map"]
fn campaign_against_dynamic_programming_bench_map() {
    campaign(Engine::BenchMap, false, 1.0005, 1.003);
}

#[test]
#[ignore = "campaign: cargo test --release -p planner --test all -- --ignored --nocapture longhaul_map"]
fn campaign_against_dynamic_programming_longhaul_map() {
    campaign(Engine::Longhaul, false, 1.0005, 1.003);
}

#[test]
#[ignore = "campaign: cargo test --release -p planner --test all -- --ignored --nocapture eco_roll"]
fn campaign_against_dynamic_programming_eco_roll() {
    campaign(Engine::Longhaul, true, 1.0025, 1.005);
}

#[test]
#[ignore = "campaign: cargo test --release -p planner --test all -- --ignored --nocapture nobody"]
fn campaign_on_roads_that_nobody_has_tuned_to_only_reports() {
    let roads = corpus::unseen();
    for engine in [Engine::Longhaul, Engine::Measured, Engine::MeasuredHull] {
        table(&roads, engine, &BANDS_KM_H[1..2], false);
    }
    table(&roads, Engine::Longhaul, &BANDS_KM_H[1..2], true);
}

/// A plan and its reference: fuel in the plan's time, g, and how much the wheel force changes from
/// interval to interval, kN.
struct Restless {
    fuel_g: [f64; 2],
    change_kn: [f64; 2],
    time_s: f64,
    beta_g_s: f64,
}

fn restless(profile: &[ProfilePoint], mass_kg: f64, engine: Engine) -> Restless {
    let limits = truck(mass_kg, engine);
    let trip = Trip::new(&request(profile, &limits, BANDS_KM_H[1])).unwrap();
    let (driven, beta) = planned(&trip);
    let task = task(&trip, &limits);
    let time_s = driven.trip_time_s();
    let found = dp::reference(&task, time_s, beta, dp::QUICK);
    let plant = dp::Plant::new(&task);
    let change_kn = |e: &[f64], gears: &[usize]| {
        let need = |k: usize| plant.exact_edge(k, gears[k], e[k], e[k + 1]).unwrap().need;
        let sum: f64 = (1..gears.len()).map(|k| (need(k) - need(k - 1)).abs()).sum();
        1e-3 * mass_kg * sum / gears.len() as f64
    };
    let of_plan = |drive: &Drive| match drive {
        Drive::Gear(g) => *g as usize,
        Drive::Neutral => dp::NEUTRAL,
    };
    let gears: Vec<usize> = driven.drive.iter().map(of_plan).collect();
    Restless {
        fuel_g: [driven.total_fuel_g(), found.fuel_at(time_s)],
        change_kn: [change_kn(&driven.e_j_kg, &gears), change_kn(&found.e, &found.gears)],
        time_s,
        beta_g_s: found.beta,
    }
}

#[test]
#[ignore = "campaign: cargo test --release -p planner --test all -- --ignored --nocapture dents"]
fn campaign_what_the_dents_of_the_measured_map_are_worth_only_reports() {
    println!(
        "| road | mass, t | plan / reference, map as read | its convex hull | reference as read / on the hull | change of force in 25 m as read, kN: plan | reference |"
    );
    println!("|---|---|---|---|---|---|---|");
    for (name, profile) in corpus::unseen() {
        for mass in MASSES_KG {
            let read = restless(&profile, mass, Engine::Measured);
            let hull = restless(&profile, mass, Engine::MeasuredHull);
            let hull_g = hull.fuel_g[1] + hull.beta_g_s * (hull.time_s - read.time_s);
            println!(
                "| {name} | {:.0} | {:.5} | {:.5} | {:.5} | {:.2} | {:.2} |",
                mass / 1e3,
                read.fuel_g[0] / read.fuel_g[1],
                hull.fuel_g[0] / hull.fuel_g[1],
                read.fuel_g[1] / hull_g,
                read.change_kn[0],
                read.change_kn[1],
            );
        }
    }
}

#[test]
#[ignore = "campaign: cargo test --release -p planner --test all -- --ignored --nocapture halving"]
fn campaign_halving_every_step_of_the_reference_changes_it_by_less_than_the_bar() {
    println!("| road | mass, t | coarse, g | half of every step, g | quarter, g |");
    println!("|---|---|---|---|---|");
    for (name, profile) in corpus::roads() {
        let mass = match name {
            "rolling4" => 19_000.0,
            "random25" | "hilly5" | "test_site" => 55_000.0,
            _ => continue,
        };
        let limits = truck(mass, Engine::Willans);
        let trip = Trip::new(&request(&profile, &limits, BANDS_KM_H[1])).unwrap();
        let (driven, beta) = planned(&trip);
        let task = task(&trip, &limits);
        let fuel = [dp::QUICK, dp::FINE, dp::FINEST].map(|r| {
            let found = dp::reference(&task, driven.trip_time_s(), beta, r);
            found.fuel_at(driven.trip_time_s())
        });
        println!(
            "| {name} | {:.0} | {:.1} | {:.1} | {:.1} |",
            mass / 1e3,
            fuel[0],
            fuel[1],
            fuel[2]
        );
        assert!((fuel[0] / fuel[2] - 1.0).abs() < 1e-3, "{name}: {fuel:?}");
    }
}

#[test]
fn a_flat_road_gives_exactly_constant_speed() {
    let (_, profile) = corpus::roads().swap_remove(0);
    for mass in MASSES_KG {
        for engine in [Engine::Willans, Engine::Continuous, Engine::BenchMap] {
            let limits = truck(mass, engine);
            let result = plan_trip(&request(&profile, &limits, BANDS_KM_H[1])).unwrap();
            assert_eq!(result.status, TripStatus::Solved);
            for row in &result.rows {
                assert!((row.v_m_s - 20.0).abs() < 1e-9, "{mass} at {}: {}", row.s_m, row.v_m_s);
            }
        }
    }
}

#[test]
fn a_wider_band_never_costs_fuel() {
    for (name, profile) in corpus::roads() {
        for mass in MASSES_KG {
            let limits = truck(mass, Engine::Willans);
            let fuel = BANDS_KM_H.map(|speeds| {
                let trip = Trip::new(&request(&profile, &limits, speeds)).unwrap();
                planned(&trip).0.total_fuel_g()
            });
            for w in fuel.windows(2) {
                assert!(w[1] <= w[0] * (1.0 + 2e-4), "{name} {mass}: {fuel:?}");
            }
        }
    }
}
