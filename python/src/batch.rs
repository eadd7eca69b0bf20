//! Environments behind a lock, with the arrays that they write; Python copies from there. The
//! interpreter's lock is not held while they drive.

use std::sync::{Mutex, PoisonError};

use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;
use sim::batch::{
    BasePolicy, Drivers, EnvSpec, EpisodeStats, Fidelity, RewardConfig, RolloutSpec, Views,
};
use sim::{Overrides, SimError};
use traffic_client::native::WindowConfig;

use crate::fault::Fault;
use crate::scenario::changed;

/// Figures of an episode, in the order of [`row`].
const FIGURES: [&str; 12] = [
    "decisions",
    "time_s",
    "reward_s",
    "distance_m",
    "delta_speed_frac",
    "lane_changes",
    "aborted",
    "refused",
    "hard_braking_caused",
    "collided",
    "collision_caused",
    "fuel_g",
];

fn row(stats: &EpisodeStats) -> [f64; FIGURES.len()] {
    [
        f64::from(stats.decisions),
        stats.time_s,
        stats.reward_s,
        stats.distance_m,
        stats.delta_speed_frac(),
        f64::from(stats.lane_changes),
        f64::from(stats.aborted),
        f64::from(stats.refused),
        f64::from(stats.hard_braking_caused),
        f64::from(u8::from(stats.collided)),
        f64::from(u8::from(stats.collision_caused)),
        stats.fuel_g.unwrap_or(f64::NAN),
    ]
}

/// The environments and their arrays.
struct Inner {
    batch: sim::batch::Batch,
    obs: Vec<f32>,
    mask: Vec<u8>,
    reward: Vec<f32>,
    terminated: Vec<u8>,
    truncated: Vec<u8>,
    final_obs: Vec<f32>,
    episodes: Vec<EpisodeStats>,
}

impl Inner {
    fn drive(
        &mut self,
        work: impl FnOnce(&mut sim::batch::Batch, &mut Views<'_>) -> Result<(), SimError>,
    ) -> Result<(), Fault> {
        let mut views = Views {
            obs: &mut self.obs,
            mask: &mut self.mask,
            reward: &mut self.reward,
            terminated: &mut self.terminated,
            truncated: &mut self.truncated,
            final_obs: &mut self.final_obs,
            episodes: &mut self.episodes,
        };
        work(&mut self.batch, &mut views).map_err(|e| Fault::of_input(&e))
    }
}

/// Environments that are stepped together.
#[pyclass(frozen, module = "tractrix._native")]
pub(crate) struct Batch {
    inner: Mutex<Option<Inner>>,
}

impl Batch {
    fn with<R: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Inner) -> Result<R, Fault> + Send,
    ) -> Result<R, Fault> {
        py.detach(|| {
            let mut inner = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
            work(inner.as_mut().ok_or_else(|| Fault::Value("the environment is closed".into()))?)
        })
    }
}

