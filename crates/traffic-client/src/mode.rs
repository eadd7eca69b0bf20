//! The paper's four traffic modes (Sec. IV-A), and the manifest that makes a run repeatable.
//!
//! | mode | engines | ego |
//! |---|---|---|
//! | `pure` | native, SUMO | not seen |
//! | `inter` | native, SUMO | seen |
//! | `re` | the engine of the manifest | as in the manifest; every 100 ticks are compared |
//! | `rep` | recorded trajectories | not seen |
//!
//! `re` needs the same ego states at the same ticks, so it repeats a whole closed loop or follows a
//! logged ego. A difference is an error that names the ticks, never a silent one.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tractrix_core::{EgoState, Scene, Time, TrafficSource};

use crate::TrafficError;
use crate::hash::Fnv;

/// A traffic mode.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    /// Traffic alone.
    Pure,
    /// Traffic that reacts to the ego.
    #[default]
    Inter,
    /// A run again, bit by bit.
    Re,
    /// Recorded trajectories.
    Rep,
}

impl std::str::FromStr for Mode {
    type Err = TrafficError;

    fn from_str(text: &str) -> Result<Self, TrafficError> {
        match text {
            "pure" => Ok(Self::Pure),
            "inter" => Ok(Self::Inter),
            "re" => Ok(Self::Re),
            "rep" => Ok(Self::Rep),
            other => {
                let why = format!("mode `{other}` is none of pure, inter, re, rep");
                Err(TrafficError::Config { why })
            }
        }
    }
}

/// Ticks per hash of a manifest.
pub const TICKS_PER_HASH: u64 = 100;

/// What is needed to repeat a run and to know that it was repeated.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Version of this format.
    pub schema: u32,
    /// Engine and its version: `native 0.1.0`, `SUMO 1.28.0`.
    pub engine: String,
    /// Seed.
    pub seed: u64,
    /// Inputs by name, each with a fingerprint or its text (road, scenario, options).
    pub inputs: BTreeMap<String, String>,
    /// Ticks of the run.
    pub ticks: u64,
    /// Running fingerprint of all scenes after every 100 ticks, hexadecimal.
    pub hashes: Vec<String>,
}

impl Manifest {
    /// Fingerprint of an input file or text.
    #[must_use]
    pub fn fingerprint(bytes: &[u8]) -> String {
        let mut hash = Fnv::default();
        for chunk in bytes.chunks(8) {
            let mut word = [0; 8];
            word.iter_mut().zip(chunk).for_each(|(to, from)| *to = *from);
            hash.add(u64::from_le_bytes(word));
        }
        hash.add(bytes.len() as u64);
        format!("{:016x}", hash.value())
    }

    /// The manifest as TOML.
    ///
    /// # Errors
    /// [`TrafficError::Manifest`] if it cannot be written.
    pub fn to_toml(&self) -> Result<String, TrafficError> {
        toml::to_string(self).map_err(|e| TrafficError::Manifest { why: e.to_string() })
    }

    /// A manifest from TOML.
    ///
    /// # Errors
    /// [`TrafficError::Manifest`] names the key, or an unknown schema.
    pub fn from_toml(text: &str) -> Result<Self, TrafficError> {
        let manifest: Self = toml::from_str(text).map_err(|e| TrafficError::Manifest {
            why: tractrix_core::words::deserializer_message(e.message()),
        })?;
        if manifest.schema == 1 {
            Ok(manifest)
        } else {
            let why = format!("schema {} is not 1", manifest.schema);
            Err(TrafficError::Manifest { why })
        }
    }

    /// Do engine, seed and inputs agree?
    ///
    /// # Errors
    /// [`TrafficError::Manifest`] names the first that does not.
    pub fn check_inputs(&self, now: &Self) -> Result<(), TrafficError> {
        let differs = |what: &str, was: &str, is: &str| {
            // Of long texts, the first line that differs says enough.
            let lines = was.lines().map(Some).chain(std::iter::repeat(None));
            let others = is.lines().map(Some).chain(std::iter::repeat(None));
            let (was, is) = lines
                .zip(others)
                .take_while(|pair| *pair != (None, None))
                .find(|(a, b)| a != b)
                .unwrap_or((Some(was), Some(is)));
            let (was, is) = (was.unwrap_or("nothing"), is.unwrap_or("nothing"));
            Err(TrafficError::Manifest { why: format!("{what} was `{was}`, is `{is}`") })
        };
        if self.engine != now.engine {
            return differs("engine", &self.engine, &now.engine);
        }
        if self.seed != now.seed {
            return differs("seed", &self.seed.to_string(), &now.seed.to_string());
        }
        for (name, was) in &self.inputs {
            let is = now.inputs.get(name).map_or("absent", String::as_str);
            if is != was {
                return differs(&format!("input {name}"), was, is);
            }
        }
        Ok(())
    }
}

