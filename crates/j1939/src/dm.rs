//! Diagnostic messages with any number of trouble codes (SAE J1939-73): DM1 active ones, DM2
//! previously active ones.
//!
//! Two bytes of lamps, then four bytes a code. One code fits into a frame, more need the transport
//! protocol; no code is one of zeros. DM3 and DM11 carry no data: a tool asks for them with a request
//! and gets an acknowledgement.

use crate::slot::{Slot, data_max};
use crate::{Id, J1939Error};

/// Active trouble codes.
pub const DM1: u32 = 65_226;
/// Previously active trouble codes.
pub const DM2: u32 = 65_227;
/// Asked for to clear the previously active codes.
pub const DM3: u32 = 65_228;
/// Asked for to clear the active codes.
pub const DM11: u32 = 65_235;

/// Bytes of one trouble code.
const CODE_BYTES: usize = 4;
/// Bytes of the lamps before the codes.
const LAMP_BYTES: usize = 2;
/// Bytes of a frame: a message with one code or none is padded to it.
const FRAME_BYTES: usize = 8;
/// The largest parameter number: 19 bits.
const SPN_MAX: u32 = 0x7_FFFF;
/// The largest failure mode: five bits.
const FMI_MAX: u8 = 31;
/// An occurrence count that is not available: seven ones.
const COUNT_NOT_AVAILABLE: u8 = 127;

/// How a lamp flashes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Flash {
    /// Once a second.
    Slow,
    /// Twice a second or faster.
    Fast,
    /// Kept for later editions.
    Reserved,
    /// Not at all, or the sender does not know of flashing.
    #[default]
    No,
}

/// One lamp on the dashboard.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Lamp {
    /// 0 off, 1 on.
    pub on: Slot<u8>,
    /// How it flashes.
    pub flash: Flash,
}

/// The lamps of a diagnostic message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Lamps {
    /// Emission-related malfunction (SPN 1213, 3038).
    pub malfunction: Lamp,
    /// Stop the truck (SPN 623, 3039).
    pub red_stop: Lamp,
    /// Warning (SPN 624, 3040).
    pub amber_warning: Lamp,
    /// A component is to be protected (SPN 987, 3041).
    pub protect: Lamp,
}

impl Lamps {
    fn of([states, flashes]: [u8; LAMP_BYTES]) -> Self {
        let lamp = |shift: u8| Lamp {
            on: Slot::of_raw(u32::from(states >> shift) & 3, 2, data_max(2)).map(|raw| raw as u8),
            flash: match (flashes >> shift) & 3 {
                0 => Flash::Slow,
                1 => Flash::Fast,
                2 => Flash::Reserved,
                _ => Flash::No,
            },
        };
        Self { protect: lamp(0), amber_warning: lamp(2), red_stop: lamp(4), malfunction: lamp(6) }
    }

    fn bytes(&self) -> [u8; LAMP_BYTES] {
        let lamps = [self.protect, self.amber_warning, self.red_stop, self.malfunction];
        let mut bytes = [0; LAMP_BYTES];
        let [states, flashes] = &mut bytes;
        for lamp in lamps.into_iter().rev() {
            *states = *states << 2 | (lamp.on.map(u32::from).to_raw(2) as u8 & 3);
            *flashes = *flashes << 2 | lamp.flash as u8;
        }
        bytes
    }
}

/// One trouble code.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Dtc {
    /// What is at fault: a suspect parameter number of 19 bits (SPN 1214).
    pub spn: u32,
    /// How it fails: a failure mode of 5 bits (SPN 1215).
    pub fmi: u8,
    /// How often it came, 0 to 126; `None` where that is not known (SPN 1216).
    pub occurrences: Option<u8>,
    /// Whether the sender says that it orders the bits of `spn` in one of the ways before 1996
    /// (SPN 1706). Which one it does not say; `spn` is read as everybody orders them today.
    pub old_order: bool,
}

