//! Fuel: what a truck file says about consumption, and the one model that everybody reads.
//!
//! Either a Willans line on indicated power, three figures of `[engine.fuel]`:
//!
//! ```text
//! flow = constant + per_rpm n + per_kw P_ind
//! ```
//! or a map measured on a test bench, `[engine.fuel_map]`: flow (or brake-specific consumption)
//! over speed and brake torque. A file gives one of them. Between the grid's points the flow is
//! bilinear; between fuel cut-off and no brake torque it rises linearly from zero, with the truck
//! file's friction (`friction_scale_coeff` not counted: a stiffer engine burns more, its map is
//! what it was). `low_load_extra_frac` acts on both.

use serde::{Deserialize, Serialize};
use tractrix_core::{CoreError, Curve, FuelModel, Grid, LowLoadFuel, RPM_PER_RAD_S};

use crate::bounds::Bounds;

/// CO2 over burnt diesel by mass: carbon fraction 0.865 times 44.01/12.011.
pub const CO2_PER_FUEL: f64 = 3.169;

/// The fuel block of a truck file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FuelParameters {
    /// Willans line: constant part, g/s; absent where the file gives a map.
    #[serde(default)]
    pub constant_g_s: Option<f64>,
    /// Willans line: part per speed, g/s per rpm.
    #[serde(default)]
    pub per_rpm_g_s: Option<f64>,
    /// Willans line: part per indicated power, g/s per kW.
    #[serde(default)]
    pub per_kw_g_s: Option<f64>,
    /// Extra consumption at low load, relative, fading out towards `low_load_kw`.
    #[serde(default)]
    pub low_load_extra_frac: f64,
    /// Indicated power at which the extra has faded out, kW.
    #[serde(default = "low_load_kw")]
    pub low_load_kw: f64,
    /// Density, kg/m³.
    pub density_kg_m3: f64,
}

/// A fuel map: flow over engine speed and brake torque at the flywheel, before auxiliaries.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FuelMap {
    /// Where the figures come from.
    pub source: String,
    /// Speeds, rpm.
    pub speed_rpm: Vec<f64>,
    /// Brake torques, Nm: from 0 with `fuel_g_s`, above 0 with `bsfc_g_kwh`.
    pub torque_nm: Vec<f64>,
    /// Flow, g/s: one row per speed, one value per torque.
    #[serde(default)]
    pub fuel_g_s: Option<Vec<Vec<f64>>>,
    /// Brake-specific consumption instead, g/kWh: one row per speed, one value per torque.
    #[serde(default)]
    pub bsfc_g_kwh: Option<Vec<Vec<f64>>>,
    /// With `bsfc_g_kwh`: flow at no brake torque, g/s, one value per speed.
    #[serde(default)]
    pub zero_torque_g_s: Option<Vec<f64>>,
    /// The grid need not span idle to governed speed and full load: beyond it the flow per
    /// revolution is held (speed) and the slope of the last interval goes on (torque).
    #[serde(default)]
    pub extrapolate: bool,
}

fn low_load_kw() -> f64 {
    LowLoadFuel::default().fades_out_kw
}

/// What a map must span.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Range {
    pub(crate) idle_rpm: f64,
    pub(crate) max_rpm: f64,
    pub(crate) full_load_nm: f64,
}

impl FuelParameters {
    fn willans(&self) -> Option<(f64, f64, f64)> {
        Some((self.constant_g_s?, self.per_rpm_g_s?, self.per_kw_g_s?))
    }

    pub(crate) fn check(&self, map: Option<&FuelMap>, range: Range, b: &mut Bounds) {
        b.within("fuel.constant_g_s", self.constant_g_s.unwrap_or(0.0), 0.0, 5.0);
        b.within("fuel.per_rpm_g_s", self.per_rpm_g_s.unwrap_or(0.0), 0.0, 0.01);
        b.within("fuel.per_kw_g_s", self.per_kw_g_s.unwrap_or(0.05), 0.01, 0.2);
        b.within("fuel.low_load_extra_frac", self.low_load_extra_frac, -0.5, 2.0);
        b.within("fuel.low_load_kw", self.low_load_kw, 1.0, 500.0);
        b.within("fuel.density_kg_m3", self.density_kg_m3, 600.0, 1_000.0);
        let given = [self.constant_g_s, self.per_rpm_g_s, self.per_kw_g_s];
        if let Some(map) = map {
            let alone = given.iter().all(Option::is_none);
            b.require(
                alone,
                "fuel: constant_g_s, per_rpm_g_s and per_kw_g_s contradict fuel_map; give one"
                    .into(),
            );
            map.check(range, b);
        } else {
            b.require(
                self.willans().is_some(),
                "fuel needs constant_g_s, per_rpm_g_s and per_kw_g_s, or a block fuel_map".into(),
            );
        }
    }

