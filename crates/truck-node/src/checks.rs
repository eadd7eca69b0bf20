//! What must be in order before anything is actuated, and the report of it.

use j1939::bus::Bus;
use j1939::ident::{VI, masked};
use j1939::message::{Cvw, Ec1};
use j1939::supervise::BusFault;
use j1939::truck::{Engagement, Readiness, lost_after_s};
use j1939::{ClaimState, Message};
use planner::localise::LocaliseError;
use tractrix_core::{PoseSource, SafetySignal, Time, Vehicle, VehicleFault};

use crate::failure::Failure;
use crate::node::Truck;
use crate::roll_call::Present;
use crate::sheet::BusTable;

/// Number, mass and reference torque of the truck are asked for so often, one second apart.
const QUESTIONS: u32 = 5;
const QUESTION_PERIOD: i64 = 1_000_000_000;
/// The radar's last word may be so old, s: five of its messages.
const RADAR_AGE_MAX_S: f64 = 0.5;

/// A line of the report.
struct Line {
    name: &'static str,
    is_missing: bool,
    says: String,
}

/// The checks of one tick.
pub(crate) struct Report(Vec<Line>);

impl Report {
    /// Whether everything is in order.
    pub(crate) fn is_ready(&self) -> bool {
        self.0.iter().all(|line| !line.is_missing)
    }

    /// What is missing, in one line.
    pub(crate) fn missing(&self) -> String {
        let missing = self.0.iter().filter(|line| line.is_missing);
        missing.map(|line| format!("{}: {}", line.name, line.says)).collect::<Vec<_>>().join("; ")
    }

    /// All of it, a line each.
    pub(crate) fn text(&self) -> String {
        let word = |missing| if missing { "missing" } else { "ok" };
        let line = |l: &Line| format!("  {:8}{:18}{}\n", word(l.is_missing), l.name, l.says);
        self.0.iter().map(line).collect()
    }

    fn add(&mut self, name: &'static str, is_ok: bool, says: String) {
        self.0.push(Line { name, is_missing: !is_ok, says });
    }
}

/// What is checked, and what has been asked.
pub(crate) struct Checks {
    bus_name: String,
    table: BusTable,
    sheet_mass_kg: f64,
    present: Present,
    asked: u32,
    ask_due: Time,
}

impl Checks {
    pub(crate) fn new(
        bus_name: String,
        table: BusTable,
        sheet_mass_kg: f64,
        present: Present,
    ) -> Self {
        Self { bus_name, table, sheet_mass_kg, present, asked: 0, ask_due: Time::ZERO }
    }

    /// Looks at everything after a tick. `radar` is the age of its last word, s.
    ///
    /// # Errors
    /// [`Failure::Input`] for what waiting does not mend: a bus that cannot be used, an address
    /// that is another's, another truck, another road.
    pub(crate) fn look(
        &mut self,
        now: Time,
        truck: &mut Truck,
        radar_s: f64,
    ) -> Result<Report, Failure> {
        if let Some(error) = truck.bus_error() {
            return Err(Failure::input(format!("--can {}: {error}", self.bus_name)));
        }
        let r = truck.readiness();
        self.refuse_contested(&r, truck)?;
        self.ask(now, &r, truck);
        let mut report = Report(Vec::new());
        let claimed = r.claim == ClaimState::Claimed;
        let own = self.table.address;
        let word = if claimed { "claimed" } else { "being claimed" };
        report.add("address", claimed, format!("{own:#04X} {word}"));
        let load = 100.0 * truck.load(now);
        let errors = truck.bus().error_frames();
        let units: Vec<_> = self.present.iter().map(|(sa, _)| format!("{sa:02X}")).collect();
        let says = format!(
            "{} frames, load {load:.0} %, {errors} error frames, claims of {}",
            r.frames,
            if units.is_empty() { "nobody".to_owned() } else { units.join(" ") }
        );
        report.add("bus", r.frames > 0, says);
        self.signals(truck, &mut report);
        self.units(&r, &mut report);
        pose(now, truck, &mut report)?;
        report.add("radar", radar_s <= RADAR_AGE_MAX_S, heard(radar_s, RADAR_AGE_MAX_S));
        self.truck(&r, &mut report)?;
        let steering = match self.table.steering_key() {
            Some(_) => "by the frame that the sheet names",
            None => "none: the sheet names no steering frame, the driver steers",
        };
        report.add("steering", true, steering.to_owned());
        faults(truck, &mut report);
        Ok(report)
    }

