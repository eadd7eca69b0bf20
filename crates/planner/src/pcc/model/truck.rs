//! Longitudinal truck as the speed planner sees it: traction, drag losses and fuel per gear.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `v` | speed | m/s |
//! | `E` | specific kinetic energy v²/2 | J/kg |
//! | `i_g` | engine radians per metre, gear ratio × final drive / wheel radius | rad/m |
//! | `η_g` | efficiency gearbox input to wheel | 1 |
//! | `T_e` | net engine torque at the gearbox input | Nm |
//! | `F` | wheel force of the driveline; `T_e i η` pulling, `T_e i / η` overrunning | N |
//! | `D` | overrun drag at fuel cut-off, `(T_friction + P_aux/ω) i / η` | N |
//! | `p` | specific indicated traction `(F + D)/m`, zero exactly at fuel cut-off | m/s² |
//! | `μ` | (mass + rotating mass)/mass | 1 |
//!
//! Eq. 20 of the paper with a gearbox, an overrun and the full-load curve, in space domain.
//! Left out: tyre warm-up, torque build-up, and the traction gap of a shift, which is charged
//! as a fixed amount of fuel per shift.

use alloc::vec::Vec;

use tractrix_core::{FuelModel, GRAVITY_M_S2, RoadLoad, RoadPiece, VehicleLimits};

use super::engine::TorqueCurves;
use crate::pcc::error::PccError;

/// A forward gear, as an index from 0, or open driveline.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Drive {
    /// Gear index from 0.
    Gear(u8),
    /// Driveline open, engine idling (eco-roll).
    Neutral,
}

impl Drive {
    /// Gear number as contracts write it: 1-based, 0 = neutral.
    #[must_use]
    pub fn number(self) -> u8 {
        match self {
            Self::Gear(g) => g + 1,
            Self::Neutral => 0,
        }
    }
}

/// Longitudinal model of one loaded truck. Built once per truck and mass.
#[derive(Debug, Clone)]
pub struct Truck {
    /// Total mass, kg.
    pub mass_kg: f64,
    /// Drag per specific energy in calm air: `ρ CdA / m`, 1/m.
    pub drag_1_m: f64,
    load: RoadLoad,
    /// Whether the load has parts that are not linear in the energy.
    nonlinear: bool,
    /// Engine radians per metre, per gear.
    ratio_rad_m: Vec<f64>,
    efficiency_frac: Vec<f64>,
    inertia_factor: Vec<f64>,
    inertia_factor_neutral: f64,
    torque_nm: TorqueCurves,
    auxiliary_power_w: f64,
    min_speed_rad_s: f64,
    max_speed_rad_s: f64,
    fuel: FuelModel,
    idle_fuel_g_s: f64,
}

impl Truck {
    /// The model from what the truck reports.
    ///
    /// # Errors
    /// [`PccError::Limits`] names the first quantity that is not usable.
    pub fn new(limits: &VehicleLimits) -> Result<Self, PccError> {
        limits.check()?;
        let (p, load) = (&limits.powertrain, &limits.road_load);
        let to_engine = p.final_drive_ratio / p.wheel_radius_m;
        let m = load.mass_kg;
        let inertia = |rotating: f64| (m + rotating) / m;
        Ok(Self {
            mass_kg: m,
            drag_1_m: load.air_density_kg_m3 * load.cd_a_m2 / m,
            load: *load,
            nonlinear: load.rolling_per_speed_s_m != 0.0 || !load.wind.is_calm(),
            ratio_rad_m: p.gear_ratios.iter().map(|r| r * to_engine).collect(),
            efficiency_frac: p.gear_efficiency_frac.clone(),
            inertia_factor: p.rotating_mass_kg.iter().map(|&r| inertia(r)).collect(),
            inertia_factor_neutral: inertia(p.rotating_mass_neutral_kg),
            torque_nm: TorqueCurves::new(&p.full_load_nm, &p.friction_nm),
            auxiliary_power_w: p.auxiliary_power_w,
            min_speed_rad_s: p.lugging_speed_rad_s,
            max_speed_rad_s: p.max_speed_rad_s,
            fuel: p.fuel.clone(),
            idle_fuel_g_s: p.idle_fuel_g_s,
        })
    }

    /// Number of forward gears.
    #[must_use]
    pub fn gears(&self) -> usize {
        self.ratio_rad_m.len()
    }

    /// Speed range in which gear `g` drives, m/s. The lowest gear (largest ratio) reaches down to
    /// standstill, on the clutch.
    #[must_use]
    pub fn speed_range_m_s(&self, g: usize) -> (f64, f64) {
        let i = self.ratio_rad_m[g];
        let lowest = self.ratio_rad_m.iter().all(|&r| r <= i);
        (if lowest { 0.0 } else { self.min_speed_rad_s / i }, self.max_speed_rad_s / i)
    }

