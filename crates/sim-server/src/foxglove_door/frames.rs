//! How long the messages are that a viewer sends: the heads of its WebSocket frames (RFC 6455, 5.2).

/// Longest message of a viewer, bytes: a subscription of every topic has some thousand.
pub(super) const MAX_MESSAGE_BYTES: u64 = 65_536;
/// Two bytes, a length of eight, a mask of four.
const MAX_FRAME_HEAD: usize = 14;

/// Where in its stream of frames a viewer is.
#[derive(Debug, Default)]
pub(super) struct Frames {
    /// Bytes of the present frame that are still to come.
    left: u64,
    /// Bytes of the frames before it that are of the same message.
    before: u64,
    head: [u8; MAX_FRAME_HEAD],
    /// Bytes of the head that are here.
    has: usize,
}

impl Frames {
    /// Reads on; false once a message is too long.
    pub(super) fn read(&mut self, mut bytes: &[u8]) -> bool {
        while !bytes.is_empty() {
            let payload = usize::try_from(self.left).unwrap_or(usize::MAX).min(bytes.len());
            bytes = bytes.get(payload..).unwrap_or_default();
            self.left -= payload as u64;
            let Some((&next, rest)) = bytes.split_first() else { return true };
            if let Some(place) = self.head.get_mut(self.has) {
                *place = next;
                self.has += 1;
            }
            bytes = rest;
            if self.has == self.head_bytes() && !self.begin_frame() {
                return false;
            }
        }
        true
    }

    /// How long the present frame's head is, as far as it is known.
    const fn head_bytes(&self) -> usize {
        if self.has < 2 {
            return 2;
        }
        let mask = if self.head[1] & 0x80 == 0 { 0 } else { 4 };
        mask + match self.head[1] & 0x7f {
            126 => 4,
            127 => 10,
            _ => 2,
        }
    }

    /// A whole head is here: its payload follows. False if the message is too long.
    fn begin_frame(&mut self) -> bool {
        let [first, second, ..] = self.head;
        let length = |bytes: &[u8]| bytes.iter().fold(0, |sum, &b| (sum << 8) | u64::from(b));
        self.left = match second & 0x7f {
            126 => length(&self.head[2..4]),
            127 => length(&self.head[2..10]),
            short => short.into(),
        };
        self.has = 0;
        let message = self.before.saturating_add(self.left);
        let (is_final, is_control) = (first & 0x80 != 0, first & 0x08 != 0);
        // A ping may come between the frames of a message
        if !is_control {
            self.before = if is_final { 0 } else { message };
        }
        message <= MAX_MESSAGE_BYTES
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A masked frame.
    fn frame(first: u8, payload: u64) -> Vec<u8> {
        let mut frame = vec![first];
        match payload {
            ..126 => frame.push(0x80 | payload as u8),
            126..65_536 => {
                frame.push(0x80 | 126);
                frame.extend((payload as u16).to_be_bytes());
            }
            _ => {
                frame.push(0x80 | 127);
                frame.extend(payload.to_be_bytes());
            }
        }
        frame.extend([1, 2, 3, 4]);
        frame.extend(std::iter::repeat_n(0xff, payload.min(100_000) as usize));
        frame
    }

    /// The protocol's crate takes 64 MB in a message from each of 16 viewers.
    #[test]
    fn a_message_is_bounded_however_it_comes() {
        let [text, part, more, last, ping] = [0x81, 0x01, 0x00, 0x80, 0x89];
        let short =
            [frame(text, 0), frame(text, 125), frame(ping, 5), frame(text, 65_536)].concat();
        let parts = [frame(part, 60_000), frame(ping, 125), frame(more, 5_000), frame(last, 536)];
        let parts = [parts.concat(), frame(text, 60_000)].concat();
        for good in [&short, &parts] {
            for piece in [1, 7, 1_000, usize::MAX] {
                let mut frames = Frames::default();
                assert!(good.chunks(piece.min(good.len())).all(|bytes| frames.read(bytes)));
            }
        }
        let long = [frame(text, 65_537), frame(text, u64::MAX)];
        let parts = [frame(part, 60_000), frame(ping, 125), frame(more, 5_537)].concat();
        for bad in long.iter().chain(&[parts]) {
            assert!(!Frames::default().read(bad));
        }
    }
}
