//! A bus by its name on the command line.

use super::{Bus, BusError, socketcand};

/// Opens `can:IFACE`, an interface of the Linux kernel, or `socketcand:HOST:PORT/IFACE`, one behind
/// a server.
///
/// # Errors
/// For another name, and as [`super::socketcan::SocketCan::open`] and
/// [`socketcand::Client::connect`].
pub fn open(name: &str) -> Result<Box<dyn Bus + Send + Sync>, BusError> {
    if let Some(interface) = name.strip_prefix("can:") {
        return kernel(interface);
    }
    let server = name.strip_prefix("socketcand:").and_then(|rest| rest.rsplit_once('/'));
    match server {
        Some((server, interface)) => Ok(Box::new(socketcand::Client::connect(server, interface)?)),
        None => {
            let why = "a bus is can:IFACE or socketcand:HOST:PORT/IFACE".to_owned();
            Err(BusError::Io { what: name.to_owned(), why })
        }
    }
}

#[cfg(target_os = "linux")]
fn kernel(interface: &str) -> Result<Box<dyn Bus + Send + Sync>, BusError> {
    Ok(Box::new(super::socketcan::SocketCan::open(interface, &[])?))
}

#[cfg(not(target_os = "linux"))]
fn kernel(interface: &str) -> Result<Box<dyn Bus + Send + Sync>, BusError> {
    let why = "CAN interfaces are Linux's; use socketcand:HOST:PORT/IFACE".to_owned();
    Err(BusError::Io { what: interface.to_owned(), why })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bus_that_cannot_be_opened_is_named() {
        for (name, says) in [
            ("vcan0", "vcan0: a bus is can:IFACE or socketcand:HOST:PORT/IFACE"),
            ("socketcand:127.0.0.1:1", "a bus is"),
            ("can:nosuch0", "nosuch0: "),
            ("socketcand:127.0.0.1:1/can0", "127.0.0.1:1/can0: "),
        ] {
            let Err(error) = open(name) else { panic!("{name}") };
            assert!(error.to_string().contains(says), "{error}");
        }
    }
}
