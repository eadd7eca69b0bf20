//! The truck's sheet: its limits, what its bus needs, how its pose is found.
//!
//! The limits are those of [`VehicleLimits::from_sheet`]; two more tables belong to this program and
//! may be left out: `[bus]` with addresses, keys and parameters of the maker, `[pose]` with the
//! antenna's place and what the sensors are worth. No proprietary frame is sent that `[bus]` does
//! not name.

use std::path::Path;

use j1939::check::Carrier;
use j1939::truck::{BusTruckConfig, DriverSetup};
use j1939::{BitRate, NULL_ADDRESS, Name, PGN_MAX};
use planner::localise::LocaliserConfig;
use serde::Deserialize;
use tractrix_core::VehicleLimits;

use crate::failure::Failure;

/// A larger file is no sheet, bytes.
const LARGEST: u64 = 4_000_000;

/// What is known of a truck.
#[derive(Debug)]
pub(crate) struct Sheet {
    pub(crate) limits: VehicleLimits,
    pub(crate) bus: BusTable,
    pub(crate) pose: LocaliserConfig,
    /// As it was read.
    pub(crate) text: String,
}

/// `[bus]`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct BusTable {
    /// NAME to claim with; it may not be one that takes another address.
    name: u64,
    /// Address to claim.
    pub(crate) address: u8,
    engine: u8,
    transmission: u8,
    pub(crate) brakes: u8,
    cab: u8,
    radar: u8,
    retarders: Retarders,
    /// Control purpose in TSC1, 0 to 31; 6 is P7.
    control_purpose: u8,
    /// The engine must say in ADSS that it is ready for an automated driving system.
    pub(crate) needs_adss: bool,
    tsc1: Tsc1,
    xbr: Xbr,
    /// The maker's steering frame; without it the truck is not steered.
    steering: Option<Steering>,
    /// The truck's number; another one on the bus is another truck.
    pub(crate) vin: Option<String>,
    /// The mass on the bus may be off the sheet's by this share.
    pub(crate) mass_tolerance_frac: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Retarders {
    engine: Option<u8>,
    driveline: Option<u8>,
    exhaust: Option<u8>,
}

#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Tsc1 {
    key: u8,
    counter_modulus: u8,
}

#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Xbr {
    /// 1024, or 61184 (Proprietary A) where a maker wants it so.
    pgn: u32,
    priority: u8,
    key: u8,
}

#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Steering {
    frame: SteeringFrame,
    address: u8,
    key: u8,
}

/// Frames that this program knows; a maker's own is one more.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum SteeringFrame {
    /// The example, which the simulated truck alone understands.
    Example,
}

impl Default for Tsc1 {
    fn default() -> Self {
        let protection = Carrier::TSC1.protection;
        Self { key: protection.key, counter_modulus: protection.counter_modulus }
    }
}

impl Default for Xbr {
    fn default() -> Self {
        let Carrier { pgn, priority, protection } = Carrier::XBR;
        Self { pgn, priority, key: protection.key }
    }
}

impl Default for BusTable {
    fn default() -> Self {
        let standard = BusTruckConfig::default();
        let [engine, driveline, exhaust] = standard.retarders;
        Self {
            // That of the library keeps its address: controllers take demands from it alone
            name: standard.name.0 & !(1 << 63),
            address: standard.address,
            engine: standard.engine,
            transmission: standard.transmission,
            brakes: standard.brakes,
            cab: standard.cab,
            radar: standard.radar,
            retarders: Retarders { engine, driveline, exhaust },
            control_purpose: standard.control_purpose,
            needs_adss: standard.needs_adss,
            tsc1: Tsc1::default(),
            xbr: Xbr::default(),
            steering: None,
            vin: None,
            mass_tolerance_frac: 0.3,
        }
    }
}

impl BusTable {
    fn check(&self) -> Result<(), String> {
        let Retarders { engine, driveline, exhaust } = self.retarders;
        let addresses = [
            ("address", Some(self.address)),
            ("engine", Some(self.engine)),
            ("transmission", Some(self.transmission)),
            ("brakes", Some(self.brakes)),
            ("cab", Some(self.cab)),
            ("radar", Some(self.radar)),
            ("retarders.engine", engine),
            ("retarders.driveline", driveline),
            ("retarders.exhaust", exhaust),
            ("steering.address", self.steering.map(|s| s.address)),
        ];
        for (key, address) in addresses {
            if address.is_some_and(|a| a >= NULL_ADDRESS) {
                return Err(format!("{key} is no address: 0 to 253"));
            }
            if key != "address" && address == Some(self.address) {
                return Err(format!("{key} is our own address {:#04X}", self.address));
            }
        }
        if Name(self.name).can_choose() || self.name == 0 {
            return Err("name may not be 0 or one that takes another address (bit 64)".to_owned());
        }
        if self.control_purpose > 31 {
            return Err("control_purpose: 0 to 31".to_owned());
        }
        if ![8, 16].contains(&self.tsc1.counter_modulus) {
            return Err("tsc1.counter_modulus: 8 or 16".to_owned());
        }
        if self.xbr.pgn > PGN_MAX || self.xbr.priority > 7 {
            return Err("xbr: pgn 0 to 0x3FFFF, priority 0 to 7".to_owned());
        }
        if !(self.mass_tolerance_frac > 0.0 && self.mass_tolerance_frac <= 1.0) {
            return Err("mass_tolerance_frac: more than 0, at most 1".to_owned());
        }
        Ok(())
    }

