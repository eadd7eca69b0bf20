//! Words of messages: what somebody may have meant, and numbers that can be read.

use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::fmt;

/// A number as a message shows it: never more digits than it has (`{}` writes 1e308 with 309).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Short(pub f64);

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let size = self.0.abs();
        if size == 0.0 || (1e-6..1e15).contains(&size) || !size.is_finite() {
            write!(f, "{}", self.0)
        } else {
            write!(f, "{:e}", self.0)
        }
    }
}

/// Names that are offered instead of an unknown one.
const OFFERED: usize = 3;

/// The three names that are most like a word, best first (Damerau-Levenshtein over the length).
#[must_use]
pub fn nearest<'a>(word: &str, names: impl IntoIterator<Item = &'a str>) -> Vec<&'a str> {
    let alike = |name: &str| strsim::normalized_damerau_levenshtein(word, name);
    let mut names: Vec<(f64, &str)> = names.into_iter().map(|n| (alike(n), n)).collect();
    names.sort_by(|a, b| b.0.total_cmp(&a.0));
    names.into_iter().take(OFFERED).map(|(_, name)| name).collect()
}

/// What a deserializer says, with the three nearest keys in place of all, on one line.
#[must_use]
pub fn deserializer_message(message: &str) -> String {
    let message = message.replace('\n', " ");
    let Some(rest) = message.strip_prefix("unknown field ") else { return message };
    let mut quoted = rest.split('`').skip(1).step_by(2);
    let Some(key) = quoted.next() else { return message };
    let near = nearest(key, quoted);
    if near.is_empty() {
        return format!("unknown key {key:?}");
    }
    format!("unknown key {key:?}; the nearest are {}", near.join(", "))
}

/// A message whose numbers have no more digits than they need.
///
/// A number stands alone; digits in a name or path are left as they are.
#[must_use]
pub fn with_short_numbers(message: &str) -> String {
    let (mut out, mut rest) = (String::with_capacity(message.len().min(400)), message);
    while let Some(start) = rest.find(|c: char| c.is_ascii_digit()) {
        let (before, from) = rest.split_at(start);
        let is_number = |c: char| c.is_ascii_digit() || c == '.';
        let end = from.find(|c| !is_number(c)).unwrap_or(from.len());
        let (digits, after) = from.split_at(end);
        let number = digits.trim_end_matches('.');
        let last = out.chars().next_back().filter(|_| before.is_empty());
        let alone = before.chars().next_back().or(last).is_none_or(stands_apart)
            && after.chars().next().is_none_or(stands_apart);
        out.push_str(before);
        match number.parse::<f64>() {
            Ok(value) if alone && number.len() > LONGEST => {
                out.push_str(&Short(value).to_string());
                out.push_str(digits.get(number.len()..).unwrap_or_default());
            }
            _ => out.push_str(digits),
        }
        rest = after;
    }
    out.push_str(rest);
    out
}

/// A double has 17 digits, a 64-bit integer 20.
const LONGEST: usize = 24;

/// Whether a number may begin after this, or end before it.
fn stands_apart(c: char) -> bool {
    !(c.is_alphanumeric() || matches!(c, '_' | '/' | '\\' | '.'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_as_short_as_they_are() {
        for (value, text) in [
            (0.0, "0"),
            (-12.5, "-12.5"),
            (86_400.0, "86400"),
            (1e308, "1e308"),
            (-2.5e-300, "-2.5e-300"),
            (f64::NAN, "NaN"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(Short(value).to_string(), text);
        }
    }

    #[test]
    fn the_nearest_names_come_first() {
        let names = ["speed_m_s", "s_m", "d_m", "lane"];
        assert_eq!(nearest("speed_km_h", names)[0], "speed_m_s");
        assert_eq!(nearest("lnae", names)[0], "lane");
        assert_eq!(nearest("x", []).len(), 0);
    }

    #[test]
    fn an_unknown_key_comes_with_the_three_nearest() {
        let serde = "unknown field `speed_km_h`, expected one of `s_m`, `d_m`, `lane`, `speed_m_s`";
        let said = deserializer_message(serde);
        assert!(said.starts_with("unknown key \"speed_km_h\"; the nearest are speed_m_s, "));
        assert_eq!(said.matches(", ").count(), 2, "{said}");
        assert_eq!(
            deserializer_message("unknown field `a`, expected `b` or `c`"),
            "unknown key \"a\"; the nearest are b, c"
        );
        assert_eq!(
            deserializer_message("unknown field `a`, there are no fields"),
            "unknown key \"a\""
        );
        assert_eq!(deserializer_message("missing field\n`a`"), "missing field `a`");
    }

    #[test]
    fn long_numbers_in_a_message_are_shortened_and_names_are_not() {
        let huge = format!("--duration {}: too long.", 1e308);
        assert_eq!(with_short_numbers(&huge), "--duration 1e308: too long.");
        let tiny = format!("mass = {} kg, {}", -1e-200, 1e30);
        assert_eq!(with_short_numbers(&tiny), "mass = -1e-200 kg, 1e30");
        let ends = format!("it is {}.", 1e40);
        assert_eq!(with_short_numbers(&ends), "it is 1e40.");
        for kept in [
            "runs/20261122094434123456789012345/run.mcap: not there",
            "drive_1234567890123456789012345: 3.25 s at line 7, 1.2.3",
            "123456789012345678901234.csv: seed 18446744073709551615",
            "ü 1 ü",
        ] {
            assert_eq!(with_short_numbers(kept), kept);
        }
    }
}
