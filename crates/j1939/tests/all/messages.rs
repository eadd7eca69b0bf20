//! The generated messages: numbers in SI, states, lengths, and what cannot be sent.

use crate::vectors;
use j1939::message::{Ccvs1, Ec1, Eec1, Eec2, Etc2, Tsc1, Vdc2, Vdhr, Xbr};
use j1939::{GLOBAL_ADDRESS, Id, J1939Error, Message, MessageTable, Slot};

const EEC1: Id = Id::from_raw(vectors::EEC1.0);

#[test]
fn known_frames_have_the_known_numbers_in_si() {
    for ((id, bytes), name, expected) in vectors::NUMBERS {
        let id = Id::from_raw(id);
        let table = MessageTable::of(id.pgn()).unwrap();
        let signal = table.signals.iter().find(|signal| signal.name == name).unwrap();
        let slot = signal.decode(&bytes);
        match expected {
            Some(expected) => assert!((slot.value().unwrap() - expected).abs() < 1e-9, "{name}"),
            None => assert_eq!(slot, Slot::Error(0xFE), "{name}"),
        }
    }
    let eec1 = Eec1::decode(EEC1, &vectors::EEC1.1).unwrap();
    let speed_rad_s = eec1.engine_speed_rad_s.value().unwrap();
    assert!((speed_rad_s - 1_520.25 * std::f64::consts::TAU / 60.0).abs() < 1e-9);
    assert_eq!(eec1.torque_mode, Slot::Value(3));
    assert_eq!(eec1.torque_demand_frac, Slot::Error(0xFE));
}

#[test]
fn a_message_written_and_read_again_is_the_same() {
    let sent = Vdc2 {
        steering_wheel_rad: Slot::Value(-1.25),
        yaw_rate_rad_s: Slot::Value(0.125),
        lateral_acceleration_m_s2: Slot::Error(0xFE00),
        steering_wheel_turns: Slot::Value(-3),
        ..Vdc2::default()
    };
    let frame = sent.frame(GLOBAL_ADDRESS, 0x0B).unwrap();
    assert_eq!((frame.id().pgn(), frame.id().priority()), (61_449, 6));
    let read = Vdc2::decode(frame.id(), frame.bytes()).unwrap();
    assert_eq!(read.steering_wheel_turns, Slot::Value(-3));
    assert_eq!(read.lateral_acceleration_m_s2, Slot::Error(0xFE00));
    assert_eq!(read.longitudinal_acceleration_m_s2, Slot::NotAvailable);
    let angle = read.steering_wheel_rad.value().unwrap();
    assert!((angle + 1.25).abs() <= 0.5 / 1024.0, "{angle}");
    assert_eq!(read.encode().unwrap(), sent.encode().unwrap());
}

#[test]
fn a_short_message_is_an_error_with_group_source_and_length() {
    let error = Eec1::decode(EEC1, &[0; 7]).unwrap_err();
    assert_eq!(error, J1939Error::Short { pgn: 61_444, sa: 0, len: 7, need: 8 });
    assert_eq!(error.to_string(), "PGN 61444 from 0x00 has 7 bytes, it needs 8");
}

#[test]
fn an_older_edition_lacks_its_last_signals_and_longer_ones_are_read() {
    let id = Id::from_raw(0x18FE_E300);
    let mut bytes = [0x00; 48];
    bytes[19..21].copy_from_slice(&2_500_u16.to_le_bytes());
    for len in [28, 34, 39, 40, 48] {
        let ec1 = Ec1::decode(id, &bytes[..len]).unwrap();
        assert_eq!(ec1.reference_torque_nm, Slot::Value(2_500.0));
        assert_eq!(ec1.moment_of_inertia_kg_m2.value().is_some(), len >= 32);
        assert_eq!(ec1.default_idle_torque_limit_frac.value().is_some(), len >= 40);
    }
    assert!(Ec1::decode(id, &bytes[..27]).is_err());
}

#[test]
fn a_demand_goes_out_only_when_all_its_codes_are_set() {
    let refused = Tsc1::default().encode().unwrap_err();
    let slot = Slot::NotAvailable;
    assert_eq!(refused, J1939Error::NotEncodable { pgn: 0, signal: "override_mode", slot });
    let beyond = Xbr { acceleration_demand_m_s2: Slot::Value(-16.0), ..Xbr::default() };
    let slot = Slot::Value(-16.0);
    let refused = J1939Error::NotEncodable { pgn: 1_024, signal: "acceleration_demand_m_s2", slot };
    assert_eq!(beyond.encode().unwrap_err(), refused);
}

#[test]
fn nothing_said_is_all_ones() {
    assert_eq!(Ccvs1::default().encode().unwrap(), [0xFF; 8]);
    let neutral = Etc2 { current_gear: Slot::Value(0), ..Etc2::default() };
    assert_eq!(neutral.encode().unwrap(), [0xFF, 0xFF, 0xFF, 125, 0xFF, 0xFF, 0xFF, 0xFF]);
}

#[test]
fn a_table_is_found_by_its_group() {
    assert_eq!(MessageTable::of(61_444), Some(Eec1::TABLE));
    assert_eq!(Eec1::TABLE.period_ms, Some(10));
    assert_eq!(MessageTable::of(61_443).unwrap().name, "EEC2");
    assert_eq!(MessageTable::of(60_928), None);
}

#[test]
fn what_looks_like_a_state_and_is_none_is_a_value() {
    // A cab that does not know its distance sends the largest valid one; a load may pass 100 %.
    let id = Id::from_raw(0x18FE_C131);
    let distance = Vdhr::decode(id, &[0xFF, 0xFF, 0xFF, 0xFA, 0xFF, 0xFF, 0xFF, 0xFF]).unwrap();
    assert_eq!(distance.total_distance_m, Slot::Value(f64::from(0xFAFF_FFFF_u32) * 5.0));
    assert_eq!(distance.trip_distance_m, Slot::NotAvailable);
    let id = Id::from_raw(0x0CF0_0300);
    let pedal = Eec2::decode(id, &[0xD1, 0xFB, 127, 0xFF, 0xFF, 0x0F, 0xFE, 0xFC]).unwrap();
    assert_eq!(pedal.load_frac, Slot::Value(1.27));
    assert_eq!(pedal.accelerator_pedal_frac, Slot::ParameterSpecific(0xFB));
    assert_eq!(pedal.torque_available_frac, Slot::Error(0xFE));
    assert_eq!(pedal.pumping_torque_frac, Slot::Reserved(0xFC));
}
