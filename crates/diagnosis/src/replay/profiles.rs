//! Signals that depend on few parameters and cost more than the balance that they enter: delayed
//! pressure, brake heating, fan, cold tyres, shifted grade. Kept per drive for the last values of
//! those parameters, which rest while others are fitted.

use std::sync::{Arc, Mutex};

/// What a kept signal is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// Force of cold brakes, N; over the lag.
    Service,
    /// Heating of the linings above the air, K; over lag, speed scale, gain, fade and their own lag.
    BrakeHeat,
    /// How far the fan is on, 0 to 1; over start, hysteresis and band.
    Fan,
    /// Torque of the engine brake, Nm; over its lag behind the stage.
    EngineBrake,
    /// Force of the retarder that follows its stage, N; over what it has more.
    Retarder,
    /// Demand that a retarder of the brakes has followed, m/s²; over its saturation.
    Blended,
    /// How far a retarder that holds on descents is filled; over how steep they are.
    Downhill,
    /// Share of the cold tyres' extra that is left; over the time constant.
    Cold,
    /// Grade of the map; over its shift.
    Grade,
    /// Fuel rate of the map and load; over the lag.
    Willans,
    /// Torque over full load, or what else may be low; over the lag and the choice.
    Load,
    /// Pedal after its dead time, followed with a lag; over both.
    Pedal,
    /// Coolant above where derating begins, K; over that temperature and the lag.
    Overheat,
}

/// Most signals kept per drive.
const KEPT: usize = 28;

/// Values of the parameters that a signal depends on, the rest zero.
type Key = [u64; 6];

type Entry = (Kind, Key, Arc<[f64]>);

/// The kept signals of one drive, the latest at the end, and memory to work in.
#[derive(Debug, Default)]
pub(crate) struct Profiles(Mutex<Vec<Entry>>, Mutex<Vec<Vec<f64>>>);

impl Profiles {
    /// The signal at up to six parameter values, built where it is not kept.
    pub(super) fn get<const N: usize>(
        &self,
        kind: Kind,
        at: [f64; N],
        build: impl FnOnce() -> Vec<f64>,
    ) -> Arc<[f64]> {
        let mut key = Key::default();
        key.iter_mut().zip(at).for_each(|(k, x)| *k = x.to_bits());
        if let Ok(mut kept) = self.0.lock()
            && let Some(i) = kept.iter().rposition(|e| e.0 == kind && e.1 == key)
        {
            let entry = kept.remove(i);
            let signal = entry.2.clone();
            kept.push(entry);
            return signal;
        }
        let signal: Arc<[f64]> = build().into();
        if let Ok(mut kept) = self.0.lock() {
            if kept.len() >= KEPT {
                kept.remove(0);
            }
            kept.push((kind, key, signal.clone()));
        }
        signal
    }

    /// A vector of any content that has room already: fresh memory of this size costs as much as the
    /// balance that fills it.
    pub(super) fn scratch(&self) -> Vec<f64> {
        self.1.lock().ok().and_then(|mut s| s.pop()).unwrap_or_default()
    }

    pub(super) fn give_back(&self, used: Vec<f64>) {
        if let Ok(mut spare) = self.1.lock() {
            spare.push(used);
        }
    }
}
