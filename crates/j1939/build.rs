//! Makes `messages.rs` of `table/messages.csv` and `table/signals.csv`: one struct a message, and the
//! table of all signals. The one place where units of the bus become SI.

use std::error::Error;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

/// One row of `table/messages.csv`.
struct Message {
    pgn: u32,
    name: String,
    length_bytes: usize,
    min_length_bytes: usize,
    priority: u8,
    period_ms: Option<u32>,
    title: String,
    signals: Vec<Signal>,
}

/// One row of `table/signals.csv`, in SI.
struct Signal {
    spn: u32,
    name: String,
    unit: &'static str,
    start_bit: usize,
    length_bits: u8,
    scale: f64,
    offset: f64,
    /// Where the parameter's definition differs from the rule of its width.
    data_max: Option<u32>,
    is_code: bool,
}

/// A unit of the bus in SI: the end of a field's name, the unit, and `si = bus * factor + zero`.
struct Unit(&'static str, &'static str, f64, f64);

fn si(unit: &str) -> Result<Unit, String> {
    Ok(match unit {
        // codes, counts, addresses, gears
        "" => Unit("", "", 1.0, 0.0),
        // ratios
        "1" => Unit("_ratio", "", 1.0, 0.0),
        "%" => Unit("_frac", "", 0.01, 0.0),
        "ppm" => Unit("_frac", "", 1e-6, 0.0),
        "rpm" => Unit("_rad_s", "rad/s", TAU / 60.0, 0.0),
        "rev" => Unit("_rad", "rad", TAU, 0.0),
        "rad" => Unit("_rad", "rad", 1.0, 0.0),
        "deg" => Unit("_rad", "rad", TAU / 360.0, 0.0),
        "rad/s" => Unit("_rad_s", "rad/s", 1.0, 0.0),
        "%/rpm" => Unit("_s_rad", "s/rad", 0.01 * 60.0 / TAU, 0.0),
        "km/h" => Unit("_m_s", "m/s", 1.0 / 3.6, 0.0),
        "m/s2" => Unit("_m_s2", "m/s2", 1.0, 0.0),
        "km" => Unit("_m", "m", 1e3, 0.0),
        "m" => Unit("_m", "m", 1.0, 0.0),
        "cm" => Unit("_m", "m", 1e-2, 0.0),
        "mm" => Unit("_m", "m", 1e-3, 0.0),
        "1/km" => Unit("_1_m", "1/m", 1e-3, 0.0),
        "day" => Unit("_s", "s", 86_400.0, 0.0),
        "h" => Unit("_s", "s", 3_600.0, 0.0),
        "min" => Unit("_s", "s", 60.0, 0.0),
        "s" => Unit("_s", "s", 1.0, 0.0),
        "kPa" => Unit("_pa", "Pa", 1e3, 0.0),
        "degC" => Unit("_k", "K", 1.0, 273.15),
        "kg" => Unit("_kg", "kg", 1.0, 0.0),
        "kg/h" => Unit("_kg_s", "kg/s", 1.0 / 3_600.0, 0.0),
        "kg m2" => Unit("_kg_m2", "kg m2", 1.0, 0.0),
        "Nm" => Unit("_nm", "N m", 1.0, 0.0),
        "l" => Unit("_m3", "m3", 1e-3, 0.0),
        "l/h" => Unit("_m3_s", "m3/s", 1e-3 / 3_600.0, 0.0),
        "km/l" => Unit("_m_m3", "m/m3", 1e6, 0.0),
        "V" => Unit("_v", "V", 1.0, 0.0),
        "A" => Unit("_a", "A", 1.0, 0.0),
        other => return Err(format!("signals.csv: no SI unit for {other:?}")),
    })
}

