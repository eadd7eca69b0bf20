//! Road load from coast-downs on one road, in both directions.
//!
//! ```text
//! (m + m_rot) v' = -(F_roll(v) + F_air(v + d w) + m g d (i + i_k))     d = +-1, the direction
//! ```
//! Mass from the scales, grade i and wind w of the road, a rest of grade i_k for each run and the
//! density of the air are nuisances with priors; their uncertainty is in the intervals, and so is what
//! the runs scatter more than their readings are said to. The direction is that of the heading: without
//! one, a grade is as good as a rolling resistance. Left out: cross wind, warm-up of the tyres.

use dynamics::TruckParameters;
use dynamics::effects::resistance::{AirFlow, ResistanceParameters, air_density_kg_m3};
use tractrix_core::{GRAVITY_M_S2, ZERO_DEGC_K};

use super::{Identified, LOAD_SHEET_FRAC, NotTold, SIGMAS_90, TOLD};
use crate::studies::fit::{Estimate, Parameter, least_squares};
use crate::{Channel as C, CoastDown, DiagnosisError, Drive};

/// Grade of a road that nobody measured, and what is left of a measured one, rise over run.
const GRADE_SIGMA: [f64; 2] = [0.01, 5e-4];
/// Rest of the grade of a single run: 5 m in 10 km.
const RUN_GRADE_SIGMA: f64 = 5e-4;
/// Wind of a day on which coast-downs are run, m/s: SAE J1263 allows 16 km/h.
const WIND_SIGMA_M_S: f64 = 2.0;
/// Growth of rolling resistance with speed over its value at rest, s/m: from none to 0.026 (Rakha 2001,
/// radial tyres).
const GROWTH_SIGMA_S_M: f64 = 0.0075;
/// Air of a day and a place that nobody wrote down: sea level to Denver, frost to heat.
const ANY_AIR: (f64, f64) = (1.15, 0.06);
/// Air by thermometer and barometer, relative.
const AIR_FRAC: f64 = 0.005;
/// Spread of rolling resistance and drag area where the truck file gives none, relative.
const ROAD_LOAD_FRAC: f64 = 0.5;
/// A table with rows as close as this is a logger's, s.
const LOGGED_S: f64 = 1.0;
/// Rounds in which the scatter of the readings is learned.
const ROUNDS: usize = 3;
/// Step of the integration, s.
const STEP_S: f64 = 0.5;
/// A heading that no straight road has by chance, rad: headings on either side of it are opposite.
const ACROSS_RAD: f64 = 0.35;

/// Places of the parameters.
const DRAG_AREA: usize = 0;
const ROLLING: usize = 1;
const GROWTH: usize = 2;
const GRADE: usize = 3;
const WIND: usize = 4;
const AIR: usize = 5;
const MASS: usize = 6;
/// First of the runs' rests of grade, followed by the runs' initial speeds, m/s.
const RUNS: usize = 7;

/// A coast-down and what is known of it.
struct Run<'a> {
    readings: &'a CoastDown,
    direction: f64,
    /// Mass on the scales, kg, and that of the wheels on top.
    mass_kg: f64,
    rotating_kg: f64,
    density_kg_m3: f64,
    /// Measured grade, rise over run, over the time, s; none: nobody measured it.
    grade_frac: Option<f64>,
}

/// What the coast-downs say: figures of the truck file, and what they do not tell.
pub(super) struct RoadLoad {
    pub(super) figures: Vec<Identified>,
    pub(super) not_told: Vec<NotTold>,
}

