//! Who is on the bus, before anything of ours but one question is sent: a bus of another bit rate is
//! not disturbed, and nobody's address is taken from him.

use std::time::Duration;

use j1939::bus::{Bus, BusError};
use j1939::{ADDRESS_CLAIMED_PGN, GLOBAL_ADDRESS, NULL_ADDRESS, Name, Request};

use crate::clock::Clock;
use crate::failure::Failure;

/// How long the bus is listened to in silence.
const LISTEN: Duration = Duration::from_millis(300);
/// How long claims are waited for after the question (SAE J1939-81 gives 250 ms at most).
const ANSWERS: Duration = Duration::from_millis(400);
const STEP: Duration = Duration::from_millis(5);

/// Who answered: addresses with their NAMEs, sorted.
pub(crate) type Present = Vec<(u8, Name)>;

/// Listens, asks for claims, listens again.
///
/// # Errors
/// [`Failure::Input`] for a bus that cannot be used or carries error frames alone, and for an
/// address that somebody else has.
pub(crate) fn roll_call(
    bus: &mut impl Bus,
    clock: Clock,
    bus_name: &str,
    address: u8,
) -> Result<Present, Failure> {
    let wrong = |e: BusError| Failure::input(format!("--can {bus_name}: {e}"));
    let mut present = Present::new();
    let asked_at = clock.elapsed() + LISTEN;
    let (mut asked, mut frames) = (false, 0_u64);
    let mut due = clock.elapsed();
    while due < asked_at + ANSWERS {
        while let Some(heard) = bus.receive(clock.now()).map_err(wrong)? {
            frames += 1;
            let sa = heard.value.id().sa();
            let name = Name::claimed_in(&heard.value);
            if sa == address {
                let who = name.map_or(String::new(), |name| format!(" (NAME {:016X})", name.0));
                return Err(Failure::input(format!(
                    "--can {bus_name}: address {address:#04X} is taken{who}; another one: --address"
                )));
            }
            if let Some(name) = name.filter(|_| sa < NULL_ADDRESS)
                && !present.contains(&(sa, name))
            {
                present.push((sa, name));
            }
        }
        if due >= asked_at && !asked {
            asked = true;
            if frames == 0 && bus.error_frames() > 0 {
                return Err(Failure::input(format!(
                    "--can {bus_name}: {} error frames and no other: wrong bit rate or wiring",
                    bus.error_frames()
                )));
            }
            let claims = Request { pgn: ADDRESS_CLAIMED_PGN, da: GLOBAL_ADDRESS, sa: NULL_ADDRESS };
            let question = claims.frame().map_err(Failure::work)?;
            bus.send(clock.now(), &question).map_err(wrong)?;
        }
        due += STEP;
        clock.sleep_until(due);
    }
    present.sort_unstable();
    Ok(present)
}
