//! Signals that a free function, or the course of a cause, may follow.

use crate::data::drive::Drive;
use crate::replay::{JUMP_FRAC, Module, Prepared, by_neighbours};

/// A measured signal, or its memory.
pub(crate) struct Signal {
    /// Column name.
    pub(crate) name: &'static str,
    read: fn(&Prepared, usize) -> f64,
    /// Time constant of a first-order memory that fills from nothing, s; 0: the signal as it is. Heat,
    /// wear and wetness follow no signal of the moment.
    pub(crate) memory_s: f64,
}

const fn now(name: &'static str, read: fn(&Prepared, usize) -> f64) -> Signal {
    Signal { name, read, memory_s: 0.0 }
}

const fn memory(name: &'static str, memory_s: f64, read: fn(&Prepared, usize) -> f64) -> Signal {
    Signal { name, read, memory_s }
}

/// All of them.
pub(crate) const SIGNALS: &[Signal] = &[
    now("engine_speed_rpm", |d, i| d.rpm[i]),
    now("speed_m_s", |d, i| d.speed[i]),
    now("curvature_1_m", |d, i| d.curvature[i].abs()),
    now("grade_frac", |d, i| d.grade[i]),
    now("time_s", |_, i| i as f64 * Drive::STEP_S),
    now("ambient_temp_degc", |d, i| d.ambient[i]),
    now("coolant_temp_degc", |d, i| d.coolant[i]),
    now("accelerator_pedal_frac", |d, i| d.pedal[i]),
    now("brake_pressure_kpa", |d, i| d.pressure[i]),
    now("gps_altitude_m", |d, i| d.altitude[i]),
    now("gear", |d, i| d.gear[i] as f64),
    now("engine_torque_percent", |d, i| d.torque[i]),
    now("engine_brake_frac", |d, i| d.engine_brake[i]),
    now("xbr_decel_m_s2", |d, i| d.xbr[i]),
    now("yaw_rate_rad_s", |d, i| d.yaw[i]),
    now("accel_y_m_s2", |d, i| d.accel_y[i]),
    now("steering_wheel_rad", |d, i| d.steer[i]),
    now("trailer_yaw_rate_rad_s", |d, i| d.trailer_yaw[i]),
    now("s_map_m", |d, i| d.s_map[i]),
    memory("brake_pressure_kpa", 180.0, |d, i| d.pressure[i]),
    memory("engine_brake_frac", 300.0, |d, i| d.engine_brake[i]),
    memory("engine_torque_percent", 300.0, |d, i| d.torque[i].max(0.0)),
];

/// Index of a column as it is at the moment.
pub(crate) fn signal(name: &str) -> Option<usize> {
    SIGNALS.iter().position(|s| s.name == name && s.memory_s == 0.0)
}

/// A signal over the rows of a module: its means over the samples of a row, or what it is as a shift
/// begins; what the rows beside say of the message that the module's model reads.
pub(crate) fn means(d: &Prepared, signal: &Signal, module: Module) -> Vec<f64> {
    let remembered: Option<Vec<f64>> = (signal.memory_s > 0.0).then(|| {
        let (mut state, part) = (0.0, Drive::STEP_S / signal.memory_s);
        let follow = |i| {
            state += part * ((signal.read)(d, i) - state);
            state
        };
        (0..d.n).map(follow).collect()
    });
    let at = |i: usize| match &remembered {
        Some(values) => values.get(i).copied().unwrap_or(0.0),
        None => (signal.read)(d, i),
    };
    if module == Module::Shift {
        return d.shifts.iter().map(|s| at(s.0)).collect();
    }
    let step = module.row_step();
    let mean = |k: usize| {
        let (from, to) = (k * step, (k * step + step).min(d.n));
        (from..to).map(at).sum::<f64>() / (to - from).max(1) as f64
    };
    let rows: Vec<f64> = (0..d.n.div_ceil(step)).map(mean).collect();
    if signal.name == "engine_torque_percent" && module.reads_noise() {
        return by_neighbours(&rows, 100.0 * JUMP_FRAC);
    }
    rows
}
