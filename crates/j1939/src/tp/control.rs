//! Connection management of TP and ETP as eight bytes (SAE J1939-21, 5.10.3 and 5.10.4).

use super::AbortReason;

/// Data bytes of a packet.
pub(super) const PACKET_BYTES: usize = 7;

/// The two transport protocols: up to 1785 bytes, and beyond.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Protocol {
    Tp,
    Etp,
}

impl Protocol {
    /// Connection management and data of TP.
    const TP_PGNS: (u32, u32) = (60_416, 60_160);
    /// Connection management and data of ETP.
    const ETP_PGNS: (u32, u32) = (51_200, 50_944);

    pub(super) const fn control_pgn(self) -> u32 {
        match self {
            Self::Tp => Self::TP_PGNS.0,
            Self::Etp => Self::ETP_PGNS.0,
        }
    }

    pub(super) const fn data_pgn(self) -> u32 {
        match self {
            Self::Tp => Self::TP_PGNS.1,
            Self::Etp => Self::ETP_PGNS.1,
        }
    }
}

/// A control message: what is said about which parameter group.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Control {
    /// As on the wire: some stacks leave the destination in the low byte.
    pub(super) pgn: u32,
    pub(super) what: What,
}

/// What is said.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum What {
    /// Request to send `len` bytes.
    Rts {
        len: u32,
    },
    /// Broadcast announcement of `len` bytes.
    Bam {
        len: u32,
    },
    /// Clear to send `count` packets from `next` on; a count of zero holds the sender.
    Cts {
        count: u8,
        next: u32,
    },
    /// The next packets of ETP count from behind `offset`.
    Dpo {
        count: u8,
        offset: u32,
    },
    /// All bytes have arrived.
    Eoma {
        len: u32,
    },
    Abort(AbortReason),
}

/// Packets of a message of `len` bytes.
pub(super) const fn packets(len: u32) -> u32 {
    len.div_ceil(PACKET_BYTES as u32)
}

impl Control {
    /// The message of eight bytes; none for what is not one, a length that does not fit its number
    /// of packets included. The sender's own limit of packets in a window is `Rts`' second value.
    pub(super) fn parse(protocol: Protocol, bytes: &[u8]) -> Option<(Self, u8)> {
        let [command, b1, b2, b3, b4, p0, p1, p2] = *bytes.first_chunk::<8>()?;
        let pgn = u32::from_le_bytes([p0, p1, p2, 0]);
        let (short, long) =
            (u32::from(u16::from_le_bytes([b1, b2])), u32::from_le_bytes([b1, b2, b3, b4]));
        let middle = u32::from_le_bytes([b2, b3, b4, 0]);
        let fits = short > 0 && packets(short) == u32::from(b3);
        let what = match (protocol, command) {
            (_, 255) => What::Abort(AbortReason(b1)),
            (Protocol::Tp, 16) if fits => What::Rts { len: short },
            (Protocol::Tp, 32) if fits => What::Bam { len: short },
            (Protocol::Tp, 17) => What::Cts { count: b1, next: u32::from(b2) },
            (Protocol::Tp, 19) => What::Eoma { len: short },
            (Protocol::Etp, 20) => What::Rts { len: long },
            (Protocol::Etp, 21) => What::Cts { count: b1, next: middle },
            (Protocol::Etp, 22) => What::Dpo { count: b1, offset: middle },
            (Protocol::Etp, 23) => What::Eoma { len: long },
            _ => return None,
        };
        let window = if protocol == Protocol::Tp && b4 > 0 { b4 } else { u8::MAX };
        Some((Self { pgn, what }, window))
    }

    /// The eight bytes. Numbers that the protocol has no room for are cut: callers bound them.
    pub(super) const fn bytes(self, protocol: Protocol) -> [u8; 8] {
        let [p0, p1, p2, _] = self.pgn.to_le_bytes();
        let [b1, b2, b3, b4] = match (protocol, self.what) {
            (Protocol::Tp, What::Rts { len } | What::Bam { len } | What::Eoma { len }) => {
                let [low, high, ..] = len.to_le_bytes();
                [low, high, packets(len) as u8, 0xFF]
            }
            (Protocol::Etp, What::Rts { len } | What::Bam { len } | What::Eoma { len }) => {
                len.to_le_bytes()
            }
            (Protocol::Tp, What::Cts { count, next }) => [count, next as u8, 0xFF, 0xFF],
            (_, What::Cts { count, next: number } | What::Dpo { count, offset: number }) => {
                let [n0, n1, n2, _] = number.to_le_bytes();
                [count, n0, n1, n2]
            }
            (_, What::Abort(reason)) => [reason.0, 0xFF, 0xFF, 0xFF],
        };
        let command = match (protocol, self.what) {
            (_, What::Abort(_)) => 255,
            (Protocol::Tp, What::Rts { .. }) => 16,
            (Protocol::Tp, What::Cts { .. }) => 17,
            (Protocol::Tp, What::Eoma { .. }) => 19,
            (_, What::Bam { .. }) => 32,
            (Protocol::Etp, What::Rts { .. }) => 20,
            (Protocol::Etp, What::Cts { .. }) => 21,
            (_, What::Dpo { .. }) => 22,
            (Protocol::Etp, What::Eoma { .. }) => 23,
        };
        [command, b1, b2, b3, b4, p0, p1, p2]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_of_real_buses() {
        let of = |protocol, bytes: [u8; 8]| {
            let parsed = Control::parse(protocol, &bytes).map(|(control, _)| control);
            assert!(parsed.is_none_or(|c| c.bytes(protocol) == bytes), "{bytes:?}");
            parsed.map(|control| (control.what, control.pgn))
        };
        let tp = |bytes| of(Protocol::Tp, bytes);
        let etp = |bytes| of(Protocol::Etp, bytes);
        // T270: DM1 of three trouble codes; PACCAR: abort without a reason; the kernel: 20,000 bytes
        let dm1 = [0x20, 0x0E, 0, 2, 0xFF, 0xCA, 0xFE, 0];
        assert_eq!(tp(dm1), Some((What::Bam { len: 14 }, 65_226)));
        let abort = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xEB, 0xFE, 0];
        assert_eq!(tp(abort), Some((What::Abort(AbortReason(0xFF)), 65_259)));
        let hold = [17, 1, 6, 0xFF, 0xFF, 0xE3, 0xFE, 0];
        assert_eq!(tp(hold), Some((What::Cts { count: 1, next: 6 }, 65_251)));
        let big = [0x14, 0x20, 0x4E, 0, 0, 0, 0x23, 1];
        assert_eq!(etp(big), Some((What::Rts { len: 20_000 }, 0x1_2300)));
        let offset = [22, 255, 0, 1, 0, 0, 0x23, 1];
        assert_eq!(etp(offset), Some((What::Dpo { count: 255, offset: 256 }, 0x1_2300)));
        let end = [23, 0x20, 0x4E, 0, 0, 0, 0x23, 1];
        assert_eq!(etp(end), Some((What::Eoma { len: 20_000 }, 0x1_2300)));
    }

    #[test]
    fn what_contradicts_itself_is_no_message() {
        for bytes in [
            [16, 18, 0, 2, 255, 0, 0xEF, 0],
            [16, 0, 0, 0, 255, 0, 0xEF, 0],
            [32, 0xFF, 0xFF, 255, 255, 0, 0xEF, 0],
            [18, 0, 0, 0, 0, 0, 0, 0],
        ] {
            assert_eq!(Control::parse(Protocol::Tp, &bytes), None);
        }
        assert_eq!(Control::parse(Protocol::Tp, &[16, 18, 0, 3]), None);
    }
}
