//! A classic CAN frame with a 29-bit identifier: what a J1939 bus carries.
//!
//! Frames with 11-bit identifiers are on many shared buses and are never J1939: a bus skips and
//! counts them. Remote frames do not exist in J1939.

use embedded_can::{ExtendedId, Id as CanId};

use tractrix_core::RawFrame;

use crate::{Id, J1939Error};

/// An identifier and up to eight bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Frame {
    id: Id,
    len: u8,
    data: [u8; 8],
}

impl Frame {
    /// A frame of at most eight bytes.
    ///
    /// # Errors
    /// For more than eight bytes.
    pub fn new(id: Id, bytes: &[u8]) -> Result<Self, J1939Error> {
        let too_long = J1939Error::Length { pgn: id.pgn(), len: bytes.len() };
        let mut data = [0; 8];
        data.get_mut(..bytes.len()).ok_or(too_long)?.copy_from_slice(bytes);
        Ok(Self { id, len: bytes.len() as u8, data })
    }

    /// A frame of all eight bytes, as most parameter groups have them.
    #[must_use]
    pub const fn of(id: Id, data: [u8; 8]) -> Self {
        Self { id, len: 8, data }
    }

    /// The identifier.
    #[must_use]
    pub const fn id(&self) -> Id {
        self.id
    }

    /// The bytes of the frame, at most eight.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        self.data.get(..usize::from(self.len)).unwrap_or(&self.data)
    }
}

impl From<&Frame> for RawFrame {
    fn from(frame: &Frame) -> Self {
        let mut data = [0; 8];
        data.iter_mut().zip(frame.bytes()).for_each(|(to, from)| *to = *from);
        Self { id: frame.id.raw(), len: frame.len, data }
    }
}

impl From<RawFrame> for Frame {
    /// More than eight bytes are eight.
    fn from(raw: RawFrame) -> Self {
        Self { id: Id::from_raw(raw.id), len: raw.len.min(8), data: raw.data }
    }
}

impl embedded_can::Frame for Frame {
    /// None for a standard (11-bit) identifier and for more than eight bytes.
    fn new(id: impl Into<CanId>, data: &[u8]) -> Option<Self> {
        match id.into() {
            CanId::Standard(_) => None,
            CanId::Extended(id) => Self::new(Id::from_raw(id.as_raw()), data).ok(),
        }
    }

    /// None: J1939 has no remote frames, a group is asked for with a request.
    fn new_remote(_id: impl Into<CanId>, _dlc: usize) -> Option<Self> {
        None
    }

    fn is_extended(&self) -> bool {
        true
    }

    fn is_remote_frame(&self) -> bool {
        false
    }

    fn id(&self) -> CanId {
        // 29 bits by construction, so the identifier exists
        CanId::Extended(ExtendedId::new(self.id.raw()).unwrap_or(ExtendedId::MAX))
    }

    fn dlc(&self) -> usize {
        usize::from(self.len)
    }

    fn data(&self) -> &[u8] {
        self.bytes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embedded_can::{Frame as _, StandardId};

    fn can_id(frame: &Frame) -> CanId {
        embedded_can::Frame::id(frame)
    }

    #[test]
    fn a_frame_goes_through_the_common_trait_and_back() {
        let id = Id::from_raw(0x0C04_0B80);
        let frame = Frame::new(id, &[0x7F, 0x6D, 0x20]).unwrap();
        let again = <Frame as embedded_can::Frame>::new(can_id(&frame), frame.data()).unwrap();
        assert_eq!(frame, again);
        assert_eq!((again.dlc(), again.bytes()), (3, &[0x7F, 0x6D, 0x20][..]));
    }

    #[test]
    fn what_is_no_j1939_frame_is_none() {
        let short = StandardId::new(0x123).unwrap();
        assert_eq!(<Frame as embedded_can::Frame>::new(short, &[0; 8]), None);
        let id = Id::from_raw(0);
        assert_eq!(Frame::new(id, &[0; 9]), Err(J1939Error::Length { pgn: 0, len: 9 }));
        assert_eq!(Frame::new_remote(ExtendedId::ZERO, 0), None);
    }
}