    fn refuse_contested(&self, r: &Readiness, truck: &Truck) -> Result<(), Failure> {
        let own = self.table.address;
        let lost = matches!(r.claim, ClaimState::Losing(_) | ClaimState::Lost);
        let contested = truck.events().any(|event| match event.fault {
            BusFault::AddressConflict { address } | BusFault::NullName { address } => {
                address == own
            }
            BusFault::Spoofed { sa, .. } => sa == own,
            _ => false,
        });
        if lost || contested {
            let why = "is taken; another one: --address";
            return Err(Failure::input(format!(
                "--can {}: address {own:#04X} {why}",
                self.bus_name
            )));
        }
        Ok(())
    }

    /// Asks for what is told on request alone, or may be.
    fn ask(&mut self, now: Time, r: &Readiness, truck: &mut Truck) {
        let known = r.vin.is_some() && r.mass_kg.is_some() && r.reference_torque_nm.is_some();
        if known || self.asked >= QUESTIONS || now < self.ask_due || r.claim != ClaimState::Claimed
        {
            return;
        }
        (self.asked, self.ask_due) = (self.asked + 1, now.plus_nanos(QUESTION_PERIOD));
        // What the bus has no room for is asked again
        if r.vin.is_none() {
            let _ = truck.ask(now, VI, self.table.engine());
        }
        if r.mass_kg.is_none() {
            let _ = truck.ask(now, Cvw::TABLE.pgn, self.table.brakes);
        }
        if r.reference_torque_nm.is_none() {
            let _ = truck.ask(now, Ec1::TABLE.pgn, self.table.engine());
        }
    }

    fn signals(&self, truck: &Truck, report: &mut Report) {
        let status = truck.status();
        for signal in SafetySignal::ALL.into_iter().filter(|s| *s != SafetySignal::Pose) {
            let age_s = status.age_s(signal).unwrap_or(f64::INFINITY);
            let limit_s = lost_after_s(signal);
            report.add(name_of(signal), age_s <= limit_s, heard(age_s, limit_s));
        }
    }

    fn units(&self, r: &Readiness, report: &mut Report) {
        let torque = r.reference_torque_nm.filter(|nm| *nm > 0.0);
        let says = torque.map_or("EC1 has not come".to_owned(), |nm| format!("{nm:.0} Nm (EC1)"));
        report.add("reference torque", torque.is_some(), says);
        let says = match r.brakes_accept {
            Some(true) => "take every demand (EBC5)",
            Some(false) => "take no demands, or the first priority alone (EBC5)",
            None => "EBC5 has not come",
        };
        report.add("brakes' consent", r.brakes_accept == Some(true), says.to_owned());
        let consent = r.engine_accepts.unwrap_or(!self.table.needs_adss);
        let says = match r.engine_accepts {
            Some(true) => "takes demands (ADSS)",
            Some(false) => "takes no demands (ADSS)",
            None => "ADSS has not come",
        };
        report.add("engine's consent", consent, says.to_owned());
    }

