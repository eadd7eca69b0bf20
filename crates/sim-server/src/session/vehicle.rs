//! How the stack reaches the truck.

use j1939::BitRate;
use j1939::bus::Bus;
use j1939::bus::loopback::Loopback;
use j1939::bus::tap::Tap;
use recording::{BusHeader, BusTrace, DriverWish};
use sim::World;

use crate::bus_board::BusBoard;
use crate::failure::Failure;

/// Reaches the truck as `--vehicle` says: directly, over a bus in memory, or over a bus outside
/// (both ends in this process, time from the ticks). Says what the recording needs of the bus; what
/// goes over it is on the board.
///
/// # Errors
/// [`Failure::Input`] names a bus that does not exist or cannot be opened.
pub(super) fn connect(
    world: &mut World,
    vehicle: &str,
    board: &BusBoard,
) -> Result<Option<BusHeader>, Failure> {
    board.begin(vehicle);
    let rate = BitRate::Kbit250;
    let [ecu, driver]: [Box<dyn Bus + Send + Sync>; 2] = match vehicle {
        "direct" => return Ok(None),
        "bus" => {
            let wire = Loopback::new(rate, 2);
            [Box::new(wire.node(0)), Box::new(wire.node(1))]
        }
        name => {
            let open =
                || j1939::bus::open(name).map_err(|e| Failure::Input(format!("--vehicle {e}")));
            sim::in_step(open()?, open()?)
        }
    };
    let trace = BusTrace::default();
    let tapped = Box::new(Tap::new(driver, (trace.clone(), board.clone())));
    world.put_on_bus(rate, ecu, tapped).map_err(Failure::work)?;
    // The truck's driver was asked to drive at the end of the warm-up
    trace.wished(DriverWish::Engage);
    let driver_json = serde_json::to_string(&sim::bus_driver_setup(rate)).map_err(Failure::work)?;
    Ok(Some(BusHeader { vehicle: vehicle.to_owned(), driver_json, trace }))
}