/// Fits the road load to those of `drives` that are coast-downs; none if there are none.
///
/// # Errors
/// Readings that carry no information.
pub(super) fn identify(
    truck: &TruckParameters,
    drives: &[&Drive],
) -> Result<Option<RoadLoad>, DiagnosisError> {
    let runs: Vec<Run<'_>> = drives.iter().filter_map(|d| run(truck, d)).collect();
    if runs.is_empty() {
        return Ok(None);
    }
    let base = &truck.resistance;
    let nothing = || DiagnosisError::Numerics("the coast-downs say nothing".into());
    // What the runs scatter more than their readings should; a logger's readings say themselves how
    // well they are known.
    let least = if runs.iter().all(|r| r.readings.step_s <= LOGGED_S) { 0.0 } else { 1.0 };
    let mut scale = 1.0;
    for _ in 0..ROUNDS {
        let (estimate, _) = fit(truck, &runs, scale).ok_or_else(nothing)?;
        let spare = (estimate.residuals.len() as f64 - RUNS as f64).max(1.0);
        scale *= (estimate.chi_squared() / spare).sqrt();
        scale = f64::max(scale, least).clamp(1e-3, 1e3);
    }
    let (estimate, priors) = fit(truck, &runs, scale).ok_or_else(nothing)?;
    let mut out = RoadLoad { figures: Vec::new(), not_told: Vec::new() };
    let mut tell = |path: &str, nominal: f64, value: f64, sigma: f64, prior: f64| {
        if sigma > TOLD * prior {
            let why = if runs.iter().any(|r| r.direction < 0.0) {
                "the coast-downs tell it no better than it was known"
            } else {
                "coast-downs in one direction do not tell it from the road's grade"
            };
            out.not_told.push(NotTold { path: path.to_owned(), why: why.to_owned() });
            return;
        }
        let half = SIGMAS_90 * sigma;
        out.figures.push(Identified {
            path: path.to_owned(),
            is_factor: false,
            nominal,
            value,
            sigma,
            interval_90: [value - half, value + half],
            prior_sigma: Some(prior),
        });
    };
    let value = |k: usize| estimate.value[k];
    let sigma = |k: usize| estimate.sigma(k);
    tell(
        "resistance.rolling_coeff",
        base.rolling_coeff,
        value(ROLLING),
        sigma(ROLLING),
        priors[ROLLING],
    );
    let growth = base.rolling_per_speed_s_m;
    let per_speed = value(GROWTH) * value(ROLLING);
    let spread = [GROWTH, ROLLING].map(|k| value(ROLLING + GROWTH - k) * sigma(k));
    tell(
        "resistance.rolling_per_speed_s_m",
        growth,
        per_speed,
        spread[0].hypot(spread[1]),
        priors[GROWTH] * value(ROLLING),
    );
    tell(
        "resistance.drag_area_m2",
        base.drag_area_m2,
        value(DRAG_AREA),
        sigma(DRAG_AREA),
        priors[DRAG_AREA],
    );
    Ok(Some(out))
}

fn run<'a>(truck: &TruckParameters, d: &'a Drive) -> Option<Run<'a>> {
    let readings = d.coast_down.as_ref()?;
    let mean = |c: C| d.get(c).map(|x| x.iter().sum::<f64>() / x.len().max(1) as f64);
    let heading = d.get(C::HeadingRad).and_then(|h| h.get(h.len() / 2).copied());
    let air = mean(C::BaroPressurePa).zip(mean(C::AmbientTempDegc));
    Some(Run {
        readings,
        direction: heading.map_or(1.0, |h| libm::cos(h - ACROSS_RAD).signum()),
        mass_kg: d.reported_mass_kg.unwrap_or_else(|| truck.lateral.total_mass_kg()),
        rotating_kg: truck.driveline.rotating_mass_kg(0.0, 0),
        density_kg_m3: air
            .map_or(ANY_AIR.0, |(pa, degc)| air_density_kg_m3(pa, degc + ZERO_DEGC_K)),
        grade_frac: mean(C::GradeFrac),
    })
}