impl Dtc {
    /// None for the place holders: all zeros where there is no code, all ones where there is nothing.
    fn of([low, middle, high, count]: [u8; CODE_BYTES]) -> Option<Self> {
        let spn = u32::from_le_bytes([low, middle, high >> 5, 0]);
        let fmi = high & FMI_MAX;
        let occurrences = Some(count & 0x7F).filter(|count| *count != COUNT_NOT_AVAILABLE);
        let nothing = (spn == 0 && fmi == 0) || (spn == SPN_MAX && fmi == FMI_MAX);
        (!nothing).then_some(Self { spn, fmi, occurrences, old_order: count & 0x80 != 0 })
    }

    /// None for numbers that do not fit.
    fn bytes(&self) -> Option<[u8; CODE_BYTES]> {
        let count = self.occurrences.unwrap_or(COUNT_NOT_AVAILABLE);
        let fits = self.spn <= SPN_MAX && self.fmi <= FMI_MAX && count <= COUNT_NOT_AVAILABLE;
        let [low, middle, high, _] = self.spn.to_le_bytes();
        fits.then_some([low, middle, high << 5 | self.fmi, u8::from(self.old_order) << 7 | count])
    }
}

/// A received DM1 or DM2: lamps, and a view of its codes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DiagnosticMessage<'a> {
    /// The lamps that the sender wants lit.
    pub lamps: Lamps,
    codes: &'a [u8],
}

impl<'a> DiagnosticMessage<'a> {
    /// Decodes the bytes of a frame or of a transported message; `id` tells the error where they came
    /// from.
    ///
    /// # Errors
    /// [`J1939Error::Short`] below lamps and one code.
    pub fn decode(id: Id, bytes: &'a [u8]) -> Result<Self, J1939Error> {
        let need = LAMP_BYTES + CODE_BYTES;
        let short = J1939Error::Short { pgn: id.pgn(), sa: id.sa(), len: bytes.len(), need };
        let (lamps, codes) = bytes.split_first_chunk().ok_or(short)?;
        if codes.len() < CODE_BYTES {
            return Err(short);
        }
        Ok(Self { lamps: Lamps::of(*lamps), codes })
    }

    /// The trouble codes, in the sender's order; bytes after the last whole code are padding.
    pub fn dtcs(&self) -> impl Iterator<Item = Dtc> + use<'a> {
        let (codes, _) = self.codes.as_chunks::<CODE_BYTES>();
        codes.iter().filter_map(|code| Dtc::of(*code))
    }
}

