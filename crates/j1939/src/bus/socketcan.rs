//! A CAN interface of the Linux kernel: a real adapter, or `vcan`.
//!
//! A shell: the only bus here that opens a socket of the kernel's CAN family and reads the clock of
//! the system, for the age of a frame.

use std::io;
use std::io::IoSliceMut;
use std::os::fd::AsRawFd;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use nix::errno::Errno;
use nix::sys::socket::{ControlMessageOwned, MsgFlags, recvmsg, setsockopt, sockopt};
use socketcan::{CanFrame, CanSocket, Socket, SocketOptions};
use tractrix_core::{Stamped, Time};

use super::{Bus, BusError};
use crate::{Frame, Id};

/// Bytes of a classic frame of the kernel and of a CAN FD frame (linux/can.h).
const CLASSIC_BYTES: usize = 16;
const FD_BYTES: usize = 72;
/// Flags in the kernel's identifier.
const EXTENDED: u32 = 0x8000_0000;
const REMOTE: u32 = 0x4000_0000;
const ERROR: u32 = 0x2000_0000;
/// Kinds of error frames that are asked for (linux/can/error.h).
const ERROR_BUS_OFF: u32 = 0x40;
const ERROR_RESTARTED: u32 = 0x100;
const ERROR_KINDS: u32 = 0x1FF;
/// Options of raw CAN sockets (linux/can/raw.h).
const SOL_CAN_RAW: i32 = 101;
const CAN_RAW_FD_FRAMES: i32 = 5;
/// Filters that the kernel takes.
const FILTERS: usize = 512;
/// A frame that claims to be older had its clock set.
const OLDEST: Duration = Duration::from_secs(1);
/// Frames that are skipped in one call; what comes behind them is for the next.
const SKIPPED_AT_ONCE: usize = 1_000;

/// What an interface delivered besides J1939 frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SocketCanCounts {
    /// Frames that the kernel dropped because nobody received in time.
    pub dropped: u64,
    /// Frames with 11-bit identifiers and remote frames: never J1939.
    pub skipped: u64,
    /// Error frames of the controller.
    pub errors: u64,
}

/// An interface as a bus.
#[derive(Debug)]
pub struct SocketCan {
    socket: CanSocket,
    interface: String,
    queue: usize,
    off: bool,
    /// The kernel's own counter of drops, which wraps.
    kernel_drops: u32,
    counts: SocketCanCounts,
}

impl SocketCan {
    /// Opens an interface. With a list of parameter groups the kernel passes on only those.
    ///
    /// # Errors
    /// With what to do about it: no such interface, interface down, no permission, a kernel without
    /// CAN, too many groups.
    pub fn open(interface: &str, pgns: &[u32]) -> Result<Self, BusError> {
        let fail = |e: io::Error| failure(interface, &e);
        let socket = CanSocket::open(interface).map_err(fail)?;
        // binding to an interface that is down works, and leaves an error behind
        if let Some(error) = socket.as_raw_socket().take_error().map_err(fail)? {
            return Err(fail(error));
        }
        socket.set_nonblocking(true).map_err(fail)?;
        socket.set_recv_own_msgs(false).map_err(fail)?;
        socket.set_error_filter(ERROR_KINDS).map_err(fail)?;
        socket.set_recv_timestamp(true).map_err(fail)?;
        // without this the kernel hides CAN FD frames, and with them that the bus is no J1939-21 bus
        socket.set_socket_option_int(SOL_CAN_RAW, CAN_RAW_FD_FRAMES, 1).map_err(fail)?;
        setsockopt(&socket, sockopt::RxqOvfl, &1).map_err(|e| fail(e.into()))?;
        if pgns.len() > FILTERS {
            let why = format!("{} parameter groups, the kernel filters {FILTERS}", pgns.len());
            return Err(BusError::Io { what: interface.to_owned(), why });
        }
        if !pgns.is_empty() {
            let filters: Vec<(u32, u32)> = pgns.iter().map(|pgn| filter(*pgn)).collect();
            socket.set_filters(&filters).map_err(fail)?;
        }
        let length = std::fs::read_to_string(format!("/sys/class/net/{interface}/tx_queue_len"));
        let queue = length.ok().and_then(|text| text.trim().parse().ok()).unwrap_or_default();
        let (interface, counts) = (interface.to_owned(), SocketCanCounts::default());
        Ok(Self { socket, interface, queue, off: false, kernel_drops: 0, counts })
    }

    /// What was delivered besides J1939 frames.
    #[must_use]
    pub const fn counts(&self) -> SocketCanCounts {
        self.counts
    }

    /// The next frame of any kind: its identifier with flags, its data, its age.
    fn read(&mut self) -> Result<Option<(u32, Vec<u8>, Duration)>, BusError> {
        let mut bytes = [0; FD_BYTES];
        let mut slices = [IoSliceMut::new(&mut bytes)];
        let mut space = nix::cmsg_space!([nix::sys::time::TimeSpec; 4], u32);
        let fd = self.socket.as_raw_fd();
        let (len, age, drops) =
            match recvmsg::<()>(fd, &mut slices, Some(&mut space), MsgFlags::empty()) {
                Err(Errno::EAGAIN | Errno::EINTR) => return Ok(None),
                Err(error) => return Err(failure(&self.interface, &error.into())),
                Ok(message) => {
                    let (mut age, mut drops) = (Duration::ZERO, None);
                    for control in message.cmsgs().into_iter().flatten() {
                        match control {
                            ControlMessageOwned::ScmTimestampns(sent) => age = age_of(sent.into()),
                            ControlMessageOwned::RxqOvfl(count) => drops = Some(count),
                            _ => {}
                        }
                    }
                    (message.bytes, age, drops)
                }
            };
        if let Some(drops) = drops {
            self.counts.dropped += u64::from(drops.wrapping_sub(self.kernel_drops));
            self.kernel_drops = drops;
        }
        if len != CLASSIC_BYTES {
            let why = "CAN FD frames on this bus, J1939-21 buses carry classic frames".to_owned();
            return Err(BusError::Io { what: self.interface.clone(), why });
        }
        let [i0, i1, i2, i3, data_len, _, _, _, data @ ..] = bytes;
        let data = data.get(..usize::from(data_len.min(8))).unwrap_or_default().to_vec();
        Ok(Some((u32::from_ne_bytes([i0, i1, i2, i3]), data, age)))
    }
}

