//! Manoeuvres that a validation engineer can drive on a proving ground or a quiet road.

/// What the driver's foot does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Foot {
    /// Holds a speed, m/s.
    Speed(f64),
    /// Holds the pedal, 0 to 1.
    Pedal(f64),
}

/// When a step ends, at the latest after its time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Until {
    /// Its time.
    Time,
    /// At this speed or above, m/s.
    Above(f64),
    /// At this speed or below, m/s.
    Below(f64),
}

/// One step of a drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Step {
    pub(super) foot: Foot,
    /// Demand on the service brake, m/s².
    pub(super) decel_m_s2: f64,
    /// Demand on the engine brake, 0 to 1.
    pub(super) engine_brake_frac: f64,
    /// Curvature of the path, 1/m; its amplitude where there is a period.
    pub(super) curvature_1_m: f64,
    /// Period of the steering, s; 0 holds it.
    pub(super) period_s: f64,
    pub(super) until: Until,
    pub(super) longest_s: f64,
}

const REST: Step = Step {
    foot: Foot::Pedal(0.0),
    decel_m_s2: 0.0,
    engine_brake_frac: 0.0,
    curvature_1_m: 0.0,
    period_s: 0.0,
    until: Until::Time,
    longest_s: 0.0,
};

const fn hold(speed_m_s: f64, longest_s: f64) -> Step {
    Step { foot: Foot::Speed(speed_m_s), longest_s, ..REST }
}

const fn pedal(frac: f64, until: Until, longest_s: f64) -> Step {
    Step { foot: Foot::Pedal(frac), until, longest_s, ..REST }
}

const fn coast(below_m_s: f64) -> Step {
    pedal(0.0, Until::Below(below_m_s), 400.0)
}

const fn brake(decel_m_s2: f64, below_m_s: f64) -> Step {
    Step { decel_m_s2, until: Until::Below(below_m_s), longest_s: 60.0, ..REST }
}

const fn engine_brake(frac: f64, below_m_s: f64, longest_s: f64) -> Step {
    Step { engine_brake_frac: frac, until: Until::Below(below_m_s), longest_s, ..REST }
}

const fn curve(speed_m_s: f64, curvature_1_m: f64, longest_s: f64) -> Step {
    Step { curvature_1_m, ..hold(speed_m_s, longest_s) }
}

const fn swing(speed_m_s: f64, curvature_1_m: f64, period_s: f64, longest_s: f64) -> Step {
    Step { period_s, ..curve(speed_m_s, curvature_1_m, longest_s) }
}

/// One drive: where, with what, and the steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Plan {
    /// Payload of the full payload.
    pub(super) payload_frac: f64,
    pub(super) altitude_m: f64,
    pub(super) air_degc: f64,
    /// Grade, rise over run: the amplitude of waves of this length, or constant where that is 0.
    pub(super) grade_frac: f64,
    pub(super) wave_m: f64,
    pub(super) heading_rad: f64,
    pub(super) start_m_s: f64,
    /// The tyres are warm at the start.
    pub(super) warm: bool,
    pub(super) steps: &'static [Step],
}

const fn full(steps: &'static [Step]) -> Plan {
    Plan {
        payload_frac: 1.0,
        altitude_m: 200.0,
        air_degc: 15.0,
        grade_frac: 0.0,
        wave_m: 0.0,
        heading_rad: 0.0,
        start_m_s: 10.0,
        warm: true,
        steps,
    }
}

const fn empty(steps: &'static [Step]) -> Plan {
    Plan { payload_frac: 0.0, ..full(steps) }
}

/// The other direction.
const fn back(plan: Plan) -> Plan {
    Plan { heading_rad: core::f64::consts::PI, ..plan }
}

/// A manoeuvre: one or more drives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Manoeuvre {
    pub(super) id: &'static str,
    /// What to do, for the driver.
    pub(super) what: &'static str,
    pub(super) drives: &'static [Plan],
}

