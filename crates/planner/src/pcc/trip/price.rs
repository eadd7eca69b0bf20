//! What a second and a joule are worth in fuel: two drives over one road compared at equal trip time
//! and equal end speed.
//!
//! **A second** costs the multiplier of the trip time in the fuel-optimal plan of the road, g/s: by
//! the envelope theorem it is the slope of the least fuel over trip time, what the best driver pays
//! to be a second earlier. **A joule** of kinetic energy costs the fuel that makes it at the set
//! speed: the slope of the fuel over the wheel force between half and full load. Height needs no
//! price: drives are compared at one place.

use road::ProfilePoint;

use super::{Trip, TripRequest};
use crate::pcc::error::PccError;
use crate::pcc::solve::DefaultSolver;

/// Longest stretch of road, from its start, that the price of time is taken from, m: a plan's effort
/// grows with its length.
const LONGEST_M: f64 = 30_000.0;

/// Prices in fuel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Price {
    /// A second of trip time, g/s.
    pub time_g_s: f64,
    /// A joule at the wheels, g/J.
    pub energy_g_j: f64,
}

/// A drive, or a part of one.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Leg {
    /// Fuel burnt, g.
    pub fuel_g: f64,
    /// Time taken, s.
    pub time_s: f64,
    /// Kinetic energy gained, J.
    pub kinetic_j: f64,
}

impl Price {
    /// The prices of a trip, in time that of cruise control with 5 km/h overspeed.
    ///
    /// # Errors
    /// As [`Trip::new`].
    pub fn of_trip(request: &TripRequest<'_>) -> Result<Self, PccError> {
        let within =
            |p: &&ProfilePoint| request.profile.first().is_some_and(|a| p.s_m <= a.s_m + LONGEST_M);
        let count = request.profile.iter().take_while(within).count();
        let trip =
            Trip::new(&TripRequest { profile: &request.profile[..count], ..request.clone() })?;
        let mut solver = DefaultSolver::default();
        let goal_s = trip.overspeed.trip_time_s();
        let plan = trip
            .plan(Some(goal_s), &mut |sub, end, time, fence| solver.solve(sub, end, time, fence));
        let (truck, set_m_s) = (&trip.truck, request.band.set_m_s);
        Ok(Self {
            time_g_s: plan.price_of_time_g_s(),
            energy_g_j: truck.marginal_fuel_g_j_kg(set_m_s) / truck.mass_kg,
        })
    }

    /// What a leg costs in all, g: fuel and time, less the energy that it leaves behind.
    #[must_use]
    pub fn cost_g(&self, leg: &Leg) -> f64 {
        leg.fuel_g + self.time_g_s * leg.time_s - self.energy_g_j * leg.kinetic_j
    }

    /// Fuel that `leg` saves against `base` over the same road at equal trip time and equal end
    /// speed, as a fraction of the base's fuel; none where the base burnt none.
    #[must_use]
    pub fn saving_frac(&self, leg: &Leg, base: &Leg) -> Option<f64> {
        (base.fuel_g > 0.0).then(|| (self.cost_g(base) - self.cost_g(leg)) / base.fuel_g)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pcc::{SpeedBand, Tuning};
    use crate::testing::reference_limits;
    use alloc::vec::Vec;

    #[test]
    fn a_later_drive_pays_its_seconds_and_a_slower_end_its_energy() {
        let price = Price { time_g_s: 3.0, energy_g_j: 5e-5 };
        let base = Leg { fuel_g: 1_000.0, time_s: 100.0, kinetic_j: 0.0 };
        let later = Leg { fuel_g: 900.0, time_s: 110.0, kinetic_j: -4e5 };
        assert!((price.saving_frac(&later, &base).unwrap() - 0.05).abs() < 1e-12);
        assert_eq!(price.saving_frac(&later, &Leg::default()), None);
    }

    #[test]
    fn on_the_flat_the_prices_are_those_of_the_closed_form() {
        // P_wheel = m g c_r v + rho CdA v³ / 2: a metre's fuel falls by q rho CdA v per m/s, a
        // metre's time by 1/v², so that a second costs q rho CdA v³; the engine's friction, which
        // grows with its speed and is left out, adds 5 %.
        let truck = reference_limits();
        let flat: Vec<ProfilePoint> = (0..=400)
            .map(|i| ProfilePoint {
                s_m: 25.0 * f64::from(i),
                speed_limit_m_s: 30.0,
                ..ProfilePoint::default()
            })
            .collect();
        let v = 22.0;
        let request = TripRequest {
            profile: &flat,
            truck: &truck,
            band: SpeedBand { set_m_s: v, min_m_s: 19.0, max_m_s: 24.0 },
            trip_time_s: None,
            eco_roll: false,
            tuning: Tuning::default(),
        };
        let price = Price::of_trip(&request).unwrap();
        let load = &truck.road_load;
        let closed = price.energy_g_j * load.air_density_kg_m3 * load.cd_a_m2 * v * v * v;
        let more_frac = price.time_g_s / closed - 1.0;
        assert!((0.0..0.1).contains(&more_frac), "{price:?}, {closed}");
        // 180 to 230 g/kWh at the crank, 90 to 97 % of it at the wheels.
        let g_kwh = price.energy_g_j * 3.6e6;
        assert!((180.0..250.0).contains(&g_kwh), "{g_kwh}");
    }
}
