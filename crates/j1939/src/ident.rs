//! Messages that are text: vehicle (VI), component (CI) and software identification (SOFT), whose
//! fields end in an asterisk (SAE J1939-71). A vehicle identification number names its owner: reports
//! print it masked.

use crate::slot::{Slot, data_max};
use crate::{Id, J1939Error};

/// Vehicle identification: one field.
pub const VI: u32 = 65_260;
/// Component identification: make, model, serial number, unit number.
pub const CI: u32 = 65_259;
/// Software identification: a count, then as many fields.
pub const SOFT: u32 = 65_242;

/// A vehicle identification number with nothing but its maker: what a report may show.
pub fn masked(vin: &str) -> impl Iterator<Item = char> {
    vin.chars().enumerate().map(|(at, letter)| if at < MAKER_LENGTH { letter } else { '*' })
}

/// Letters of a vehicle identification number that name the maker (ISO 3780).
const MAKER_LENGTH: usize = 3;

/// A vehicle identification number: printable ASCII.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Vin {
    bytes: [u8; VIN_MAX],
    len: usize,
}

/// Characters of the longest number that is kept; the standard's has 17 (ISO 3779).
const VIN_MAX: usize = 32;

impl Vin {
    /// The number in a VI message; none for an empty one, one that is no text or too long.
    #[must_use]
    pub fn of(id: Id, bytes: &[u8]) -> Option<Self> {
        let text = fields(id, bytes).next()?.ok()?.as_bytes();
        let mut vin = Self { bytes: [0; VIN_MAX], len: text.len() };
        vin.bytes.get_mut(..text.len())?.copy_from_slice(text);
        (vin.len > 0).then_some(vin)
    }

    /// The number.
    #[must_use]
    pub fn as_str(&self) -> &str {
        let text = self.bytes.get(..self.len).unwrap_or_default();
        core::str::from_utf8(text).unwrap_or_default()
    }
}

/// What ends a field.
const DELIMITER: u8 = b'*';

/// The fields of a VI or CI message in their order: printable ASCII without padding. A field that
/// the sender left out is absent.
pub fn fields(id: Id, bytes: &[u8]) -> impl Iterator<Item = Result<&str, J1939Error>> {
    // what follows the last asterisk is padding, unless the only field came without one
    let end = bytes.iter().rposition(|byte| *byte == DELIMITER).unwrap_or(bytes.len());
    let text = bytes.get(..end).unwrap_or(bytes);
    text.split(|byte| *byte == DELIMITER).map(move |field| {
        let wrong = J1939Error::Text { pgn: id.pgn(), sa: id.sa() };
        let is_text = field.iter().all(|byte| matches!(byte, b' '..=b'~' | 0));
        let text = core::str::from_utf8(field).map_err(|_| wrong)?;
        if is_text { Ok(text.trim_matches([' ', '\0'])) } else { Err(wrong) }
    })
}

/// The fields of a SOFT message: how many the sender says it has, and those that are there.
///
/// # Errors
/// [`J1939Error::Short`] for an empty message.
pub fn software(
    id: Id,
    bytes: &[u8],
) -> Result<(Slot<u8>, impl Iterator<Item = Result<&str, J1939Error>>), J1939Error> {
    let short = J1939Error::Short { pgn: id.pgn(), sa: id.sa(), len: 0, need: 1 };
    let (count, text) = bytes.split_first().ok_or(short)?;
    let count = Slot::of_raw(u32::from(*count), 8, data_max(8)).map(|raw| raw as u8);
    Ok((count, fields(id, text)))
}

