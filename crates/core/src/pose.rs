//! Where the truck is: what a bus does not say, and who does.

use serde::{Deserialize, Serialize};

use crate::{Stamped, Time};

/// Position and attitude of the truck, referred to the reference point of [`crate::Geometry`].
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Pose {
    /// Map x, m.
    pub x_m: f64,
    /// Map y, m.
    pub y_m: f64,
    /// Map z, m.
    pub z_m: f64,
    /// Tractor heading, rad, counter-clockwise from map x, not wrapped.
    pub yaw_rad: f64,
    /// Position along the route, m.
    pub s_m: f64,
    /// Offset from the route's reference line, m, positive left.
    pub d_m: f64,
    /// Lateral speed of the reference point, m/s, body y.
    pub lateral_speed_m_s: f64,
    /// Articulation angle, rad: trailer heading minus tractor heading.
    pub articulation_rad: f64,
    /// Trailer yaw rate, rad/s.
    pub trailer_yaw_rate_rad_s: f64,
}

/// What the truck's own sensors say about its motion.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Motion {
    /// Longitudinal speed of the reference point, m/s.
    pub speed_m_s: f64,
    /// Tractor yaw rate, rad/s, counter-clockwise.
    pub yaw_rate_rad_s: f64,
}

/// A position measured by satellites, in WGS 84.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Fix {
    /// Latitude, degrees, positive north.
    pub latitude_deg: f64,
    /// Longitude, degrees, positive east.
    pub longitude_deg: f64,
    /// Course over ground, rad, clockwise from true north; `None` where the receiver has none.
    pub course_rad: Option<f64>,
}

/// Where a truck's pose comes from: the plant's truth, or a localiser.
pub trait PoseSource {
    /// What can go wrong at this seam.
    type Error: core::error::Error;
    /// The latest pose at `now`.
    ///
    /// # Errors
    /// When there is no pose that can be driven with; an old one is returned with its old stamp.
    fn pose(&mut self, now: Time) -> Result<Stamped<Pose>, Self::Error>;
    /// Hears what the truck's own sensors say. A source that measures the pose itself needs none.
    fn moved(&mut self, _motion: &Stamped<Motion>) {}
    /// Hears a fix that came over the truck's bus.
    fn fixed(&mut self, _fix: &Stamped<Fix>) {}
}
