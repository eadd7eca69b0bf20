//! What VECTO declares for its generic 40 t truck: single figures of the result file that its
//! release is tested against (CLIMA-VECTO/vecto-sim, VectoCoreTest/TestData/Integration/
//! DeclarationMode/40t Truck/40t_Long_Haul_Truck.vsum, commit de154fde): consumption by the fuel
//! map (column FC-Map, before the correction for transient operation).

use std::path::Path;

use dynamics::TruckParameters;

use super::cycle::{Cycle, Taken, drive as drive_cycle, with_map_of, with_rolling_of_mass};

/// One run of the result file.
pub(crate) struct Declared {
    pub(crate) cycle: &'static str,
    pub(crate) payload_kg: f64,
    pub(crate) g_km: f64,
    pub(crate) speed_kmh: f64,
    pub(crate) engine_kwh: f64,
    pub(crate) overrun_kwh: f64,
    pub(crate) brake_kwh: f64,
}

const fn run(cycle: &'static str, payload_kg: f64, f: [f64; 5]) -> Declared {
    let [g_km, speed_kmh, engine_kwh, overrun_kwh, brake_kwh] = f;
    Declared { cycle, payload_kg, g_km, speed_kmh, engine_kwh, overrun_kwh, brake_kwh }
}

pub(crate) const DECLARED: [Declared; 6] = [
    run("LongHaul", 0.0, [215.4556, 75.025, 119.688, 2.087, 3.872]),
    run("LongHaul", 19_300.0, [303.645, 73.718, 170.547, 5.316, 19.406]),
    run("LongHaul", 25_400.0, [334.0563, 73.219, 187.486, 5.838, 26.168]),
    run("RegionalDelivery", 0.0, [219.7443, 59.148, 28.688, 1.079, 2.560]),
    run("RegionalDelivery", 12_900.0, [299.4737, 59.186, 39.365, 1.953, 6.876]),
    run("RegionalDelivery", 25_400.0, [378.3818, 58.627, 49.937, 2.295, 12.109]),
];

/// The same run in the plant.
pub(crate) fn drive(folder: &Path, d: &Declared) -> Result<Taken, Box<dyn std::error::Error>> {
    let truck = with_map_of(TruckParameters::load("vecto-40t")?, folder)?;
    let truck = with_rolling_of_mass(truck, 14_600.0 + d.payload_kg)?;
    let cycle = Cycle::read(&folder.join("cycles").join(format!("{}.csv", d.cycle)))?;
    drive_cycle(truck, d.payload_kg, &cycle)
}