/// Writes `fields` into `buffer`, each with its asterisk, and returns the bytes. SOFT gets its count
/// in front.
///
/// # Errors
/// [`J1939Error::Text`] for a field that is no printable ASCII or holds an asterisk,
/// [`J1939Error::Buffer`] where `buffer` is too small.
pub fn write<'b>(id: Id, fields: &[&str], buffer: &'b mut [u8]) -> Result<&'b [u8], J1939Error> {
    let counted = id.pgn() == SOFT;
    let need = usize::from(counted) + fields.iter().map(|field| field.len() + 1).sum::<usize>();
    let small = J1939Error::Buffer { pgn: id.pgn(), len: buffer.len(), need };
    let bytes = buffer.get_mut(..need).ok_or(small)?;
    let wrong = J1939Error::Text { pgn: id.pgn(), sa: id.sa() };
    let count = u8::try_from(fields.len()).map_err(|_| wrong)?;
    let count = counted.then_some(count).into_iter();
    let text = fields.iter().flat_map(|field| field.bytes().chain([DELIMITER]));
    let is_text = |field: &&str| field.bytes().all(|b| matches!(b, b' '..=b'~') && b != DELIMITER);
    if !fields.iter().all(is_text) {
        return Err(wrong);
    }
    for (to, from) in bytes.iter_mut().zip(count.chain(text)) {
        *to = from;
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn id(pgn: u32) -> Id {
        Id::new(6, pgn, crate::GLOBAL_ADDRESS, 0x00).unwrap()
    }

    fn read(pgn: u32, bytes: &[u8]) -> Vec<Result<&str, J1939Error>> {
        fields(id(pgn), bytes).collect()
    }

    #[test]
    fn a_number_is_read_with_and_without_its_asterisk_and_padding() {
        let vin = "1TRACTRIX00000001";
        for text in ["1TRACTRIX00000001*", "1TRACTRIX00000001", "1TRACTRIX00000001*\0\0"] {
            assert_eq!(read(VI, text.as_bytes()), [Ok(vin)]);
        }
        assert_eq!(read(CI, b"MAKE*MODEL**7*\xFF\xFF"), [Ok("MAKE"), Ok("MODEL"), Ok(""), Ok("7")]);
        assert_eq!(read(VI, b"\xFF\xFF*"), [Err(J1939Error::Text { pgn: VI, sa: 0 })]);
    }

    #[test]
    fn software_says_how_many_fields_it_has() {
        let (count, fields) = software(id(SOFT), b"\x02one*two*").unwrap();
        assert_eq!(
            (count, fields.flatten().collect::<Vec<_>>()),
            (Slot::Value(2), vec!["one", "two"])
        );
        assert!(software(id(SOFT), b"").is_err());
    }

    #[test]
    fn what_cannot_be_a_field_is_refused() {
        let mut buffer = [0; 16];
        let wrong = Err(J1939Error::Text { pgn: CI, sa: 0 });
        for field in ["a*b", "ä", "a\n"] {
            assert_eq!(write(id(CI), &[field], &mut buffer), wrong);
        }
        let small = J1939Error::Buffer { pgn: CI, len: 16, need: 17 };
        assert_eq!(write(id(CI), &["0123456789abcdef"], &mut buffer), Err(small));
    }

    proptest! {
        #[test]
        fn fields_go_out_and_come_back(texts in prop::collection::vec("[!-)+-~]([ -)+-~]{0,20}[!-)+-~])?", 1..6)) {
            let texts: Vec<&str> = texts.iter().map(String::as_str).collect();
            let mut buffer = [0; 256];
            let bytes = write(id(CI), &texts, &mut buffer).unwrap();
            prop_assert_eq!(read(CI, bytes), texts.iter().map(|text| Ok(*text)).collect::<Vec<_>>());
            let bytes = write(id(SOFT), &texts, &mut buffer).unwrap();
            let (count, fields) = software(id(SOFT), bytes).unwrap();
            prop_assert_eq!(count, Slot::Value(texts.len() as u8));
            prop_assert_eq!(fields.flatten().collect::<Vec<_>>(), texts);
        }

        #[test]
        fn arbitrary_bytes_never_panic(bytes: Vec<u8>) {
            prop_assert!(fields(id(CI), &bytes).count() <= bytes.len() + 1);
        }
    }
}
