//! The learned decider: a fully connected network with rectified hidden layers (the paper's
//! 216-256-512-256-3), evaluated here without any framework.
//!
//! Files: `policy.safetensors` with `layers.<i>.weight` (`[out, in]`, f32, as PyTorch stores it) and
//! `layers.<i>.bias`, and `policy.json` with at least
//! `{"schema": 1, "observation_hash": "<16 hex digits>", "actions": ["left", "keep", "right"],
//! "weights_sha256": "<64 hex digits>"}`; more keys (training revision, evaluation) are kept out of
//! the decision. The hash says which [`ObservationSpec`] the policy was trained on; one trained on
//! another observation, or torn weights, are refused.

use alloc::format;
use alloc::vec;
use alloc::vec::Vec;

use super::LaneChoice;
use crate::PlannerError;
use crate::decider::observation::ObservationSpec;

/// Largest accepted layer.
const WIDTH_MAX: usize = 8192;

/// One layer, weights transposed: `weights[i * outputs + o]`.
#[derive(Debug, Clone, PartialEq)]
struct Layer {
    outputs: usize,
    weights: Vec<f32>,
    bias: Vec<f32>,
}

/// Columns that are added up together: each sum is read and written once for all of them.
const TOGETHER: usize = 4;

impl Layer {
    /// `y = W x + b`, in the order of the inputs whatever is left out or taken together.
    fn apply(&self, x: &[f32], y: &mut [f32], rectified: bool) {
        let n = self.outputs;
        let y = &mut y[..n];
        y.copy_from_slice(&self.bias);
        let mut some = [(0.0, 0); TOGETHER];
        let mut count = 0;
        for (i, &value) in x.iter().enumerate() {
            if value != 0.0 {
                some[count] = (value, i * n);
                count += 1;
            }
            if count == TOGETHER {
                let [a, b, c, d] = some.map(|(value, at)| (value, &self.weights[at..at + n]));
                for (o, sum) in y.iter_mut().enumerate() {
                    *sum = *sum + a.0 * a.1[o] + b.0 * b.1[o] + c.0 * c.1[o] + d.0 * d.1[o];
                }
                count = 0;
            }
        }
        for &(value, at) in &some[..count] {
            for (sum, weight) in y.iter_mut().zip(&self.weights[at..at + n]) {
                *sum += value * weight;
            }
        }
        if rectified {
            for v in y {
                *v = v.max(0.0);
            }
        }
    }
}

/// Memory of a forward pass, from [`Policy::scratch`].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Scratch {
    values: [Vec<f32>; 2],
}

/// A network, what it sees and the meaning of its outputs.
#[derive(Debug, Clone, PartialEq)]
pub struct Policy {
    spec: ObservationSpec,
    layers: Vec<Layer>,
    actions: [LaneChoice; 3],
}

impl Policy {
    /// A policy that sees `spec`, from layers of (row-major `[out, in]` weights, bias), actions in
    /// output order.
    ///
    /// # Errors
    /// [`PlannerError::Policy`] if sizes do not chain from the observation to three actions, or a
    /// weight is not finite.
    pub fn new(
        spec: ObservationSpec,
        layers: &[(Vec<f32>, Vec<f32>)],
        actions: [LaneChoice; 3],
    ) -> Result<Self, PlannerError> {
        let bad = |why: alloc::string::String| PlannerError::Policy(why);
        let mut inputs = spec.size();
        let mut chained = Vec::with_capacity(layers.len());
        for (i, (weight, bias)) in layers.iter().enumerate() {
            let outputs = bias.len();
            if outputs == 0 || outputs > WIDTH_MAX || weight.len() != outputs * inputs {
                return Err(bad(format!(
                    "layer {i}: {} weights and {outputs} biases for {inputs} inputs",
                    weight.len()
                )));
            }
            if weight.iter().chain(bias).any(|w| !w.is_finite()) {
                return Err(bad(format!("layer {i}: a weight is not finite")));
            }
            let mut transposed = vec![0.0; weight.len()];
            for o in 0..outputs {
                for i in 0..inputs {
                    transposed[i * outputs + o] = weight[o * inputs + i];
                }
            }
            chained.push(Layer { outputs, weights: transposed, bias: bias.clone() });
            inputs = outputs;
        }
        if inputs != actions.len() || chained.is_empty() {
            return Err(bad(format!("{inputs} outputs for {} actions", actions.len())));
        }
        Ok(Self { spec, layers: chained, actions })
    }