/// The parameters and the standard deviations that they had before, with readings that are off by
/// `scale` times what is said.
fn fit(truck: &TruckParameters, runs: &[Run<'_>], scale: f64) -> Option<(Estimate, Vec<f64>)> {
    let base = &truck.resistance;
    let spread = |path: &str, value: f64| {
        let known = truck.provenance.get(path).and_then(|o| o.sigma).filter(|s| *s > 0.0);
        known.unwrap_or(ROAD_LOAD_FRAC * value)
    };
    let drag = spread("resistance.drag_area_m2", base.drag_area_m2);
    let rolling = spread("resistance.rolling_coeff", base.rolling_coeff);
    let growth = base.rolling_per_speed_s_m / base.rolling_coeff;
    let growth_sigma = truck
        .provenance
        .get("resistance.rolling_per_speed_s_m")
        .and_then(|o| o.sigma)
        .map_or(GROWTH_SIGMA_S_M, |s| s / base.rolling_coeff);
    let measured = runs.iter().all(|r| r.grade_frac.is_some());
    let air = if runs.iter().any(|r| r.density_kg_m3 == ANY_AIR.0) { ANY_AIR.1 } else { AIR_FRAC };
    let mut parameters = vec![
        Parameter::known(base.drag_area_m2, drag),
        Parameter::known(base.rolling_coeff, rolling),
        Parameter::known(growth, growth_sigma),
        Parameter::known(0.0, GRADE_SIGMA[usize::from(measured)]),
        Parameter::known(0.0, WIND_SIGMA_M_S),
        Parameter::known(1.0, air),
        Parameter::known(1.0, LOAD_SHEET_FRAC),
    ];
    let priors = parameters.iter().filter_map(|p| p.prior_sigma).collect();
    parameters.extend(runs.iter().map(|_| Parameter::known(0.0, RUN_GRADE_SIGMA)));
    let first =
        |r: &Run<'_>| Parameter::free(r.readings.speed_m_s.first().copied().unwrap_or(0.0), 1.0);
    parameters.extend(runs.iter().map(first));
    let estimate = least_squares(&parameters, |p| {
        let of_run = |(k, run): (usize, &Run<'_>)| {
            residuals(base, run, p, k, runs.len()).into_iter().map(move |r| r / scale)
        };
        runs.iter().enumerate().flat_map(of_run).collect()
    })?;
    Some((estimate, priors))
}

/// Modelled minus read speeds over what the readings are known to.
fn residuals(
    base: &ResistanceParameters,
    run: &Run<'_>,
    p: &[f64],
    k: usize,
    runs: usize,
) -> Vec<f64> {
    let mut resistance = base.clone();
    resistance.drag_area_m2 = p[DRAG_AREA];
    resistance.rolling_coeff = p[ROLLING];
    resistance.rolling_per_speed_s_m = p[ROLLING] * p[GROWTH];
    let mass_kg = run.mass_kg * p[MASS];
    let grade = run.grade_frac.unwrap_or(0.0) + run.direction * p[GRADE] + p[RUNS + k];
    let rate = |v: f64| {
        // A model that would have stopped rolls back: it must not lose its slope.
        let air = AirFlow {
            head_m_s: v + run.direction * p[WIND],
            cross_m_s: 0.0,
            density_kg_m3: run.density_kg_m3 * p[AIR],
        };
        let held_n = resistance.rolling_n(mass_kg, v, 1.0, 1.0) + resistance.drag_n(&air);
        -(held_n + mass_kg * GRAVITY_M_S2 * grade) / (mass_kg + run.rotating_kg)
    };
    let readings = run.readings;
    let (mut v, mut t) = (p[RUNS + runs + k], readings.time_s.first().copied().unwrap_or(0.0));
    let last = readings.time_s.len().saturating_sub(1);
    let slope = |i: usize| {
        let (a, b) = (i.saturating_sub(1), (i + 1).min(last));
        let seconds = (readings.time_s[b] - readings.time_s[a]).max(1e-9);
        (readings.speed_m_s[b] - readings.speed_m_s[a]) / seconds
    };
    let mut before = 0.0;
    (0..=last)
        .map(|i| {
            (v, t) = (coasted(&rate, v, readings.time_s[i] - t), readings.time_s[i]);
            let sigma = readings.speed_sigma_m_s.hypot(readings.time_sigma_s * slope(i));
            let error = v - readings.speed_m_s[i];
            // What a gust took from the speed stays taken: a logger's readings are fine enough for
            // that to be all that is wrong from one to the next.
            let new = error - if readings.step_s <= LOGGED_S { before } else { 0.0 };
            before = error;
            new / sigma
        })
        .collect()
}

/// Speed after a time, by classical Runge-Kutta.
fn coasted(rate: &impl Fn(f64) -> f64, mut v: f64, seconds: f64) -> f64 {
    let steps = (seconds / STEP_S).ceil().max(0.0);
    let h = seconds / steps.max(1.0);
    for _ in 0..steps as usize {
        let k1 = rate(v);
        let k2 = rate(v + 0.5 * h * k1);
        let k3 = rate(v + 0.5 * h * k2);
        let k4 = rate(v + h * k3);
        v += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
    }
    v
}
