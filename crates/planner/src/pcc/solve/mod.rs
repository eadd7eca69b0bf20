//! The continuous part: a sequence of convex quadratic programmes.
//!
//! | file | idea |
//! |---|---|
//! | `lin`, `quadratic` | the convex subproblem |
//! | `parabola` | an interval's fuel over traction, above zero wheel force |
//! | `solution` | what a solver returns |
//! | `structured` | its solution by a banded interior-point method, without a library |
//! | `programme`, `clarabel` | its solution by Clarabel |
//! | `solver` | which of the two a subproblem goes to |
//! | `sqp` | the iteration |
//! | `eco_roll` | coasting with the driveline open |

#[cfg(feature = "solver")]
pub mod clarabel;
pub(crate) mod eco_roll;
mod lin;
mod parabola;
#[cfg(feature = "solver")]
mod programme;
mod quadratic;
mod solution;
mod solver;
mod sqp;
mod structured;

#[cfg(feature = "solver")]
pub use clarabel::Clarabel;
pub use lin::{Linearisation, Subproblem, Terminal, TimeRule};
#[cfg(feature = "solver")]
pub use programme::{Programme, Triplets};
pub use solution::{Solution, SolveStatus};
pub use solver::DefaultSolver;
pub(crate) use sqp::refined_gears;
pub use sqp::{CutModel, Iterations, Problem, Profile, Solver, iterate};
pub use structured::Structured;
