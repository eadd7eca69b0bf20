//! The causes of the catalogue as hypotheses; their physics and words for both signs stand beside the truck
//! model ([`dynamics::catalogue`]).
//!
//! | file | |
//! |---|---|
//! | `param` | the parameters that the replay knows, with priors |
//! | `hypothesis` | which of them a cause has, and from where they are fitted |
//! | `sentence` | what is said of it |

pub(crate) mod hypothesis;
pub(crate) mod param;
pub(crate) mod sentence;