    /// The model of checked parameters. `friction_nm` is the friction that the map's brake torque
    /// excludes, over speed in rad/s.
    pub(crate) fn model(
        &self,
        map: Option<&FuelMap>,
        friction_nm: Curve,
    ) -> Result<FuelModel, CoreError> {
        let low_load =
            LowLoadFuel { extra_frac: self.low_load_extra_frac, fades_out_kw: self.low_load_kw };
        if let Some(map) = map {
            return Ok(FuelModel::Map { flow_g_s: map.grid()?, friction_nm, low_load });
        }
        let (constant_g_s, per_rpm_g_s, per_kw_g_s) =
            self.willans().ok_or_else(|| bad("neither a Willans line nor a map".into()))?;
        Ok(FuelModel::Willans { constant_g_s, per_rpm_g_s, per_kw_g_s, low_load })
    }
}

fn bad(why: String) -> CoreError {
    CoreError::BadTable { name: "fuel_map".into(), why }
}

impl FuelMap {
    /// Flow in g/s over (speed rad/s, brake torque Nm from zero).
    pub(crate) fn grid(&self) -> Result<Grid, CoreError> {
        let speed_rad_s: Vec<f64> = self.speed_rpm.iter().map(|n| n / RPM_PER_RAD_S).collect();
        let first_nm = self.torque_nm.first().copied().unwrap_or(f64::NAN);
        match (&self.fuel_g_s, &self.bsfc_g_kwh, &self.zero_torque_g_s) {
            (Some(rows), None, None) => {
                if first_nm != 0.0 {
                    return Err(bad(format!(
                        "torque_nm begins at {first_nm}, with fuel_g_s it must begin at 0"
                    )));
                }
                let flow = self.rows("fuel_g_s", rows)?.concat();
                Grid::new("fuel_map", speed_rad_s, self.torque_nm.clone(), flow)
            }
            (None, Some(rows), Some(zero)) => {
                if !(first_nm > 0.0) || zero.len() != self.speed_rpm.len() {
                    return Err(bad(format!(
                        "with bsfc_g_kwh torque_nm begins above 0 and zero_torque_g_s has {} values",
                        self.speed_rpm.len()
                    )));
                }
                let rows = self.rows("bsfc_g_kwh", rows)?;
                let mut flow = Vec::new();
                for ((row, zero_g_s), speed_rad_s) in rows.iter().zip(zero).zip(&speed_rad_s) {
                    flow.push(*zero_g_s);
                    let g_s = |(g_kwh, nm): (&f64, &f64)| g_kwh * nm * speed_rad_s / 3.6e6;
                    flow.extend(row.iter().zip(&self.torque_nm).map(g_s));
                }
                let torque_nm = [&[0.0], self.torque_nm.as_slice()].concat();
                Grid::new("fuel_map", speed_rad_s, torque_nm, flow)
            }
            _ => Err(bad("give fuel_g_s, or bsfc_g_kwh with zero_torque_g_s".into())),
        }
    }

    fn rows<'a>(&self, key: &str, rows: &'a [Vec<f64>]) -> Result<&'a [Vec<f64>], CoreError> {
        let (speeds, torques) = (self.speed_rpm.len(), self.torque_nm.len());
        if speeds < 2 || torques < 2 {
            return Err(bad(format!("{speeds} speeds and {torques} torques, 2 of each needed")));
        }
        match rows.iter().find(|r| r.len() != torques) {
            _ if rows.len() != speeds => {
                Err(bad(format!("{key} has {} rows for {speeds} speeds", rows.len())))
            }
            Some(r) => Err(bad(format!("a row of {key} has {} values for {torques}", r.len()))),
            None => Ok(rows),
        }
    }

    fn check(&self, range: Range, b: &mut Bounds) {
        let grid = match self.grid() {
            Ok(grid) => grid,
            Err(e) => return b.result("fuel_map", Err(e)),
        };
        let (speed_rad_s, torque_nm) = (grid.x(), grid.y());
        for (row, n) in grid.z().chunks(torque_nm.len()).zip(speed_rad_s) {
            let rpm = n * RPM_PER_RAD_S;
            b.require(
                row[0] > 0.0 && row.windows(2).all(|w| w[1] > w[0]),
                format!("fuel_map: at {rpm:.0} rpm the flow must be positive and rise with torque"),
            );
        }
        let ends = (self.speed_rpm[0], self.speed_rpm[self.speed_rpm.len() - 1]);
        let last_nm = torque_nm[torque_nm.len() - 1];
        let spans =
            ends.0 <= range.idle_rpm && ends.1 >= range.max_rpm && last_nm >= range.full_load_nm;
        b.require(
            spans || self.extrapolate,
            format!(
                "fuel_map spans {} to {} rpm and {last_nm} Nm; idle to governed speed and full load \
                 need {} to {} rpm and {} Nm, or extrapolate = true",
                ends.0, ends.1, range.idle_rpm, range.max_rpm, range.full_load_nm
            ),
        );
        b.require(
            ends.0 > 0.0 && ends.1 <= 10_000.0 && last_nm <= 10_000.0,
            "fuel_map: speeds must be above 0 to 10000 rpm, torques up to 10000 Nm".into(),
        );
    }
}