#[pymethods]
impl Batch {
    /// `count` environments, the scenarios (name, or JSON text) in turn.
    #[new]
    #[pyo3(signature = (count, scenarios, *, road, seed, fidelity, spec, episode_s, start_spread_m, window_m,
        awake_m, change_cost_s, threads))]
    #[expect(clippy::too_many_arguments, reason = "keywords of one call from Python")]
    fn new(
        py: Python<'_>,
        count: usize,
        scenarios: Vec<(String, Option<String>)>,
        road: Option<&str>,
        seed: u64,
        fidelity: &str,
        spec: &str,
        episode_s: f64,
        start_spread_m: f64,
        window_m: Option<(f64, f64)>,
        awake_m: Option<f64>,
        change_cost_s: Option<f64>,
        threads: usize,
    ) -> PyResult<Self> {
        let fidelity = match fidelity {
            "kinematic" => Fidelity::Kinematic,
            "truck" => Fidelity::Truck,
            other => {
                let text = format!("fidelity = {other:?}: kinematic or truck");
                return Err(Fault::Value(text).into());
            }
        };
        let of = match spec {
            "ours" => EnvSpec::new,
            "paper" => EnvSpec::paper,
            other => {
                return Err(Fault::Value(format!("spec = {other:?}: ours or paper")).into());
            }
        };
        if let Some(cost_s) = change_cost_s.filter(|cost_s| !(0.0..=100.0).contains(cost_s)) {
            return Err(Fault::Value(format!("change_cost_s = {cost_s}: 0 to 100 s")).into());
        }
        let build = || -> Result<Inner, Fault> {
            let changes = Overrides { road, ..Overrides::default() };
            let specs = scenarios.iter().map(|(name, json)| {
                let scenario = changed(name, json.as_deref(), &changes)?;
                let usual = of(scenario, fidelity);
                let window = window_m.map_or(usual.window, |(behind_m, ahead_m)| {
                    let whole = behind_m == f64::INFINITY && ahead_m == f64::INFINITY;
                    (!whole).then_some(WindowConfig { behind_m, ahead_m, awake_m: None })
                });
                let window = window.map(|window| WindowConfig { awake_m, ..window });
                if awake_m.is_some() && window.is_none() {
                    return Err(Fault::Value("awake_m: not without a window_m".to_owned()));
                }
                let change_s = change_cost_s.unwrap_or(usual.reward.change_s);
                let reward = RewardConfig { change_s, ..usual.reward };
                Ok(EnvSpec { episode_s, start_spread_m, window, reward, ..usual })
            });
            let specs = specs.collect::<Result<Vec<_>, Fault>>()?;
            let specs: Vec<EnvSpec> = specs.iter().cycle().take(count).cloned().collect();
            let batch = sim::batch::Batch::new(specs, seed, threads);
            let batch = batch.map_err(|e| Fault::of_input(&e))?;
            let (n, size) = (batch.len(), batch.observation_size());
            Ok(Inner {
                batch,
                obs: vec![0.0; n * size],
                mask: vec![0; n * sim::batch::ACTIONS.len()],
                reward: vec![0.0; n],
                terminated: vec![0; n],
                truncated: vec![0; n],
                final_obs: vec![0.0; n * size],
                episodes: vec![EpisodeStats::default(); n],
            })
        };
        Ok(Self { inner: Mutex::new(Some(py.detach(build)?)) })
    }

    /// Numbers in an observation.
    fn observation_size(&self, py: Python<'_>) -> PyResult<usize> {
        Ok(self.with(py, |inner| Ok(inner.batch.observation_size()))?)
    }

    /// Begins episodes where `which` is true, with these seeds or the next of their own.
    fn reset(&self, py: Python<'_>, seeds: Vec<Option<u64>>, which: Vec<bool>) -> PyResult<()> {
        let of = move |i: usize| {
            let wanted = which.get(i).copied().unwrap_or(false);
            wanted.then(|| seeds.get(i).copied().flatten())
        };
        Ok(self.with(py, |inner| inner.drive(|batch, views| batch.begin(of, views)))?)
    }

    /// Drives one decision everywhere.
    fn step(&self, py: Python<'_>, actions: PyBuffer<u8>) -> PyResult<()> {
        let actions = actions.to_vec(py)?;
        Ok(self.with(py, |inner| inner.drive(|batch, views| batch.step(&actions, views)))?)
    }

    /// Copies the latest arrays into these: observations, masks, rewards, ends by collision and by
    /// time or road, last observations of ended episodes.
    #[expect(clippy::too_many_arguments, reason = "one array each")]
    fn read(
        &self,
        py: Python<'_>,
        obs: PyBuffer<f32>,
        mask: PyBuffer<u8>,
        reward: PyBuffer<f32>,
        terminated: PyBuffer<u8>,
        truncated: PyBuffer<u8>,
        final_obs: PyBuffer<f32>,
    ) -> PyResult<()> {
        // Who holds this lock while it drives never waits for the interpreter.
        let guard = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
        let inner =
            guard.as_ref().ok_or_else(|| Fault::Value("the environment is closed".into()))?;
        obs.copy_from_slice(py, &inner.obs)?;
        mask.copy_from_slice(py, &inner.mask)?;
        reward.copy_from_slice(py, &inner.reward)?;
        terminated.copy_from_slice(py, &inner.terminated)?;
        truncated.copy_from_slice(py, &inner.truncated)?;
        final_obs.copy_from_slice(py, &inner.final_obs)
    }

    /// Writes what each action is worth over keeping, 3 numbers per environment.
    #[pyo3(signature = (out, *, base, horizon_s, rollouts, discount_frac_s, drivers))]
    #[expect(clippy::too_many_arguments, reason = "keywords of one call from Python")]
    fn advantages(
        &self,
        py: Python<'_>,
        out: PyBuffer<f32>,
        base: &str,
        horizon_s: f64,
        rollouts: u32,
        discount_frac_s: f64,
        drivers: &str,
    ) -> PyResult<()> {
        let drivers = match drivers {
            "true" => Drivers::True,
            "forgotten" => Drivers::Forgotten,
            other => {
                let text = format!("drivers = {other:?}: true or forgotten");
                return Err(Fault::Value(text).into());
            }
        };
        let base = BasePolicy::named(base).map_err(|e| Fault::of_input(&e))?;
        let spec = RolloutSpec { base, horizon_s, rollouts, discount_frac_s, drivers };
        let advantages = self.with(py, |inner| {
            let mut out = vec![0.0; inner.reward.len() * sim::batch::ACTIONS.len()];
            inner.batch.advantages(&spec, &mut out).map_err(|e| Fault::of_input(&e))?;
            Ok(out)
        })?;
        out.copy_from_slice(py, &advantages)
    }

    /// Writes what a decider would do, an action per environment.
    fn wishes(&self, py: Python<'_>, decider: &str, out: PyBuffer<u8>) -> PyResult<()> {
        let kind = match BasePolicy::named(decider).map_err(|e| Fault::of_input(&e))? {
            BasePolicy::Decider(kind) => kind,
            BasePolicy::Policy(_) => planner::DeciderKind::Dqn,
        };
        let wishes = self.with(py, |inner| {
            let mut out = vec![0; inner.reward.len()];
            inner.batch.wishes(kind, &mut out).map_err(|e| Fault::of_input(&e))?;
            Ok(out)
        })?;
        out.copy_from_slice(py, &wishes)
    }

    /// Seed and figures of each episode.
    fn episodes(&self, py: Python<'_>) -> PyResult<Vec<(u64, Vec<f64>)>> {
        let of = |stats: &EpisodeStats| (stats.seed, row(stats).to_vec());
        Ok(self.with(py, |inner| Ok(inner.episodes.iter().map(of).collect()))?)
    }

    /// Names of the figures.
    #[staticmethod]
    fn figures() -> Vec<&'static str> {
        FIGURES.to_vec()
    }

    fn close(&self, py: Python<'_>) {
        py.detach(|| *self.inner.lock().unwrap_or_else(PoisonError::into_inner) = None);
    }
}