/// Writes a diagnostic message (`pgn` is DM1 or DM2) into `buffer` and returns its bytes: eight for
/// up to one code, `2 + 4 n` for more.
///
/// # Errors
/// [`J1939Error::Dtc`] for a code that does not fit into its bits, [`J1939Error::Buffer`] where
/// `buffer` is too small.
pub fn write<'b>(
    pgn: u32,
    lamps: &Lamps,
    dtcs: &[Dtc],
    buffer: &'b mut [u8],
) -> Result<&'b [u8], J1939Error> {
    let need = (LAMP_BYTES + CODE_BYTES * dtcs.len()).max(FRAME_BYTES);
    let small = J1939Error::Buffer { pgn, len: buffer.len(), need };
    let bytes = buffer.get_mut(..need).ok_or(small)?;
    let (first, codes) = bytes.split_first_chunk_mut::<LAMP_BYTES>().ok_or(small)?;
    *first = lamps.bytes();
    codes.fill(0xFF);
    let (places, _) = codes.as_chunks_mut::<CODE_BYTES>();
    if let (Some(place), []) = (places.first_mut(), dtcs) {
        *place = [0; CODE_BYTES];
    }
    for (place, dtc) in places.iter_mut().zip(dtcs) {
        let refused = J1939Error::Dtc { pgn, spn: dtc.spn, fmi: dtc.fmi };
        *place = dtc.bytes().ok_or(refused)?;
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ID: Id = Id::from_raw(0x18FE_CA31);

    #[test]
    fn a_transported_message_of_a_real_truck_has_its_three_codes() {
        // T270, cab controller: amber lamp on, codes 191/9, 84/9 and 5357/31
        let bytes =
            [0x04, 0xFF, 0xBF, 0x00, 0x09, 0x08, 0x54, 0x00, 0x09, 0x08, 0xED, 0x14, 0x1F, 0x01];
        let message = DiagnosticMessage::decode(ID, &bytes).unwrap();
        assert_eq!(message.lamps.amber_warning, Lamp { on: Slot::Value(1), flash: Flash::No });
        assert_eq!(message.lamps.red_stop.on, Slot::Value(0));
        let codes: Vec<_> = message.dtcs().map(|d| (d.spn, d.fmi, d.occurrences)).collect();
        assert_eq!(codes, [(191, 9, Some(8)), (84, 9, Some(8)), (5_357, 31, Some(1))]);
    }

    #[test]
    fn no_code_is_a_place_holder_and_padding_is_no_code() {
        let mut buffer = [0; 8];
        let bytes = write(DM1, &Lamps::default(), &[], &mut buffer).unwrap();
        assert_eq!(bytes, [0xFF, 0xFF, 0, 0, 0, 0, 0xFF, 0xFF]);
        assert_eq!(DiagnosticMessage::decode(ID, bytes).unwrap().dtcs().count(), 0);
        let padded = [0x00, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF];
        assert_eq!(DiagnosticMessage::decode(ID, &padded).unwrap().dtcs().count(), 0);
    }

    #[test]
    fn what_is_too_short_too_large_or_does_not_fit_is_an_error() {
        let short = J1939Error::Short { pgn: DM1, sa: 0x31, len: 5, need: 6 };
        assert_eq!(DiagnosticMessage::decode(ID, &[0; 5]), Err(short));
        assert!(DiagnosticMessage::decode(ID, &[]).is_err());
        let code = Dtc { spn: 191, fmi: 9, occurrences: None, old_order: false };
        let mut buffer = [0; 9];
        let small = J1939Error::Buffer { pgn: DM1, len: 9, need: 10 };
        assert_eq!(write(DM1, &Lamps::default(), &[code; 2], &mut buffer), Err(small));
        for wrong in [
            Dtc { spn: 0x8_0000, ..code },
            Dtc { fmi: 32, ..code },
            Dtc { occurrences: Some(128), ..code },
        ] {
            let refused = J1939Error::Dtc { pgn: DM1, spn: wrong.spn, fmi: wrong.fmi };
            assert_eq!(write(DM1, &Lamps::default(), &[wrong], &mut buffer), Err(refused));
        }
    }

    proptest! {
        #[test]
        fn any_number_of_codes_goes_out_and_comes_back(
            codes in prop::collection::vec((1_u32..SPN_MAX, 0_u8..=FMI_MAX, 0_u8..=127, any::<bool>()), 0..60),
            states: [u8; 2],
        ) {
            let codes: Vec<Dtc> = codes
                .into_iter()
                .map(|(spn, fmi, count, old_order)| {
                    Dtc { spn, fmi, occurrences: (count < 127).then_some(count), old_order }
                })
                .collect();
            let mut buffer = [0; 2 + 4 * 60];
            let bytes = write(DM2, &Lamps::of(states), &codes, &mut buffer).unwrap();
            prop_assert_eq!(&bytes[..2], &states);
            let message = DiagnosticMessage::decode(ID, bytes).unwrap();
            prop_assert_eq!(message.dtcs().collect::<Vec<_>>(), codes);
        }

        #[test]
        fn arbitrary_bytes_never_panic(bytes: Vec<u8>) {
            if let Ok(message) = DiagnosticMessage::decode(ID, &bytes) {
                prop_assert!(message.dtcs().count() <= bytes.len() / 4);
            }
        }
    }
}
