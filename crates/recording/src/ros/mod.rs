//! The messages of a recording: plain serde structs whose field order is that of the `.msg` files,
//! so that CDR bytes are those of a ROS 2 node, and the texts that describe them.

pub(crate) mod diagnostic;
pub(crate) mod input;
pub(crate) mod marker;
pub(crate) mod schema;
pub(crate) mod standard;
pub(crate) mod truck;

use serde::Serialize;

/// A message type of a recording.
pub(crate) trait Message: Serialize {
    /// `package/Type`, the key of its definition.
    const DEFINITION: &'static str;
    /// `package/msg/Type`, the name in a recording.
    const NAME: &'static str;
}
