//! What the stack and its bus were given, exactly, so that both can be driven again.
//!
//! | file | holds |
//! |---|---|
//! | `step` | a step of the stack as a message and back |
//! | `scene` | the other vehicles, as differences to what was to be expected |
//! | `bus` | what the truck's driver read from its bus and sent to it, tick by tick |
//! | `reader` | all of it out of a recording |

mod bus;
mod reader;
mod scene;
mod step;

pub(crate) use bus::call_messages;
pub use bus::{BusCall, BusTrace, DriverWish, SentFrame};
pub use reader::{About, Inputs};
pub(crate) use reader::{BUS_RECORD, DRIVER_KEY};
pub(crate) use scene::SceneWriter;
pub use step::GivenStep;
pub(crate) use step::{StepNote, StepNotes};
