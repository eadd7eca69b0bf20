//! Units that show only against another channel of the same drive.

use nalgebra::{Matrix3, Vector3};

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
/// What the largest pressure has to take of the speed for its unit to be judged, m/s²: less is a
/// light application, or what a retarder beside it does.
const BRAKED_M_S2: f64 = 0.3;
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
/// application beside a retarder whose demand is not measured: it is not used.
fn brake_pressure(drive: &mut Drive, note: &mut Note<'_>) {
    let Some((per_unit_m_s2, largest)) = slowed_by_pressure(drive) else { return };
    if per_unit_m_s2 * largest < BRAKED_M_S2 {
        return;
    }
    let within = |[least, most]: [f64; 2]| (least..most).contains(&per_unit_m_s2);
    let name = Some(Channel::BrakePressureKpa.name());
    if within(BAR_M_S2) && largest <= MOST_BAR {
        scale(drive, Channel::BrakePressureKpa, 100.0);
        note(name, None, FindingKind::WrongUnit { suspected: "bar" }, Action::Corrected);
    } else if within(PSI_M_S2) {
        drive.remove(Channel::BrakePressureKpa);
        note(name, None, FindingKind::WrongUnit { suspected: "psi" }, Action::ChannelDropped);
    }
}

/// How much more a truck slows for each unit of brake pressure, m/s², and the largest pressure: by
/// least squares over all that it slows, beside what slows it without brakes and what goes with the
/// demand of its retarder.
fn slowed_by_pressure(drive: &Drive) -> Option<(f64, f64)> {
    let (v, pressure) = (drive.get(Channel::SpeedMS)?, drive.get(Channel::BrakePressureKpa)?);
    let retarder = drive.get(Channel::EngineBrakeFrac);
    let second = (1.0 / Drive::STEP_S) as usize;
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    let (mut largest, mut braked) = (0.0_f64, 0);
    for (i, (v0, v1)) in v.iter().zip(v.iter().skip(second)).enumerate() {
        let middle = i + second / 2;
        let slowed_m_s2 = v0 - v1;
        let acts = Vector3::new(1.0, retarder.map_or(0.0, |r| r[middle]), pressure[middle]);
        if !(slowed_m_s2 > 0.0) || !acts.iter().all(|x| x.is_finite()) {
            continue;
        }
        normal += acts * acts.transpose();
        right += acts * slowed_m_s2;
        largest = largest.max(pressure[middle]);
        braked += usize::from(pressure[middle] > 0.0);
    }
    if braked < LEAST_SAMPLES {
        return None;
    }
    // A retarder that is never used has no row of its own.
    let unused = f64::from(u8::from(normal[(1, 1)] == 0.0));
    normal[(1, 1)] += unused;
    Some((normal.cholesky()?.solve(&right)[2], largest))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Slows from 25 m/s again and again: coasting, with a retarder, with brakes beside it.
    /// `unit_kpa` is what the pressure is written in, `most_kpa` the largest application.
    fn braked(unit_kpa: f64, most_kpa: f64) -> Drive {
        let n = 6_000;
        let mut drive = Drive::new("d", 0.0, n);
        let mut speed_m_s = 25.0;
        let (mut speeds, mut pressures, mut retarder) = (Vec::new(), Vec::new(), Vec::new());
        for i in 0..n {
            let t_s = Drive::STEP_S * i as f64 % 30.0;
            let frac = if t_s > 8.0 && t_s < 16.0 { 0.95 } else { 0.0 };
            let kpa = if t_s > 11.0 && t_s < 15.0 { most_kpa * (t_s - 11.0) / 4.0 } else { 0.0 };
            let wave = (0.7 * t_s).sin();
            let slower = 0.08 + 0.05 * wave + (0.75 + 0.1 * wave) * frac + 0.01 * kpa;
            speed_m_s = if t_s > 20.0 {
                speed_m_s + 1.0 * Drive::STEP_S
            } else {
                speed_m_s - slower * Drive::STEP_S
            };
            speeds.push(speed_m_s);
            // A message on the bus has steps of 4 kPa.
            pressures.push((kpa / 4.0).round() * 4.0 / unit_kpa);
            retarder.push(frac);
        }
        drive.set(Channel::SpeedMS, speeds);
        drive.set(Channel::BrakePressureKpa, pressures);
        drive.set(Channel::EngineBrakeFrac, retarder);
        drive
    }

    fn suspected(mut drive: Drive) -> Vec<&'static str> {
        let mut found = Vec::new();
        let mut note = |_: Option<&str>, _: Option<f64>, kind: FindingKind, _: Action| {
            if let FindingKind::WrongUnit { suspected } = kind {
                found.push(suspected);
            }
        };
        brake_pressure(&mut drive, &mut note);
        found
    }

    /// A retarder takes 0.9 m/s² with 4 to 24 kPa in the brakes beside it, as much as so many psi:
    /// in 10 of 30 sets of simulated drives a drive lost its brake pressure for that.
    #[test]
    fn a_light_application_beside_a_retarder_has_the_right_unit() {
        for most_kpa in [4.0, 8.0, 24.0, 100.0, 300.0] {
            assert_eq!(suspected(braked(1.0, most_kpa)), [""; 0], "{most_kpa} kPa");
        }
    }

    #[test]
    fn pressures_in_psi_and_bar_are_told_beside_a_retarder() {
        for most_kpa in [60.0, 100.0, 300.0] {
            assert_eq!(suspected(braked(6.894_757, most_kpa)), ["psi"], "{most_kpa} kPa");
            assert_eq!(suspected(braked(100.0, most_kpa)), ["bar"], "{most_kpa} kPa");
        }
    }
}