fn main() -> Result<(), Box<dyn Error>> {
    let root = std::env::var_os("CARGO_MANIFEST_DIR").ok_or("CARGO_MANIFEST_DIR is not set")?;
    let out = std::env::var_os("OUT_DIR").ok_or("OUT_DIR is not set")?;
    writeln!(std::io::stdout(), "cargo:rerun-if-changed=table")?;
    let messages = read(&Path::new(&root).join("table"))?;
    std::fs::write(Path::new(&out).join("messages.rs"), generate(&messages)?)?;
    Ok(())
}

fn read(folder: &Path) -> Result<Vec<Message>, Box<dyn Error>> {
    let mut messages = Vec::new();
    for row in csv::Reader::from_path(folder.join("messages.csv"))?.records() {
        let row = row?;
        let cell =
            |at: usize| row.get(at).ok_or_else(|| format!("messages.csv: short row {row:?}"));
        messages.push(Message {
            pgn: cell(0)?.parse()?,
            name: cell(1)?.to_owned(),
            length_bytes: cell(2)?.parse()?,
            min_length_bytes: cell(3)?.parse()?,
            priority: cell(4)?.parse()?,
            period_ms: optional(cell(5)?)?,
            title: cell(6)?.to_owned(),
            signals: Vec::new(),
        });
    }
    if !messages.is_sorted_by(|a, b| a.pgn < b.pgn) {
        return Err("messages.csv: sort it by PGN, each once".into());
    }
    for row in csv::Reader::from_path(folder.join("signals.csv"))?.records() {
        let row = row?;
        let cell = |at: usize| row.get(at).ok_or_else(|| format!("signals.csv: short row {row:?}"));
        let message = messages
            .iter_mut()
            .find(|message| Some(&*message.name) == row.get(0))
            .ok_or_else(|| format!("signals.csv: no such message: {row:?}"))?;
        let Unit(suffix, unit, factor, zero) = si(cell(8)?)?;
        let (byte, bit): (usize, usize) = (cell(3)?.parse()?, cell(4)?.parse()?);
        let (scale, offset): (f64, f64) = (cell(6)?.parse()?, cell(7)?.parse()?);
        let signal = Signal {
            spn: cell(1)?.parse()?,
            name: format!("{}{suffix}", cell(2)?),
            unit,
            start_bit: 8 * (byte - 1) + bit - 1,
            length_bits: cell(5)?.parse()?,
            scale: scale * factor,
            offset: if zero == 0.0 { offset * factor } else { hundredths(offset + zero) },
            data_max: optional(cell(9)?)?,
            is_code: cell(8)?.is_empty(),
        };
        let end = signal.start_bit + usize::from(signal.length_bits);
        if !(1..=32).contains(&signal.length_bits) || end > 8 * message.length_bytes {
            return Err(format!("signals.csv: does not fit into its message: {row:?}").into());
        }
        message.signals.push(signal);
    }
    Ok(messages)
}

/// Degrees Celsius have their zero at 273.15 K: the sum without the noise of its last bits.
fn hundredths(kelvin: f64) -> f64 {
    (kelvin * 100.0).round() / 100.0
}

fn optional(cell: &str) -> Result<Option<u32>, std::num::ParseIntError> {
    if cell.is_empty() { Ok(None) } else { cell.parse().map(Some) }
}

fn generate(messages: &[Message]) -> Result<String, std::fmt::Error> {
    let mut out = String::new();
    writeln!(out, "/// All messages with a fixed layout, by PGN.")?;
    writeln!(out, "pub static MESSAGES: [MessageTable; {}] = [", messages.len())?;
    for message in messages {
        let Message {
            pgn, name, length_bytes, min_length_bytes, priority, period_ms, title, ..
        } = message;
        writeln!(
            out,
            "MessageTable {{ pgn: {pgn}, name: {name:?}, title: {title:?}, length_bytes: {length_bytes}, \
             min_length_bytes: {min_length_bytes}, priority: {priority}, period_ms: {period_ms:?}, \
             signals: &{name}_SIGNALS }},"
        )?;
    }
    writeln!(out, "];")?;
    for (at, message) in messages.iter().enumerate() {
        generate_one(&mut out, at, message)?;
    }
    Ok(out)
}

