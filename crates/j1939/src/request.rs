//! Requests for a parameter group and their acknowledgment (SAE J1939-21, 5.4.2 and 5.4.4).

use crate::{Frame, GLOBAL_ADDRESS, Id, J1939Error, PGN_MAX};

/// Parameter group of a request.
pub const REQUEST_PGN: u32 = 59_904;
/// Parameter group of an acknowledgment.
pub const ACKNOWLEDGMENT_PGN: u32 = 59_392;
/// Default priority of both.
const PRIORITY: u8 = 6;

/// Somebody asks for a parameter group.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Request {
    /// The group asked for.
    pub pgn: u32,
    /// Who is asked; [`GLOBAL_ADDRESS`] for everybody.
    pub da: u8,
    /// Who asks; [`crate::NULL_ADDRESS`] for a node without an address.
    pub sa: u8,
}

impl Request {
    /// The frame of the request.
    ///
    /// # Errors
    /// For a group that does not exist.
    pub fn frame(self) -> Result<Frame, J1939Error> {
        if self.pgn > PGN_MAX {
            return Err(J1939Error::Pgn(self.pgn));
        }
        let [p0, p1, p2, _] = self.pgn.to_le_bytes();
        Frame::new(Id::new(PRIORITY, REQUEST_PGN, self.da, self.sa)?, &[p0, p1, p2])
    }

    /// The request in a frame, when it is one: three bytes or more, as some fill up with 0xFF.
    #[must_use]
    pub fn of(frame: &Frame) -> Option<Self> {
        let id = frame.id();
        let [p0, p1, p2] = *frame.bytes().first_chunk::<3>()?;
        let pgn = u32::from_le_bytes([p0, p1, p2, 0]);
        (id.pgn() == REQUEST_PGN && pgn <= PGN_MAX).then(|| Self { pgn, da: id.da(), sa: id.sa() })
    }
}

/// What is answered to a request that is not answered with the group itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    /// Done.
    Positive,
    /// Not supported.
    Negative,
    /// Not for this source.
    AccessDenied,
    /// Not now.
    Busy,
}

/// An answer without data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Acknowledgment {
    /// The answer.
    pub answer: Answer,
    /// Which of several functions of the group was meant; 0xFF when the group has none.
    pub group_function: u8,
    /// Who had asked. The answer itself goes to everybody.
    pub address: u8,
    /// The group that was asked for.
    pub pgn: u32,
}

impl Acknowledgment {
    /// The frame of the answer of `sa`.
    #[must_use]
    pub fn frame(self, sa: u8) -> Frame {
        let control = match self.answer {
            Answer::Positive => 0,
            Answer::Negative => 1,
            Answer::AccessDenied => 2,
            Answer::Busy => 3,
        };
        let [p0, p1, p2, _] = self.pgn.to_le_bytes();
        let raw = u32::from(PRIORITY) << 26
            | (ACKNOWLEDGMENT_PGN | u32::from(GLOBAL_ADDRESS)) << 8
            | u32::from(sa);
        let data = [control, self.group_function, 0xFF, 0xFF, self.address, p0, p1, p2];
        Frame::of(Id::from_raw(raw), data)
    }

    /// The acknowledgment in a frame, when it is one.
    #[must_use]
    pub fn of(frame: &Frame) -> Option<Self> {
        let [control, group_function, _, _, address, p0, p1, p2] =
            *frame.bytes().first_chunk::<8>()?;
        let answer = match control {
            0 => Answer::Positive,
            1 => Answer::Negative,
            2 => Answer::AccessDenied,
            3 => Answer::Busy,
            _ => return None,
        };
        let pgn = u32::from_le_bytes([p0, p1, p2, 0]);
        (frame.id().pgn() == ACKNOWLEDGMENT_PGN).then_some(Self {
            answer,
            group_function,
            address,
            pgn,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn requests_and_answers_of_real_buses() {
        // j1939acd asks everybody for claims, from no address
        let request = Request { pgn: 60_928, da: 0xFF, sa: 0xFE };
        let frame = request.frame().unwrap();
        assert_eq!((frame.id().raw(), frame.bytes()), (0x18EA_FFFE, &[0, 0xEE, 0][..]));
        assert_eq!(Request::of(&frame), Some(request));
        // T270: the engine's answer
        let nack = Frame::of(Id::from_raw(0x18E8_FF00), [1, 0xFF, 0xFF, 0xFF, 0xF9, 0xEC, 0xFE, 0]);
        let answer = Acknowledgment::of(&nack).unwrap();
        assert_eq!((answer.answer, answer.address, answer.pgn), (Answer::Negative, 0xF9, 65_260));
        assert_eq!(answer.frame(0), nack);
        assert_eq!(Request { pgn: 1 << 18, ..request }.frame(), Err(J1939Error::Pgn(1 << 18)));
    }

    proptest! {
        #[test]
        fn what_is_read_is_written_again(raw in 0_u32..1 << 29, data in any::<[u8; 8]>(), len in 0_usize..9) {
            for pgn in [REQUEST_PGN, ACKNOWLEDGMENT_PGN] {
                let id = Id::from_raw(raw & 0xFC00_00FF | pgn << 8);
                let frame = Frame::new(id, &data[..len]).unwrap();
                if let Some(request) = Request::of(&frame) {
                    prop_assert_eq!(Request::of(&request.frame().unwrap()), Some(request));
                }
                if let Some(answer) = Acknowledgment::of(&frame) {
                    prop_assert_eq!(Acknowledgment::of(&answer.frame(id.sa())), Some(answer));
                }
            }
        }
    }
}
