//! What the control unit says of the fuel, and an analyser of the carbon.

use diagnosis::Drive;

use super::super::effects::Shape;
use super::colour::towards;
use super::faults::Faults;

/// Highest fuel rate of the data sheet's engine, g/s: 455 kW.
const MOST_G_S: f64 = 23.3;

/// The two meters.
pub(crate) struct Meters {
    fuel: Option<(f64, Shape)>,
    carbon: Option<(f64, Shape)>,
    /// Fuel rate over the last seconds, g/s.
    flow: f64,
}

impl Meters {
    pub(crate) fn new(faults: &Faults) -> Self {
        Self { fuel: faults.get("fuel_flow_scale"), carbon: faults.get("co2_scale"), flow: 1.0 }
    }

    /// Factors on the fuel rate and on the carbon of a sample.
    pub(crate) fn act(&mut self, fuel_g_s: f64, coolant_degc: f64) -> [f64; 2] {
        towards(&mut self.flow, fuel_g_s, Drive::STEP_S, 8.0);
        let load = fuel_g_s / MOST_G_S;
        // An injector that wears gives more than its map says by a constant quantity, and by a share
        // that grows with the pressure; warm fuel leaks past it.
        let fuel = self.fuel.map_or(1.0, |(x, shape)| {
            let least = shape.at(0, 0.0, 0.5);
            let warm = 1.0 + shape.at(1, -0.004, 0.004) * (coolant_degc - 85.0);
            1.0 + x * (least + (1.0 - least) * load.sqrt()) * warm
        });
        // A tunnel's flow is wrong by a share; with much exhaust it is pushed back, seconds later.
        let carbon = self.carbon.map_or(1.0, |(x, shape)| {
            let pushed = self.flow / MOST_G_S;
            1.0 + x * (1.0 - shape.at(0, 0.0, 0.7) * (1.0 - pushed).powi(2))
        });
        [fuel, carbon]
    }
}