    /// As the library takes it.
    fn config(&self, claim_delay_steps: u8) -> BusTruckConfig {
        let Retarders { engine, driveline, exhaust } = self.retarders;
        let mut tsc1 = Carrier::TSC1;
        tsc1.protection.key = self.tsc1.key;
        tsc1.protection.counter_modulus = self.tsc1.counter_modulus;
        let mut xbr = Carrier { pgn: self.xbr.pgn, priority: self.xbr.priority, ..Carrier::XBR };
        xbr.protection.key = self.xbr.key;
        let standard = BusTruckConfig::default();
        BusTruckConfig {
            name: Name(self.name),
            address: self.address,
            claim_delay_steps,
            engine: self.engine,
            transmission: self.transmission,
            brakes: self.brakes,
            cab: self.cab,
            radar: self.radar,
            retarders: [engine, driveline, exhaust],
            steering: self.steering.map_or(standard.steering, |s| s.address),
            tsc1,
            xbr,
            control_purpose: self.control_purpose,
            needs_adss: self.needs_adss,
            ..standard
        }
    }

    /// What drives the truck, as the library takes it.
    pub(crate) fn setup(&self, rate: BitRate, claim_delay_steps: u8) -> DriverSetup {
        let config = self.config(claim_delay_steps);
        DriverSetup { rate, config, steering_key: self.steering_key() }
    }

    /// Key of the steering frame that the sheet names.
    pub(crate) fn steering_key(&self) -> Option<u8> {
        self.steering.map(|Steering { frame: SteeringFrame::Example, key, .. }| key)
    }

    /// The engine's address.
    pub(crate) const fn engine(&self) -> u8 {
        self.engine
    }
}

impl Sheet {
    /// Reads a sheet; `address` is claimed in place of the one in it.
    ///
    /// # Errors
    /// [`Failure::Input`] names the file and everything in it that cannot be used.
    pub(crate) fn load(path: &Path, address: Option<u8>) -> Result<Self, Failure> {
        let file = |e| Failure::file(path, &e);
        if std::fs::metadata(path).map_err(file)?.len() > LARGEST {
            return Err(Failure::Input(format!("{}: too large for a sheet", path.display())));
        }
        let text = std::fs::read_to_string(path).map_err(file)?;
        Self::parse(&path.display().to_string(), &text, address)
    }

    fn parse(file: &str, text: &str, address: Option<u8>) -> Result<Self, Failure> {
        // What is no TOML is said by who reads limits
        let Ok(mut sheet) = text.parse::<toml::Table>() else {
            let error = VehicleLimits::from_sheet(file, text).err();
            return Err(Failure::input(error.map_or_else(String::new, |e| e.to_string())));
        };
        let own = ["bus", "pose"].map(|key| sheet.remove(key));
        let limits = toml::to_string(&sheet).map_err(Failure::input)?;
        let limits = VehicleLimits::from_sheet(file, &limits).map_err(Failure::input)?;
        let wrong = |table: &str, why: &dyn std::fmt::Display| {
            Failure::input(format!("{file}: [{table}] {why}"))
        };
        let [bus, pose] = own;
        let mut bus: BusTable = match bus {
            Some(table) => {
                table.try_into().map_err(|e: toml::de::Error| wrong("bus", &e.message()))?
            }
            None => BusTable::default(),
        };
        bus.address = address.unwrap_or(bus.address);
        bus.check().map_err(|why| wrong("bus", &why))?;
        let pose: LocaliserConfig = match pose {
            Some(table) => {
                table.try_into().map_err(|e: toml::de::Error| wrong("pose", &e.message()))?
            }
            None => LocaliserConfig::default(),
        };
        pose.check().map_err(|why| wrong("pose", &why))?;
        Ok(Self { limits, bus, pose, text: text.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sheet_without_a_bus_is_the_standard_s_and_keeps_its_address() {
        let standard = BusTruckConfig::default();
        let config = BusTable::default().config(standard.claim_delay_steps);
        assert!(standard.name.can_choose() && !config.name.can_choose());
        assert_eq!(BusTruckConfig { name: standard.name, ..config }, standard);
        assert!(BusTable::default().steering_key().is_none());
    }

    /// The example of docs/truck.md, commented lines included.
    #[test]
    fn the_example_of_the_docs_is_read() {
        let page = include_str!("../../../docs/truck.md");
        let example = page.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next());
        let lines = example.unwrap().lines().map(|line| line.strip_prefix("# ").unwrap_or(line));
        let tables: toml::Table = lines.collect::<Vec<_>>().join("\n").parse().unwrap();
        let bus: BusTable = tables["bus"].clone().try_into().unwrap();
        bus.check().unwrap();
        let config = bus.config(0);
        assert_eq!(config.retarders, [Some(0x0F), None, Some(0x29)]);
        assert_eq!(config.xbr, Carrier::proprietary_xbr(0x3C));
        assert!(config.needs_adss && bus.vin.is_some() && bus.steering_key() == Some(0x5A));
        let pose: LocaliserConfig = tables["pose"].clone().try_into().unwrap();
        pose.check().unwrap();
        assert_eq!(pose.antenna_ahead_m, 3.1);
    }
}
