//! What one message says, whatever kind it is.

use std::borrow::Cow;

use j1939::dm::{DM1, DM2, DiagnosticMessage, Dtc, Lamp};
use j1939::ident::{self, CI, SOFT, VI};
use j1939::{Id, J1939Error, MessageTable, Signal, Slot};

/// The messages that have no fixed layout, by the standard's acronym.
pub(crate) const OTHERS: [(u32, &str); 5] =
    [(DM1, "DM1"), (DM2, "DM2"), (VI, "VI"), (CI, "CI"), (SOFT, "SOFT")];
/// The signals of those messages; codes and fields beyond are numbered.
pub(crate) const OTHER_SIGNALS: [&str; 11] = [
    "malfunction_lamp",
    "red_stop_lamp",
    "amber_warning_lamp",
    "protect_lamp",
    "dtc",
    "vin",
    "make",
    "model",
    "serial",
    "unit",
    "software",
];

/// What a message says.
#[derive(Debug, PartialEq)]
pub(crate) enum Content {
    /// Its signals.
    Said(Vec<Item>),
    /// It cannot be decoded.
    Wrong(J1939Error),
}

/// One signal.
#[derive(Debug, PartialEq)]
pub(crate) struct Item {
    pub(crate) name: &'static str,
    pub(crate) unit: &'static str,
    pub(crate) slot: Slot<Said>,
}

/// What a signal says where it says something.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Said {
    Number(f64),
    Code(i64),
    Text(Cow<'static, str>),
}

/// The name of a message and what it says; none for one that the table does not have.
pub(crate) fn read(id: Id, bytes: &[u8]) -> Option<(&'static str, Content)> {
    if let Some(table) = MessageTable::of(id.pgn()) {
        let said = || table.signals.iter().map(|signal| of_signal(signal, bytes)).collect();
        let content = match table.check_length(id, bytes) {
            Ok(()) => Content::Said(said()),
            Err(error) => Content::Wrong(error),
        };
        return Some((table.name, content));
    }
    let (pgn, name) = *OTHERS.iter().find(|(pgn, _)| *pgn == id.pgn())?;
    let said = match pgn {
        DM1 | DM2 => trouble(id, bytes),
        VI => texts(
            ident::fields(id, bytes).map(|vin| vin.map(|vin| ident::masked(vin).collect())),
            &["vin"],
        ),
        CI => texts(
            ident::fields(id, bytes).map(|field| field.map(str::to_owned)),
            &["make", "model", "serial", "unit"],
        ),
        _ => ident::software(id, bytes).and_then(|(_, fields)| {
            texts(fields.map(|field| field.map(str::to_owned)), &["software"])
        }),
    };
    Some((name, said.map_or_else(Content::Wrong, Content::Said)))
}

fn of_signal(signal: &Signal, bytes: &[u8]) -> Item {
    let number =
        |value| if signal.is_code { Said::Code(value as i64) } else { Said::Number(value) };
    Item { name: signal.name, unit: signal.unit, slot: signal.decode(bytes).map(number) }
}

fn trouble(id: Id, bytes: &[u8]) -> Result<Vec<Item>, J1939Error> {
    let message = DiagnosticMessage::decode(id, bytes)?;
    let lamp = |name, lamp: Lamp| Item {
        name,
        unit: "",
        slot: lamp.on.map(|on| Said::Code(i64::from(on))),
    };
    let lamps = [
        lamp("malfunction_lamp", message.lamps.malfunction),
        lamp("red_stop_lamp", message.lamps.red_stop),
        lamp("amber_warning_lamp", message.lamps.amber_warning),
        lamp("protect_lamp", message.lamps.protect),
    ];
    Ok(lamps.into_iter().chain(message.dtcs().map(|dtc| text("dtc", in_words(&dtc)))).collect())
}

/// SPN/FMI, and how often it came where the sender knows.
fn in_words(dtc: &Dtc) -> String {
    let times = dtc.occurrences.map_or(String::new(), |times| format!(" x{times}"));
    format!("{}/{}{times}", dtc.spn, dtc.fmi)
}

/// Fields under these names; what is more has the last.
fn texts(
    fields: impl Iterator<Item = Result<String, J1939Error>>,
    names: &[&'static str],
) -> Result<Vec<Item>, J1939Error> {
    let names = names.iter().chain(names.last().into_iter().cycle());
    names.zip(fields).map(|(name, field)| field.map(|field| text(name, field))).collect()
}

fn text(name: &'static str, text: String) -> Item {
    Item { name, unit: "", slot: Slot::Value(Said::Text(text.into())) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(pgn: u32, bytes: &[u8]) -> Vec<(&'static str, Slot<Said>)> {
        let (_, content) = read(Id::from_raw(0x1800_0000 | pgn << 8), bytes).unwrap();
        let Content::Said(items) = content else { panic!("{content:?}") };
        items.into_iter().map(|item| (item.name, item.slot)).collect()
    }

    #[test]
    fn numbers_are_masked_and_fields_have_their_names() {
        let text = |text: &'static str| Slot::Value(Said::Text(text.into()));
        assert_eq!(said(VI, b"1XKTRACTRIX000001*"), [("vin", text("1XK**************"))]);
        assert_eq!(
            said(CI, b"MAKE*MODEL*SERIAL*"),
            [("make", text("MAKE")), ("model", text("MODEL")), ("serial", text("SERIAL"))]
        );
        assert_eq!(
            said(SOFT, b"\x02one*two*"),
            [("software", text("one")), ("software", text("two"))]
        );
    }

    #[test]
    fn trouble_codes_follow_their_lamps() {
        let items = said(DM1, &[0x04, 0xFF, 0xBF, 0x00, 0x09, 0x08, 0xFF, 0xFF]);
        assert_eq!(items[2], ("amber_warning_lamp", Slot::Value(Said::Code(1))));
        assert_eq!(items[4], ("dtc", Slot::Value(Said::Text("191/9 x8".into()))));
        assert_eq!(items.len(), 5);
    }

    #[test]
    fn what_is_too_short_is_wrong_and_what_is_not_in_the_table_is_none() {
        let (name, content) = read(Id::from_raw(0x0CF0_0400), &[0; 3]).unwrap();
        let short = J1939Error::Short { pgn: 61_444, sa: 0, len: 3, need: 8 };
        assert_eq!((name, content), ("EEC1", Content::Wrong(short)));
        assert_eq!(read(Id::from_raw(0x18FF_0000), &[0; 8]), None);
    }
}
