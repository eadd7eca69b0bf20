//! Units that show only against another channel of the same drive.

use crate::Channel;
use crate::data::drive::Drive;
use crate::data::finding::{Action, FindingKind};

use super::grid::Note;

/// Samples that a comparison needs: 2 s.
const LEAST_SAMPLES: usize = 40;
const DEG: f64 = core::f64::consts::PI / 180.0;
/// Hand wheel over curvature of the path, m: steering ratio (12 to 26) times wheelbase (3 to 7 m),
/// more with understeer and without the little turns of a straight road.
const WHEEL_OVER_CURVATURE_M: [f64; 2] = [25.0, 350.0];
/// Curvature that is no longer a straight road, 1/m.
const CURVES_1_M: f64 = 2e-3;
/// A truck decelerates at 0.004 to 0.02 m/s² for a kPa in its brakes; for a psi and a bar seven and
/// a hundred times as much.
const PSI_M_S2: [f64; 2] = [0.045, 0.25];
const BAR_M_S2: [f64; 2] = [0.35, 3.0];
/// Reservoirs hold no more, bar.
const MOST_BAR: f64 = 14.0;

/// Compares hand wheel, yaw rate, lateral acceleration and brake pressure with what the truck did.
pub(super) fn compare(drive: &mut Drive, note: &mut Note<'_>) {
    yaw_rate(drive, note);
    hand_wheel(drive, note);
    brake_pressure(drive, note);
}

fn scale(drive: &mut Drive, channel: Channel, factor: f64) {
    if let Some(v) = drive.get(channel) {
        let v = v.iter().map(|x| factor * x).collect();
        drive.set(channel, v);
    }
}

/// Median, if there are enough.
fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len() / 2;
    (values.len() >= LEAST_SAMPLES)
        .then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// A yaw rate in degrees shows in the lateral acceleration, which is speed times yaw rate.
fn yaw_rate(drive: &mut Drive, note: &mut Note<'_>) {
    let (Some(v), Some(yaw), Some(a_y)) = (
        drive.get(Channel::SpeedMS),
        drive.get(Channel::YawRateRadS),
        drive.get(Channel::AccelYMS2),
    ) else {
        return;
    };
    let rows = v.iter().zip(yaw).zip(a_y);
    let curves = rows.filter(|((v, _), a_y)| **v > 5.0 && a_y.abs() > 0.5);
    let ratio = median(curves.map(|((v, yaw), a_y)| v * yaw / a_y).collect());
    if ratio.is_some_and(|r| (0.5..2.0).contains(&(r * DEG))) {
        scale(drive, Channel::YawRateRadS, DEG);
        let kind = FindingKind::WrongUnit { suspected: "deg/s" };
        note(Some(Channel::YawRateRadS.name()), None, kind, Action::Corrected);
    }
}

/// A hand wheel in degrees shows in the curves that the truck drives.
fn hand_wheel(drive: &mut Drive, note: &mut Note<'_>) {
    let (Some(v), Some(yaw), Some(wheel)) = (
        drive.get(Channel::SpeedMS),
        drive.get(Channel::YawRateRadS),
        drive.get(Channel::SteeringWheelRad),
    ) else {
        return;
    };
    let rows = v.iter().zip(yaw).zip(wheel).filter(|((v, _), _)| **v > 3.0);
    let curves = rows.map(|((v, yaw), wheel)| (yaw / v, wheel));
    let curves = curves.filter(|(curvature, _)| curvature.abs() > CURVES_1_M);
    let ratio = median(curves.map(|(curvature, wheel)| wheel / curvature).collect());
    let [least, most] = WHEEL_OVER_CURVATURE_M;
    if ratio.is_some_and(|r| (least..most).contains(&(r.abs() * DEG)) && r.abs() > 2.0 * most) {
        scale(drive, Channel::SteeringWheelRad, DEG);
        let kind = FindingKind::WrongUnit { suspected: "deg" };
        note(Some(Channel::SteeringWheelRad.name()), None, kind, Action::Corrected);
    }
}

/// A pressure in bar or psi shows in the deceleration. What seems to be psi could be a light
/// application beside a strong retarder: it is not used.
fn brake_pressure(drive: &mut Drive, note: &mut Note<'_>) {
    let (Some(v), Some(pressure)) =
        (drive.get(Channel::SpeedMS), drive.get(Channel::BrakePressureKpa))
    else {
        return;
    };
    let largest = pressure.iter().fold(0.0_f64, |a, p| a.max(*p));
    let second = (1.0 / Drive::STEP_S) as usize;
    let before_after = v.iter().zip(v.iter().skip(second));
    let steps = before_after.zip(pressure.iter().skip(second / 2));
    let braking = steps.filter(|((v0, v1), p)| **p > 0.6 * largest && **v0 - **v1 > 0.8);
    let ratio = median(braking.map(|((v0, v1), p)| (v0 - v1) / p).collect());
    let Some(ratio) = ratio else { return };
    let within = |[least, most]: [f64; 2]| (least..most).contains(&ratio);
    let name = Some(Channel::BrakePressureKpa.name());
    if within(BAR_M_S2) && largest <= MOST_BAR {
        scale(drive, Channel::BrakePressureKpa, 100.0);
        note(name, None, FindingKind::WrongUnit { suspected: "bar" }, Action::Corrected);
    } else if within(PSI_M_S2) {
        drive.remove(Channel::BrakePressureKpa);
        note(name, None, FindingKind::WrongUnit { suspected: "psi" }, Action::ChannelDropped);
    }
}
