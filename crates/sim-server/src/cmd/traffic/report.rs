//! `statistics.json`.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::Serialize;
use sim::Scenario;
use traffic_client::Mode;
use traffic_client::native::TrafficConfig;
use traffic_client::stats::{
    Moments, QUANTITIES, Quantity, Samples, kolmogorov_smirnov, kolmogorov_smirnov_by_chance,
    moments, wasserstein,
};

use super::measured::Measured;
use super::{Driven, End};
use crate::provenance::Provenance;

/// The whole file.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    #[serde(flatten)]
    provenance: Provenance,
    scenario: String,
    road: String,
    engine: String,
    mode: Mode,
    end_reason: End,
    /// Recordings that the drivers were calibrated to.
    calibrated_to: Vec<String>,
    /// What came to the road and what it served, where an engine made it.
    #[serde(skip_serializing_if = "Option::is_none")]
    demand: Option<Demand>,
    simulated: Figures,
    /// All recordings together.
    #[serde(skip_serializing_if = "Option::is_none")]
    measured: Option<Figures>,
    /// Which distances stand below, what each is of, and whether its speeds are near enough.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    comparisons: Vec<Comparison>,
    /// Simulated against measured, by quantity.
    #[serde(skip_serializing_if = "Option::is_none")]
    distances: Option<Distances>,
    /// The same drivers between the measured start, arrivals and end of each recording, all
    /// recordings together.
    #[serde(skip_serializing_if = "Option::is_none")]
    bounded: Option<Bounded>,
    /// The same for each recording.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    recordings: Vec<OneRecording>,
}

/// Demand and what became of it.
#[derive(Debug, Clone, Copy, Serialize)]
pub(super) struct Demand {
    /// What the scenario asks for at the start of the road, vehicles per hour and lane.
    asked_veh_h_lane: f64,
    /// What its drivers carry in equilibrium, vehicles per hour and lane.
    equilibrium_veh_h_lane: f64,
    /// Vehicles that came to the road and those that wait before it at the end.
    #[serde(flatten)]
    arrivals: sim::Arrivals,
}

impl Demand {
    pub(super) fn new(config: &TrafficConfig, arrivals: sim::Arrivals) -> Self {
        Self {
            asked_veh_h_lane: config.asked_veh_h_lane(),
            equilibrium_veh_h_lane: config.capacity().flow_veh_h_lane,
            arrivals,
        }
    }
}

#[derive(Debug, Serialize)]
struct OneRecording {
    file: String,
    figures: Figures,
    distances: Distances,
    #[serde(skip_serializing_if = "Option::is_none")]
    bounded: Option<Bounded>,
    /// This recording against all others together: what recordings differ by among themselves.
    #[serde(skip_serializing_if = "Option::is_none")]
    distances_to_other_recordings: Option<Distances>,
}

/// Traffic with the start and the arrivals of a recording.
#[derive(Debug, Serialize)]
struct Bounded {
    distances: Distances,
    lane_changes_per_vehicle_1_km: f64,
    /// What remains if nobody reacts to anybody: everyone keeps the speed of their arrival.
    ks_of_kept_speeds: f64,
}

/// Traffic in numbers.
#[derive(Debug, Serialize)]
struct Figures {
    duration_s: f64,
    vehicles: usize,
    driven_km: f64,
    flow_per_lane_1_h: f64,
    density_per_lane_1_km: f64,
    lane_changes: usize,
    lane_changes_per_vehicle_1_km: f64,
    min_gap_m: f64,
    #[serde(flatten)]
    moments: BTreeMap<&'static str, Moments>,
}

/// What traffic was compared with the recordings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Kind {
    Free,
    Bounded,
    Replayed,
}

/// One kind of comparison in words, and its verdict on the speeds.
#[derive(Debug, Serialize)]
struct Comparison {
    kind: Kind,
    /// Where in this file its distances stand.
    key: &'static str,
    definition: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    ks_of_speed: Option<f64>,
    /// Near enough is at most this.
    bound: f64,
    within_bound: bool,
}

