//! One drive of the second family, and its log.

use std::collections::VecDeque;

use diagnosis::Drive;
use rand_chacha::ChaCha8Rng;

use super::super::Campaign;
use super::super::effects::Effect;
use super::super::logger::{Exhaust, LOGGED, log};
use super::super::random::between;
use super::super::sheet::{G, RADIUS_M, engine_brake};

use super::braking::Brakes;
use super::chassis::{Chassis, Push};
use super::driver::{Driver, Sight};
use super::engine::Engine;
use super::faults::{Faults, Moment};
use super::gearbox::Gearbox;
use super::instruments::Instruments;
use super::meters::Meters;
use super::outside::{self, Memory, Outcome};
use super::resistance::Ground;
use super::road::Route;
use super::steering::Steering;
use super::wind::Air;
use super::{Trip, tolerances};

/// Step of the simulation, s; every fifth is logged.
const STEP_S: f64 = 0.01;
const EVERY: usize = 5;

/// Values of the last two and a half seconds.
struct Late(VecDeque<f64>);

impl Late {
    fn new() -> Self {
        Self(VecDeque::from(vec![0.0; 256]))
    }

    /// Takes the newest value and returns that of `delay_s` ago.
    fn put(&mut self, x: f64, delay_s: f64) -> f64 {
        self.0.pop_back();
        self.0.push_front(x);
        let back = (delay_s / STEP_S).clamp(0.0, 250.0);
        let (whole, part) = (back as usize, back.fract());
        self.0[whole] + part * (self.0[whole + 1] - self.0[whole])
    }
}

