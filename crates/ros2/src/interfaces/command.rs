//! What a node may tell the truck.

use serde::{Deserialize, Serialize};

use super::geometry::Stamp;
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

/// `std_msgs/msg/Bool` on `/command/external_control`: `false` gives the truck back to the stack.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Bool {
    pub(crate) data: bool,
}

/// `autoware_control_msgs/msg/Control` on `/control/command/control_cmd`. Speed and jerk that are
/// asked for are not looked at, and no time but that of its arrival.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Control {
    stamp: Stamp,
    control_time: Stamp,
    lateral: Lateral,
    longitudinal: Longitudinal,
}

/// `autoware_control_msgs/msg/Lateral`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Lateral {
    stamp: Stamp,
    control_time: Stamp,
    /// rad, positive left.
    steering_tire_angle: f32,
    steering_tire_rotation_rate: f32,
    is_defined_steering_tire_rotation_rate: bool,
}

/// `autoware_control_msgs/msg/Longitudinal`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Longitudinal {
    stamp: Stamp,
    control_time: Stamp,
    velocity: f32,
    /// m/s².
    acceleration: f32,
    jerk: f32,
    is_defined_acceleration: bool,
    is_defined_jerk: bool,
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

impl Asks for Bool {
    fn request(&self) -> Result<Request, String> {
        match self.data {
            false => Ok(Request::Release),
            true => Err("true: who drives says so on /control/command/control_cmd".to_owned()),
        }
    }
}

impl Asks for Control {
    fn request(&self) -> Result<Request, String> {
        let accel_m_s2 = f64::from(self.longitudinal.acceleration);
        let road_wheel_rad = f64::from(self.lateral.steering_tire_angle);
        if !self.longitudinal.is_defined_acceleration {
            return Err("is_defined_acceleration = false: a speed alone is not driven".to_owned());
        }
        if !(-10.0..=5.0).contains(&accel_m_s2) {
            return Err(format!("acceleration {accel_m_s2} m/s2: expected -10 to 5"));
        }
        if !(-1.0..=1.0).contains(&road_wheel_rad) {
            return Err(format!("steering_tire_angle {road_wheel_rad} rad: expected -1 to 1"));
        }
        Ok(Request::Control { accel_m_s2, road_wheel_rad })
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
        let control = |acceleration, steering_tire_angle| {
            let (mut control, _) =
                cdr_encoding::from_bytes::<Control, byteorder::LittleEndian>(&[0; 76]).unwrap();
            control.lateral.steering_tire_angle = steering_tire_angle;
            control.longitudinal.acceleration = acceleration;
            control.longitudinal.is_defined_acceleration = true;
            control
        };
        let driven = Request::Control { accel_m_s2: -1.5, road_wheel_rad: 0.25 };
        assert_eq!(control(-1.5, 0.25).request(), Ok(driven));
        for (accel, wheel, word) in
            [(f32::NAN, 0.0, "acceleration NaN"), (6.0, 0.0, "-10 to 5"), (0.0, 2.0, "-1 to 1")]
        {
            assert!(control(accel, wheel).request().unwrap_err().contains(word));
        }
        let left = Text { data: "left".to_owned() };
        assert_eq!(left.request(), Ok(Request::LaneChange(Direction::Left)));
        let long = Text { data: "up".repeat(10_000) };
        assert!(long.request().unwrap_err().len() < 120);
    }
}
