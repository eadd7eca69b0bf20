//! Numbers of a bus on the command line.

use j1939::{GLOBAL_ADDRESS, NULL_ADDRESS, PGN_MAX};

/// A number, or hexadecimal digits behind 0x.
fn number(text: &str) -> Option<u64> {
    match text.strip_prefix("0x") {
        Some(digits) => u64::from_str_radix(digits, 16).ok(),
        None => text.parse().ok(),
    }
}

/// An address that a node can have.
pub(super) fn address(text: &str) -> Result<u8, String> {
    let found = number(text).and_then(|n| u8::try_from(n).ok()).filter(|n| *n < NULL_ADDRESS);
    found.ok_or_else(|| "not an address of 0 to 253 (or 0x00 to 0xFD)".to_owned())
}

/// An address that a frame can go to.
pub(super) fn destination(text: &str) -> Result<u8, String> {
    match number(text) {
        Some(n) if n == u64::from(GLOBAL_ADDRESS) => Ok(GLOBAL_ADDRESS),
        _ => address(text).map_err(|e| format!("{e}, nor 255 for everybody")),
    }
}

/// A parameter group.
pub(super) fn pgn(text: &str) -> Result<u32, String> {
    let found = number(text).and_then(|n| u32::try_from(n).ok()).filter(|n| *n <= PGN_MAX);
    found.ok_or_else(|| format!("not a parameter group of 0 to {PGN_MAX} (or 0x0 to 0x3FFFF)"))
}

/// A NAME: hexadecimal, not zero.
pub(super) fn name(text: &str) -> Result<u64, String> {
    let digits = text.strip_prefix("0x").unwrap_or(text);
    let found = u64::from_str_radix(digits, 16).ok().filter(|name| *name != 0);
    found.ok_or_else(|| "not a NAME: 64 bits in hexadecimal, not zero".to_owned())
}

/// Content of a message: one value of the command line, where a bare list would be many.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Bytes(pub(super) Vec<u8>);

/// Bytes of a message.
pub(super) fn data(text: &str) -> Result<Bytes, String> {
    let byte = |pair: &[u8]| match pair {
        [a, b] => Some((char::from(*a).to_digit(16)? << 4 | char::from(*b).to_digit(16)?) as u8),
        _ => None,
    };
    let bytes: Option<Vec<u8>> = text.as_bytes().chunks(2).map(byte).collect();
    bytes.map(Bytes).ok_or_else(|| "not bytes in hexadecimal, two digits each".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_taken_in_both_ways_and_bounded() {
        assert_eq!((address("249"), address("0xF9")), (Ok(249), Ok(249)));
        assert!(address("254").is_err() && address("-1").is_err() && address("0x").is_err());
        assert_eq!((destination("255"), destination("0x0B")), (Ok(255), Ok(11)));
        assert!(destination("254").is_err());
        assert_eq!((pgn("65260"), pgn("0xFEEC")), (Ok(65_260), Ok(65_260)));
        assert!(pgn("262144").is_err());
        assert_eq!(name("0x8000810000000001"), Ok(0x8000_8100_0000_0001));
        assert!(name("0").is_err());
        assert_eq!(data("00eE0a"), Ok(Bytes(vec![0, 0xEE, 10])));
        assert!(data("0").is_err() && data("0g").is_err() && data("é").is_err());
    }
}
