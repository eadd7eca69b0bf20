//! The gear that the speed plan has, asked for as long as the truck follows the plan.

use crate::pcc::horizon::HorizonPoint;
use crate::pcc::model::Drive;
use tractrix_core::{EgoState, GearRequest, VehicleLimits};

/// A truck this far off the plan's speed chooses its gears itself, m/s; and again asks for gears
/// from half of it on.
const GEAR_OFF_M_S: f64 = 1.5;
/// An open driveline is closed when the truck is this much faster than planned, m/s: it must not
/// run away.
const RUNAWAY_M_S: f64 = 0.5;
/// A requested gear is kept for this long, s.
const GEAR_HOLD_S: f64 = 4.0;
/// Above this pedal a gear below the lugging limit is not asked for.
const LUGGING_PEDAL_FRAC: f64 = 0.75;

/// What the truck does now, for the choice of a gear.
pub(super) struct Doing {
    pub(super) free: bool,
    pub(super) braking: bool,
    pub(super) pedal_frac: f64,
}

/// Memory of the choice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PlannedGear {
    asking: bool,
    gear: GearRequest,
    gear_s: f64,
}

impl Default for PlannedGear {
    fn default() -> Self {
        Self { asking: false, gear: GearRequest::Automatic, gear_s: 0.0 }
    }
}

impl PlannedGear {
    /// The gear to ask for, if the driver lets gears be asked for (`ask`).
    pub(super) fn choose(
        &mut self,
        dt_s: f64,
        ask: bool,
        ego: &EgoState,
        limits: &VehicleLimits,
        doing: &Doing,
        planned: impl Fn(f64) -> Option<HorizonPoint>,
    ) -> GearRequest {
        self.gear_s += dt_s;
        let lead_m = 0.5 * limits.powertrain.shift_duration_s.clamp(0.0, 3.0) * ego.speed_m_s;
        let wanted = match (planned(ego.s_m), planned(ego.s_m + lead_m)) {
            (Some(here), Some(soon)) if ask && !doing.braking => {
                let over = ego.speed_m_s - here.speed_m_s;
                let room = if self.asking { GEAR_OFF_M_S } else { 0.5 * GEAR_OFF_M_S };
                self.asking = doing.free && over.abs() < room;
                match soon.drive {
                    _ if !self.asking => GearRequest::Automatic,
                    Drive::Gear(g)
                        if doing.pedal_frac > LUGGING_PEDAL_FRAC && lugs(g, ego, limits) =>
                    {
                        GearRequest::Automatic
                    }
                    Drive::Gear(g) => GearRequest::Gear(g + 1),
                    Drive::Neutral if over < RUNAWAY_M_S && soon.coast => GearRequest::Neutral,
                    Drive::Neutral => GearRequest::Automatic,
                }
            }
            _ => {
                self.asking = false;
                GearRequest::Automatic
            }
        };
        // A planned gear rests for a while; giving the choice back to the gearbox never waits.
        let rests = wanted != GearRequest::Automatic
            && self.gear != GearRequest::Automatic
            && self.gear_s < GEAR_HOLD_S;
        if wanted != self.gear && !rests {
            self.gear = wanted;
            self.gear_s = 0.0;
        }
        self.gear
    }
}

/// Whether a gear, as an index, turns the engine below its lugging limit.
fn lugs(gear: u8, ego: &EgoState, limits: &VehicleLimits) -> bool {
    let p = &limits.powertrain;
    let ratio = p.gear_ratios.get(usize::from(gear)).copied().unwrap_or(0.0);
    ego.speed_m_s * ratio * p.final_drive_ratio / p.wheel_radius_m < p.lugging_speed_rad_s
}