    /// Whether gear `g` drives at this speed.
    #[must_use]
    pub fn usable(&self, g: usize, v_m_s: f64) -> bool {
        let (low, high) = self.speed_range_m_s(g);
        v_m_s >= low && v_m_s <= high
    }

    /// μ, the factor by which rotating parts enlarge the inertia.
    #[must_use]
    pub fn inertia(&self, drive: Drive) -> f64 {
        match drive {
            Drive::Gear(g) => self.inertia_factor[g as usize],
            Drive::Neutral => self.inertia_factor_neutral,
        }
    }

    /// Resistance of road and air per mass at `E`, m/s².
    #[must_use]
    pub fn resistance_m_s2(&self, e_j_kg: f64, road: &RoadPiece) -> f64 {
        if self.nonlinear {
            return self.load.resistance_n(libm::sqrt(2.0 * e_j_kg.max(0.0)), road) / self.mass_kg;
        }
        // the same without roots: speed squared is twice the energy
        let l = &self.load;
        self.drag_1_m * e_j_kg
            + GRAVITY_M_S2 * (road.sin_grade + l.rolling_coeff * road.cos_grade)
            + self.curve_1(road) * e_j_kg * e_j_kg
            + l.constant_drag_n / self.mass_kg
    }

    /// Its slope in `E`, 1/m.
    #[must_use]
    pub fn resistance_slope_1_m(&self, e_j_kg: f64, road: &RoadPiece) -> f64 {
        if !self.nonlinear {
            return self.drag_1_m + 2.0 * self.curve_1(road) * e_j_kg;
        }
        let step = 0.01 * e_j_kg.max(1.0);
        let at = |e: f64| self.resistance_m_s2(e, road);
        (at(e_j_kg + step) - at(e_j_kg - step)) / (2.0 * step)
    }

    /// Induced drag of a curve per mass and energy squared.
    fn curve_1(&self, road: &RoadPiece) -> f64 {
        4.0 * self.load.curve_drag_1_n * self.mass_kg * road.curvature_squared_1_m2
    }

    fn engine_speed(&self, g: usize, v: f64) -> f64 {
        // On the clutch in the lowest gear the engine keeps its lowest driving speed.
        (v * self.ratio_rad_m[g]).max(self.min_speed_rad_s)
    }

    /// Engine and driveline in gear `g` at this speed.
    #[must_use]
    pub fn at(&self, g: usize, v_m_s: f64) -> Operating<'_> {
        let speed_rad_s = self.engine_speed(g, v_m_s);
        let torque = self.torque_nm.at(speed_rad_s);
        Operating {
            truck: self,
            speed_rad_s,
            auxiliary_nm: self.auxiliary_power_w / speed_rad_s,
            full_load_nm: torque.full_load,
            friction_nm: torque.friction,
            ratio_rad_m: self.ratio_rad_m[g],
            efficiency_frac: self.efficiency_frac[g],
        }
    }

    /// Overrun drag per mass at fuel cut-off, `D/m`, m/s².
    #[must_use]
    pub fn overrun_m_s2(&self, g: usize, v_m_s: f64) -> f64 {
        self.at(g, v_m_s).overrun_m_s2()
    }

    /// Largest specific indicated traction `φ = (F_max + D)/m`, m/s².
    #[must_use]
    pub fn traction_m_s2(&self, g: usize, v_m_s: f64) -> f64 {
        self.at(g, v_m_s).traction_m_s2()
    }

    /// Fuel flow, g/s, at specific traction `p >= 0`: the truth. Zero at cut-off.
    #[must_use]
    pub fn fuel_g_s(&self, drive: Drive, v_m_s: f64, p_m_s2: f64) -> f64 {
        match drive {
            Drive::Neutral => self.idle_fuel_g_s,
            Drive::Gear(g) => self.at(g as usize, v_m_s).fuel_g_s(p_m_s2),
        }
    }

    /// Crank power for specific traction `p`, W: net engine torque plus auxiliaries, times speed.
    #[must_use]
    pub fn engine_power_w(&self, drive: Drive, v_m_s: f64, p_m_s2: f64) -> f64 {
        match drive {
            Drive::Neutral => self.auxiliary_power_w,
            Drive::Gear(g) => {
                let at = self.at(g as usize, v_m_s);
                (at.indicated_nm(p_m_s2) - at.friction_nm) * at.speed_rad_s
            }
        }
    }

    /// Fuel of a joule per kilogram made at a speed, g per J/kg: the slope of the fuel between half
    /// and full load in the strongest gear.
    #[must_use]
    pub fn marginal_fuel_g_j_kg(&self, v_m_s: f64) -> f64 {
        let g = self.strongest_gear(v_m_s);
        let phi = self.traction_m_s2(g, v_m_s);
        let drive = Drive::Gear(g as u8);
        let fuel = |p: f64| self.fuel_g_s(drive, v_m_s, p);
        (fuel(phi) - fuel(0.5 * phi)) / (0.5 * phi * v_m_s)
    }

    /// Fuel flow with the driveline open, g/s.
    #[must_use]
    pub fn idle_fuel_g_s(&self) -> f64 {
        self.idle_fuel_g_s
    }

    /// The gear with the largest net traction at this speed, and that traction minus overrun drag
    /// per inertia factor. Falls back to the gear whose range is nearest.
    #[must_use]
    pub fn strongest_gear(&self, v_m_s: f64) -> usize {
        let mut best = (f64::MIN, 0);
        for g in 0..self.gears() {
            if self.usable(g, v_m_s) {
                let at = self.at(g, v_m_s);
                let pull = at.traction_m_s2() - at.overrun_m_s2();
                if pull > best.0 {
                    best = (pull, g);
                }
            }
        }
        if best.0 > f64::MIN {
            return best.1;
        }
        let miss = |g: usize| {
            let (low, high) = self.speed_range_m_s(g);
            (low - v_m_s).max(v_m_s - high)
        };
        (0..self.gears()).min_by(|&a, &b| miss(a).total_cmp(&miss(b))).unwrap_or(0)
    }

    /// Highest speed that any gear reaches, m/s.
    #[must_use]
    pub fn top_speed_m_s(&self) -> f64 {
        (0..self.gears()).map(|g| self.speed_range_m_s(g).1).fold(0.0, f64::max)
    }
}

