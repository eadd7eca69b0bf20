//! The figures of a truck file and the parameters of the replay are the same thing: a truck with a
//! cause written into its file is replayed like the truck without, off by the cause. Where that does
//! not hold, the extended truck is not the one that was fitted.

use std::collections::BTreeMap;

use dynamics::TruckParameters;

use super::*;
use crate::Channel as C;
use crate::causes::hypothesis::{CATALOGUE, Hypothesis};
use crate::problem::resolution;
use crate::{Cause, Drive, Parameter, extend};

/// Ten minutes of signals that reach every module: climbs at full load high up in the heat with hot
/// coolant, descents on stages of the engine brake, brakes that grow hot, curves, cold tyres.
fn signals(truck: &TruckParameters) -> Drive {
    let n = 10 * 60 * 20;
    let gear = truck.driveline.top_gear() - 1;
    let per_speed = truck.driveline.engine_speed_rad_s(1.0, gear) * tractrix_core::RPM_PER_RAD_S;
    // Where the engine runs well in that gear.
    let usual_m_s = 1_300.0 / per_speed;
    let wave = |i: usize, period_s: f64| {
        let turns = i as f64 * Drive::STEP_S / period_s;
        (2.0 * core::f64::consts::PI * turns).sin()
    };
    let climbs = |i: usize| wave(i, 150.0) > -0.2;
    let speed = |i: usize| usual_m_s * (1.0 + 0.15 * wave(i, 97.0));
    let mut drive = Drive::new("signals", 0.0, n);
    drive.reported_mass_kg = Some(truck.lateral.total_mass_kg().max(20_000.0));
    drive.tyres_warm_at_start = Some(false);
    let mut set = |c: C, f: &dyn Fn(usize) -> f64| drive.set(c, (0..n).map(f).collect());
    set(C::SpeedMS, &speed);
    set(C::GpsSpeedMS, &|i| speed(i) + 0.02 * wave(i, 3.0));
    set(C::SMapM, &|i| i as f64 * Drive::STEP_S * usual_m_s);
    set(C::EngineSpeedRpm, &|i| per_speed * speed(i));
    set(C::Gear, &|_| f64::from(gear));
    set(C::ShiftInProcess, &|i| if i % 1_000 < 20 { 1.0 } else { 0.0 });
    set(C::AcceleratorPedalFrac, &|i| if climbs(i) { 0.6 + 0.4 * wave(i, 11.0) } else { 0.0 });
    let percent = |i| if climbs(i) { 55.0 + 40.0 * wave(i, 11.0) } else { 0.0 };
    set(C::EngineTorquePercent, &percent);
    set(C::EngineBrakeFrac, &|i| if climbs(i) { 0.0 } else { 0.5 });
    let brakes = |i: usize| !climbs(i) && wave(i, 20.0) > 0.0;
    set(C::XbrDecelMS2, &|i| if brakes(i) { 0.8 } else { 0.0 });
    // Steps of a fine resolution, so that no rounding is left to the replay to mend.
    let pressure_kpa = |i: usize| 150.0 + 20.0 * wave(i, 1.7) + 2e-6 * (i % 2) as f64;
    set(C::BrakePressureKpa, &|i| if brakes(i) { pressure_kpa(i) } else { 0.0 });
    set(C::FuelRateGS, &|i| 0.3 + 0.12 * percent(i));
    set(C::Co2RateGS, &|i| 1.0 + 0.38 * percent(i));
    set(C::GradeFrac, &|i| if climbs(i) { 0.02 + 0.01 * wave(i, 40.0) } else { -0.04 });
    set(C::GpsAltitudeM, &|i| 2_200.0 + 50.0 * wave(i, 150.0));
    set(C::AmbientTempDegc, &|i| 38.0 + wave(i, 300.0));
    set(C::CoolantTempDegc, &|i| 96.0 + 8.0 * wave(i, 120.0));
    set(C::SteeringWheelRad, &|i| 0.4 * wave(i, 9.0));
    set(C::YawRateRadS, &|i| 0.05 * wave(i - i.min(4), 9.0));
    set(C::TrailerYawRateRadS, &|i| 0.05 * wave(i - i.min(12), 9.0));
    set(C::AccelYMS2, &|i| 0.9 * wave(i - i.min(4), 9.0));
    set(C::AccelXMS2, &|i| 0.2 + 0.1 * wave(i, 97.0));
    set(C::HeadingRad, &|i| 0.07 * wave(i, 18.0));
    drive
}