impl Comparison {
    fn new(kind: Kind, distances: &Distances) -> Self {
        let (key, bound, definition) = match kind {
            Kind::Free => (
                "distances",
                0.15,
                "the scenario's own demand (inflow, density, speeds at both ends), drivers and seed, \
                 which a calibration takes from its first recording; nothing else is taken from \
                 the recordings compared with",
            ),
            Kind::Bounded => (
                "bounded",
                0.15,
                "the scenario's drivers between the start, arrivals, departures and the speed at \
                 the end of each recording compared with",
            ),
            Kind::Replayed => ("distances", 0.10, "the trajectories of a recording (mode rep)"),
        };
        let ks_of_speed = distances.get("speed_m_s").map(|d| d.ks);
        let within_bound = ks_of_speed.is_some_and(|ks| ks <= bound);
        Self { kind, key, definition, ks_of_speed, bound, within_bound }
    }

    /// A line: what it is, the verdict, all distances.
    fn line(&self, distances: Option<&Distances>) -> String {
        let all: Vec<String> = distances
            .into_iter()
            .flatten()
            .map(|(key, d)| {
                let chance = d.ks_by_chance.map(|c| format!(", by chance up to {c:.3}"));
                format!("{key} {:.3} ({:.2}{})", d.ks, d.wasserstein, chance.unwrap_or_default())
            })
            .collect();
        let name = match self.kind {
            Kind::Free => "free",
            Kind::Bounded => "bounded",
            Kind::Replayed => "replayed",
        };
        let verdict = match self.ks_of_speed {
            Some(ks) => format!(
                "KS of speed {ks:.3}, {} {:.2}",
                if self.within_bound { "within" } else { "not within" },
                self.bound
            ),
            None => "no speeds to compare".to_owned(),
        };
        format!(
            "\n{name} (`{}`: {}): {verdict}; KS (Wasserstein) to measured: {}",
            self.key,
            self.definition,
            all.join(", ")
        )
    }
}

type Distances = BTreeMap<&'static str, Distance>;

/// How far two distributions lie apart.
#[derive(Debug, Serialize)]
struct Distance {
    /// Kolmogorov-Smirnov, dimensionless.
    ks: f64,
    /// Wasserstein-1, in the unit of the quantity.
    wasserstein: f64,
    /// At lane changes, which are few and independent: `ks` of two sets of this size of one
    /// distribution stays below this in 95 % of cases, so that a smaller one says nothing.
    #[serde(skip_serializing_if = "Option::is_none")]
    ks_by_chance: Option<f64>,
}

fn figures(s: &Samples, lanes_m: f64) -> Figures {
    let of = |q, key| moments(s.of(q)).map(|m| (key, m));
    Figures {
        duration_s: s.duration_s,
        vehicles: s.vehicles,
        driven_km: s.driven_km,
        flow_per_lane_1_h: s.flow_1_h(lanes_m),
        density_per_lane_1_km: s.density_1_km(lanes_m),
        lane_changes: s.lane_changes,
        lane_changes_per_vehicle_1_km: s.lane_changes_1_km(),
        min_gap_m: if s.min_gap_m.is_finite() { s.min_gap_m } else { 0.0 },
        moments: QUANTITIES.iter().filter_map(|&(q, key, _)| of(q, key)).collect(),
    }
}

fn distances(a: &Samples, b: &Samples) -> Distances {
    let of = |q, key: &'static str| {
        let (ks, wasserstein) =
            kolmogorov_smirnov(a.of(q), b.of(q)).zip(wasserstein(a.of(q), b.of(q)))?;
        let rare = key.starts_with("lane_change");
        let ks_by_chance = rare.then(|| kolmogorov_smirnov_by_chance(a.of(q).len(), b.of(q).len()));
        Some((key, Distance { ks, wasserstein, ks_by_chance }))
    };
    QUANTITIES.iter().filter_map(|&(q, key, _)| of(q, key)).collect()
}

