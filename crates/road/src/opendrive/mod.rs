//! OpenDRIVE 1.4 to 1.8: reader, network, route, check, writer.
//!
//! [`Network`] is the whole map as the file states it, in f64, with every element evaluated
//! exactly; [`Network::route`] turns a way through it into a [`crate::Road`]. Source: ASAM
//! OpenDRIVE 1.8.1.
//!
//! Read: plan view (line, arc, spiral, poly3, paramPoly3), elevation, superelevation, lane offset,
//! lane sections, widths, borders, speed records of road types and lanes, road links, lane links,
//! common and direct junctions, tunnels and bridges. Objects and signals are counted by type. What
//! would change the surface and is not read (lateral shape, crossfall, lane height, CRG) is counted
//! as unsupported, everything else as ignored; [`Network::check`] reports both.

mod check;
mod companions;
mod count;
mod edges;
mod elements;
mod graph;
mod model;
mod network;
mod read;
mod read_lanes;
mod route;
mod tracks;
mod write;
mod xml;
mod xml_out;

pub use check::{Jump, JumpKind, MapReport, RecordCount};
pub use graph::{Heading, RouteChoice};
pub use model::{
    Connection, Contact, Header, Junction, Lane, LaneOutline, LaneSection, LaneUse, Link, Network,
    RoadRecord,
};
pub use network::NetworkPosition;