/// Engine and driveline in one gear at one speed: what depends on both alone is read once.
#[derive(Debug, Clone, Copy)]
pub struct Operating<'a> {
    truck: &'a Truck,
    speed_rad_s: f64,
    /// Torque of the auxiliaries, Nm.
    auxiliary_nm: f64,
    full_load_nm: f64,
    friction_nm: f64,
    ratio_rad_m: f64,
    efficiency_frac: f64,
}

impl Operating<'_> {
    /// Torque at the gearbox input that friction and auxiliaries take at fuel cut-off, Nm.
    fn loss_nm(&self) -> f64 {
        self.friction_nm + self.auxiliary_nm
    }

    /// Overrun drag, `D`, N.
    fn drag_n(&self) -> f64 {
        self.loss_nm() * self.ratio_rad_m / self.efficiency_frac
    }

    /// Overrun drag per mass at fuel cut-off, `D/m`, m/s².
    #[must_use]
    pub fn overrun_m_s2(&self) -> f64 {
        self.drag_n() / self.truck.mass_kg
    }

    /// Largest specific indicated traction `φ = (F_max + D)/m`, m/s².
    #[must_use]
    pub fn traction_m_s2(&self) -> f64 {
        let net = (self.full_load_nm - self.auxiliary_nm).max(0.0);
        let pull = net * self.ratio_rad_m * self.efficiency_frac;
        (pull + self.drag_n()) / self.truck.mass_kg
    }

    /// Indicated engine torque for specific traction `p`, Nm.
    fn indicated_nm(&self, p_m_s2: f64) -> f64 {
        let (i, eta) = (self.ratio_rad_m, self.efficiency_frac);
        let force = p_m_s2 * self.truck.mass_kg - self.drag_n();
        let net = if force >= 0.0 { force / (i * eta) } else { force * eta / i };
        net + self.loss_nm()
    }

    /// Fuel flow, g/s, at specific traction `p >= 0`: the truth. Zero at cut-off.
    #[must_use]
    pub fn fuel_g_s(&self, p_m_s2: f64) -> f64 {
        let torque = self.indicated_nm(p_m_s2);
        let torque = if torque < 1e-6 { 0.0 } else { torque };
        self.truck.fuel.rate_g_s(self.speed_rad_s, torque)
    }

    /// Fuel flow, g/s, with the part that does not depend on torque charged at cut-off too: the
    /// planning objective. A map that jumps when injection starts would otherwise make full power
    /// and fuel cut-off by turns optimal on a flat road.
    #[must_use]
    pub fn fuel_charged_g_s(&self, p_m_s2: f64) -> f64 {
        let torque = self.indicated_nm(p_m_s2).max(1e-6);
        self.truck.fuel.rate_g_s(self.speed_rad_s, torque)
    }
}
