//! What is supervised on a truck's bus: messages that must come, commands that few may give.

use tractrix_core::SafetySignal;

use super::BusTruckConfig;
use super::config::lost_after_s;
use crate::message::{Ebc1, Eec1, Eec2, Etc2, Hrw, Tc1, Tsc1, Vdc2};
use crate::supervise::{BusBounds, Exclusive, Supervisor, Watch};
use crate::{AddressSet, BitRate, Message};

/// The supervisor of a truck's bus.
pub(super) type BusSupervisor = Supervisor<6, 6>;

/// Supervision as a truck's configuration asks for it.
pub(super) fn supervisor(rate: BitRate, config: &BusTruckConfig) -> BusSupervisor {
    let watches = [
        watch::<Eec1>(config.engine, SafetySignal::Engine),
        often(watch::<Eec2>(config.engine, SafetySignal::Pedals), 20),
        watch::<Etc2>(config.transmission, SafetySignal::Transmission),
        watch::<Ebc1>(config.brakes, SafetySignal::Brakes),
        often(watch::<Hrw>(config.brakes, SafetySignal::RoadSpeed), 10),
        watch::<Vdc2>(config.brakes, SafetySignal::YawRate),
    ];
    // Transmissions ask the engine for torque in a shift, brakes ask retarders not to lock wheels
    let shifts = AddressSet::of(&[config.address, config.transmission]);
    let slows =
        AddressSet::of(&[config.address, config.transmission, config.brakes, config.engine]);
    let ours = AddressSet::of(&[config.address]);
    // Addresses 5 and 6 are shift consoles (SAE J1939 appendix B); a T270 of 2014 has one
    let selects = AddressSet::of(&[config.address, 0x05, 0x06]);
    let torque = |da, senders| Exclusive { pgn: Tsc1::TABLE.pgn, da, senders };
    let [first, second, third] = config.retarders.map(|da| {
        // An address that no retarder has is the engine's: the same rule twice
        da.map_or(torque(config.engine, shifts), |da| torque(da, slows))
    });
    let exclusives = [
        torque(config.engine, shifts),
        first,
        second,
        third,
        Exclusive { pgn: config.xbr.pgn, da: config.brakes, senders: ours },
        Exclusive { pgn: Tc1::TABLE.pgn, da: config.transmission, senders: selects },
    ];
    Supervisor::new(BusBounds::usual(rate), watches, exclusives)
}

fn watch<M: Message>(sa: u8, signal: SafetySignal) -> Watch {
    Watch {
        pgn: M::TABLE.pgn,
        sa,
        period_nanos: i64::from(M::TABLE.period_ms.unwrap_or(1000)) * 1_000_000,
        timeout_nanos: (lost_after_s(signal) * 1e9) as i64,
        protection: None,
    }
}

/// A message that some trucks send more often than the standard has it: a T270 of 2014 EEC2 every
/// 20 ms (50), a truck of 2024 HRW every 10 ms (20).
const fn often(watch: Watch, shortest_ms: i64) -> Watch {
    Watch { period_nanos: shortest_ms * 1_000_000, ..watch }
}
