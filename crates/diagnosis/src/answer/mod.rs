//! What is concluded.
//!
//! | file | |
//! |---|---|
//! | `wrong` | what the simulation gets wrong |
//! | `named` | causes, sizes, rivals, probabilities |
//! | `observable` | what the drives can show |
//! | `detectable` | how loud silence is |
//! | `gain` | what an extension is worth |
//! | `overlay` | the extended truck |
//! | `verdict` | the form of `diagnosis.json` |

pub(crate) mod detectable;
pub(crate) mod gain;
pub(crate) mod named;
pub(crate) mod observable;
pub(crate) mod overlay;
pub(crate) mod verdict;
pub(crate) mod wrong;
