//! What a truck engineer can do about a named cause.

/// The next step for a cause, as a sentence; a general one for causes without their own.
#[must_use]
pub fn advice(id: &str) -> &'static str {
    match id {
        "rolling_resistance" => {
            "Check tyre pressures and tyre types on all axles, and wheel alignment; then take the new coefficient over."
        }
        "air_drag" => {
            "Check the gap between cab and trailer, roof deflector and side skirts against the configuration that the truck file describes."
        }
        "headwind" | "wind" => {
            "Weather, not the truck: drive again on another day or in both directions, or enter the wind of the day."
        }
        "mass" => "Weigh the combination: the load sheet does not fit the accelerations.",
        "grade_bias" => "Check the map's heights against a survey or a second map.",
        "map_shift" => {
            "Check the map's reference point and the odometer: the profile lies beside the road."
        }
        "tyre_warmup" => {
            "Plan the first half hour with cold tyres, or drive warm before a measurement."
        }
        "driveline_loss" => {
            "Check oil level and viscosity of gearbox and axle, and axle temperature after the drive."
        }
        "fan_load" => "Check the fan clutch: it engages more than the truck file knows.",
        "dragging_brake" => {
            "Stop and feel for a hot drum or disc: a brake does not release, or a bearing is tight."
        }
        "engine_friction" => "Check oil viscosity and temperature, and what the engine drives.",
        "altitude_derate" => "Ask for the engine's altitude map and plan climbs with less torque.",
        "heat_derate" => {
            "Check charge-air cooler and radiator for dirt; the engine protects itself in the heat."
        }
        "turbo_lag" => "Check charge pressure, leaks and the turbocharger's actuator.",
        "pedal_delay" => "Check the torque request's path: bus load and gateway delay.",
        "shift_duration" => {
            "Check the clutch actuator's air supply and the gearbox calibration; plan fewer shifts until then."
        }
        "fuel_map_low_load" => {
            "Measure the engine at low load, or take the fuel map from this fit: idle and coasting cost more."
        }
        "brake_gain" => "Check linings and chamber strokes: pressure gives another force.",
        "engine_brake_torque" => {
            "Check the engine brake's valve clearance, oil pressure and flap; plan descents by what it holds now."
        }
        "brake_fade" => {
            "Plan descents with engine brake and retarder first: hot brakes lose force."
        }
        "brake_delay" => "Check the EBS valves and lines: the pressure comes late.",
        "hidden_retarder" => {
            "Find out which retarder acts on its own and enter it in the truck file."
        }
        "speed_scale" => {
            "Correct the tyre size in the tachograph; all distances and speeds are off by this factor."
        }
        "fuel_flow_scale" => {
            "Weigh the fuel of a drive and correct the control unit's rate by it; consumption from the bus is off by this factor."
        }
        "co2_scale" => "Calibrate the analyser with span gas, and the tunnel's flow.",
        "yaw_rate_bias" => "Calibrate the gyro at standstill.",
        "steering_ratio" => "Check the steering gear's ratio on the type plate.",
        "steering_offset" => "Centre the hand wheel sensor, or align the steer axle.",
        "steering_free_play" => {
            "Check ball joints and steering gear for play before driving automatically."
        }
        "steering_lag" => "Check the steering actuator's response and supply.",
        "cornering_stiffness_front"
        | "cornering_stiffness_drive"
        | "cornering_stiffness_trailer" => {
            "Check tyre type, tread and pressure of that axle group."
        }
        "payload_position" => "Check where the load lies and how the axle loads share it.",
        "road_bank" => "Add the cross-fall to the map, or check the level of the accelerometer.",
        "crosswind" => "Weather, not the truck: drive again on a calm day to confirm.",
        _ => "Repeat the drive to confirm it before the model is changed.",
    }
}
