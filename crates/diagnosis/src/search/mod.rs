//! From nothing to a set of causes, by evidence.
//!
//! | file | |
//! |---|---|
//! | `evidence` | what explanations are compared by |
//! | `screen` | what every cause would add |
//! | `free` | what a set frees |
//! | `refit` | a set fitted |
//! | `steps` | add, swap, drop, pair |
//! | `gate` | which are kept |
//! | `kept` | search and gate in turns |
//! | `held_out` | causes against unseen drives |
//! | `worth` | what evidence is worth |
//! | `weights` | how probable an explanation is |
//! | `decisions` | the numbers that decide |

pub(crate) mod decisions;
pub(crate) mod evidence;
pub(crate) mod free;
pub(crate) mod gate;
pub(crate) mod held_out;
pub(crate) mod kept;
pub(crate) mod refit;
pub(crate) mod screen;
pub(crate) mod steps;
pub(crate) mod weights;
pub(crate) mod worth;