/// A truck with the drive made ready for it, and what is left without a cause.
struct Replayed {
    plant: Plant,
    drive: Prepared,
    plain: Residuals,
}

impl Replayed {
    fn of(drive: &Drive, truck: &TruckParameters) -> Self {
        let plant = Plant::of_truck(truck).unwrap();
        let drive = Prepared::new(drive, &plant);
        let plain = replayed(&drive, &plant, &[0.0; PARAMS]);
        Self { plant, drive, plain }
    }
}

fn replayed(drive: &Prepared, plant: &Plant, theta: &Theta) -> Residuals {
    let mut out = Residuals::default();
    GROUPS.iter().for_each(|g| replay_group(drive, plant, theta, *g, &mut out));
    out
}

/// A cause of a part of its prior spread, its shape off by as much; switches as the truck model has
/// them.
fn part(h: &Hypothesis, part: f64) -> (Theta, Cause) {
    let mut theta = [0.0; PARAMS];
    let mut parameters = BTreeMap::new();
    for p in h.params() {
        let s = p.spec();
        let x = match p {
            P::StiffnessFollows | P::StiffnessFollowsMass | P::FuelLowOver => 1.0,
            P::SteerDelay | P::PedalLag | P::RetarderSaturation => 0.0,
            _ => (part * s.prior).max(s.lo),
        };
        theta[p as usize] = x;
        let value = if s.key.ends_with("scale") { 1.0 + x } else { x };
        parameters.insert(s.key, Parameter { value, sigma: 0.0, unit: s.unit });
    }
    let cause = Cause {
        id: h.id,
        kind: h.kind(),
        sentence: String::new(),
        parameters,
        evidence: 0.0,
        probability: 1.0,
        confused_with: Vec::new(),
    };
    (theta, cause)
}

/// The largest difference of two replays in a module, over the resolution of its channel.
fn difference(d: [&Prepared; 2], a: &Residuals, b: &Residuals) -> f64 {
    let of = |m: Module| {
        let i = m as usize;
        assert_eq!(a[i].len(), b[i].len(), "{m:?}");
        let valid = d[0].valid[i].iter().zip(&d[1].valid[i]).map(|(x, y)| *x && *y);
        let rows = valid.zip(a[i].iter().zip(&b[i])).filter(|(ok, _)| *ok);
        rows.map(|(_, (x, y))| (x - y).abs()).fold(0.0, f64::max) / resolution(m)
    };
    Module::ALL.into_iter().map(of).fold(0.0, f64::max)
}

/// What a cause does and how far both ways of replaying it are apart; `None` where no figure of the
/// truck file carries it, or not so much of it.
fn both_ways(
    truck: &TruckParameters,
    drive: &Drive,
    own: &Replayed,
    (theta, cause): (Theta, Cause),
) -> Option<(f64, f64)> {
    let extension = extend(truck, &truck.name, "x", &[cause], "test");
    let overlay = extension.overlay?;
    if overlay.set.values().any(|v| v.source.contains("limited")) {
        return None;
    }
    let extended = truck.with_overlay(&overlay).unwrap();
    let extended = Replayed::of(drive, &extended);
    let off = replayed(&own.drive, &own.plant, &theta);
    let moved = difference([&own.drive; 2], &off, &own.plain);
    Some((moved, difference([&own.drive, &extended.drive], &off, &extended.plain)))
}

#[test]
fn a_cause_in_the_truck_file_is_replayed_as_the_cause() {
    let mut failures = Vec::new();
    for name in TruckParameters::names() {
        let truck = TruckParameters::load(name).unwrap();
        let drive = signals(&truck);
        let own = Replayed::of(&drive, &truck);
        for h in CATALOGUE {
            // A gain of the brakes stands for it.
            if h.sizes == [P::RetarderBrake] {
                continue;
            }
            let signs: &[f64] = if h.sign == 0.0 { &[1.0, -1.0] } else { &[1.0] };
            for sign in signs {
                let what = format!("{name}: {} {:?} {sign}", h.id, h.sizes);
                let parts = [0.5, 0.2, 0.05].map(|x| x * sign);
                match parts.iter().find_map(|x| both_ways(&truck, &drive, &own, part(h, *x))) {
                    Some((moved, apart)) if apart > 0.05 || moved < 1.0 && name == "reference" => {
                        failures.push(format!("{what}: moves {moved:.2e}, apart {apart:.2e}"));
                    }
                    // A demand map without lags and with losses of its own leaves no room for some.
                    None if name != "iits" => failures.push(format!("{what}: not carried")),
                    _ => {}
                }
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}
