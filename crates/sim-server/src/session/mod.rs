//! A session: worlds that are driven one after the other, and the one door through which page, API
//! and ROS 2 command them.
//!
//! [`Drive`] owns a world and drives it in its own thread; everything else holds a [`Handle`]. A
//! [`Command`] acts between two ticks and is answered ([`Acted`], [`Refused`]) once it has: the same
//! commands at the same ticks give the same bits, whoever sends them. A reset is another world with
//! a recording of its own; nothing is rewound.

mod command;
#[cfg(test)]
mod command_tests;
mod drive;
mod handle;
mod pace;
mod record;
mod registry;
mod runs;
mod settings;
mod start;
mod vehicle;

pub(crate) use command::{Command, CommandError, Wish};
use drive::{Drive, Ended, Job, Reply};
use handle::Asked;
pub(crate) use handle::{Acted, Handle, Next, Refused, RunState, State, answer, channel};
pub(crate) use pace::Pace;
pub(crate) use registry::{Claim, DEFAULT, Registry};
pub(crate) use runs::{Begin, Place, RESULTS, Runs, first_world, setting};
pub(crate) use settings::{Controls, Settings, Standing};
pub(crate) use start::{Wanted, start};
