//! Inputs of the force balance that depend on no parameter, and work on them in blocks of samples.

use dynamics::effects::driveline::RELEASED_PEDAL_FRAC;
use dynamics::effects::table::accel_m_s2;
use tractrix_core::ZERO_DEGC_K;

use super::prepared::Prepared;
use crate::Plant;

/// Speed below which a measured ratio says nothing, m/s.
const LEAST_M_S: f64 = 1.0;

/// A measured ratio this close to 1 is that of a direct gear: gears are 1.2 to 1.3 apart.
const MEASURED_DIRECT_WITHIN: f64 = 0.1;

/// Samples that are computed side by side.
pub(super) const BLOCK: usize = 64;

/// What enters the balance and depends on no parameter, per sample, padded to whole blocks.
#[derive(Debug, Default)]
pub(crate) struct Inputs {
    pub(super) padded: usize,
    pub(super) speed: Vec<f64>,
    pub(super) indicated_nm: Vec<f64>,
    pub(super) friction_nm: Vec<f64>,
    /// Auxiliaries without the fan.
    pub(super) auxiliary_nm: Vec<f64>,
    /// Torque per power at the crank, Nm/W.
    pub(super) per_w: Vec<f64>,
    pub(super) engine_brake_nm: Vec<f64>,
    /// Ratio engine to wheel over wheel radius, 1/m.
    pub(super) ratio_1_m: Vec<f64>,
    pub(super) rotating_kg: Vec<f64>,
    /// 1 where teeth carry the power, 0 in a direct gear.
    pub(super) meshes: Vec<f64>,
    pub(super) density: Vec<f64>,
    /// Cosine of the grade.
    pub(super) cos: Vec<f64>,
    /// Part of the rolling resistance coefficient that grows with speed.
    pub(super) rolling_by_speed: Vec<f64>,
    /// Induced drag of the tyres' side forces, N, against the motion.
    pub(super) holding_n: Vec<f64>,
    /// The truck file's fitted tables, m/s².
    pub(super) table_m_s2: Vec<f64>,
    pub(super) course_sin: Vec<f64>,
    pub(super) course_cos: Vec<f64>,
    pub(super) air_k: Vec<f64>,
    pub(super) xbr: Vec<f64>,
    /// 1 where the driver asks for nothing.
    pub(super) coasts: Vec<f64>,
}

impl Inputs {
    pub(super) fn new(d: &Prepared, plant: &Plant) -> Self {
        let (engine, truck) = (&plant.engine, &plant.truck);
        let driveline = &truck.driveline;
        let measured = |i: usize| {
            let ratio_1_m = d.turning[i] / d.speed[i].max(LEAST_M_S);
            let wheel_kg = driveline.rotating_mass_kg(0.0, 0);
            (ratio_1_m, wheel_kg + truck.engine.inertia_kg_m2 * ratio_1_m * ratio_1_m)
        };
        let per_gear: Vec<(f64, f64)> = (0..=driveline.top_gear())
            .map(|g| {
                let rotating_kg = driveline.rotating_mass_kg(truck.engine.inertia_kg_m2, g);
                (driveline.total_ratio(g) / driveline.wheel_radius_m, rotating_kg)
            })
            .collect();
        let gear = |i: usize| match d.measured_ratio {
            true => measured(i),
            false => per_gear[if d.gear[i] < per_gear.len() { d.gear[i] } else { 0 }],
        };
        let direct: Vec<bool> =
            (0..=driveline.top_gear()).map(|g| driveline.is_direct(g)).collect();
        let passes_through = |i: usize| match d.measured_ratio {
            true => {
                (measured(i).0 / driveline.shaft_force_n(1.0) - 1.0).abs() < MEASURED_DIRECT_WITHIN
            }
            false => direct.get(d.gear[i]).copied().unwrap_or(false),
        };
        let holding = induced_n(d, plant);
        let padded = d.n.next_multiple_of(BLOCK);
        let of = |f: &dyn Fn(usize) -> f64| -> Vec<f64> { pad((0..d.n).map(f), padded) };
        Self {
            padded,
            speed: of(&|i| d.speed[i]),
            indicated_nm: of(&|i| d.torque[i] * 0.01 * truck.engine.reference_torque_nm),
            friction_nm: of(&|i| engine.friction_nm(d.omega[i])),
            auxiliary_nm: of(&|i| engine.auxiliary_nm(d.omega[i], 0.0)),
            per_w: of(&|i| engine.crank_nm(1.0, d.omega[i])),
            engine_brake_nm: of(&|i| d.engine_brake[i] * engine.engine_brake_nm(d.omega[i])),
            ratio_1_m: of(&|i| gear(i).0),
            rotating_kg: of(&|i| gear(i).1),
            meshes: of(&|i| if passes_through(i) { 0.0 } else { 1.0 }),
            density: of(&|i| d.density[i]),
            cos: of(&|i| d.slope[i]),
            rolling_by_speed: of(&|i| truck.resistance.rolling_per_speed_s_m * d.speed[i]),
            holding_n: pad(holding.into_iter(), padded),
            table_m_s2: of(&|i| accel_m_s2(&plant.tables, d.speed[i], |s| d.signal(s, i))),
            course_sin: of(&|i| d.course[i].0),
            course_cos: of(&|i| d.course[i].1),
            air_k: of(&|i| d.ambient[i] + ZERO_DEGC_K),
            xbr: of(&|i| d.xbr[i]),
            coasts: of(&|i| if d.pedal[i] < RELEASED_PEDAL_FRAC { 1.0 } else { 0.0 }),
        }
    }
}

/// Drag that the side forces of the tyres induce, from the measured yaw rate, N. Their stiffness is
/// that of the load sheet without the file's factors: those are lateral figures, which the balance
/// would only blur.
fn induced_n(d: &Prepared, plant: &Plant) -> Vec<f64> {
    let mut loaded = super::lateral::loaded(d, plant, &[0.0; crate::causes::param::PARAMS]);
    loaded.tyres.stiffness_scale = [1.0; 3];
    let stiffness: f64 = loaded.tyres.stiffness_n_rad(&loaded.static_axle_load_n()).iter().sum();
    let lateral_m_s2 = d.speed.iter().zip(&d.yaw).map(|(v, yaw)| v * yaw);
    lateral_m_s2.map(|a| plant.truck.resistance.curve_n(d.mass_kg, a, stiffness)).collect()
}

/// A signal with its last value held up to `padded` samples.
pub(super) fn pad(x: impl Iterator<Item = f64>, padded: usize) -> Vec<f64> {
    let mut x: Vec<f64> = x.collect();
    x.resize(padded, x.last().copied().unwrap_or(0.0));
    x
}

#[inline(always)]
pub(super) fn cut<const L: usize>(x: &[f64], at: usize) -> &[f64; L] {
    x.get(at..).and_then(<[f64]>::first_chunk).unwrap_or(&[0.0; L])
}

/// One value per sample of a block; a loop, which the compiler makes wide.
#[inline(always)]
pub(super) fn lanes<const L: usize>(f: impl Fn(usize) -> f64) -> [f64; L] {
    let mut out = [0.0; L];
    for (j, x) in out.iter_mut().enumerate() {
        *x = f(j);
    }
    out
}

#[inline(always)]
pub(super) fn scaled<const L: usize>(x: &[f64; L], factor: f64) -> [f64; L] {
    lanes(|j| x[j] * factor)
}
