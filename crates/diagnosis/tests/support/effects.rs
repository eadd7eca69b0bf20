//! Hidden causes of the catalogue: what each changes in the truck, with sizes and shapes of the
//! generator's own.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::outside::Outside;
use super::random::{between, sign};
use super::second::outside::SecondOutside;
use super::sheet::{AXLE, Figures, RADIUS_M, engine_brake, full_load};

/// What is wrong with the truck, beyond its tolerances.
#[derive(Debug, Clone)]
pub(crate) enum Effect {
    /// A cause of the catalogue: id, size in the unit of [`SIZES`], and a drawn shape.
    Cause { id: &'static str, size: f64, shape: Shape },
    /// An effect that the catalogue does not have.
    Outside { kind: Outside, size: f64, shape: Shape },
    /// The same in the second family of drives.
    SecondOutside { kind: SecondOutside, size: f64, shape: Shape },
}

/// How an effect looks beyond its size: four numbers between 0 and 1.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Shape(pub(crate) [f64; 4]);

impl Shape {
    pub(crate) fn draw(rng: &mut ChaCha8Rng) -> Self {
        Self([rng.random(), rng.random(), rng.random(), rng.random()])
    }

    /// The `i`-th number mapped between two bounds.
    pub(crate) fn at(&self, i: usize, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0[i]
    }

    /// A choice among `n`.
    pub(crate) fn choice(&self, i: usize, n: usize) -> usize {
        ((self.0[i] * n as f64) as usize).min(n - 1)
    }
}

/// Id, medium size, whether either sign occurs.
pub(crate) const SIZES: [(&str, f64, bool); 37] = [
    ("rolling_resistance", 0.16, true),
    ("air_drag", 0.13, true),
    ("headwind", 2.2, true),
    ("wind", 4.5, false),
    ("mass", 0.08, true),
    ("grade_bias", 0.0016, true),
    ("map_shift", 30.0, true),
    ("tyre_warmup", 0.30, false),
    ("driveline_loss", 0.035, false),
    ("fan_load", 22.0, false),
    ("dragging_brake", 600.0, false),
    ("engine_friction", 0.28, true),
    ("altitude_derate", 0.08, false),
    ("heat_derate", 0.06, false),
    ("turbo_lag", 0.45, false),
    ("pedal_delay", 0.2, false),
    ("shift_duration", 0.4, false),
    ("fuel_map_low_load", 0.2, true),
    ("brake_gain", 0.17, true),
    ("brake_fade", 0.30, false),
    ("brake_delay", 0.2, false),
    ("hidden_retarder", 800.0, false),
    ("speed_scale", 0.02, true),
    ("yaw_rate_bias", 0.004, true),
    ("steering_ratio", 0.07, true),
    ("steering_offset", 0.05, true),
    ("steering_free_play", 0.07, false),
    ("steering_lag", 0.13, false),
    ("cornering_stiffness_front", 0.22, true),
    ("cornering_stiffness_drive", 0.22, true),
    ("cornering_stiffness_trailer", 0.25, true),
    ("payload_position", 0.6, true),
    ("road_bank", 0.014, true),
    ("crosswind", 4.0, true),
    ("engine_brake_torque", 0.22, true),
    ("fuel_flow_scale", 0.08, true),
    ("co2_scale", 0.1, true),
];

/// How large a hidden cause is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Magnitude {
    Small,
    Medium,
    Large,
}

/// Draws size and shape of a cause; `None` if there is no such id.
pub(crate) fn hide(id: &str, magnitude: Magnitude, rng: &mut ChaCha8Rng) -> Option<Effect> {
    let (id, medium, either) = *SIZES.iter().find(|s| s.0 == id)?;
    let factor = match magnitude {
        Magnitude::Small => between(rng, 0.35, 0.55),
        Magnitude::Medium => between(rng, 0.75, 1.25),
        Magnitude::Large => between(rng, 1.5, 2.1),
    };
    let size = medium * factor * if either { sign(rng) } else { 1.0 };
    Some(Effect::Cause { id, size, shape: Shape::draw(rng) })
}

