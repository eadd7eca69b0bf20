//! Statistics of the diagnosis: whitening, marginal Gram matrices, evidence.

pub(crate) mod evidence;
pub(crate) mod whiten;
