//! Samples of a column that cannot be: missing, in a wrong unit, beyond a range, leapt to.

use super::grid::Note;
use crate::Channel;
use crate::data::finding::{Action, FindingKind};

/// Part of a channel that may be missing or implausible and is interpolated over.
const MAX_BAD_FRAC: f64 = 0.02;
/// A receiver's jump back or forth is over by then, s.
const LEAP_S: f64 = 3.0;

/// Interpolates over bad samples; false if the channel is beyond use.
pub(super) fn clean(channel: Channel, t: &[f64], v: &mut [f64], note: &mut Note<'_>) -> bool {
    let (lo, hi) = channel.plausible();
    let name = Some(channel.name());
    let bad: Vec<bool> = v.iter().map(|x| !x.is_finite()).collect();
    let missing = bad.iter().filter(|b| **b).count();
    let first = |b: &[bool]| b.iter().position(|b| *b).map(|i| t[i]);
    let enough = |n: usize| n as f64 <= MAX_BAD_FRAC * t.len() as f64;
    if missing == v.len() {
        let kind = FindingKind::NonFinite { samples: missing };
        note(name, first(&bad), kind, Action::ChannelDropped);
        return false;
    }
    if missing > 0 {
        let ok = enough(missing);
        let action = if ok { Action::Interpolated } else { Action::ChannelDropped };
        note(name, first(&bad), FindingKind::NonFinite { samples: missing }, action);
        if !ok {
            return false;
        }
    }
    let largest = v.iter().filter(|x| x.is_finite()).fold(0.0_f64, |a, x| a.max(x.abs()));
    if let Some((suspected, factor)) = unit_error(channel, v, largest) {
        v.iter_mut().for_each(|x| *x *= factor);
        note(name, None, FindingKind::WrongUnit { suspected }, Action::Corrected);
    }
    let outside: Vec<bool> = v.iter().map(|x| x.is_finite() && !(lo..=hi).contains(x)).collect();
    let implausible = outside.iter().filter(|b| **b).count();
    if implausible > 0 {
        let value = v.iter().zip(&outside).find(|p| *p.1).map_or(f64::NAN, |p| *p.0);
        let ok = enough(implausible + missing);
        let action = if ok { Action::Interpolated } else { Action::ChannelDropped };
        let kind = FindingKind::Implausible { samples: implausible, value };
        note(name, first(&outside), kind, action);
        if !ok {
            return false;
        }
    }
    let leaps = leaps(channel, t, v, &bad);
    let leapt = leaps.iter().filter(|b| **b).count();
    if leapt > 0 {
        let value = v.iter().zip(&leaps).find(|p| *p.1).map_or(f64::NAN, |p| *p.0);
        let ok = enough(leapt + implausible + missing);
        let action = if ok { Action::Interpolated } else { Action::ChannelDropped };
        note(name, first(&leaps), FindingKind::Jump { samples: leapt, value }, action);
        if !ok {
            return false;
        }
    }
    let bad = bad.iter().zip(&outside).zip(&leaps);
    let mask: Vec<bool> = bad.map(|((a, b), c)| *a || *b || *c).collect();
    interpolate_over(t, v, &mask);
    true
}

/// What a receiver can show from one sample to the next: a step, and a rate per second.
fn most_change(channel: Channel) -> Option<(f64, f64)> {
    match channel {
        Channel::GpsSpeedMS => Some((3.0, 4.0)),
        Channel::GpsAltitudeM => Some((15.0, 10.0)),
        _ => None,
    }
}

/// Samples of a receiver that are too far from the last good one; what stays there for longer than
/// [`LEAP_S`] is believed again.
fn leaps(channel: Channel, t: &[f64], v: &[f64], bad: &[bool]) -> Vec<bool> {
    let mut found = vec![false; v.len()];
    let Some((step, rate)) = most_change(channel) else { return found };
    let mut good: Option<usize> = None;
    for i in 0..v.len() {
        if bad[i] {
            continue;
        }
        let far = good.is_some_and(|k| {
            let seconds = t[i] - t[k];
            seconds < LEAP_S && (v[i] - v[k]).abs() > step + rate * seconds
        });
        if far {
            found[i] = true;
        } else {
            good = Some(i);
        }
    }
    found
}

/// Units that are often mistaken and leave a range that no truck shows.
fn unit_error(channel: Channel, v: &[f64], largest: f64) -> Option<(&'static str, f64)> {
    let mut sorted: Vec<f64> = v.iter().copied().filter(|x| x.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let median = sorted[sorted.len() / 2];
    let beyond = |limit: f64| (sorted.len() - sorted.partition_point(|x| *x <= limit)) as f64;
    match channel {
        // faster than any truck for longer than spikes last
        Channel::SpeedMS | Channel::GpsSpeedMS
            if largest <= 60.0 * 3.6 && beyond(60.0) > MAX_BAD_FRAC * sorted.len() as f64 =>
        {
            Some(("km/h", 1.0 / 3.6))
        }
        // a whole drive below 1.3 % of the reference torque
        Channel::EngineTorquePercent if (0.2..=1.3).contains(&largest) => Some(("fraction", 100.0)),
        Channel::AcceleratorPedalFrac | Channel::EngineBrakeFrac
            if largest > 1.5 && largest <= 101.0 =>
        {
            Some(("percent", 0.01))
        }
        Channel::CoolantTempDegc | Channel::AmbientTempDegc if median > 200.0 => None,
        Channel::BaroPressurePa if (40.0..110.0).contains(&median) => Some(("kPa", 1e3)),
        Channel::BaroPressurePa if (400.0..1100.0).contains(&median) => Some(("hPa", 1e2)),
        Channel::BrakePressureKpa if largest > 5e3 => Some(("Pa", 1e-3)),
        Channel::GradeFrac if largest > 0.5 && largest < 25.0 => Some(("percent", 0.01)),
        Channel::YawRateRadS | Channel::TrailerYawRateRadS if largest > 4.0 => {
            Some(("deg/s", core::f64::consts::PI / 180.0))
        }
        Channel::SteeringWheelRad if largest > 40.0 => Some(("deg", core::f64::consts::PI / 180.0)),
        _ => None,
    }
}

fn interpolate_over(t: &[f64], v: &mut [f64], bad: &[bool]) {
    let mut last: Option<usize> = None;
    let mut i = 0;
    while i < v.len() {
        if !bad[i] {
            last = Some(i);
            i += 1;
            continue;
        }
        let next = (i..v.len()).find(|&j| !bad[j]);
        let end = next.unwrap_or(v.len());
        for j in i..end {
            v[j] = match (last, next) {
                (Some(a), Some(b)) => v[a] + (v[b] - v[a]) * (t[j] - t[a]) / (t[b] - t[a]),
                (Some(a), None) => v[a],
                (None, Some(b)) => v[b],
                (None, None) => 0.0,
            };
        }
        i = end;
    }
}