/// Drives and logs.
pub(crate) fn drive(
    name: &str,
    hidden: &[Effect],
    trip: &Trip,
    campaign: &Campaign,
    rng: &mut ChaCha8Rng,
) -> Drive {
    let faults = Faults::of(hidden);
    let f = tolerances::draw(campaign.tolerance, rng);
    let sheet_kg = 19_000.0 + trip.payload_kg;
    let mass = sheet_kg * f.mass_scale * (1.0 + faults.size("mass"));
    let route = Route::draw(trip, 26.0 * campaign.duration_s + 3000.0, rng);
    let mut driver = Driver::new(trip, rng);
    let mut gearbox = Gearbox::new(&faults, rng);
    let mut engine = Engine::new(&faults, rng);
    let mut brakes = Brakes::new(&faults);
    let mut steering = Steering::new(&faults, rng);
    let mut ground = Ground::new(&faults, trip.warm, rng);
    let mut air = Air::new(&f, &faults, rng);
    let mut instruments = Instruments::new(&faults, rng);
    let mut meters = Meters::new(&faults);
    let mut exhaust = Exhaust::new(1.8, 0.6, campaign.tolerance, rng);
    let mut chassis = Chassis::new(mass, trip.payload_kg, &f, &faults);
    let (tractor_kg, trailer_kg, trailer_cg) = chassis.bodies();
    let pedal_fault = faults.get("pedal_delay");
    let driveline = faults.get("driveline_loss");
    let mut memory = Memory::default();
    let (mut feet, mut demands) = (Late::new(), Late::new());
    let mut foot = 0.0;
    let samples = (campaign.duration_s / Drive::STEP_S) as usize;
    let mut truth: Vec<Vec<f64>> = (0..LOGGED).map(|_| Vec::with_capacity(samples)).collect();
    let (mut v, mut place, mut altitude) = (1.0_f64, 0.0_f64, trip.altitude_m);
    let mut heading = between(rng, -3.0, 3.0);
    let (mut course, mut offset) = (heading, 0.0_f64);
    for i in 0..samples * EVERY {
        let (grade, curvature) = (route.grade(place), route.curvature(place));
        let slope = 1.0 / (1.0 + grade * grade).sqrt();
        let air_degc = trip.air_degc - 0.0065 * (altitude - trip.altitude_m);
        let air_pa = 101_325.0 * (1.0 - 2.255_77e-5 * altitude).powf(5.2559);
        let density = air_pa / (287.05 * (air_degc + 273.15));
        let time_s = i as f64 * STEP_S;
        let sight = Sight {
            time_s,
            place_m: place,
            v,
            mass_kg: mass,
            grade,
            aside: heading - course,
            offset,
        };
        driver.act(&route, &sight, rng, STEP_S);
        let now = Moment {
            place_m: place,
            speed: v,
            grade,
            rpm: gearbox.rpm,
            torque_nm: engine.torque_nm,
            gear: gearbox.gear,
            pedal: driver.pedal,
            stage: driver.stage,
            xbr: driver.xbr,
            yaw_rate: chassis.yaw()[0],
            air_degc,
            altitude_m: altitude,
            mass_kg: mass,
        };
        let mut o = Outcome::NOTHING;
        for e in hidden {
            if let Effect::SecondOutside { kind, size, shape } = e {
                outside::act(&mut o, &mut memory, (*kind, *size, shape), &now, STEP_S);
            }
        }
        // Along the road.
        let mut asked = feet.put(
            driver.pedal,
            f.pedal_delay_s + pedal_fault.map_or(0.0, |(x, s)| x * s.at(0, 0.5, 1.0)),
        );
        if let Some((x, shape)) = pedal_fault {
            super::colour::towards(&mut foot, asked, STEP_S, x * (1.0 - shape.at(0, 0.5, 1.0)));
            asked = foot;
        }
        gearbox.turn(&now, o.shift_s, rng, STEP_S);
        let now = Moment { rpm: gearbox.rpm, gear: gearbox.gear, ..now };
        engine.burn(&f, asked, gearbox.closed(), o.torque, &now, STEP_S);
        let tired =
            now.stage * engine_brake(now.rpm) * f.engine_brake_scale * (1.0 - o.engine_brake);
        let net = (engine.torque_nm - engine.losses(&f, &now, STEP_S) + tired) * gearbox.closed();
        // Gears in mesh lose more than the direct one.
        let lost = driveline.map_or(0.0, |(x, shape)| {
            x * if now.gear == 12 {
                1.0 - shape.at(0, 0.0, 0.2)
            } else {
                1.0 + shape.at(0, 0.0, 0.5)
            }
        });
        let efficiency = f.efficiency * (1.0 - lost);
        let pull = net * gearbox.per_m() * if net > 0.0 { efficiency } else { 1.0 / efficiency };
        let late = demands.put(driver.xbr, brakes.dead_s(&f));
        let service = brakes.act(&f, (late, sheet_kg), (o.pressure, o.friction), &now, STEP_S);
        let retarder = brakes.retard(&now, STEP_S);
        let blow = air.act(&f, (v, heading, density), rng, STEP_S);
        let held = ground.act(&f, &now, rng, STEP_S);
        let turning = if gearbox.closed() > 0.0 { 3.5 * gearbox.per_m().powi(2) } else { 0.0 };
        let inertia = mass + 288.0 / (RADIUS_M * RADIUS_M) + turning;
        let against =
            blow.drag_n + held + mass * G * slope * grade + service + retarder + o.force_n;
        let acceleration = (pull - against) / inertia;
        // Across the road.
        let delta = steering.turn(&f, driver.wheel, rng, STEP_S);
        let bank = instruments.bank(&f);
        let pushes = [
            blow.pushes[0],
            blow.pushes[1],
            Push::Tractor { force_n: -tractor_kg * G * bank, behind_m: 0.0 },
            Push::Trailer { force_n: -trailer_kg * G * bank, behind_m: trailer_cg },
        ];
        let side = chassis.step(v.max(4.0), delta, o.stiffness, &pushes, STEP_S);
        let [yaw, trailer_yaw] = chassis.yaw();
        instruments.go(v * STEP_S, rng, STEP_S);
        let percent = engine.reported(rng, STEP_S);
        if i % EVERY == 0 {
            let fuel = engine.fuel(&f, gearbox.rpm) * o.fuel;
            let [fuel_seen, carbon_seen] = meters.act(fuel, engine.coolant_degc);
            exhaust.burn(fuel, carbon_seen);
            let [seen, map_grade, map_curvature] = instruments.seen(&f, &route, place);
            let row = [
                seen,
                instruments.speed(&f, v),
                v,
                altitude,
                course,
                acceleration + G * grade * slope + f.accel_bias[0],
                driver.pedal,
                percent,
                gearbox.rpm,
                gearbox.gear as f64,
                f64::from(u8::from(gearbox.shifting())),
                driver.stage,
                driver.xbr,
                brakes.pressure_kpa,
                driver.wheel,
                (yaw + instruments.yaw_bias(&f)) * o.yaw,
                trailer_yaw + f.trailer_yaw_bias,
                side + G * bank + f.accel_bias[1],
                fuel * fuel_seen,
                engine.coolant_degc,
                air_degc,
                air_pa,
                map_grade,
                map_curvature,
            ];
            for (column, x) in truth.iter_mut().zip(row) {
                column.push(x);
            }
        }
        heading += STEP_S * yaw;
        course += STEP_S * v * curvature;
        offset += STEP_S * (v * (heading - course) + chassis.slip() - 1.55 * yaw);
        v = (v + STEP_S * acceleration).max(0.3);
        place += STEP_S * v;
        altitude += STEP_S * v * grade * slope;
        engine.warm(&now, STEP_S);
    }
    let mut out = Drive::new(name, 0.0, samples);
    out.reported_mass_kg = Some((sheet_kg * 10.0).round() / 10.0);
    out.tyres_warm_at_start = Some(trip.warm);
    exhaust.log(&mut out);
    log(&mut out, &truth, rng);
    out
}
