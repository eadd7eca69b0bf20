//! The guard alone: what it says of a tick in order and of wrong ones, and what it then asks for.

use crate::guard::{self, GuardConfig, GuardInput, GuardMemory, inspect, limit};
use crate::meter::Meter;
use tractrix_core::{
    Command, EgoState, GuardReason, Stamped, Time, VehicleFault, VehicleLimits, VehicleStatus,
};

/// What a tick of the guard is given.
struct Inputs {
    now: Time,
    ego: Option<Stamped<EgoState>>,
    status: VehicleStatus,
    scene_time: Option<Time>,
    demand_time: Option<Time>,
    pedal_frac: f64,
}

/// One thing that goes wrong, and what the guard calls it.
type Case = (fn(&mut Inputs), GuardReason);

const CASES: [Case; 9] = [
    (|i| i.ego = None, GuardReason::Stale),
    (|i| i.scene_time = None, GuardReason::Stale),
    (|i| i.demand_time = Some(Time(-1_000_000_000)), GuardReason::Stale),
    (|i| ego(i).time = Time(-1_000_000_000), GuardReason::Stale),
    (|i| ego(i).value.speed_m_s = f64::NAN, GuardReason::NonFinite),
    (|i| ego(i).value.s_m += 50.0, GuardReason::Jump),
    (|i| ego(i).value.speed_m_s = 70.0, GuardReason::Range),
    (|i| i.status.raise(VehicleFault::BusOff, Time::ZERO), GuardReason::Bus),
    (|i| i.status.raise(VehicleFault::Spoofed, Time::ZERO), GuardReason::Intruder),
];

fn ego(inputs: &mut Inputs) -> &mut Stamped<EgoState> {
    inputs.ego.get_or_insert_default()
}

/// Runs a tick in order and one after it for each case: how many, and the instructions of the
/// dearest.
pub fn all_cases(meter: &Meter, limits: &VehicleLimits) -> Result<(usize, u64), &'static str> {
    let config = GuardConfig::default();
    let mut worst = 0;
    let mut tick = |inputs: &Inputs, memory: &GuardMemory| {
        let (instructions, result) = meter.instructions(|| {
            let ego = inputs.ego.as_ref();
            let read = guard::Inputs {
                ego,
                status: &inputs.status,
                scene_time: inputs.scene_time,
                demand_time: inputs.demand_time,
            };
            let (inspection, memory) = inspect(&config, memory, inputs.now, &read);
            let input = GuardInput {
                dt_s: 0.01,
                speed_m_s: 20.0,
                planned: inspection.ego_usable.then_some(Command {
                    accelerator_pedal_frac: inputs.pedal_frac,
                    ..Command::default()
                }),
                keep_lane_wheel_rad: 0.0,
                minimal_risk: inspection.minimal_risk,
                driver_wheel_rad: None,
                headway: None,
            };
            let (guarded, memory) = limit(&config, &memory, &input, limits);
            (inspection, guarded, memory)
        });
        worst = worst.max(instructions);
        result
    };
    let inputs = |ms: i64| {
        let now = Time(ms * 1_000_000);
        let s_m = 0.02 * ms as f64;
        let value = EgoState { s_m, speed_m_s: 20.0, ..EgoState::default() };
        Inputs {
            now,
            ego: Some(Stamped { time: now, value }),
            status: VehicleStatus::default(),
            scene_time: Some(now),
            demand_time: None,
            pedal_frac: 0.5,
        }
    };
    let (inspection, guarded, memory) = tick(&inputs(0), &GuardMemory::default());
    if inspection.minimal_risk
        || guarded.minimal_risk
        || guarded.command.accelerator_pedal_frac != 0.5
    {
        return Err("the guard acts on a tick in order");
    }
    for (spoil, reason) in CASES {
        let mut wrong = inputs(10);
        spoil(&mut wrong);
        let (inspection, guarded, _) = tick(&wrong, &memory);
        let command = &guarded.command;
        let brakes = command.accelerator_pedal_frac == 0.0 && command.xbr_decel_m_s2 > 0.0;
        if !inspection.reasons.contains(reason) || !guarded.minimal_risk || !brakes {
            return Err("the guard does not act on a wrong tick");
        }
    }
    Ok((CASES.len() + 1, worst))
}