const UP: Until = Until::Above(24.0);
const COAST: &[Step] = &[pedal(0.8, UP, 200.0), hold(24.0, 20.0), coast(8.0)];
const SPEEDS: &[Step] = &[hold(11.0, 100.0), hold(17.0, 100.0), hold(24.0, 120.0)];
const BURSTS: &[Step] = &[
    pedal(1.0, Until::Above(19.0), 150.0),
    coast(11.0),
    pedal(1.0, Until::Above(19.0), 150.0),
    coast(11.0),
    pedal(0.6, Until::Above(17.0), 150.0),
];
const RAMPS: &[Step] = &[
    pedal(1.0, UP, 200.0),
    coast(11.0),
    pedal(1.0, UP, 200.0),
    coast(11.0),
    pedal(1.0, UP, 200.0),
];
const CLIMB: &[Step] = &[pedal(1.0, Until::Time, 600.0)];
const STOPS: &[Step] = &[
    hold(20.0, 80.0),
    brake(0.6, 8.0),
    hold(20.0, 100.0),
    brake(1.0, 6.0),
    hold(20.0, 100.0),
    brake(1.6, 5.0),
    hold(20.0, 100.0),
    brake(2.2, 5.0),
];
const HOT: &[Step] = &[
    Step { decel_m_s2: 0.55, ..hold(16.0, 300.0) },
    brake(1.2, 6.0),
    hold(16.0, 40.0),
    brake(1.2, 6.0),
];
const STAGES: &[Step] = &[
    hold(24.0, 60.0),
    engine_brake(0.3, 14.0, 60.0),
    hold(24.0, 60.0),
    engine_brake(0.6, 12.0, 60.0),
    hold(24.0, 60.0),
    engine_brake(1.0, 10.0, 60.0),
];
const PEDAL_STEPS: &[Step] = &[
    hold(15.0, 30.0),
    pedal(0.9, Until::Time, 5.0),
    pedal(0.1, Until::Time, 5.0),
    pedal(0.7, Until::Time, 5.0),
    pedal(0.2, Until::Time, 5.0),
    pedal(1.0, Until::Time, 5.0),
    pedal(0.0, Until::Time, 5.0),
    pedal(0.5, Until::Time, 5.0),
    pedal(0.05, Until::Time, 5.0),
    pedal(0.9, Until::Time, 5.0),
    pedal(0.1, Until::Time, 8.0),
];
const LIGHT: &[Step] = &[
    hold(10.0, 60.0),
    hold(14.0, 60.0),
    pedal(0.08, Until::Time, 40.0),
    hold(18.0, 60.0),
    pedal(0.05, Until::Time, 40.0),
    hold(12.0, 60.0),
];
const CURVES: &[Step] = &[
    hold(8.0, 15.0),
    curve(8.0, 0.012, 15.0),
    hold(8.0, 10.0),
    curve(8.0, -0.012, 15.0),
    hold(15.0, 40.0),
    curve(15.0, 0.005, 15.0),
    hold(15.0, 10.0),
    curve(15.0, -0.005, 15.0),
    hold(23.0, 70.0),
    curve(23.0, 0.0025, 15.0),
    hold(23.0, 10.0),
    curve(23.0, -0.0025, 15.0),
];
const SWINGS: &[Step] = &[
    hold(14.0, 20.0),
    swing(14.0, 0.004, 5.0, 25.0),
    swing(14.0, 0.002, 2.5, 20.0),
    swing(14.0, 0.0004, 4.0, 20.0),
    hold(22.0, 60.0),
    swing(22.0, 0.002, 5.0, 25.0),
    swing(22.0, 0.001, 2.5, 20.0),
    swing(22.0, 0.0003, 4.0, 20.0),
];
const STRAIGHT: &[Step] = &[hold(6.0, 60.0), hold(14.0, 80.0), hold(23.0, 120.0)];
const GEARS: &[Step] = &[
    pedal(0.6, UP, 200.0),
    brake(1.0, 3.0),
    pedal(0.8, UP, 200.0),
    brake(1.0, 3.0),
    pedal(1.0, UP, 200.0),
];
const CRUISE: &[Step] = &[hold(22.0, 1500.0)];