/// Puts the causes that are a figure of the truck into it.
pub(crate) fn apply(f: &mut Figures, effects: &[Effect]) {
    for e in effects {
        let Effect::Cause { id, size, shape } = e else { continue };
        let x = *size;
        match *id {
            "rolling_resistance" => f.rolling *= 1.0 + x,
            "air_drag" => f.drag_area *= 1.0 + x,
            "headwind" => f.headwind += x,
            "wind" => {
                let (sin, cos) = shape.at(0, 0.0, core::f64::consts::TAU).sin_cos();
                f.wind = [f.wind[0] + x * cos, f.wind[1] + x * sin];
                f.side_share = shape.at(1, 0.15, 0.45);
                f.side_behind_m = shape.at(2, -1.0, 1.0);
                f.wind_turns_rad = shape.at(3, 0.0, 0.3);
            }
            "mass" => {
                f.mass_scale *= 1.0 + x;
                f.tyres_follow = shape.choice(0, 2) == 1;
            }
            "grade_bias" => f.grade_bias += x,
            "map_shift" => f.map_shift_m += x,
            // An axle loses in all gears, a gearbox more where its teeth carry the power.
            "driveline_loss" => {
                f.efficiency *= 1.0 - x;
                f.mesh_loss = if shape.choice(0, 2) == 0 { 0.0 } else { x * shape.at(1, 0.0, 0.8) };
            }
            "dragging_brake" => f.drag_force_n += x,
            "engine_friction" => f.friction_scale *= 1.0 + x,
            "turbo_lag" => {
                f.boost_lag_s += x;
                f.boost_from = shape.at(0, 0.27, 0.43);
            }
            "pedal_delay" => {
                let lag_s = if shape.choice(0, 2) == 0 { 0.0 } else { x * shape.at(1, 0.3, 0.8) };
                f.pedal_delay_s += x - lag_s;
                f.pedal_lag_s = lag_s;
            }
            "shift_duration" => f.shift_extra_s += x,
            "brake_gain" => f.brake_scale *= 1.0 + x,
            "brake_delay" => f.brake_delay_s += x,
            "speed_scale" => f.speed_scale *= 1.0 + x,
            "yaw_rate_bias" => f.yaw_bias += x,
            "steering_ratio" => f.steer_ratio *= 1.0 + x,
            "steering_offset" => f.steer_offset_rad += x,
            "steering_free_play" => f.free_play_rad += x,
            "steering_lag" => match shape.choice(0, 3) {
                0 => f.steer_lag_s += x,
                1 => f.steer_delay_s += x,
                _ => {
                    f.steer_lag_s += 0.5 * x;
                    f.steer_delay_s += 0.5 * x;
                }
            },
            "cornering_stiffness_front" => f.stiffness[0] *= 1.0 + x,
            "cornering_stiffness_drive" => f.stiffness[1] *= 1.0 + x,
            "cornering_stiffness_trailer" => f.stiffness[2] *= 1.0 + x,
            "payload_position" => {
                f.payload_rearward_m += x;
                f.tyres_follow = shape.choice(0, 2) == 1;
            }
            "road_bank" => f.bank_rad += x,
            "crosswind" => {
                f.crosswind += x;
                f.side_share = shape.at(1, 0.15, 0.45);
                f.side_behind_m = shape.at(2, -1.0, 1.0);
                f.crosswind_swells = shape.at(3, 0.0, 0.3);
            }
            _ => {}
        }
    }
}

/// What an effect may look at, at one moment of the drive.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Now {
    pub(crate) time_s: f64,
    pub(crate) place_m: f64,
    pub(crate) speed: f64,
    pub(crate) rpm: f64,
    pub(crate) indicated_nm: f64,
    pub(crate) pedal: f64,
    pub(crate) stage: f64,
    pub(crate) xbr: f64,
    pub(crate) coolant_degc: f64,
    pub(crate) ambient_degc: f64,
    pub(crate) altitude_m: f64,
    pub(crate) curvature: f64,
    pub(crate) service_n: f64,
    pub(crate) brake_k: f64,
    pub(crate) mass_kg: f64,
    pub(crate) gear: usize,
    pub(crate) warm: bool,
}

/// What the effects with a course of their own do now.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Acting {
    /// Force against the motion, N.
    pub(crate) force_n: f64,
    /// Torque taken from the crank, Nm.
    pub(crate) crank_nm: f64,
    /// Factor on the full load.
    pub(crate) derate: f64,
    /// Factor on the demanded torque.
    pub(crate) demand: f64,
    /// Factor and offset, kPa, of the pressure.
    pub(crate) pressure: [f64; 2],
    /// Factor on the service brake's force.
    pub(crate) friction: f64,
    /// Factor on the fuel.
    pub(crate) fuel: f64,
    /// Factors of the fuel meter and of the CO2 meter.
    pub(crate) meters: [f64; 2],
    /// Factor and offset of the logged yaw rate, trailer yaw rate, lateral acceleration, GPS speed.
    pub(crate) yaw: [f64; 2],
    pub(crate) trailer_yaw: [f64; 2],
    pub(crate) accel_y: [f64; 2],
    pub(crate) gps: [f64; 2],
    /// Side forces on the tractor's and the trailer's CG, N.
    pub(crate) side_n: [f64; 2],
    /// Extra length of a shift that begins now, s.
    pub(crate) shift_s: f64,
}

impl Acting {
    pub(crate) const NOTHING: Self = Self {
        force_n: 0.0,
        crank_nm: 0.0,
        derate: 1.0,
        demand: 1.0,
        pressure: [1.0, 0.0],
        friction: 1.0,
        fuel: 1.0,
        meters: [1.0; 2],
        yaw: [1.0, 0.0],
        trailer_yaw: [1.0, 0.0],
        accel_y: [1.0, 0.0],
        gps: [1.0, 0.0],
        side_n: [0.0; 2],
        shift_s: 0.0,
    };
}

