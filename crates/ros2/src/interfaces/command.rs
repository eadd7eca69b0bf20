//! What a node may tell the truck.

use serde::{Deserialize, Serialize};

use crate::simulator::{Direction, Request};

/// `std_msgs/msg/Float64` on `/command/set_speed`: m/s.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Float64 {
    pub(crate) data: f64,
}

/// `std_msgs/msg/String` on `/command/lane_change`: `left`, `right`, `keep`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Text {
    pub(crate) data: String,
}

/// A received message that asks for something; in words why it does not.
pub(crate) trait Asks {
    fn request(&self) -> Result<Request, String>;
}

impl Asks for Float64 {
    fn request(&self) -> Result<Request, String> {
        match self.data {
            speed_m_s if speed_m_s.is_finite() && speed_m_s >= 0.0 => {
                Ok(Request::SetSpeed { speed_m_s })
            }
            other => Err(format!("set speed {other} m/s: expected a number of zero or more")),
        }
    }
}

impl Asks for Text {
    fn request(&self) -> Result<Request, String> {
        match self.data.as_str() {
            "left" => Ok(Request::LaneChange(Direction::Left)),
            "right" => Ok(Request::LaneChange(Direction::Right)),
            "keep" => Ok(Request::LaneChange(Direction::Keep)),
            other => {
                let shown: String = other.chars().take(40).collect();
                Err(format!("lane change {shown:?}: expected left, right or keep"))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_makes_no_sense_is_refused_in_words() {
        assert_eq!(Float64 { data: 20.0 }.request(), Ok(Request::SetSpeed { speed_m_s: 20.0 }));
        for bad in [f64::NAN, -1.0, f64::INFINITY] {
            assert!(Float64 { data: bad }.request().unwrap_err().contains("m/s"));
        }
        let left = Text { data: "left".to_owned() };
        assert_eq!(left.request(), Ok(Request::LaneChange(Direction::Left)));
        let long = Text { data: "up".repeat(10_000) };
        assert!(long.request().unwrap_err().len() < 120);
    }
}
