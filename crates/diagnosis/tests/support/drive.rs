//! One drive: a driver in the loop of the generator's truck on a drawn road, and its log.

use diagnosis::Drive;
use rand_chacha::ChaCha8Rng;

use super::bodies::{Bodies, State};
use super::driver::{Driver, View};
use super::effects::{self, Acting, Effect, Memory, Now};
use super::engine::Drivetrain;
use super::logger::{Exhaust, LOGGED, log, smooth};
use super::outside;
use super::random::{between, normal};
use super::road::Road;
use super::sheet::{Figures, G, RADIUS_M, RPM, engine_brake, friction};

/// Step of the simulation, s; every fifth is logged.
const STEP_S: f64 = 0.01;

/// Where, when and with what a drive goes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Setting {
    pub(crate) payload_kg: f64,
    pub(crate) altitude_m: f64,
    pub(crate) air_degc: f64,
    pub(crate) hills: f64,
    pub(crate) climb: f64,
    pub(crate) cruise: f64,
    pub(crate) engine_brake: f64,
    pub(crate) warm: bool,
}

/// The truck of this drive, within tolerances of `scale` (1: usual).
fn tolerances(scale: f64, rng: &mut ChaCha8Rng) -> Figures {
    let mut n = |sigma: f64| scale * sigma * normal(rng);
    let mut f = Figures::SHEET;
    f.rolling *= 1.0 + n(0.015);
    f.drag_area *= 1.0 + n(0.012);
    f.efficiency *= 1.0 + n(0.002);
    f.friction_scale *= 1.0 + n(0.02);
    f.auxiliary_w += n(400.0);
    f.boost_lag_s *= 1.0 + n(0.02);
    f.pedal_delay_s = (f.pedal_delay_s + n(0.003)).max(0.0);
    f.brake_scale *= 1.0 + n(0.015);
    f.brake_delay_s += n(0.004);
    f.engine_brake_scale *= 1.0 + n(0.015);
    f.fuel_scale *= 1.0 + n(0.005);
    f.mass_scale *= 1.0 + n(0.004);
    f.stiffness = [1.0 + n(0.01), 1.0 + n(0.01), 1.0 + n(0.01)];
    f.payload_rearward_m = n(0.03);
    f.steer_ratio *= 1.0 + n(0.003);
    f.steer_offset_rad = n(0.004);
    f.bank_rad = n(2.5e-4);
    f.headwind = n(0.2);
    f.crosswind = n(0.3);
    f.wind = [n(0.5), n(0.5)];
    f.grade_bias = n(1e-4);
    f.map_shift_m = n(2.5);
    f.speed_scale *= 1.0 + n(0.001);
    f.yaw_bias = n(2.5e-4);
    f.trailer_yaw_bias = n(2.5e-4);
    f.accel_bias = [n(0.02), n(0.02)];
    f
}

