//! The traffic source of a world.

use tractrix_core::{EgoState, Scene, Time, TrafficSource};
use traffic_client::TrafficError;
use traffic_client::native::NativeTraffic;

/// One of the sources that a scenario can name.
#[derive(Debug, Clone)]
pub enum Traffic {
    /// An empty road.
    None(Scene),
    /// The native engine.
    Native(Box<NativeTraffic>),
}

impl TrafficSource for Traffic {
    type Error = TrafficError;

    fn advance(&mut self, now: Time, ego: &EgoState) -> Result<&Scene, TrafficError> {
        match self {
            Self::None(scene) => {
                scene.time = now;
                Ok(scene)
            }
            Self::Native(native) => native.advance(now, ego),
        }
    }
}
