//! The generic 40 t truck of VECTO in the plant against what VECTO declares for it. The tables and
//! cycles of its release (EUPL) are not part of this repository: the folder that holds
//! `fuel_map.csv` and `cycles/` is named in the environment variable `TRACTRIX_VECTO`.
#![expect(clippy::disallowed_macros, reason = "a skipped test says so")]

use crate::cycle;
use crate::declared;
use dynamics::TruckParameters;
use dynamics::effects::engine::Engine;
use tractrix_core::RPM_PER_RAD_S;

fn folder() -> Option<std::path::PathBuf> {
    let folder = std::env::var_os("TRACTRIX_VECTO").map(std::path::PathBuf::from);
    if folder.is_none() {
        println!("skipped: TRACTRIX_VECTO names no folder of the VECTO release");
    }
    folder
}

#[test]
fn the_plant_burns_what_vecto_declares_on_its_cycles_within_three_percent() {
    let Some(folder) = folder() else { return };
    for d in declared::DECLARED {
        let t = declared::drive(&folder, &d).unwrap();
        let off = t.g_km() / d.g_km - 1.0;
        assert!(off.abs() < 0.03, "{} {} kg: {} g/km, {off:+.4}", d.cycle, d.payload_kg, t.g_km());
        let speed = t.distance_m / t.time_s * 3.6 / d.speed_kmh - 1.0;
        assert!(speed.abs() < 0.01, "{} {} kg: mean speed {speed:+.4}", d.cycle, d.payload_kg);
        // and for the right reasons: work, overrun and brakes, as shares of the work
        for (ours, theirs) in [
            (t.engine_kwh, d.engine_kwh),
            (t.overrun_kwh, d.overrun_kwh),
            (t.brake_kwh, d.brake_kwh),
        ] {
            let off = (ours - theirs) / d.engine_kwh;
            assert!(off.abs() < 0.03, "{} {} kg: {ours} {theirs}", d.cycle, d.payload_kg);
        }
    }
}

#[test]
fn the_committed_fit_is_the_released_map_within_four_percent_where_trucks_drive() {
    let Some(folder) = folder() else { return };
    let fit = TruckParameters::load("vecto-40t").unwrap();
    let map = Engine::new(cycle::with_map_of(fit.clone(), &folder).unwrap().engine).unwrap();
    let fit = Engine::new(fit.engine).unwrap();
    for rpm in (800..1700).step_by(100).map(f64::from) {
        for brake_nm in (400..2200).step_by(100).map(f64::from) {
            let rad_s = rpm / RPM_PER_RAD_S;
            if brake_nm < fit.full_load_nm.at(rad_s) {
                let nm = brake_nm + fit.friction_nm(rad_s);
                let off = fit.fuel_rate_g_s(rad_s, nm) / map.fuel_rate_g_s(rad_s, nm) - 1.0;
                assert!(off.abs() < 0.04, "{rpm} rpm {brake_nm} Nm: {off}");
            }
        }
    }
}

/// A cycle that this file makes up: three kilometres at 60 km/h, a stop of 10 s, one kilometre. The
/// driver covers it in the time that its accelerations allow, and stops where the cycle says.
#[test]
fn a_driver_follows_targets_and_stops() {
    let folder = std::env::temp_dir().join(format!("tractrix-cycle-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("made_up.csv");
    let rows =
        "s_m,v_kmh,grade_pct,stop_s\n0,0,0,2\n5,60,0,0\n3000,0,0,10\n3005,60,0,0\n4000,0,0,2\n";
    std::fs::write(&path, rows).unwrap();
    let cycle = cycle::Cycle::read(&path).unwrap();
    let bad = folder.join("bad.csv");
    std::fs::write(&bad, "s_m,v_kmh,grade_pct\n0,fast,0\n").unwrap();
    let e = cycle::Cycle::read(&bad).err().unwrap().to_string();
    std::fs::remove_dir_all(&folder).unwrap();
    assert!(e.contains("bad.csv line 2"), "{e}");
    let truck = TruckParameters::load("vecto-40t").unwrap();
    let t = cycle::drive(truck, 19_300.0, &cycle).unwrap();
    assert!((t.distance_m - 4_000.0).abs() < 3.0, "{}", t.distance_m);
    // 4 km at 60 km/h take 240 s, two starts of 33.9 t some 20 s each, two stops 12 s each, 14 s wait
    assert!((290.0..330.0).contains(&t.time_s), "{}", t.time_s);
    assert!((t.fuel_g / t.engine_kwh - 195.0).abs() < 12.0);
    assert!(t.brake_kwh > 1.0, "two stops from 60 km/h: {}", t.brake_kwh);
}