fn generate_one(out: &mut String, at: usize, message: &Message) -> std::fmt::Result {
    let Message { pgn, name, length_bytes, title, signals, .. } = message;
    let (first, rest) = name.split_at(1);
    let ty = format!("{first}{}", rest.to_ascii_lowercase());

    writeln!(out, "const {name}_SIGNALS: [Signal; {}] = [", signals.len())?;
    for signal in signals {
        let Signal { spn, name, unit, start_bit, length_bits, scale, offset, is_code, .. } = signal;
        let data_max = match signal.data_max {
            Some(raw) => raw.to_string(),
            None => format!("crate::slot::data_max({length_bits})"),
        };
        writeln!(
            out,
            "Signal {{ pgn: {pgn}, spn: {spn}, name: {name:?}, unit: {unit:?}, start_bit: {start_bit}, \
             length_bits: {length_bits}, scale: {scale:?}, offset: {offset:?}, data_max: {data_max}, \
             is_code: {is_code} }},"
        )?;
    }
    writeln!(out, "];")?;

    writeln!(out, "/// {title}: {name}, PGN {pgn}.")?;
    writeln!(out, "#[derive(Debug, Clone, Copy, PartialEq, Default)]\npub struct {ty} {{")?;
    for signal in signals {
        let (byte, bit) = (signal.start_bit / 8 + 1, signal.start_bit % 8 + 1);
        let unit = match (signal.is_code, signal.unit) {
            (true, _) => "code or count",
            (false, "") => "fraction of one",
            (false, unit) => unit,
        };
        writeln!(
            out,
            "/// {unit}; {} bits from byte {byte}, bit {bit} (SPN {}).\npub {}: Slot<{}>,",
            signal.length_bits,
            signal.spn,
            signal.name,
            field_type(signal)
        )?;
    }
    writeln!(out, "}}")?;

    writeln!(
        out,
        "impl Message for {ty} {{\nconst TABLE: &'static MessageTable = &MESSAGES[{at}];\n\
         type Bytes = [u8; {length_bytes}];\n\
         #[inline]\nfn decode(id: Id, bytes: &[u8]) -> Result<Self, J1939Error> {{\n\
         Self::TABLE.check_length(id, bytes)?;\n\
         let mut data = [0xFF; {length_bytes}];\n\
         for (to, from) in data.iter_mut().zip(bytes) {{ *to = *from; }}\nOk(Self {{"
    )?;
    for (i, signal) in signals.iter().enumerate() {
        let field = &signal.name;
        if signal.is_code {
            let ty = field_type(signal);
            writeln!(
                out,
                "{field}: const {{ {name}_SIGNALS[{i}] }}.decode_code(&data).map(|code| code as {ty}),"
            )?;
        } else {
            writeln!(out, "{field}: const {{ {name}_SIGNALS[{i}] }}.decode(&data),")?;
        }
    }
    writeln!(
        out,
        "}})\n}}\nfn encode(&self) -> Result<Self::Bytes, J1939Error> {{\nlet mut data = [0xFF; {length_bytes}];"
    )?;
    for (i, signal) in signals.iter().enumerate() {
        let number = if signal.is_code { ".map(f64::from)" } else { "" };
        writeln!(
            out,
            "const {{ {name}_SIGNALS[{i}] }}.write(&mut data, self.{}{number})?;",
            signal.name
        )?;
    }
    writeln!(out, "Ok(data)\n}}\n}}")
}

/// Codes and counts are the smallest integer that holds them, everything else a float.
fn field_type(signal: &Signal) -> &'static str {
    match (signal.is_code, signal.offset == 0.0, signal.length_bits) {
        (false, ..) => "f64",
        (true, true, ..=8) => "u8",
        (true, true, ..=16) => "u16",
        (true, true, _) => "u32",
        (true, false, _) => "i16",
    }
}