    /// Whether it is the truck of the sheet.
    fn truck(&self, r: &Readiness, report: &mut Report) -> Result<(), Failure> {
        let asks = self.asked < QUESTIONS;
        let hidden = |vin: &str| masked(vin).collect::<String>();
        match (&r.vin, &self.table.vin) {
            (Some(vin), Some(expected)) if vin.as_str() != expected => {
                return Err(Failure::input(format!(
                    "--truck: the sheet is of another truck: VIN {} in it, {} on the bus",
                    hidden(expected),
                    hidden(vin.as_str())
                )));
            }
            (Some(vin), Some(_)) => {
                report.add("number", true, format!("{} as in the sheet", hidden(vin.as_str())));
            }
            (Some(vin), None) => {
                let vin = hidden(vin.as_str());
                report.add("number", true, format!("{vin}, not compared: the sheet has none"));
            }
            (None, Some(_)) => report.add("number", false, "the engine has not told it".to_owned()),
            (None, None) => report.add("number", !asks, "not told".to_owned()),
        }
        let sheet_kg = self.sheet_mass_kg;
        match r.mass_kg {
            Some(kg) if (kg / sheet_kg - 1.0).abs() > self.table.mass_tolerance_frac => {
                Err(Failure::input(format!(
                    "--truck: the sheet is of another truck or load: {sheet_kg:.0} kg in it, \
                     {kg:.0} kg on the bus (CVW)"
                )))
            }
            Some(kg) => {
                report.add(
                    "mass",
                    true,
                    format!("{kg:.0} kg (CVW), {sheet_kg:.0} kg in the sheet"),
                );
                Ok(())
            }
            None => {
                report.add("mass", !asks, "not told: not compared".to_owned());
                Ok(())
            }
        }
    }
}

fn pose(now: Time, truck: &mut Truck, report: &mut Report) -> Result<(), Failure> {
    let source = truck.pose_source();
    let (fixes, sd_m) = (source.fixes(), source.deviation_m());
    match source.pose(now) {
        Ok(pose) => {
            let age_s = now.seconds_since(pose.time);
            let (s_m, d_m) = (pose.value.s_m, pose.value.d_m);
            let says = format!("s {s_m:.1} m, d {d_m:.2} m, within {sd_m:.2} m, {fixes} fixes");
            report.add("pose", age_s <= lost_after_s(SafetySignal::Pose), says);
        }
        Err(off @ LocaliseError::OffRoad { .. }) => {
            return Err(Failure::input(format!("--map: {off}")));
        }
        Err(error) => report.add("pose", false, format!("{error}, {fixes} fixes")),
    }
    Ok(())
}

fn faults(truck: &Truck, report: &mut Report) {
    // Until it drives, the driver does; what is missing is told above
    let told = [VehicleFault::DriverOverride, VehicleFault::SignalLost, VehicleFault::NotReady];
    let status = truck.status();
    let faults: Vec<_> =
        status.faults().map(|f| f.fault).filter(|f| !told.contains(f)).map(word).collect();
    let drives = match truck.engagement() {
        Engagement::Off => "a pedal is pressed, or something is missing",
        _ => "keeps off the pedals",
    };
    let says = if faults.is_empty() { "none".to_owned() } else { faults.join(", ") };
    report.add("faults", faults.is_empty(), says);
    report.add("driver", truck.engagement() != Engagement::Off, drives.to_owned());
}

/// A name as it is in the status: `bus_off`.
pub(crate) fn word(value: impl serde::Serialize) -> String {
    match serde_json::to_value(value) {
        Ok(serde_json::Value::String(word)) => word,
        _ => String::new(),
    }
}

fn heard(age_s: f64, limit_s: f64) -> String {
    if age_s.is_finite() && age_s < 1e6 {
        format!("{:.0} ms old, lost after {:.0} ms", 1e3 * age_s, 1e3 * limit_s)
    } else {
        "never heard".to_owned()
    }
}

const fn name_of(signal: SafetySignal) -> &'static str {
    match signal {
        SafetySignal::Pose => "pose",
        SafetySignal::RoadSpeed => "wheel speed",
        SafetySignal::YawRate => "yaw rate",
        SafetySignal::SteeringAngle => "steering angle",
        SafetySignal::Engine => "engine",
        SafetySignal::Transmission => "transmission",
        SafetySignal::Brakes => "brakes",
        SafetySignal::Pedals => "pedals",
    }
}
