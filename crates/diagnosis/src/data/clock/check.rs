//! Every pair of channels of a drive that measure the same quantity, and what their clocks say.

use std::f64::consts::{PI, TAU};

use super::{
    CERTAIN, ClockStretch, ClockTrack, Kind, Rates, Signal, TOGETHER, hold_delay_s, track,
};
use crate::{Action, Channel as C, Drive, Finding, FindingKind};

/// A pair of redundant channels, and what of their lag is not reported because filters of sensors
/// and receivers do as much: lag, s, and its growth over a stretch, s. A heading is the course
/// from positions on many receivers, filtered over a second, and its rate the noisiest of all.
struct Pair {
    channel: C,
    against: C,
    offset_s: f64,
    drift_s: f64,
}

const PAIRS: [Pair; 3] = [
    Pair { channel: C::GpsSpeedMS, against: C::SpeedMS, offset_s: 0.25, drift_s: 0.25 },
    Pair { channel: C::AccelXMS2, against: C::SpeedMS, offset_s: 0.25, drift_s: 0.25 },
    Pair { channel: C::HeadingRad, against: C::YawRateRadS, offset_s: 1.0, drift_s: 3.0 },
];

/// Appends a finding for every clock that is apart from another, drifts or jumps, and moves its
/// channels to the other clock.
pub(crate) fn check(drive: &mut Drive, findings: &mut Vec<Finding>) {
    for pair in &PAIRS {
        let Pair { channel, against, .. } = *pair;
        let (Some(x), Some(y)) = (drive.get(channel), drive.get(against)) else { continue };
        let unwrapped;
        let x = if channel == C::HeadingRad {
            unwrapped = unwrap(x);
            unwrapped.as_slice()
        } else {
            x
        };
        let kind = |c| match c {
            C::AccelXMS2 | C::YawRateRadS => Kind::Rate,
            _ => Kind::Value,
        };
        let signal = |c, samples| Signal { samples, kind: kind(c) };
        let rates = Rates::new(signal(channel, x), signal(against, y), Drive::STEP_S);
        let Some(mut track) = track(&rates) else { continue };
        let held = hold_delay_s(x, Drive::STEP_S) - hold_delay_s(y, Drive::STEP_S);
        for s in &mut track.stretches {
            s.lag_s -= held;
        }
        let before = findings.len();
        report(drive, pair, &track, findings);
        if findings.len() > before {
            let moved = track.aligned(x, Drive::STEP_S);
            // the receiver's other channel has its clock
            let altitude = (channel == C::GpsSpeedMS)
                .then(|| drive.get(C::GpsAltitudeM).map(|h| track.aligned(h, Drive::STEP_S)));
            drive.set(channel, moved);
            if let Some(altitude) = altitude.flatten() {
                drive.set(C::GpsAltitudeM, altitude);
            }
        }
    }
}

/// Heading without turns of 2 pi.
fn unwrap(heading_rad: &[f64]) -> Vec<f64> {
    let mut turns = 0.0;
    let mut last = heading_rad.first().copied().unwrap_or(0.0);
    heading_rad
        .iter()
        .map(|&h| {
            if h - last > PI {
                turns -= TAU;
            } else if h - last < -PI {
                turns += TAU;
            }
            last = h;
            h + turns
        })
        .collect()
}

fn report(drive: &Drive, pair: &Pair, track: &ClockTrack, out: &mut Vec<Finding>) {
    let mut note = |time_s: Option<f64>, kind| {
        out.push(Finding {
            drive: drive.name.clone(),
            channel: Some(pair.channel.name().to_owned()),
            time_s: time_s.map(|t| t + drive.start_s),
            kind,
            action: Action::Corrected,
        });
    };
    let against = || pair.against.name().to_owned();
    for s in track.stretches.iter().filter(|s| s.correlation > TOGETHER) {
        if s.lag_s.abs() > pair.offset_s.max(CERTAIN * s.lag_sigma_s) {
            let kind = FindingKind::ClockOffset {
                against: against(),
                seconds: s.lag_s,
                sigma_s: s.lag_sigma_s,
                until_s: drive.start_s + s.to_s,
            };
            note(Some(s.from_s), kind);
        }
        let grown = s.drift_s_s * (s.to_s - s.from_s);
        let sigma = s.drift_sigma_s_s * (s.to_s - s.from_s);
        if grown.abs() > pair.drift_s.max(CERTAIN * sigma) {
            let kind = FindingKind::ClockDrift {
                against: against(),
                first_s: s.lag_s - 0.5 * grown,
                last_s: s.lag_s + 0.5 * grown,
                sigma_s: sigma,
            };
            note(Some(s.from_s), kind);
        }
    }
    for neighbours in track.stretches.windows(2) {
        let [a, b] = neighbours else { continue };
        if ClockStretch::jumps(a, b) && a.correlation.min(b.correlation) > TOGETHER {
            let (before, after, sigma) = ClockStretch::jump(a, b);
            let kind = FindingKind::ClockJump {
                against: against(),
                before_s: before,
                after_s: after,
                sigma_s: sigma,
            };
            note(Some(a.to_s), kind);
        }
    }
}