/// All manoeuvres.
pub(super) const MANOEUVRES: &[Manoeuvre] = &[
    Manoeuvre {
        id: "coast_down",
        what: "coast down in gear from 86 to 29 km/h on the flat, in both directions, empty and loaded",
        drives: &[full(COAST), back(full(COAST)), empty(COAST), back(empty(COAST))],
    },
    Manoeuvre {
        id: "constant_speeds",
        what: "hold 40, 61 and 86 km/h for two minutes each on the flat, in both directions, empty and loaded",
        drives: &[full(SPEEDS), back(full(SPEEDS)), empty(SPEEDS), back(empty(SPEEDS))],
    },
    Manoeuvre {
        id: "square",
        what: "hold 40, 61 and 86 km/h on the flat in four directions, a right angle apart, loaded",
        drives: &[
            full(SPEEDS),
            Plan { heading_rad: core::f64::consts::FRAC_PI_2, ..full(SPEEDS) },
            back(full(SPEEDS)),
            Plan { heading_rad: -core::f64::consts::FRAC_PI_2, ..full(SPEEDS) },
        ],
    },
    Manoeuvre {
        id: "accelerate_and_coast",
        what: "accelerate with full pedal from 40 to 68 km/h and coast back on the flat, several times, empty and loaded",
        drives: &[full(BURSTS), empty(BURSTS)],
    },
    Manoeuvre {
        id: "hills",
        what: "hold 72 km/h over hills of 3 % up and down, loaded",
        drives: &[
            Plan {
                grade_frac: 0.03,
                wave_m: 1600.0,
                start_m_s: 18.0,
                ..full(&[hold(20.0, 480.0)])
            },
            Plan {
                grade_frac: 0.03,
                wave_m: 1600.0,
                start_m_s: 18.0,
                ..empty(&[hold(20.0, 480.0)])
            },
        ],
    },
    Manoeuvre {
        id: "full_pedal_low_and_high",
        what: "accelerate with full pedal from 40 to 86 km/h three times, near sea level and above 2000 m, in cool air",
        drives: &[
            Plan { air_degc: 8.0, ..full(RAMPS) },
            Plan { altitude_m: 2300.0, air_degc: 8.0, ..full(RAMPS) },
        ],
    },
    Manoeuvre {
        id: "full_pedal_climb_cool_and_hot",
        what: "climb 4 % with full pedal for ten minutes, loaded, at 8 and at 38 degC",
        drives: &[
            Plan { grade_frac: 0.04, air_degc: 8.0, start_m_s: 12.0, ..full(CLIMB) },
            Plan { grade_frac: 0.04, air_degc: 38.0, start_m_s: 12.0, ..full(CLIMB) },
        ],
    },
    Manoeuvre {
        id: "brake_stops",
        what: "brake from 72 km/h with 0.6, 1.0, 1.6 and 2.2 m/s2, brakes cold, empty and loaded",
        drives: &[full(STOPS), empty(STOPS)],
    },
    Manoeuvre {
        id: "hot_brakes",
        what: "hold 58 km/h down 5 % on the service brake for five minutes, then brake twice, loaded",
        drives: &[Plan { grade_frac: -0.05, start_m_s: 16.0, ..full(HOT) }],
    },
    Manoeuvre {
        id: "engine_brake_stages",
        what: "brake from 86 km/h with the engine brake at 30, 60 and 100 %, loaded",
        drives: &[full(STAGES)],
    },
    Manoeuvre {
        id: "pedal_steps",
        what: "step the pedal between light and full every five seconds at 50 to 70 km/h, loaded",
        drives: &[full(PEDAL_STEPS)],
    },
    Manoeuvre {
        id: "light_load",
        what: "hold 36, 50 and 65 km/h and roll with a light pedal on the flat, empty",
        drives: &[empty(LIGHT)],
    },
    Manoeuvre {
        id: "gears",
        what: "accelerate through all gears with 60, 80 and 100 % pedal, loaded",
        drives: &[Plan { start_m_s: 3.0, ..full(GEARS) }],
    },
    Manoeuvre {
        id: "curves",
        what: "steady curves left and right at 29, 54 and 83 km/h (radius 83, 200 and 400 m), empty and loaded",
        drives: &[full(CURVES), empty(CURVES)],
    },
    Manoeuvre {
        id: "sine_steer",
        what: "sine steering, wide and narrow, slow and quick, at 50 and 79 km/h, empty and loaded",
        drives: &[full(SWINGS), empty(SWINGS)],
    },
    Manoeuvre {
        id: "straight",
        what: "drive straight on level ground at 22, 50 and 83 km/h, in both directions, loaded",
        drives: &[full(STRAIGHT), back(full(STRAIGHT))],
    },
    Manoeuvre {
        id: "cold_start",
        what: "hold 79 km/h on the flat for 25 minutes from cold tyres, loaded",
        drives: &[Plan { warm: false, start_m_s: 18.0, ..full(CRUISE) }],
    },
];