impl Bounded {
    fn new(bounded: &Samples, measured: &Samples, kept_m_s: &[f64]) -> Self {
        let speeds = measured.of(Quantity::Speed);
        Self {
            distances: distances(bounded, measured),
            lane_changes_per_vehicle_1_km: bounded.lane_changes_1_km(),
            ks_of_kept_speeds: kolmogorov_smirnov(kept_m_s, speeds).unwrap_or(1.0),
        }
    }
}

impl Report {
    pub(super) fn new(
        scenario: &Scenario,
        seed: u64,
        driven: &Driven,
        measured: &Measured,
        bounded: &[Samples],
        calibrated_to: &[PathBuf],
    ) -> Self {
        let there = !measured.each.is_empty();
        let recordings =
            measured.files.iter().zip(&measured.each).enumerate().map(|(k, (f, s))| {
                let rest = measured.each.iter().enumerate().filter(|&(j, _)| j != k);
                let others = Samples::pooled(rest.map(|(_, other)| other));
                OneRecording {
                    file: f.display().to_string(),
                    figures: figures(s, measured.lanes_m),
                    distances: distances(&driven.samples, s),
                    bounded: bounded.get(k).map(|b| Bounded::new(b, s, &measured.kept_m_s[k])),
                    distances_to_other_recordings: (measured.each.len() > 1)
                        .then(|| distances(s, &others)),
                }
            });
        let together = (!bounded.is_empty()).then(|| {
            let all = Samples::pooled(bounded);
            Bounded::new(&all, &measured.samples, &measured.kept_m_s.concat())
        });
        let distances = there.then(|| distances(&driven.samples, &measured.samples));
        let driven_kind = if driven.mode == Mode::Rep { Kind::Replayed } else { Kind::Free };
        let comparisons = distances
            .iter()
            .map(|d| Comparison::new(driven_kind, d))
            .chain(together.iter().map(|b| Comparison::new(Kind::Bounded, &b.distances)));
        Self {
            provenance: Provenance::of_seed(seed),
            scenario: scenario.name.clone(),
            road: scenario.road.clone(),
            engine: driven.engine.clone(),
            mode: driven.mode,
            end_reason: driven.end,
            calibrated_to: calibrated_to.iter().map(|p| p.display().to_string()).collect(),
            demand: driven
                .arrivals
                .map(|arrivals| Demand::new(&scenario.traffic.demand(seed), arrivals)),
            simulated: figures(&driven.samples, driven.lanes_m),
            measured: there.then(|| figures(&measured.samples, measured.lanes_m)),
            comparisons: comparisons.collect(),
            distances,
            bounded: together,
            recordings: recordings.collect(),
        }
    }

    /// The result in a sentence.
    pub(super) fn sentence(&self) -> String {
        let s = &self.simulated;
        let mean = |key| s.moments.get(key).map_or(0.0, |m| m.mean);
        let mut text = format!(
            "{}: {} vehicles, {:.1} vehicle-km in {:.0} s, {:.2} m/s, {:.0} vehicles per hour and \
             lane, {:.1} per km and lane, {:.2} lane changes per vehicle-km, smallest gap {:.2} m",
            self.engine,
            s.vehicles,
            s.driven_km,
            s.duration_s,
            mean("speed_m_s"),
            s.flow_per_lane_1_h,
            s.density_per_lane_1_km,
            s.lane_changes_per_vehicle_1_km,
            s.min_gap_m,
        );
        for comparison in &self.comparisons {
            let distances = match comparison.kind {
                Kind::Bounded => self.bounded.as_ref().map(|b| &b.distances),
                Kind::Free | Kind::Replayed => self.distances.as_ref(),
            };
            text.push_str(&comparison.line(distances));
        }
        for one in &self.recordings {
            let speed = |d: &Distances| d.get("speed_m_s").map_or(1.0, |d| d.ks);
            let (file, alone) = (&one.file, speed(&one.distances));
            text.push_str(&format!("\n  {file}: KS of speed {alone:.3}"));
            if let Some(b) = &one.bounded {
                let (ks, kept) = (speed(&b.distances), b.ks_of_kept_speeds);
                text.push_str(&format!(", bounded {ks:.3}, with kept speeds {kept:.3}"));
            }
        }
        text
    }
}