/// A source whose scenes are fingerprinted, and compared with a manifest in mode `re`.
#[derive(Debug, Clone)]
pub struct Hashed<S> {
    inner: S,
    hash: Fnv,
    manifest: Manifest,
    expected: Option<Manifest>,
    stopped: bool,
}

impl<S> Hashed<S> {
    /// Fingerprints; `manifest` holds engine, seed and inputs.
    pub fn record(inner: S, manifest: Manifest) -> Self {
        let manifest = Manifest { schema: 1, ticks: 0, hashes: Vec::new(), ..manifest };
        Self { inner, hash: Fnv::default(), manifest, expected: None, stopped: false }
    }

    /// Fingerprints and compares with an earlier run.
    ///
    /// # Errors
    /// [`TrafficError::Manifest`] if engine, seed or inputs differ from the start.
    pub fn verify(inner: S, manifest: Manifest, expected: Manifest) -> Result<Self, TrafficError> {
        expected.check_inputs(&manifest)?;
        Ok(Self { expected: Some(expected), ..Self::record(inner, manifest) })
    }

    /// Takes no more fingerprints, unless they are compared.
    pub fn stop(&mut self) {
        self.stopped = self.expected.is_none();
    }

    /// The manifest so far.
    #[must_use]
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// The source inside.
    pub fn inner_mut(&mut self) -> &mut S {
        &mut self.inner
    }

    /// The source inside.
    #[must_use]
    pub fn inner(&self) -> &S {
        &self.inner
    }
}

impl<S: TrafficSource<Error = TrafficError>> TrafficSource for Hashed<S> {
    type Error = TrafficError;

    fn advance(&mut self, now: Time, ego: &EgoState) -> Result<&Scene, TrafficError> {
        let scene = self.inner.advance(now, ego)?;
        if self.stopped {
            return Ok(scene);
        }
        self.hash.add(scene.time.0 as u64);
        for n in &scene.neighbours {
            self.hash.add(n.id);
            for x in [n.front_s_m, n.rear_s_m, n.d_m, n.speed_m_s, n.accel_m_s2] {
                self.hash.add(x.to_bits());
            }
        }
        self.manifest.ticks += 1;
        if self.manifest.ticks.is_multiple_of(TICKS_PER_HASH) {
            let hash = format!("{:016x}", self.hash.value());
            let expected =
                self.expected.as_ref().and_then(|e| e.hashes.get(self.manifest.hashes.len()));
            if expected.is_some_and(|e| *e != hash) {
                let tick = self.manifest.ticks;
                return Err(TrafficError::Diverged { from_tick: tick - TICKS_PER_HASH, tick });
            }
            self.manifest.hashes.push(hash);
        }
        Ok(scene)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modes_have_their_names() {
        assert_eq!("re".parse::<Mode>().unwrap(), Mode::Re);
        assert!("all".parse::<Mode>().unwrap_err().to_string().contains("`all`"));
    }

    #[test]
    fn a_manifest_survives_toml_and_names_what_differs() {
        let mut m =
            Manifest { schema: 1, engine: "native 0.1.0".into(), seed: 7, ..Manifest::default() };
        m.inputs.insert("road".into(), Manifest::fingerprint(b"abc"));
        m.hashes.push("00ff".into());
        assert_eq!(Manifest::from_toml(&m.to_toml().unwrap()).unwrap(), m);
        let mut other = m.clone();
        other.inputs.insert("road".into(), Manifest::fingerprint(b"abd"));
        assert!(m.check_inputs(&other).unwrap_err().to_string().contains("input road"));
        assert!(
            Manifest::from_toml("schema = 2\nengine=\"\"\nseed=0\nticks=0\nhashes=[]\n[inputs]\n")
                .is_err()
        );
    }
}
