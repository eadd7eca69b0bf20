//! The engine of a data sheet: full load from its corners, the rest of an engine of the same form
//! scaled by displacement (mean pressures of one generation of engines are alike; Heywood, Internal
//! Combustion Engine Fundamentals, 2.7).

use tractrix_core::RPM_PER_RAD_S;

use super::Engine;
use super::figures::Figures;
use crate::bounds::Bounds;
use crate::effects::engine::EngineParameters;
use crate::{DynamicsError, TruckParameters};

/// Largest torque per displacement of present long-haul engines, Nm/l (mean pressure of 23 bar).
const TORQUE_PER_DISPLACEMENT_NM_L: f64 = 183.0;
/// Displacement of the built-in trucks' engines, l.
const BASE_DISPLACEMENT_L: f64 = 12.7;
/// Torque at idle over the largest.
const IDLE_TORQUE_FRAC: f64 = 0.5;
/// Where the largest torque is usually there, rpm.
const MAX_TORQUE_RPM: [f64; 2] = [1_000.0, 1_400.0];
/// Rated speed where a sheet does not say it, rpm, and how far the governor ends above it.
const RATED_RPM: f64 = 1_700.0;
const GOVERNOR_RPM: f64 = 300.0;
const IDLE_RPM: f64 = 600.0;
/// Speed at which an engine brake's power is usually stated, rpm.
const ENGINE_BRAKE_RPM: f64 = 2_100.0;
/// Full load may not exceed the largest torque by more than rounding.
const ROUNDING: f64 = 1.02;

impl Engine {
    pub(super) fn violations(&self, out: &mut Vec<String>) {
        let mut b = Bounds::of("engine");
        match (&self.full_load_speed_rpm, &self.full_load_torque_nm) {
            (Some(speed), Some(torque)) => b.curve("full_load_torque_nm", speed, torque),
            (None, None) => self.check_corners(&mut b),
            _ => b.require(
                false,
                "full_load_speed_rpm and full_load_torque_nm belong together".into(),
            ),
        }
        for (key, value, low, high) in [
            ("displacement_l", self.displacement_l, 2.0, 30.0),
            ("idle_speed_rpm", self.idle_speed_rpm, 300.0, 1_000.0),
            ("max_speed_rpm", self.max_speed_rpm, 1_200.0, 6_000.0),
            ("engine_brake_power_kw", self.engine_brake_power_kw, 10.0, 1_000.0),
            ("engine_brake_speed_rpm", self.engine_brake_speed_rpm, 1_000.0, 4_000.0),
        ] {
            if let Some(value) = value {
                b.within(key, value, low, high);
            }
        }
        out.append(&mut b.violations);
    }

    fn check_corners(&self, b: &mut Bounds) {
        let missing = |value: Option<f64>, b: &mut Bounds, key: &str| {
            b.require(value.is_some(), format!("{key} is missing, or full_load_speed_rpm"));
        };
        missing(self.rated_power_kw, b, "rated_power_kw");
        missing(self.max_torque_nm, b, "max_torque_nm");
        b.within("rated_power_kw", self.rated_power_kw.unwrap_or(300.0), 50.0, 1_000.0);
        b.within("max_torque_nm", self.max_torque_nm.unwrap_or(2_000.0), 300.0, 5_000.0);
        let (idle, rated) = (self.idle_rpm(), self.rated_rpm());
        let [from, to] = self.max_torque_rpm();
        b.require(idle < from && from < to && to < rated && rated < self.max_rpm(), {
            format!(
                "speeds must rise: idle {idle}, largest torque from {from} to {to}, rated {rated}, \
                 governed {} rpm",
                self.max_rpm()
            )
        });
        if let (Some(kw), Some(nm)) = (self.rated_power_kw, self.max_torque_nm) {
            let rated_nm = 1e3 * kw / rated * RPM_PER_RAD_S;
            b.require(
                rated_nm <= ROUNDING * nm,
                format!("rated_power_kw = {kw} at {rated} rpm are {rated_nm:.0} Nm, more than max_torque_nm = {nm}"),
            );
        }
    }

    fn rated_rpm(&self) -> f64 {
        self.rated_speed_rpm.unwrap_or(RATED_RPM)
    }

    fn idle_rpm(&self) -> f64 {
        self.idle_speed_rpm.unwrap_or(IDLE_RPM)
    }

    fn max_rpm(&self) -> f64 {
        let curve = self.full_load_speed_rpm.as_ref().and_then(|c| c.last().copied());
        let governed = curve.unwrap_or(self.rated_rpm() + GOVERNOR_RPM);
        self.max_speed_rpm.unwrap_or(governed)
    }

    fn max_torque_rpm(&self) -> [f64; 2] {
        let [from, to] = MAX_TORQUE_RPM;
        let to = self.max_torque_to_rpm.unwrap_or(to.min(self.rated_rpm() - 100.0));
        [self.max_torque_from_rpm.unwrap_or(from), to]
    }

    fn max_torque_nm(&self) -> f64 {
        let curve = self.full_load_torque_nm.iter().flatten().copied().fold(0.0, f64::max);
        if curve > 0.0 { curve } else { self.max_torque_nm.unwrap_or(0.0) }
    }