/// Drives and logs; returns the drive as a logger has it.
pub(crate) fn drive(
    name: &str,
    hidden: &[Effect],
    setting: &Setting,
    duration_s: f64,
    tolerance: f64,
    rng: &mut ChaCha8Rng,
) -> Drive {
    let mut f = tolerances(tolerance, rng);
    effects::apply(&mut f, hidden);
    let sheet_kg = 19_000.0 + setting.payload_kg;
    let mass = sheet_kg * f.mass_scale;
    let bodies = Bodies::new(mass, setting.payload_kg, &f);
    let [tractor_kg, trailer_kg] = bodies.masses();
    let road =
        Road::draw(rng, 26.0 * duration_s + 2000.0, setting.hills, setting.climb, setting.cruise);
    let mut driver = Driver::new(setting.engine_brake, rng);
    let mut train = Drivetrain::new(rng);
    let samples = (duration_s / Drive::STEP_S) as usize;
    let mut truth: Vec<Vec<f64>> = (0..LOGGED).map(|_| Vec::with_capacity(samples)).collect();
    let matched = smooth(samples, 3.0, 1.0, rng);
    let mut exhaust = Exhaust::new(1.2, 1.0, tolerance, rng);
    let (mut v, mut place, mut altitude) = (0.5_f64, 0.0_f64, setting.altitude_m);
    let mut heading = between(rng, -3.0, 3.0);
    let (begun, mut course) = (heading, heading);
    let mut lateral: State = [0.0; 4];
    let (mut gear_rad, mut delta, mut offset) = (0.0_f64, 0.0_f64, 0.0_f64);
    let (mut pressure, mut brake_k, mut coolant) = (0.0_f64, 0.0_f64, 80.0_f64);
    let (mut pedals, mut demands, mut wheels) = (Delay::new(), Delay::new(), Delay::new());
    let mut pedal = 0.0;
    let mut memory = Memory::default();
    for i in 0..samples * 5 {
        let time_s = i as f64 * STEP_S;
        let (grade, curvature) = (road.grade(place), road.curvature(place));
        let slope = 1.0 / (1.0 + grade * grade).sqrt();
        let air_degc = setting.air_degc - 0.0065 * (altitude - setting.altitude_m);
        let air_pa = 101_325.0 * (1.0 - 2.255_77e-5 * altitude).powf(5.2559);
        let density = air_pa / (287.05 * (air_degc + 273.15));
        let view = View { place, v, climb_n: grade * mass * G, aside: heading - course, offset };
        driver.act(&road, &view, rng, STEP_S);
        let now = Now {
            time_s,
            place_m: place,
            speed: v,
            rpm: train.rpm,
            indicated_nm: train.indicated_nm,
            pedal: driver.pedal,
            stage: driver.stage,
            xbr: driver.xbr,
            coolant_degc: coolant,
            ambient_degc: air_degc,
            altitude_m: altitude,
            curvature,
            service_n: 400.0 * pressure,
            brake_k,
            mass_kg: mass,
            gear: train.gear,
            warm: setting.warm,
        };
        let mut a = Acting::NOTHING;
        for e in hidden {
            match e {
                Effect::Cause { id, size, shape } => {
                    effects::act(&mut a, &mut memory, (id, *size, shape), &now, STEP_S);
                }
                Effect::Outside { kind, size, shape } => {
                    outside::act(&mut a, &mut memory, (*kind, *size, shape), &now, rng, STEP_S);
                }
                // Acts in drives of its own family.
                Effect::SecondOutside { .. } => {}
            }
        }
        // Engine and gearbox.
        let late = pedals.put(driver.pedal, f.pedal_delay_s);
        pedal += (late - pedal) * (1.0 - (-STEP_S / f.pedal_lag_s.max(1e-6)).exp());
        let slowing = driver.stage > 0.0 || driver.xbr > 0.0;
        train.turn(v, driver.pedal, slowing, f.shift_extra_s + a.shift_s, rng, STEP_S);
        train.fuel_up(&f, pedal, a.derate, a.demand, STEP_S);
        let turning = train.rpm / RPM;
        let net = train.indicated_nm
            - friction(train.rpm) * f.friction_scale
            - f.auxiliary_w / turning
            - a.crank_nm
            - driver.stage * engine_brake(train.rpm) * f.engine_brake_scale;
        let passed = net * train.closed();
        let efficiency = f.efficiency * if train.gear == 12 { 1.0 } else { 1.0 - f.mesh_loss };
        let drive_n =
            passed * train.per_m() * if passed > 0.0 { efficiency } else { 1.0 / efficiency };
        // Brakes.
        let demand = demands.put(driver.xbr, f.brake_delay_s) * sheet_kg / 400.0 * a.pressure[0]
            + if driver.xbr > 0.0 { a.pressure[1] } else { 0.0 };
        let step = (demand - pressure) * (1.0 - (-STEP_S / 0.15_f64).exp());
        pressure = (pressure + step.clamp(-1000.0 * STEP_S, 500.0 * STEP_S)).max(0.0);
        let service_n = 400.0 * pressure * f.brake_scale * a.friction;
        brake_k += STEP_S * (service_n * v / 200e3 - brake_k / 600.0);
        // Air.
        let weather = (time_s / 70.0 + begun).sin();
        let (sin, cos) = (heading - f.wind_turns_rad * weather).sin_cos();
        let along = v + f.headwind - f.wind[0] * cos - f.wind[1] * sin;
        let across =
            f.crosswind * (1.0 + f.crosswind_swells * weather) + f.wind[1] * cos - f.wind[0] * sin;
        let yaw_deg = (across / along.abs().max(1.0)).atan().to_degrees();
        let stream = along.hypot(across);
        let drag = 0.5 * density * f.drag_area * (1.0 + 0.018 * yaw_deg.abs()) * stream * along;
        let blown = 0.5 * density * stream * stream * 0.7 * yaw_deg;
        // Along the road.
        let rotating = 288.0
            + if train.closed() > 0.0 { 3.5 * (train.per_m() * RADIUS_M).powi(2) } else { 0.0 };
        let resistance = mass * G * slope * (grade + if v > 0.05 { f.rolling } else { 0.0 });
        let acceleration = (drive_n - drag - resistance - service_n - f.drag_force_n - a.force_n)
            / (mass + rotating / (RADIUS_M * RADIUS_M));
        // Across the road.
        let half = 0.5 * f.free_play_rad;
        let wheel = wheels.put(driver.wheel, f.steer_delay_s);
        gear_rad = gear_rad.clamp(wheel - half, wheel + half);
        let target = (gear_rad - f.steer_offset_rad) / f.steer_ratio;
        delta += (target - delta) * (1.0 - (-STEP_S / f.steer_lag_s.max(0.01)).exp());
        let rolled = v.max(3.0);
        let force = [
            f.side_share * blown + a.side_n[0] - tractor_kg * G * f.bank_rad,
            (1.0 - f.side_share) * blown + a.side_n[1] - trailer_kg * G * f.bank_rad,
            (1.0 - f.side_share) * blown * f.side_behind_m,
        ];
        if i % 5 == 0 {
            let fuel =
                (0.05 + 0.000_12 * train.rpm + 0.0505 * train.indicated_nm * train.rpm / 9549.3)
                    * f.fuel_scale
                    * a.fuel;
            exhaust.burn(fuel, a.meters[1]);
            let side = bodies.rate(&lateral, rolled, delta, force)[0] + rolled * lateral[1];
            let seen = place + matched[i / 5];
            let row = [
                seen,
                v * f.speed_scale,
                v * a.gps[0] + a.gps[1],
                altitude,
                course,
                acceleration + G * grade * slope + f.accel_bias[0],
                driver.pedal,
                train.indicated_nm / 27.0,
                train.rpm,
                train.gear as f64,
                f64::from(u8::from(train.shifting())),
                driver.stage,
                driver.xbr,
                pressure,
                driver.wheel,
                (lateral[1] + f.yaw_bias) * a.yaw[0] + a.yaw[1],
                (lateral[2] + f.trailer_yaw_bias) * a.trailer_yaw[0] + a.trailer_yaw[1],
                (side + G * f.bank_rad) * a.accel_y[0] + a.accel_y[1] + f.accel_bias[1],
                fuel * a.meters[0],
                coolant,
                air_degc,
                air_pa,
                road.grade(seen + f.map_shift_m) + f.grade_bias,
                road.curvature(seen + f.map_shift_m),
            ];
            for (column, x) in truth.iter_mut().zip(row) {
                column.push(x);
            }
        }
        lateral = bodies.step(&lateral, rolled, delta, force, STEP_S);
        heading += STEP_S * lateral[1];
        course += STEP_S * v * curvature;
        offset += STEP_S * (v * (heading - course) + lateral[0] - 1.55 * lateral[1]);
        v = (v + STEP_S * acceleration).max(0.3);
        place += STEP_S * v;
        altitude += STEP_S * v * grade * slope;
        coolant = warmed(coolant, air_degc, &train, v, STEP_S);
    }
    let mut out = Drive::new(name, 0.0, samples);
    out.reported_mass_kg = Some((sheet_kg * 10.0).round() / 10.0);
    out.tyres_warm_at_start = Some(setting.warm);
    exhaust.log(&mut out);
    log(&mut out, &truth, rng);
    out
}

/// Coolant heated by the engine, cooled over a thermostat.
fn warmed(coolant: f64, air_degc: f64, train: &Drivetrain, v: f64, dt: f64) -> f64 {
    let heat = 8e3 + 0.42 * train.indicated_nm * train.rpm / 9.5493;
    let open = ((coolant - 82.0) / 12.0).clamp(0.03, 1.0);
    let away = open * (1150.0 + 42.0 * v) * (coolant - air_degc);
    coolant + dt * (heat - away) / 240e3
}

/// A delay line at the simulation's step.
struct Delay {
    past: [f64; 256],
    next: usize,
}

impl Delay {
    fn new() -> Self {
        Self { past: [0.0; 256], next: 0 }
    }

    /// Takes the newest value and returns that of `delay_s` ago.
    fn put(&mut self, x: f64, delay_s: f64) -> f64 {
        self.past[self.next] = x;
        let back = (delay_s / STEP_S).clamp(0.0, 250.0);
        let (whole, part) = (back as usize, back.fract());
        let at = |k: usize| self.past[(self.next + 512 - k) % 256];
        let y = (1.0 - part) * at(whole) + part * at(whole + 1);
        self.next = (self.next + 1) % 256;
        y
    }
}
