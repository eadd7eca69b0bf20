//! Engines of the corpus: lines, a made-up map, the default truck's map, a map read off a figure.

use tractrix_core::{Curve, FuelModel, Grid, LowLoadFuel, PowertrainLimits, RPM_PER_RAD_S};

/// Fuel maps of the corpus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Engine {
    /// The reference truck's Willans line, which jumps where injection starts.
    Willans,
    /// A Willans line through zero at fuel cut-off.
    Continuous,
    /// Another engine's consumption over speed and torque.
    BenchMap,
    /// The engine of truck `longhaul`: the smoothed form of a measured map.
    Longhaul,
    /// The measured map itself, as it was read off a figure, 250 rpm slower; its flow is not convex
    /// in torque.
    Measured,
    /// The same without its dents: at each speed the lower convex hull of its flow over torque.
    MeasuredHull,
}

impl Engine {
    /// Puts this engine into a truck.
    pub(crate) fn install(self, p: &mut PowertrainLimits) {
        match self {
            Self::Willans => {}
            Self::Continuous => {
                p.fuel = FuelModel::Willans {
                    constant_g_s: 0.0,
                    per_rpm_g_s: 0.0,
                    per_kw_g_s: 0.052,
                    low_load: LowLoadFuel::default(),
                };
            }
            Self::BenchMap => p.fuel = bench_map(),
            Self::Longhaul => longhaul(p),
            Self::Measured => p.fuel = measured(&p.friction_nm, |_, flow| flow),
            Self::MeasuredHull => p.fuel = measured(&p.friction_nm, hull),
        }
    }
}

fn map(rad_s: Vec<f64>, torque_nm: Vec<f64>, flow_g_s: Vec<f64>, friction_nm: Curve) -> FuelModel {
    let flow_g_s = Grid::new("flow", rad_s, torque_nm, flow_g_s).unwrap();
    FuelModel::Map { flow_g_s, friction_nm, low_load: LowLoadFuel::default() }
}

/// Fuel map of another engine as a test bench tells it: flow over speed and torque. Losses grow
/// toward both ends of the speed range and with the load, so that the best point lies at middle
/// speed and three quarters of full load; flow at a given speed is convex in torque. Its friction is
/// that of the reference truck.
fn bench_map() -> FuelModel {
    let rad_s: Vec<f64> = (0..13).map(|i| (600.0 + 125.0 * f64::from(i)) / RPM_PER_RAD_S).collect();
    let torque_nm: Vec<f64> = (0..110).map(|i| 24.0 * f64::from(i)).collect();
    let flow = |w: f64, t: f64| {
        let lost = 120.0 + 0.09 * w * RPM_PER_RAD_S + 100.0 * (w / 120.0 - 1.0).powi(2);
        0.0485e-3 * w * (t + lost + 60.0 * (t / 1300.0).powi(2))
    };
    let g_s = rad_s.iter().flat_map(|&w| torque_nm.iter().map(move |&t| flow(w, t))).collect();
    let friction_nm = rad_s.iter().map(|w| 95.0 + 0.085 * w * RPM_PER_RAD_S).collect();
    let friction_nm = Curve::new("friction", rad_s.clone(), friction_nm).unwrap();
    map(rad_s, torque_nm, g_s, friction_nm)
}

/// Fuel map, friction, auxiliaries and idling of the default truck.
fn longhaul(p: &mut PowertrainLimits) {
    let file: toml::Table =
        include_str!("../../../../dynamics/trucks/longhaul.toml").parse().unwrap();
    let engine = &file["engine"];
    let number = |key: &str| engine[key].as_float().unwrap();
    let list = |of: &toml::Value| -> Vec<f64> {
        of.as_array().unwrap().iter().map(|v| v.as_float().unwrap()).collect()
    };
    let of_map = &engine["fuel_map"];
    let rpm = list(&of_map["speed_rpm"]);
    let friction = |n: f64| number("friction_constant_nm") + number("friction_per_rpm_nm") * n;
    let rad_s: Vec<f64> = rpm.iter().map(|n| n / RPM_PER_RAD_S).collect();
    let flow_g_s = of_map["fuel_g_s"].as_array().unwrap().iter().flat_map(list).collect();
    p.friction_nm =
        Curve::new("friction", rad_s.clone(), rpm.iter().map(|n| friction(*n)).collect()).unwrap();
    p.auxiliary_power_w = number("auxiliary_power_w");
    p.fuel = map(rad_s, list(&of_map["torque_nm"]), flow_g_s, p.friction_nm.clone());
    let idle = p.idle_speed_rad_s;
    let holding_nm = p.friction_nm.at(idle) + p.auxiliary_power_w / idle;
    p.idle_fuel_g_s = p.fuel.rate_g_s(idle, holding_nm);
}

/// The measured map (`crates/dynamics/data/advisor_fc_ci330`) with friction of the truck; flow without
/// torque from the line through the two lowest torques. `shape` makes a speed's flow, g/s, of its
/// torques, Nm, and what was measured.
fn measured(friction_nm: &Curve, shape: fn(&[f64], Vec<f64>) -> Vec<f64>) -> FuelModel {
    let text = include_str!("../../../../dynamics/data/advisor_fc_ci330/bsfc_map.csv");
    let rows: Vec<[f64; 3]> = text
        .lines()
        .filter(|line| line.starts_with(|c: char| c.is_ascii_digit()))
        .map(|line| {
            let mut cells = line.split(',').map(|cell| cell.parse().unwrap());
            core::array::from_fn(|_| cells.next().unwrap())
        })
        .collect();
    let torques = rows.iter().take_while(|row| row[0] == rows[0][0]).count();
    let rad_s: Vec<f64> =
        rows.iter().step_by(torques).map(|row| (row[0] - 250.0) / RPM_PER_RAD_S).collect();
    let torque_nm: Vec<f64> =
        core::iter::once(0.0).chain(rows[..torques].iter().map(|row| row[1])).collect();
    let mut flow_g_s = Vec::new();
    for (of_speed, w) in rows.chunks(torques).zip(&rad_s) {
        let flow: Vec<f64> = of_speed.iter().map(|[_, t, bsfc]| bsfc * t * w / 3.6e6).collect();
        let row = core::iter::once(2.0 * flow[0] - flow[1]).chain(flow).collect();
        flow_g_s.extend(shape(&torque_nm, row));
    }
    map(rad_s, torque_nm, flow_g_s, friction_nm.clone())
}

/// The lower convex hull of points over `x`, read at `x`.
fn hull(x: &[f64], y: Vec<f64>) -> Vec<f64> {
    let mut corners: Vec<usize> = Vec::new();
    for i in 0..x.len() {
        while let [.., a, b] = corners[..]
            && (y[b] - y[a]) * (x[i] - x[a]) >= (y[i] - y[a]) * (x[b] - x[a])
        {
            corners.pop();
        }
        corners.push(i);
    }
    let of = |values: &[f64]| corners.iter().map(|&i| values[i]).collect();
    let hull = Curve::new("hull", of(x), of(&y)).unwrap();
    x.iter().map(|&at| hull.at(at)).collect()
}
