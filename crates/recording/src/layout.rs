//! Numbers out of CDR messages by field name, as the message definition inside a recording says.
//!
//! A definition (`ros2msg`) is flattened to scalar fields in order (`pose.pose.position.x`); a
//! message is read field by field (OMG DDSI-RTPS, plain CDR, little endian: every scalar aligned
//! to its size after the four encapsulation bytes). Left out: everything behind the first field of
//! variable length other than a string.

/// Most fields of a message, and most levels of nesting: a definition from outside is bounded.
const MOST_FIELDS: usize = 4096;
const MOST_LEVELS: usize = 8;
/// Bytes of the encapsulation header.
const ENCAPSULATION_BYTES: usize = 4;

/// Scalar fields of a message in order.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Layout(Vec<(String, Kind)>);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    F64,
    F32,
    Unsigned(usize),
    Signed(usize),
    Text,
}

impl Kind {
    fn of(word: &str) -> Option<Self> {
        Some(match word {
            "float64" => Self::F64,
            "float32" => Self::F32,
            "bool" | "uint8" | "byte" | "char" => Self::Unsigned(1),
            "uint16" => Self::Unsigned(2),
            "uint32" => Self::Unsigned(4),
            "uint64" => Self::Unsigned(8),
            "int8" => Self::Signed(1),
            "int16" => Self::Signed(2),
            "int32" => Self::Signed(4),
            "int64" => Self::Signed(8),
            "string" => Self::Text,
            _ => return None,
        })
    }

    const fn bytes(self) -> usize {
        match self {
            Self::F64 => 8,
            Self::F32 | Self::Text => 4,
            Self::Unsigned(n) | Self::Signed(n) => n,
        }
    }
}

impl Layout {
    /// The layout of a definition.
    pub(crate) fn of(definition: &str) -> Self {
        let mut sections = vec![("", Vec::new())];
        for line in definition.lines() {
            let line = line.split('#').next().unwrap_or("").trim();
            if let Some(name) = line.strip_prefix("MSG: ") {
                sections.push((name, Vec::new()));
            } else if !line.is_empty() && !line.starts_with("==") && !line.contains('=') {
                let mut words = line.split_whitespace();
                if let (Some(kind), Some(name), Some(last)) =
                    (words.next(), words.next(), sections.last_mut())
                {
                    last.1.push((kind, name));
                }
            }
        }
        let mut fields = Vec::new();
        flatten(&sections, 0, "", 0, &mut fields);
        Self(fields)
    }

    /// Index of a field for [`Self::read`].
    pub(crate) fn index(&self, name: &str) -> Option<usize> {
        self.0.iter().position(|f| f.0 == name)
    }

    /// Values of the fields at `wanted` (increasing) in a message; none if it is too short.
    pub(crate) fn read(&self, message: &[u8], wanted: &[usize]) -> Option<Vec<f64>> {
        let data = message.get(ENCAPSULATION_BYTES..)?;
        let mut at = 0_usize;
        let mut out = Vec::with_capacity(wanted.len());
        let last = *wanted.last()?;
        for (i, (_, kind)) in self.0.iter().enumerate().take(last + 1) {
            let bytes = kind.bytes();
            at = at.next_multiple_of(bytes);
            let raw = data.get(at..at + bytes)?;
            at += bytes;
            let bits = raw.iter().rev().fold(0_u64, |acc, b| (acc << 8) | u64::from(*b));
            let value = match kind {
                Kind::F64 => f64::from_bits(bits),
                Kind::F32 => f64::from(f32::from_bits(bits as u32)),
                Kind::Unsigned(_) => bits as f64,
                Kind::Signed(n) => {
                    let unused = 64 - 8 * *n as u32;
                    ((bits << unused) as i64 >> unused) as f64
                }
                Kind::Text => {
                    at = at.checked_add(usize::try_from(bits).ok()?)?;
                    f64::NAN
                }
            };
            if wanted.get(out.len()) == Some(&i) {
                out.push(value);
            }
        }
        (out.len() == wanted.len()).then_some(out)
    }
}

type Section<'a> = (&'a str, Vec<(&'a str, &'a str)>);

/// Appends the fields of a section; false once a field of variable length ends the layout.
fn flatten(
    sections: &[Section<'_>],
    section: usize,
    prefix: &str,
    level: usize,
    out: &mut Vec<(String, Kind)>,
) -> bool {
    let Some((_, fields)) = sections.get(section) else { return false };
    for (word, name) in fields {
        let (word, count) = match word.split_once('[') {
            None => (*word, 1),
            Some((word, size)) => match size.trim_end_matches(']').parse::<usize>() {
                Ok(count) => (word, count),
                Err(_) => return false,
            },
        };
        for i in 0..count {
            if out.len() >= MOST_FIELDS || level >= MOST_LEVELS {
                return false;
            }
            let element = if count == 1 { String::new() } else { format!("[{i}]") };
            let full = format!("{prefix}{name}{element}");
            if let Some(kind) = Kind::of(word) {
                out.push((full, kind));
                continue;
            }
            let Some(inner) = sections.iter().position(|s| s.0 == word) else { return false };
            if !flatten(sections, inner, &format!("{full}."), level + 1, out) {
                return false;
            }
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ros::schema::schema_text;

    #[test]
    fn nested_fields_have_dotted_names_and_values_where_cdr_puts_them() {
        let text = "uint8 a # first\nint32 LIMIT=3\np/B b\nstring s\nint16 c\nfloat64[2] d\n\
            ====\nMSG: p/B\nfloat64 x\nfloat32 y\n";
        let layout = Layout::of(text);
        let names: Vec<&str> = layout.0.iter().map(|f| f.0.as_str()).collect();
        assert_eq!(names, ["a", "b.x", "b.y", "s", "c", "d[0]", "d[1]"]);
        let mut message = vec![0, 1, 0, 0, 7, 0, 0, 0, 0, 0, 0, 0];
        message.extend(1.5_f64.to_le_bytes());
        message.extend(2.5_f32.to_le_bytes());
        message.extend(3_u32.to_le_bytes());
        message.extend(b"hi\0\0");
        message.extend((-2_i16).to_le_bytes());
        message.extend([0, 0]); // to a multiple of eight after the encapsulation
        message.extend(4.0_f64.to_le_bytes());
        message.extend(5.0_f64.to_le_bytes());
        let got = layout.read(&message, &[0, 1, 2, 4, 5, 6]);
        assert_eq!(got, Some(vec![7.0, 1.5, 2.5, -2.0, 4.0, 5.0]));
        assert_eq!(layout.read(&message[..30], &[0, 6]), None);
    }

    #[test]
    fn the_layout_of_a_state_ends_with_its_last_field() {
        let layout = Layout::of(&schema_text("truck_msgs/TruckState").unwrap());
        assert_eq!(layout.0.last().unwrap().0, "requested_gear");
        assert!(layout.index("header.stamp.sec").is_some());
    }

    #[test]
    fn definitions_that_nest_in_themselves_end() {
        assert!(Layout::of("p/A a\n==\nMSG: p/A\nfloat64 x\np/A b\n").0.len() <= MOST_LEVELS);
    }
}
