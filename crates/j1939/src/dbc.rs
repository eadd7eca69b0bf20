//! Writes the table of messages as a DBC, the format that tools for CAN logs read: J1939 identifiers,
//! SI units, no states (DBC knows none; a tool that reads a log with it turns "error" into a number).

use core::fmt::{Result, Write};

use crate::message::MESSAGES;
use crate::{Id, NULL_ADDRESS};

/// Marks an extended identifier in a DBC.
const EXTENDED: u32 = 0x8000_0000;

/// Writes all of [`MESSAGES`] to `out`. The source in the identifiers is the null address, as DBCs
/// of J1939 have it: tools match the parameter group.
///
/// # Errors
/// Those of `out`.
pub fn write(out: &mut impl Write) -> Result {
    writeln!(out, "VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_: Vector__XXX\n")?;
    for message in &MESSAGES {
        writeln!(
            out,
            "BO_ {} {}: {} Vector__XXX",
            identifier(message.pgn, message.priority),
            message.name,
            message.length_bytes
        )?;
        for signal in message.signals {
            let last = f64::from(signal.data_max) * signal.scale + signal.offset;
            writeln!(
                out,
                " SG_ {} : {}|{}@1+ ({:?},{:?}) [{:?}|{last:?}] \"{}\" Vector__XXX",
                signal.name,
                signal.start_bit,
                signal.length_bits,
                signal.scale,
                signal.offset,
                signal.offset,
                signal.unit
            )?;
        }
        writeln!(out)?;
    }
    writeln!(
        out,
        "BA_DEF_ BO_ \"VFrameFormat\" ENUM \"StandardCAN\",\"ExtendedCAN\",\"reserved\",\"J1939PG\";"
    )?;
    writeln!(out, "BA_DEF_ SG_ \"SPN\" INT 0 524287;\nBA_DEF_ \"ProtocolType\" STRING;")?;
    writeln!(out, "BA_DEF_DEF_ \"VFrameFormat\" \"J1939PG\";\nBA_DEF_DEF_ \"SPN\" 0;")?;
    writeln!(out, "BA_DEF_DEF_ \"ProtocolType\" \"\";\nBA_ \"ProtocolType\" \"J1939\";")?;
    for message in &MESSAGES {
        let id = identifier(message.pgn, message.priority);
        writeln!(out, "BA_ \"VFrameFormat\" BO_ {id} 3;")?;
        for signal in message.signals {
            writeln!(out, "BA_ \"SPN\" SG_ {id} {} {};", signal.name, signal.spn)?;
        }
    }
    Ok(())
}

fn identifier(pgn: u32, priority: u8) -> u32 {
    let raw = u32::from(priority & 7) << 26 | pgn << 8 | u32::from(NULL_ADDRESS);
    EXTENDED | Id::from_raw(raw).raw()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_and_its_signals_are_written_in_si() {
        let mut text = String::new();
        write(&mut text).unwrap();
        assert!(text.contains("BO_ 2364540158 EEC1: 8 Vector__XXX\n"));
        assert!(
            text.contains(
                " SG_ torque_frac : 16|8@1+ (0.01,-1.25) [-1.25|1.25] \"\" Vector__XXX\n"
            )
        );
        assert!(text.contains("BA_ \"SPN\" SG_ 2364540158 engine_speed_rad_s 190;\n"));
        assert_eq!(text.matches("\nBO_ ").count(), MESSAGES.len());
    }
}
