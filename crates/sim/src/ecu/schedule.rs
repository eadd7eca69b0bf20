//! What each control unit sends by itself, and when.

use j1939::message::{
    Acc1, Adss, Air1, Amb, Ccvs1, Ebc1, Ebc2, Ebc3, Ebc5, Ec1, Eec1, Eec2, Eec3, Erc1, Et1, Etc1,
    Etc2, Hrw, Lfe1, Message, Rc, Vdc1, Vdc2, Vdhr, Vds, Vp1,
};
use j1939::{Frame, GLOBAL_ADDRESS, J1939Error, MessageTable};
use tractrix_core::Time;

use super::Unit;
use super::messages::Snapshot;

/// Bytes of the longest message that a unit sends by itself: EC1.
pub(super) const LONGEST_BYTES: usize = 40;

/// A message on its way.
pub(super) enum Outgoing {
    /// One frame.
    Frame(Frame),
    /// Nothing: the truck does not know it.
    None,
    /// For the transport: its table and its bytes.
    Long(&'static MessageTable, [u8; LONGEST_BYTES], usize),
}

/// A message that is sent every period of its table, first at its phase.
struct Entry {
    unit: Unit,
    table: &'static MessageTable,
    phase_ms: i64,
    make: fn(&Snapshot<'_>, u8) -> Result<Outgoing, J1939Error>,
}

/// Everything but SAS, which counts, and DM1. Ten-millisecond messages go in the middle of a tick of 10 ms;
/// slow ones have phases of their own, so that they do not meet.
const ENTRIES: [Entry; 25] = [
    entry::<Eec1>(Unit::Engine, 5, |s, sa| short(&s.eec1(), sa)),
    entry::<Eec2>(Unit::Engine, 5, |s, sa| short(&s.eec2(), sa)),
    entry::<Eec3>(Unit::Engine, 35, |s, sa| short(&s.eec3(), sa)),
    entry::<Ec1>(Unit::Engine, 10, |s, _| long(&s.ec1())),
    entry::<Lfe1>(Unit::Engine, 15, |s, sa| short(&s.lfe1(), sa)),
    entry::<Et1>(Unit::Engine, 110, |s, sa| short(&s.et1(), sa)),
    entry::<Adss>(Unit::Engine, 120, |s, sa| short(&s.adss(), sa)),
    entry::<Etc1>(Unit::Transmission, 5, |s, sa| short(&s.etc1(), sa)),
    entry::<Etc2>(Unit::Transmission, 25, |s, sa| short(&s.etc2(), sa)),
    entry::<Hrw>(Unit::Brakes, 15, |s, sa| short(&s.hrw(), sa)),
    entry::<Vdc2>(Unit::Brakes, 5, |s, sa| short(&s.vdc2(), sa)),
    entry::<Ebc1>(Unit::Brakes, 45, |s, sa| short(&s.ebc1(), sa)),
    entry::<Ebc2>(Unit::Brakes, 55, |s, sa| short(&s.ebc2(), sa)),
    entry::<Ebc3>(Unit::Brakes, 65, |s, sa| short(&s.ebc3(), sa)),
    entry::<Ebc5>(Unit::Brakes, 75, |s, sa| short(&s.ebc5(), sa)),
    entry::<Vdc1>(Unit::Brakes, 85, |s, sa| short(&s.vdc1(), sa)),
    entry::<Air1>(Unit::Brakes, 130, |s, sa| short(&s.air1(), sa)),
    entry::<Erc1>(Unit::Retarder, 95, |s, sa| short(&s.erc1(), sa)),
    entry::<Rc>(Unit::Retarder, 260, |s, _| long(&s.rc())),
    entry::<Acc1>(Unit::Radar, 85, |s, sa| short(&s.acc1(), sa)),
    entry::<Ccvs1>(Unit::Cab, 5, |s, sa| short(&s.ccvs1(), sa)),
    entry::<Amb>(Unit::Cab, 140, |s, sa| short(&s.amb(), sa)),
    entry::<Vdhr>(Unit::Cab, 150, |s, sa| short(&s.vdhr(), sa)),
    entry::<Vds>(Unit::Cab, 165, |s, sa| known(s.vds(), sa)),
    entry::<Vp1>(Unit::Cab, 175, |s, sa| known(s.vp1(), sa)),
];

const fn entry<M: Message>(
    unit: Unit,
    phase_ms: i64,
    make: fn(&Snapshot<'_>, u8) -> Result<Outgoing, J1939Error>,
) -> Entry {
    Entry { unit, table: M::TABLE, phase_ms, make }
}

fn short<M: Message>(message: &M, sa: u8) -> Result<Outgoing, J1939Error> {
    Ok(Outgoing::Frame(message.frame(GLOBAL_ADDRESS, sa)?))
}

fn known<M: Message>(message: Option<M>, sa: u8) -> Result<Outgoing, J1939Error> {
    message.map_or(Ok(Outgoing::None), |message| short(&message, sa))
}

fn long<M: Message>(message: &M) -> Result<Outgoing, J1939Error> {
    let encoded = message.encode()?;
    let (mut bytes, len) = ([0xFF; LONGEST_BYTES], encoded.as_ref().len());
    let room = bytes.get_mut(..len);
    let small = J1939Error::Buffer { pgn: M::TABLE.pgn, len: LONGEST_BYTES, need: len };
    room.ok_or(small)?.copy_from_slice(encoded.as_ref());
    Ok(Outgoing::Long(M::TABLE, bytes, len))
}

/// The message of a parameter group that this unit sends by itself, if it is one of them.
pub(super) fn requested(
    unit: Unit,
    pgn: u32,
    snapshot: &Snapshot<'_>,
    sa: u8,
) -> Option<Result<Outgoing, J1939Error>> {
    let entry = ENTRIES.iter().find(|e| e.unit == unit && e.table.pgn == pgn)?;
    Some((entry.make)(snapshot, sa))
}

/// When each message is due again.
#[derive(Debug, Clone)]
pub(super) struct Schedule {
    due: [Time; ENTRIES.len()],
}

impl Schedule {
    /// All messages are due at their phase after `start`.
    pub(super) fn new(start: Time) -> Self {
        Self { due: ENTRIES.map(|e| start.plus_nanos(e.phase_ms * 1_000_000)) }
    }

    /// The messages that are due at `now`, with who sends them.
    pub(super) fn take(
        &mut self,
        now: Time,
        snapshot: &Snapshot<'_>,
        address: impl Fn(Unit) -> Option<u8>,
    ) -> Result<Vec<(Unit, Outgoing)>, J1939Error> {
        let mut messages = Vec::new();
        for (entry, due) in ENTRIES.iter().zip(&mut self.due) {
            if now < *due {
                continue;
            }
            let period_ms = entry.table.period_ms.unwrap_or(1000);
            // After a pause a message is sent once, not once for every period of the pause
            let missed = (now.0 - due.0) / (i64::from(period_ms) * 1_000_000);
            *due = due.plus_nanos((missed + 1) * i64::from(period_ms) * 1_000_000);
            if let Some(sa) = address(entry.unit) {
                messages.push((entry.unit, (entry.make)(snapshot, sa)?));
            }
        }
        Ok(messages)
    }
}
