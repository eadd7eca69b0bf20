//! The figures that are asked for: which parameter of the replay stands for each, and how the truck
//! file carries it.

use std::collections::BTreeMap;

use dynamics::{Overlay, TruckParameters};

use super::LOAD_SHEET_FRAC;
use crate::Channel as C;
use crate::answer::overlay;
use crate::causes::hypothesis::CATALOGUE;
use crate::causes::param::P;
use crate::replay::Prepared;
use crate::search::free::Prior;

/// Spread of a reference torque and of a full load that a sheet says, relative.
const ENGINE_SHEET_FRAC: f64 = 0.03;
/// Spread of the level of a fuel map that is not the engine's own, relative.
const FUEL_LEVEL_FRAC: f64 = 0.08;

/// What a stiffness that grows with the slip angle's first power misses of a tyre, relative.
const TYRE_FORM_FRAC: f64 = 0.01;

/// How far a payload's centre lies elsewhere on the average of the drives, m.
const PAYLOAD_PLACE_M: f64 = 0.05;

/// A figure that is asked for.
pub(super) struct Figure {
    pub(super) p: P,
    /// The cause of the catalogue whose figure it is; none: one of the engine's levels.
    pub(super) id: Option<&'static str>,
}

const fn of(id: &'static str, p: P) -> Figure {
    Figure { p, id: Some(id) }
}

/// All figures. A torque message in percent counts by the reference torque, so that the balance of
/// forces tells it only as well as the mass is known.
pub(super) const FIGURES: [Figure; 22] = [
    of("rolling_resistance", P::Rolling),
    of("air_drag", P::Drag),
    of("mass", P::Mass),
    of("driveline_loss", P::DrivelineLoss),
    of("engine_friction", P::Friction),
    of("engine_brake_torque", P::EngineBrakeScale),
    Figure { p: P::TorqueScale, id: None },
    Figure { p: P::TorqueReport, id: None },
    Figure { p: P::FuelScale, id: None },
    of("turbo_lag", P::TurboLag),
    of("pedal_delay", P::PedalDelay),
    of("shift_duration", P::ShiftTime),
    of("brake_gain", P::BrakeGain),
    of("brake_delay", P::BrakeDelay),
    of("speed_scale", P::SpeedScale),
    of("steering_ratio", P::SteerRatio),
    of("steering_offset", P::SteerOffset),
    of("steering_lag", P::SteerLag),
    of("cornering_stiffness_front", P::CFront),
    of("cornering_stiffness_drive", P::CDrive),
    of("cornering_stiffness_trailer", P::CTrailer),
    of("payload_position", P::PayloadX),
];

impl Figure {
    /// Channels that no drive has and that it needs.
    pub(super) fn missing(&self, drives: &[Prepared]) -> Vec<&'static str> {
        let engine: &[C] = match self.p {
            P::TorqueReport => {
                &[C::AcceleratorPedalFrac, C::EngineTorquePercent, C::EngineSpeedRpm]
            }
            P::FuelScale => &[C::FuelRateGS, C::EngineTorquePercent, C::EngineSpeedRpm],
            _ => &[C::EngineTorquePercent, C::EngineSpeedRpm, C::Gear, C::GradeFrac],
        };
        let of_cause = |id| CATALOGUE.iter().find(|h| h.id == id).map(|h| h.channels);
        let needed = self.id.map_or(Some(engine), of_cause).unwrap_or_default();
        let absent = |c: &&C| !drives.iter().any(|d| d.has(&[**c]));
        needed.iter().filter(absent).map(|c| c.name()).collect()
    }

    /// How far the reference torque goes into it: what a message's percent tells.
    pub(super) fn with_torque(&self) -> f64 {
        match self.p {
            P::TorqueReport => 1.0,
            P::FuelScale => -1.0,
            _ => 0.0,
        }
    }

    /// What the drives cannot tell from it whatever they excite, in its size: delays and levels that
    /// the logger and its messages add, the form of tyres, where loads lie.
    pub(super) fn beyond_drives(&self) -> f64 {
        match self.p {
            P::CFront | P::CDrive | P::CTrailer => TYRE_FORM_FRAC,
            P::PayloadX => PAYLOAD_PLACE_M,
            _ => self.p.spec().calibration,
        }
    }

    /// Where it stands in a truck file.
    pub(super) fn path(&self, truck: &TruckParameters) -> &'static str {
        match (self.p, self.id) {
            (P::TorqueReport, _) => "engine.full_load_torque_nm",
            (P::FuelScale, _) if truck.engine.fuel_map.is_some() => "engine.fuel_map.fuel_g_s",
            (P::FuelScale, _) => "engine.fuel.per_kw_g_s",
            (_, Some(id)) => overlay::figure(truck, id, self.p, 0.0).map_or("", |f| f.0),
            _ => "engine.reference_torque_nm",
        }
    }

    /// Whether it is a factor on a table.
    pub(super) fn is_factor(&self) -> bool {
        matches!(self.p, P::TorqueReport | P::FuelScale)
    }
}

