//! The two forms of output.

use std::fmt::Write as _;

use j1939::Slot;
use serde_json::{Map, Value, json};
use tractrix_core::Time;

use j1939::bus::candump::Heard;

use super::Format;
use crate::bus_content::{Content, Item, Said};
use crate::failure::Failure;
use crate::output::Lines;

/// Writes what was decoded to standard output.
pub(super) struct Printer {
    format: Format,
    lines: Lines,
    text: String,
}

impl Printer {
    pub(super) fn new(format: Format) -> Result<Self, Failure> {
        let mut lines = Lines::new();
        if format == Format::Csv {
            lines.write("time_s,channel,pgn,message,sa,da,signal,unit,value,state\n")?;
        }
        Ok(Self { format, lines, text: String::new() })
    }

    /// Whether the reader of a pipe has left.
    pub(super) const fn nobody_reads(&self) -> bool {
        self.lines.nobody_reads()
    }

    pub(super) fn finish(&mut self) -> Result<(), Failure> {
        self.lines.flush()
    }

    pub(super) fn print(
        &mut self,
        heard: &Heard<'_>,
        message: &str,
        content: &Content,
    ) -> Result<(), Failure> {
        self.text.clear();
        match self.format {
            Format::Csv => csv(&mut self.text, heard, message, content).map_err(Failure::work)?,
            Format::Jsonl => {
                let object = object(heard, message, content);
                writeln!(self.text, "{object}").map_err(Failure::work)?;
            }
        }
        self.lines.write(&self.text)
    }
}

fn seconds(time: Time) -> String {
    // logs have microseconds
    let micros = time.0 / 1_000;
    format!("{}.{:06}", micros / 1_000_000, micros % 1_000_000)
}

fn csv(text: &mut String, heard: &Heard<'_>, message: &str, content: &Content) -> std::fmt::Result {
    let Heard { channel, id, da, .. } = heard;
    let head = format!(
        "{},{},{},{message},{},{da}",
        seconds(heard.time),
        quoted(channel),
        id.pgn(),
        id.sa()
    );
    match content {
        Content::Said(items) => {
            for Item { name, unit, slot } in items {
                let state = slot.state();
                match slot {
                    Slot::Value(Said::Number(number)) => {
                        writeln!(text, "{head},{name},{unit},{number},{state}")?;
                    }
                    Slot::Value(Said::Code(code)) => {
                        writeln!(text, "{head},{name},{unit},{code},{state}")?;
                    }
                    Slot::Value(Said::Text(said)) => {
                        writeln!(text, "{head},{name},{unit},{},{state}", quoted(said))?;
                    }
                    _ => writeln!(text, "{head},{name},{unit},,{state}")?,
                }
            }
            Ok(())
        }
        Content::Wrong(error) => writeln!(text, "{head},,,,{}", quoted(&error.to_string())),
    }
}

/// A field of CSV as it stands, or in quotes where it needs them.
fn quoted(field: &str) -> String {
    if field.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", field.replace('"', "\"\""))
    } else {
        field.to_owned()
    }
}

/// A message as an object: states are words in place of numbers; a signal that comes several times
/// (trouble codes) is a list.
fn object(heard: &Heard<'_>, message: &str, content: &Content) -> Value {
    let mut object = json!({
        "time_s": heard.time.0 as f64 / 1e9,
        "channel": heard.channel,
        "pgn": heard.id.pgn(),
        "message": message,
        "sa": heard.id.sa(),
        "da": heard.da,
    });
    match content {
        Content::Said(items) => object["signals"] = Value::Object(signals(items)),
        Content::Wrong(error) => object["error"] = error.to_string().into(),
    }
    object
}

fn signals(items: &[Item]) -> Map<String, Value> {
    let mut signals = Map::new();
    for item in items {
        let value = match &item.slot {
            Slot::Value(Said::Number(number)) => json!(number),
            Slot::Value(Said::Code(code)) => json!(code),
            Slot::Value(Said::Text(text)) => json!(text),
            state => json!(state.state()),
        };
        let several = matches!(item.name, "dtc" | "software");
        match signals.get_mut(item.name) {
            Some(Value::Array(list)) => list.push(value),
            _ if several => drop(signals.insert(item.name.to_owned(), json!([value]))),
            _ => drop(signals.insert(item.name.to_owned(), value)),
        }
    }
    signals
}

#[cfg(test)]
mod tests {
    use super::*;
    use j1939::Id;

    #[test]
    fn fields_of_csv_are_quoted_where_they_need_it() {
        assert_eq!(quoted("can0"), "can0");
        assert_eq!(quoted("a,\"b\""), "\"a,\"\"b\"\"\"");
    }

    #[test]
    fn states_are_words_and_codes_a_list() {
        let item = |name, slot| Item { name, unit: "", slot };
        let code = |text: &'static str| Slot::Value(Said::Text(text.into()));
        let content = Content::Said(vec![
            item("protect_lamp", Slot::Error(2)),
            item("dtc", code("191/9 x8")),
            item("dtc", code("84/9")),
        ]);
        let heard = Heard {
            time: Time(1_500_000_000),
            channel_number: 0,
            channel: "can0",
            id: Id::from_raw(0x18FE_CA31),
            da: 0xFF,
            bytes: &[],
        };
        let object = object(&heard, "DM1", &content);
        assert_eq!(
            object["signals"],
            json!({"protect_lamp": "error", "dtc": ["191/9 x8", "84/9"]})
        );
        assert_eq!((&object["time_s"], &object["sa"]), (&json!(1.5), &json!(0x31)));
        let mut text = String::new();
        csv(&mut text, &heard, "DM1", &content).unwrap();
        assert!(
            text.starts_with("1.500000,can0,65226,DM1,49,255,protect_lamp,,,error\n"),
            "{text}"
        );
    }
}
