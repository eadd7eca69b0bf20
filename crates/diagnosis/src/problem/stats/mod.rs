//! Statistics of the diagnosis: whitening, marginal Gram matrices, evidence.

pub(crate) mod evidence;
pub(crate) mod slow;
pub(crate) mod whiten;
