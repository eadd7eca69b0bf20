//! Channels that rest although the truck drives.

use super::grid::Note;
use crate::Channel;
use crate::data::drive::Drive;
use crate::data::finding::{Action, FindingKind};

/// A channel that must move and does not for this long while the truck drives is stuck, s.
const STUCK_S: f64 = 30.0;
/// Spread of a road speed that is held, m/s: an engine speed in whole steps rests then.
const HELD_M_S: f64 = 0.05;

/// Notes such channels and drops those that rest for long.
pub(super) fn stuck(drive: &mut Drive, speed: &[f64], note: &mut Note<'_>) {
    let channels: Vec<Channel> =
        Channel::all().filter(|c| !c.may_rest() && drive.has(*c)).collect();
    for channel in channels {
        let Some(v) = drive.get(channel) else { continue };
        let (mut from, mut longest, mut at, mut total) = (0, 0, 0, 0);
        for i in 1..=v.len() {
            let still = i < v.len() && v[i] == v[i - 1] && speed[i] > 5.0;
            if still {
                continue;
            }
            let run = i - from;
            let rests = channel == Channel::EngineSpeedRpm && is_held(&speed[from..i]);
            if run as f64 * Drive::STEP_S > STUCK_S && !rests {
                total += run;
                if run > longest {
                    (longest, at) = (run, from);
                }
            }
            from = i;
        }
        if longest > 0 {
            let drop = total as f64 > 0.2 * v.len() as f64 && channel != Channel::SpeedMS;
            let kind = FindingKind::Stuck { seconds: longest as f64 * Drive::STEP_S };
            let time = drive.start_s + at as f64 * Drive::STEP_S;
            let action = if drop { Action::ChannelDropped } else { Action::Kept };
            note(Some(channel.name()), Some(time), kind, action);
            if drop {
                drive.remove(channel);
            }
        }
    }
}

/// Whether a road speed is held: cruise control on an even road.
fn is_held(speed: &[f64]) -> bool {
    let (low, high) =
        speed.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |a, v| (a.0.min(*v), a.1.max(*v)));
    high - low < HELD_M_S
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_engine_speed_rests_while_the_road_speed_is_held_and_else_it_is_stuck() {
        let stuck_with = |swing_m_s: f64| {
            let mut drive = Drive::new("d", 0.0, 2000);
            let speed: Vec<f64> =
                (0..2000).map(|i| 22.0 + swing_m_s * libm::sin(0.01 * f64::from(i))).collect();
            drive.set(Channel::EngineSpeedRpm, vec![1141.0; 2000]);
            let mut found = 0;
            stuck(&mut drive, &speed, &mut |_, _, _, _| found += 1);
            (found, drive.has(Channel::EngineSpeedRpm))
        };
        assert_eq!(stuck_with(0.01), (0, true));
        assert_eq!(stuck_with(1.0), (1, false));
    }
}