impl Bus for SocketCan {
    fn send(&mut self, _now: Time, frame: &Frame) -> Result<(), BusError> {
        if self.off {
            return Err(BusError::Off);
        }
        let can = embedded_can::Frame::id(frame);
        let Some(can) = <CanFrame as embedded_can::Frame>::new(can, frame.bytes()) else {
            return Ok(()); // every frame of ours is one of theirs
        };
        match self.socket.write_frame(&can) {
            Ok(()) => Ok(()),
            Err(e) if is_full(&e) => Err(BusError::Full(self.queue)),
            Err(e) => Err(failure(&self.interface, &e)),
        }
    }

    fn receive(&mut self, now: Time) -> Result<Option<Stamped<Frame>>, BusError> {
        for _ in 0..SKIPPED_AT_ONCE {
            let Some((id, data, age)) = self.read()? else { break };
            if id & ERROR != 0 {
                self.counts.errors += 1;
                self.off = (self.off || id & ERROR_BUS_OFF != 0) && id & ERROR_RESTARTED == 0;
            } else if id & EXTENDED == 0 || id & REMOTE != 0 {
                self.counts.skipped += 1;
            } else if let Ok(value) = Frame::new(Id::from_raw(id), &data) {
                let age_nanos = i64::try_from(age.as_nanos()).unwrap_or_default();
                return Ok(Some(Stamped { time: now.plus_nanos(-age_nanos), value }));
            }
        }
        if self.off { Err(BusError::Off) } else { Ok(None) }
    }

    fn error_frames(&self) -> u64 {
        self.counts.errors
    }
}

/// Identifier and mask for data frames of one parameter group, whatever priority and addresses.
fn filter(pgn: u32) -> (u32, u32) {
    let with_destination = Id::from_raw(pgn << 8 | 0xFF00).da() == 0xFF && (pgn >> 8 & 0xFF) < 240;
    let group = if with_destination { 0x3_FF00 } else { 0x3_FFFF };
    (EXTENDED | (pgn & group) << 8, EXTENDED | REMOTE | group << 8)
}

/// How long ago a frame came in.
#[expect(clippy::disallowed_methods, reason = "a shell: the kernel stamps with the system's clock")]
fn age_of(sent: Duration) -> Duration {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    now.checked_sub(sent).filter(|age| *age < OLDEST).unwrap_or_default()
}

/// Whether the send queue of the interface or of the socket has no room.
fn is_full(error: &io::Error) -> bool {
    let errno = error.raw_os_error().map(Errno::from_raw);
    matches!(errno, Some(Errno::ENOBUFS | Errno::EAGAIN))
}

/// What the kernel says, in words that help.
fn failure(interface: &str, error: &io::Error) -> BusError {
    let why = match error.raw_os_error().map(Errno::from_raw) {
        Some(Errno::ENODEV | Errno::ENXIO) => {
            "no such CAN interface; `ip link` lists them".to_owned()
        }
        Some(Errno::ENETDOWN) => format!(
            "the interface is down; `ip link set {interface} up type can bitrate 250000` (vcan: without type)"
        ),
        Some(Errno::EPERM | Errno::EACCES) => "no permission to open a CAN socket".to_owned(),
        Some(Errno::EAFNOSUPPORT | Errno::EPROTONOSUPPORT) => {
            "this kernel has no CAN sockets; `modprobe can_raw`".to_owned()
        }
        _ => error.to_string(),
    };
    BusError::Io { what: interface.to_owned(), why }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::REQUEST_PGN;

    #[test]
    fn an_interface_that_cannot_be_opened_is_named_with_what_helps() {
        let error = SocketCan::open("nosuch0", &[]).unwrap_err().to_string();
        let helps = ["no such CAN interface", "no CAN sockets", "no permission"];
        assert!(
            error.starts_with("nosuch0: ") && helps.iter().any(|h| error.contains(h)),
            "{error}"
        );
        for (errno, word) in [
            (Errno::ENETDOWN, "down"),
            (Errno::EPERM, "no permission"),
            (Errno::ENODEV, "no such"),
            (Errno::EAFNOSUPPORT, "no CAN sockets"),
        ] {
            let error = failure("can0", &io::Error::from_raw_os_error(errno as i32)).to_string();
            assert!(error.starts_with("can0: ") && error.contains(word), "{error}");
        }
    }

    #[test]
    fn a_filter_passes_its_group_alone() {
        let passes = |pgn: u32, raw: u32| {
            let (id, mask) = filter(pgn);
            (raw | EXTENDED) & mask == id & mask
        };
        for (pgn, raw, expected) in [
            (61_444, 0x0CF0_0400, true),
            (61_444, 0x18F0_0431, true),
            (61_444, 0x0CF0_0500, false),
            (REQUEST_PGN, 0x18EA_FFFE, true),
            (REQUEST_PGN, 0x18EA_2A00, true),
            (REQUEST_PGN, 0x18EB_2A00, false),
        ] {
            assert_eq!(passes(pgn, raw), expected, "{pgn} {raw:08X}");
        }
    }
}