/// An overlay that changes nothing, to have a truck's figures checked.
fn nothing(truck: &TruckParameters) -> Overlay {
    let (base, set, table_effects) = Default::default();
    Overlay { schema: 1, base, name: truck.name.clone(), set, table_effects }
}

/// A truck on its way, and the factors on its tables.
#[derive(Debug, Clone)]
pub(super) struct Standing {
    pub(super) truck: TruckParameters,
    full_load: f64,
    fuel: f64,
    /// What drives asked for last and no truck has, by path.
    pub(super) refused: BTreeMap<&'static str, f64>,
}

impl Standing {
    pub(super) fn new(truck: TruckParameters) -> Self {
        Self { truck, full_load: 1.0, fuel: 1.0, refused: BTreeMap::new() }
    }

    /// The figure as it stands.
    pub(super) fn value(&self, f: &Figure) -> f64 {
        self.with(f, 0.0)
    }

    /// The figure with a size of the replay's parameter; linear in it.
    fn with(&self, f: &Figure, size: f64) -> f64 {
        match (f.p, f.id) {
            (P::TorqueReport, _) => self.full_load * (1.0 + size),
            (P::FuelScale, _) => self.fuel * (1.0 + size),
            (_, Some(id)) => overlay::figure(&self.truck, id, f.p, size).map_or(f64::NAN, |x| x.1),
            _ => self.truck.engine.reference_torque_nm * (1.0 + size),
        }
    }

    /// Change of the figure per size.
    pub(super) fn slope(&self, f: &Figure) -> f64 {
        self.with(f, 1.0) - self.with(f, 0.0)
    }

    /// What the truck file at the start says of a size that counts from here.
    pub(super) fn prior(&self, start: &TruckParameters, f: &Figure, weighed: bool) -> Prior {
        let slope = self.slope(f);
        let nominal = Self::new(start.clone()).value(f);
        let known = start.provenance.get(f.path(start)).and_then(|o| o.sigma);
        let sigma = match (known.filter(|s| *s > 0.0 && !f.is_factor()), f.p) {
            (Some(sigma), _) => sigma / slope.abs(),
            (None, P::Mass) if weighed => LOAD_SHEET_FRAC,
            (None, P::TorqueScale | P::TorqueReport) => ENGINE_SHEET_FRAC,
            (None, P::FuelScale) => FUEL_LEVEL_FRAC,
            _ => f.p.spec().prior,
        };
        Prior { mean: (nominal - self.value(f)) / slope, sigma }
    }

    /// Takes sizes over.
    pub(super) fn apply(&mut self, sizes: &[(&Figure, f64)]) {
        let of = |p: P| sizes.iter().find(|s| s.0.p == p).map(|s| 1.0 + s.1);
        let before = self.truck.clone();
        for (f, size) in sizes {
            let carried = f.id.and_then(|id| overlay::figure(&before, id, f.p, *size));
            let Some((path, value)) = carried else { continue };
            let truck = self.truck.with_parameter(path, value);
            match truck.ok().filter(|t| t.with_overlay(&nothing(t)).is_ok()) {
                Some(truck) => {
                    self.truck = truck;
                    self.refused.remove(path);
                }
                None => {
                    self.refused.insert(path, value);
                }
            }
        }
        let torque = of(P::TorqueScale).unwrap_or(1.0);
        let e = &mut self.truck.engine;
        e.reference_torque_nm *= torque;
        // The messages' percent tells full load and flow, and a percent is worth another torque now;
        // what is not told stays in newton metres as the sheet has it. The flow is close to a
        // multiple of the torque: what it is not the next round sees.
        if let Some(demand) = of(P::TorqueReport) {
            e.full_load_torque_nm.iter_mut().for_each(|nm| *nm *= torque * demand);
            self.full_load *= torque * demand;
            // a map that just spans what the sheet says ends below
            let peak_nm = e.peak_torque_nm();
            if let Some(map) = &mut e.fuel_map {
                map.extrapolate |= map.torque_nm.last().is_some_and(|last_nm| *last_nm < peak_nm);
            }
        }
        if let Some(level) = of(P::FuelScale) {
            let factor = level / torque;
            e.scale_fuel(factor);
            self.fuel *= factor;
        }
    }
}