    /// Reads `policy.safetensors` and `policy.json`.
    ///
    /// # Errors
    /// [`PlannerError::Policy`] says what is missing, of the wrong size or from another observation.
    #[cfg(feature = "std")]
    pub fn from_files(safetensors: &[u8], sidecar: &str) -> Result<Self, PlannerError> {
        let bad = |why: alloc::string::String| PlannerError::Policy(why);
        let sidecar: Sidecar =
            serde_json::from_str(sidecar).map_err(|e| bad(format!("policy.json: {e}")))?;
        let (spec, actions) = sidecar.check(safetensors)?;
        let tensors = safetensors::SafeTensors::deserialize(safetensors)
            .map_err(|e| bad(format!("policy.safetensors: {e}")))?;
        let mut layers = Vec::new();
        for i in 0..=32 {
            let name = format!("layers.{i}.weight");
            if !tensors.names().contains(&name.as_str()) {
                break;
            }
            let weight = floats(&tensors, &name, 2)?;
            let bias = floats(&tensors, &format!("layers.{i}.bias"), 1)?;
            layers.push((weight, bias));
        }
        Self::new(spec, &layers, actions)
    }

    /// What the policy sees.
    #[must_use]
    pub fn spec(&self) -> ObservationSpec {
        self.spec
    }

    /// Memory for [`Self::values`] of this policy.
    #[must_use]
    pub fn scratch(&self) -> Scratch {
        let widest = self.layers.iter().map(|l| l.outputs).max().unwrap_or(0);
        Scratch { values: [vec![0.0; widest], vec![0.0; widest]] }
    }

    /// Values of the actions in output order for an observation of [`Self::spec`]; not a number if
    /// the observation's size is another. Allocates only for a scratch of another policy.
    #[must_use]
    pub fn values(&self, observation: &[f32], scratch: &mut Scratch) -> [f32; 3] {
        if observation.len() != self.spec.size() {
            return [f32::NAN; 3];
        }
        let [x, y] = &mut scratch.values;
        let last = self.layers.len() - 1;
        for (i, layer) in self.layers.iter().enumerate() {
            y.resize(layer.outputs, 0.0);
            let input: &[f32] = if i == 0 { observation } else { x };
            layer.apply(input, y, i < last);
            core::mem::swap(x, y);
        }
        [x[0], x[1], x[2]]
    }

    /// The allowed action of the highest value; keep if a value is not finite.
    #[must_use]
    pub fn choose(
        &self,
        observation: &[f32],
        scratch: &mut Scratch,
        allowed: impl Fn(LaneChoice) -> bool,
    ) -> LaneChoice {
        let values = self.values(observation, scratch);
        if values.iter().any(|v| !v.is_finite()) {
            return LaneChoice::Keep;
        }
        self.actions
            .into_iter()
            .zip(values)
            .filter(|&(action, _)| action == LaneChoice::Keep || allowed(action))
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .map_or(LaneChoice::Keep, |(action, _)| action)
    }
}

/// The part of `policy.json` that decides whether the weights may be used.
#[cfg(feature = "std")]
#[derive(Debug, serde::Deserialize)]
struct Sidecar {
    schema: u32,
    observation_hash: alloc::string::String,
    actions: [LaneChoice; 3],
    weights_sha256: alloc::string::String,
}

#[cfg(feature = "std")]
impl Sidecar {
    fn check(&self, weights: &[u8]) -> Result<(ObservationSpec, [LaneChoice; 3]), PlannerError> {
        use sha2::Digest;
        let bad = |why: alloc::string::String| PlannerError::Policy(why);
        if self.schema != 1 {
            return Err(bad(format!("policy.json: schema {} is not 1", self.schema)));
        }
        let known = ObservationSpec::ALL.map(|spec| (spec, format!("{:016x}", spec.hash())));
        let Some((spec, _)) = known.iter().find(|(_, hash)| *hash == self.observation_hash) else {
            return Err(bad(format!(
                "trained on observation {}, this program makes {}",
                self.observation_hash,
                known.map(|(_, hash)| hash).join(" and ")
            )));
        };
        let digest: alloc::string::String =
            sha2::Sha256::digest(weights).iter().map(|b| format!("{b:02x}")).collect();
        if !self.weights_sha256.eq_ignore_ascii_case(&digest) {
            return Err(bad(format!(
                "policy.safetensors has SHA-256 {digest}, policy.json names {}",
                self.weights_sha256
            )));
        }
        let mut seen = self.actions;
        seen.sort_by_key(|a| *a as u8);
        if seen != [LaneChoice::Left, LaneChoice::Keep, LaneChoice::Right] {
            return Err(bad("policy.json: actions must be left, keep and right".into()));
        }
        Ok((*spec, self.actions))
    }
}

/// A tensor of single-precision numbers.
#[cfg(feature = "std")]
fn floats(
    tensors: &safetensors::SafeTensors<'_>,
    name: &str,
    dimensions: usize,
) -> Result<Vec<f32>, PlannerError> {
    let tensor = tensors
        .tensor(name)
        .map_err(|e| PlannerError::Policy(format!("policy.safetensors, {name}: {e}")))?;
    if tensor.dtype() != safetensors::Dtype::F32 || tensor.shape().len() != dimensions {
        return Err(PlannerError::Policy(format!(
            "policy.safetensors, {name}: {:?} of shape {:?}, not f32 of {dimensions} dimensions",
            tensor.dtype(),
            tensor.shape()
        )));
    }
    let bytes = tensor.data().chunks_exact(4);
    Ok(bytes.map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
}