/// Memory of the effects.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Memory {
    fan_goal: f64,
    fan: f64,
    /// Brake linings over the air, K.
    lining_k: f64,
    /// Coolant above where the engine takes torque away, as its controller follows it, K.
    overheat_k: f64,
    pub(crate) gust: f64,
}

/// Adds a cause of the catalogue to what acts; `dt` since the last call, s.
pub(crate) fn act(
    a: &mut Acting,
    m: &mut Memory,
    (id, size, shape): (&str, f64, &Shape),
    now: &Now,
    dt: f64,
) {
    match id {
        "tyre_warmup" if !now.warm => {
            let tau = shape.at(0, 900.0, 2100.0);
            let left = if shape.choice(1, 2) == 0 {
                (-now.time_s / tau).exp()
            } else {
                1.0 / (1.0 + (now.time_s / tau).powf(1.3))
            };
            a.force_n += 0.0062 * 9.81 * now.mass_kg * size * left;
        }
        "fan_load" => {
            let on = shape.at(0, 92.0, 99.0);
            let off = on - shape.at(1, 1.0, 7.0);
            if now.coolant_degc > on {
                m.fan_goal = 1.0;
            } else if now.coolant_degc < off {
                m.fan_goal = 0.0;
            }
            m.fan += (m.fan_goal - m.fan) * dt / 1.5;
            a.crank_nm += 1e3 * size * m.fan * 9.549_3 / now.rpm.max(500.0);
        }
        "altitude_derate" => {
            let over = (now.altitude_m - shape.at(0, 700.0, 1700.0)).max(0.0) * 1e-3;
            a.derate *= 1.0 - (size * over.powf(shape.at(1, 0.85, 1.25))).min(0.6);
        }
        "heat_derate" => {
            let over = if shape.choice(1, 2) == 0 {
                (now.ambient_degc - shape.at(0, 22.0, 32.0)).max(0.0)
            } else {
                // At once, or as the controller ramps it.
                let tau = if shape.choice(2, 2) == 0 { 0.0 } else { shape.at(3, 5.0, 60.0) };
                let over = (now.coolant_degc - shape.at(0, 93.0, 100.0)).max(0.0);
                let keep = (-dt / f64::max(tau, 1e-3)).exp();
                m.overheat_k = over + (m.overheat_k - over) * keep;
                m.overheat_k
            };
            a.derate *= 1.0 - (0.1 * size * over).min(0.6);
        }
        "brake_fade" => {
            // Linings as hot as the discs, or behind them.
            let tau = if shape.choice(1, 2) == 0 { 0.0 } else { shape.at(2, 5.0, 40.0) };
            m.lining_k += (now.brake_k - m.lining_k) * (1.0 - (-dt / f64::max(tau, 1e-3)).exp());
            let over = now.ambient_degc + m.lining_k - shape.at(0, 90.0, 200.0);
            let loss = 0.01 * size * over.max(0.0);
            a.friction *= 1.0 - loss / (1.0 + loss);
        }
        "engine_brake_torque" => {
            // Even over engine speed, or with a course of its own about 1500 rpm.
            let power = if shape.choice(0, 2) == 0 { 0.0 } else { shape.at(1, -0.6, 0.6) };
            let course = (now.rpm / 1500.0).powf(power);
            a.crank_nm += size * now.stage * engine_brake(now.rpm) * course;
        }
        "hidden_retarder" => {
            let on = match shape.choice(0, 3) {
                0 => now.stage,
                1 => f64::from(now.pedal < 0.01 && now.speed > shape.at(1, 3.0, 9.0)),
                _ => (now.xbr / shape.at(1, 0.5, 1.2)).min(1.0),
            };
            let fall = (now.speed / 5.0).min(1.0) * (1.0 + shape.at(2, -0.2, 0.2));
            a.force_n += on * size * AXLE / RADIUS_M * fall;
        }
        "fuel_flow_scale" | "co2_scale" => {
            // Of the rate at full load: alike at all loads, in proportion, or from a load on.
            let load = now.indicated_nm * now.rpm / 9549.3 / 455.0;
            let course = match shape.choice(0, 3) {
                0 => 1.0,
                1 => load.powf(shape.at(1, 0.4, 1.5)),
                _ => {
                    let from = shape.at(1, 0.0, 0.3);
                    ((load - from) / (1.0 - from)).clamp(0.0, 1.1)
                }
            };
            a.meters[usize::from(id == "co2_scale")] *= 1.0 + size * course;
        }
        "fuel_map_low_load" => {
            let (x, knee) = match shape.choice(0, 3) {
                0 => (now.indicated_nm / full_load(now.rpm).max(100.0), shape.at(1, 0.2, 0.5)),
                1 => (now.indicated_nm * now.rpm / 9549.3, shape.at(1, 50.0, 130.0)),
                _ => (now.indicated_nm / 2700.0, shape.at(1, 0.15, 0.4)),
            };
            let course = if shape.choice(2, 2) == 0 {
                (1.0 - x / knee).max(0.0)
            } else {
                1.0 / (1.0 + ((x / knee - 1.0) / 0.2).exp())
            };
            a.fuel *= 1.0 + size * course;
        }
        _ => {}
    }
}