    /// Full load over its corners, rpm and Nm.
    fn corners(&self) -> (Vec<f64>, Vec<f64>) {
        let (top, rated) = (self.max_torque_nm(), self.rated_rpm());
        let rated_nm = 1e3 * self.rated_power_kw.unwrap_or(0.0) / rated * RPM_PER_RAD_S;
        let [from, to] = self.max_torque_rpm();
        (
            vec![self.idle_rpm(), from, to, rated, self.max_rpm()],
            vec![IDLE_TORQUE_FRAC * top, top, top, rated_nm.min(top), 0.0],
        )
    }

    /// Puts the engine into a truck under way.
    pub(super) fn put(&self, figures: &mut Figures<'_>) -> Result<(), DynamicsError> {
        let like = format!("as truck {}, by displacement", figures.truck.name);
        match (&self.full_load_speed_rpm, &self.full_load_torque_nm) {
            (Some(speed), Some(torque)) => {
                let engine = &mut figures.truck.engine;
                engine.full_load_speed_rpm.clone_from(speed);
                engine.full_load_torque_nm.clone_from(torque);
                figures.listed("engine.full_load_torque_nm");
            }
            _ => {
                let (speed, torque) = self.corners();
                let engine = &mut figures.truck.engine;
                (engine.full_load_speed_rpm, engine.full_load_torque_nm) = (speed, torque);
                figures.listed("engine.full_load_torque_nm");
            }
        }
        figures.truck.engine.idle_speed_rpm = self.idle_rpm();
        figures.truck.engine.max_speed_rpm = self.max_rpm();
        figures.answer("engine.idle_speed_rpm", self.idle_speed_rpm, 0.07, "usual")?;
        figures.answer(
            "engine.max_speed_rpm",
            self.max_speed_rpm,
            0.05,
            "rated speed and 300 rpm",
        )?;
        let displacement_l =
            self.displacement_l.unwrap_or(self.max_torque_nm() / TORQUE_PER_DISPLACEMENT_NM_L);
        scale(&mut figures.truck, displacement_l / BASE_DISPLACEMENT_L);
        for (path, sigma_frac) in [
            ("engine.friction_constant_nm", 0.4),
            ("engine.friction_per_rpm_nm", 0.25),
            ("engine.inertia_kg_m2", 0.3),
            ("engine.slow_lag_s", 0.5),
            ("engine.auxiliary_power_w", 0.4),
        ] {
            figures.estimated(path, sigma_frac, &like);
        }
        // what the largest indicated torque is, with some room, as makers round it
        let engine = &figures.truck.engine;
        let friction_nm = engine.friction_constant_nm + 1_200.0 * engine.friction_per_rpm_nm;
        let reference_nm = ((self.max_torque_nm() + friction_nm) / 50.0).ceil() * 50.0;
        figures.set("engine.reference_torque_nm", reference_nm)?;
        let source = "largest torque and friction; message EC1 of the engine says it (SPN 544)";
        let reference = "engine.reference_torque_nm";
        figures.answer(reference, self.reference_torque_nm, 0.04, source)?;
        self.put_engine_brake(figures, &like)
    }

    fn put_engine_brake(&self, figures: &mut Figures<'_>, like: &str) -> Result<(), DynamicsError> {
        let e = &figures.truck.engine;
        if let Some(kw) = self.engine_brake_power_kw {
            let rpm = self.engine_brake_speed_rpm.unwrap_or(ENGINE_BRAKE_RPM);
            // a stated power is that of the engine without fuel, friction in it
            let friction_nm = e.friction_constant_nm + e.friction_per_rpm_nm * rpm;
            let wanted_nm = (1e3 * kw / rpm * RPM_PER_RAD_S - friction_nm).max(0.0);
            let has_nm = e.engine_brake_constant_nm + e.engine_brake_per_rpm_nm * rpm;
            let factor = wanted_nm / has_nm.max(1.0);
            let (constant, per_rpm) =
                (factor * e.engine_brake_constant_nm, factor * e.engine_brake_per_rpm_nm);
            figures.said("engine.engine_brake_constant_nm", constant)?;
            figures.said("engine.engine_brake_per_rpm_nm", per_rpm)
        } else {
            figures.estimated("engine.engine_brake_constant_nm", 0.3, like);
            figures.estimated("engine.engine_brake_per_rpm_nm", 0.3, like);
            Ok(())
        }
    }
}

/// Another displacement: torques, inertia and flow with it, speeds and times as they are.
fn scale(truck: &mut TruckParameters, factor: f64) {
    let EngineParameters {
        friction_constant_nm,
        friction_per_rpm_nm,
        inertia_kg_m2,
        engine_brake_constant_nm,
        engine_brake_per_rpm_nm,
        auxiliary_power_w,
        fuel_map,
        ..
    } = &mut truck.engine;
    for figure in [
        friction_constant_nm,
        friction_per_rpm_nm,
        inertia_kg_m2,
        engine_brake_constant_nm,
        engine_brake_per_rpm_nm,
        auxiliary_power_w,
    ] {
        *figure = round(*figure * factor);
    }
    if let Some(map) = fuel_map {
        map.source = format!("{}; torque and flow times {factor:.4}", map.source);
        map.torque_nm.iter_mut().for_each(|x| *x = round(*x * factor));
        let flows = map.fuel_g_s.iter_mut().flatten().flatten();
        flows.for_each(|x| *x = round(*x * factor));
        map.extrapolate = true;
    }
}

/// Four digits, as sheets have them.
fn round(x: f64) -> f64 {
    if x == 0.0 {
        return x;
    }
    let unit = libm::pow(10.0, libm::floor(libm::log10(x.abs())) - 3.0);
    (x / unit).round() * unit
}
