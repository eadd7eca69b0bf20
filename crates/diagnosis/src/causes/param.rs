//! The parameters that the replay knows: sizes of effects, their shapes, and tolerances of
//! instruments. One vector serves as fitted causes (common to all drives), as tolerances (random,
//! per drive) and as calibration (common, small, learned from drives that are in order).

use super::hypothesis::CATALOGUE;

/// Values of all parameters; zero is the truck file.
pub(crate) type Theta = [f64; PARAMS];

/// Index of a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(usize)]
pub(crate) enum P {
    Rolling,
    Drag,
    Headwind,
    WindX,
    WindY,
    Mass,
    GradeBias,
    MapShift,
    WarmupAmp,
    WarmupTau,
    DrivelineLoss,
    FanPower,
    FanStart,
    DragBrake,
    Friction,
    Altitude,
    AltitudeStart,
    HeatAir,
    HeatAirStart,
    HeatCoolant,
    HeatCoolantStart,
    TurboLag,
    PedalDelay,
    ShiftTime,
    FuelLow,
    FuelLowLoad,
    FuelLowOver,
    BrakeGain,
    Fade,
    FadeStart,
    BrakeDelay,
    RetarderStage,
    RetarderBrake,
    RetarderCoast,
    RetarderFrom,
    SpeedScale,
    YawBias,
    SteerRatio,
    SteerOffset,
    FreePlay,
    SteerLag,
    CFront,
    CDrive,
    CTrailer,
    PayloadX,
    Bank,
    Crosswind,
    GpsLag,
    ImuBias,
    AltitudeOffset,
    HeadingOffset,
    AccelYBias,
    TrailerYawBias,
    FuelScale,
    TorqueScale,
    EngineBrakeScale,
    SpeedLag,
    FuelLag,
    TorqueReport,
    PressureLag,
    FanWidth,
    StiffnessFollows,
    StiffnessFollowsMass,
    TurboStart,
    SteerDelay,
    BrakeLoad,
    WindShare,
    CrosswindShare,
    FuelFlow,
    FuelFlowPower,
    Co2Scale,
    Co2Power,
    LiningLag,
    PayloadSpread,
    HeatCoolantLag,
    RetarderSaturation,
    PlayCentring,
    RetarderSlope,
    RetarderSteep,
    WindBehind,
    CrosswindBehind,
    SideShare,
    SideBehind,
    MeshLoss,
    PedalLag,
    TurboWidth,
    FanBand,
    StageLag,
    CurveBank,
    AccelYAhead,
}

/// Number of parameters.
pub(crate) const PARAMS: usize = 90;

/// What is known of a parameter before any drive.
pub(crate) struct Spec {
    pub(crate) p: P,
    /// Key in `diagnosis.json`, with the unit where it has one.
    pub(crate) key: &'static str,
    pub(crate) unit: &'static str,
    /// Standard deviation of its size as a cause.
    pub(crate) prior: f64,
    /// Bounds.
    pub(crate) lo: f64,
    pub(crate) hi: f64,
    /// Step of the secant.
    pub(crate) step: f64,
    /// Standard deviation of its scatter between drives of one truck; 0: none.
    pub(crate) tolerance: f64,
    /// Standard deviation of its common calibration; 0: none.
    pub(crate) calibration: f64,
}

impl Spec {
    /// It multiplies the truck file's figure: reported as a factor, one without a cause.
    pub(crate) fn is_factor(&self) -> bool {
        self.key.ends_with("_scale") || self.key == "scale"
    }
}

const fn s(
    p: P,
    key: &'static str,
    unit: &'static str,
    (prior, lo, hi, step): (f64, f64, f64, f64),
    tolerance: f64,
    calibration: f64,
) -> Spec {
    Spec { p, key, unit, prior, lo, hi, step, tolerance, calibration }
}

/// All parameters, in the order of [`P`]. Priors and tolerances are engineering ranges for highway
/// trucks: load sheets within 1 %, weather wind along the road 1 m/s, tyres and drag area 2 %.
pub(crate) const SPECS: [Spec; PARAMS] = [
    s(P::Rolling, "coefficient_scale", "1", (0.2, -0.6, 1.5, 0.05), 0.015, 0.0),
    s(P::Drag, "cd_a_scale", "1", (0.15, -0.6, 1.0, 0.05), 0.015, 0.0),
    s(P::Headwind, "headwind_m_s", "m/s", (3.0, -15.0, 15.0, 0.5), 0.3, 0.0),
    s(P::WindX, "wind_to_x_m_s", "m/s", (4.0, -20.0, 20.0, 0.5), 0.5, 0.0),
    s(P::WindY, "wind_to_y_m_s", "m/s", (4.0, -20.0, 20.0, 0.5), 0.5, 0.0),
    s(P::Mass, "mass_scale", "1", (0.08, -0.4, 0.6, 0.01), 0.005, 0.0),
    s(P::GradeBias, "grade_frac", "1", (0.002, -0.02, 0.02, 0.0005), 1.5e-4, 0.0),
    s(P::MapShift, "shift_m", "m", (40.0, -300.0, 300.0, 10.0), 4.0, 0.0),
    s(P::WarmupAmp, "cold_extra_frac", "1", (0.3, -0.1, 1.5, 0.1), 0.0, 0.0),
    s(P::WarmupTau, "ln_time_constant", "1", (0.5, -1.2, 1.2, 0.2), 0.0, 0.0),
    s(P::DrivelineLoss, "extra_loss_frac", "1", (0.03, -0.05, 0.3, 0.01), 0.003, 0.0),
    s(P::FanPower, "fan_power_kw", "kW", (20.0, -5.0, 90.0, 5.0), 0.0, 0.0),
    s(P::FanStart, "coolant_start_offset_k", "K", (5.0, -14.0, 14.0, 1.5), 0.0, 0.0),
    s(P::DragBrake, "force_n", "N", (600.0, -200.0, 6000.0, 100.0), 30.0, 0.0),
    s(P::Friction, "friction_scale", "1", (0.25, -0.7, 1.5, 0.1), 0.015, 0.0),
    s(P::Altitude, "torque_loss_per_km", "1/km", (0.08, -0.02, 0.5, 0.03), 0.0, 0.0),
    s(P::AltitudeStart, "start_offset_m", "m", (600.0, -1500.0, 1200.0, 100.0), 0.0, 0.0),
    s(P::HeatAir, "torque_loss_per_10_k_air", "1/(10 K)", (0.06, -0.02, 0.5, 0.02), 0.0, 0.0),
    s(P::HeatAirStart, "air_start_offset_k", "K", (6.0, -20.0, 12.0, 1.0), 0.0, 0.0),
    s(
        P::HeatCoolant,
        "torque_loss_per_10_k_coolant",
        "1/(10 K)",
        (0.1, -0.02, 0.6, 0.03),
        0.0,
        0.0,
    ),
    s(P::HeatCoolantStart, "coolant_start_offset_k", "K", (5.0, -14.0, 14.0, 1.0), 0.0, 0.0),
    s(P::TurboLag, "lag_s", "s", (0.4, -0.4, 4.0, 0.05), 0.01, 0.0),
    s(P::PedalDelay, "delay_s", "s", (0.2, -0.1, 1.5, 0.05), 0.004, 0.03),
    s(P::ShiftTime, "extra_time_s", "s", (0.4, -0.8, 3.0, 0.1), 0.01, 0.05),
    s(P::FuelLow, "extra_frac", "1", (0.2, -0.6, 2.0, 0.05), 0.0, 0.0),
    s(P::FuelLowLoad, "ln_load", "1", (0.35, -1.0, 1.0, 0.2), 0.0, 0.0),
    s(P::FuelLowOver, "over", "1", (1.0, 0.0, 2.0, 1.0), 0.0, 0.0),
    s(P::BrakeGain, "gain_scale", "1", (0.2, -0.8, 1.5, 0.05), 0.015, 0.0),
    s(P::Fade, "loss_per_100_k", "1", (0.3, -0.1, 2.0, 0.05), 0.0, 0.0),
    s(P::FadeStart, "start_offset_k", "K", (50.0, -100.0, 200.0, 10.0), 0.0, 0.0),
    s(P::BrakeDelay, "delay_s", "s", (0.2, -0.2, 2.0, 0.05), 0.005, 0.06),
    s(P::RetarderStage, "torque_per_stage_nm", "Nm", (800.0, -300.0, 5000.0, 100.0), 0.0, 0.0),
    s(P::RetarderBrake, "force_n_per_m_s2", "N s2/m", (4000.0, -2e3, 4e4, 400.0), 0.0, 0.0),
    s(P::RetarderCoast, "torque_nm", "Nm", (800.0, -300.0, 5000.0, 100.0), 0.0, 0.0),
    s(P::RetarderFrom, "start_offset_m_s", "m/s", (3.0, -7.0, 7.0, 0.25), 0.0, 0.0),
    s(P::SpeedScale, "scale", "1", (0.02, -0.2, 0.2, 0.005), 0.001, 0.0),
    s(P::YawBias, "bias_rad_s", "rad/s", (0.004, -0.05, 0.05, 0.001), 3e-4, 0.0),
    s(P::SteerRatio, "ratio_scale", "1", (0.08, -0.4, 0.6, 0.02), 0.004, 0.0),
    s(P::SteerOffset, "offset_rad", "rad", (0.05, -0.6, 0.6, 0.01), 0.005, 0.0),
    s(P::FreePlay, "free_play_rad", "rad", (0.06, 0.0, 0.6, 0.02), 0.0, 0.0),
    s(P::SteerLag, "lag_s", "s", (0.12, -0.08, 1.0, 0.03), 0.004, 0.06),
    s(P::CFront, "stiffness_scale", "1", (0.2, -0.7, 1.0, 0.05), 0.01, 0.0),
    s(P::CDrive, "stiffness_scale", "1", (0.2, -0.6, 1.0, 0.05), 0.01, 0.0),
    s(P::CTrailer, "stiffness_scale", "1", (0.2, -0.8, 1.5, 0.05), 0.01, 0.0),
    s(P::PayloadX, "shift_rearward_m", "m", (0.6, -3.0, 2.0, 0.1), 0.03, 0.0),
    s(P::Bank, "bank_rad", "rad", (0.015, -0.12, 0.12, 0.003), 3e-4, 0.0),
    s(P::Crosswind, "wind_to_left_m_s", "m/s", (4.0, -20.0, 20.0, 1.0), 0.2, 0.0),
    s(P::GpsLag, "lag_s", "s", (0.2, -5.0, 5.0, 0.05), 0.02, 0.2),
    s(P::ImuBias, "bias_m_s2", "m/s2", (0.1, -2.0, 2.0, 0.02), 0.02, 0.0),
    s(P::AltitudeOffset, "offset_m", "m", (10.0, -100.0, 100.0, 1.0), 10.0, 0.0),
    s(P::HeadingOffset, "offset_rad", "rad", (0.1, -1.0, 1.0, 0.01), 0.05, 0.0),
    s(P::AccelYBias, "bias_m_s2", "m/s2", (0.1, -2.0, 2.0, 0.02), 0.02, 0.0),
    s(P::TrailerYawBias, "bias_rad_s", "rad/s", (0.004, -0.05, 0.05, 0.001), 3e-4, 0.0),
    s(P::FuelScale, "scale", "1", (0.05, -0.4, 0.6, 0.01), 0.005, 0.01),
    s(P::TorqueScale, "scale", "1", (0.05, -0.4, 0.4, 0.01), 0.003, 0.0),
    s(P::EngineBrakeScale, "torque_scale", "1", (0.2, -0.9, 1.0, 0.05), 0.015, 0.0),
    s(P::SpeedLag, "lag_s", "s", (0.1, -1.0, 1.0, 0.02), 0.004, 0.05),
    s(P::FuelLag, "lag_s", "s", (0.1, -0.3, 2.0, 0.02), 0.004, 0.05),
    s(P::TorqueReport, "scale", "1", (0.05, -0.3, 0.3, 0.01), 0.002, 0.0),
    s(P::PressureLag, "lag_s", "s", (0.1, -0.5, 0.5, 0.02), 0.004, 0.05),
    s(P::FanWidth, "hysteresis_k", "K", (3.0, 0.0, 12.0, 0.5), 0.0, 0.0),
    s(P::StiffnessFollows, "stiffness_follows_load", "1", (1.0, 0.0, 1.0, 0.1), 0.0, 0.0),
    s(P::StiffnessFollowsMass, "stiffness_follows_load", "1", (1.0, 0.0, 1.0, 0.1), 0.0, 0.0),
    s(P::TurboStart, "threshold_offset_frac", "1", (0.1, -0.3, 0.4, 0.02), 0.0, 0.0),
    s(P::SteerDelay, "pure_delay_frac", "1", (0.5, 0.0, 1.0, 0.1), 0.0, 0.0),
    s(P::BrakeLoad, "load_estimate_scale", "1", (0.15, -0.6, 1.5, 0.02), 0.15, 0.0),
    // Where the side force acts: share and point are its two moments.
    s(P::WindShare, "tractor_share_offset_frac", "1", (0.12, -0.25, 0.5, 0.05), 0.0, 0.0),
    s(P::CrosswindShare, "tractor_share_offset_frac", "1", (0.12, -0.25, 0.5, 0.05), 0.0, 0.0),
    // At the engine's highest rate; laboratories are right within a per cent or two.
    s(P::FuelFlow, "scale", "1", (0.1, -0.5, 1.0, 0.02), 0.0, 0.0),
    s(P::FuelFlowPower, "rate_exponent", "1", (0.7, -1.0, 3.0, 0.1), 0.0, 0.0),
    s(P::Co2Scale, "scale", "1", (0.1, -0.5, 1.0, 0.02), 0.01, 0.0),
    s(P::Co2Power, "rate_exponent", "1", (0.7, -1.0, 3.0, 0.1), 0.0, 0.0),
    s(P::LiningLag, "lining_lag_s", "s", (20.0, 0.0, 120.0, 3.0), 0.0, 0.0),
    // Loads of 8 to 13.6 m, evenly spread: length²/12 is 0.5 to 1.6 of the usual 9.9 m².
    s(P::PayloadSpread, "gyration_squared_scale", "1", (0.25, -0.6, 0.8, 0.05), 0.0, 0.0),
    // Engine controllers take torque away over seconds to a minute.
    s(P::HeatCoolantLag, "derating_lag_s", "s", (20.0, 0.0, 120.0, 3.0), 0.0, 0.0),
    // 1 / (1 + x) of what it has without a limit at a demand of 1 m/s²: retarders blend in before the
    // service brakes.
    s(P::RetarderSaturation, "saturation_s2_m", "s2/m", (1.0, 0.0, 10.0, 0.2), 0.0, 0.0),
    // The wheels' self-alignment against the friction of the gear: not at all, or within seconds.
    s(P::PlayCentring, "centring_1_s", "1/s", (0.3, 0.0, 3.0, 0.05), 0.0, 0.0),
    s(P::RetarderSlope, "torque_downhill_nm", "Nm", (800.0, -300.0, 5000.0, 100.0), 0.0, 0.0),
    s(P::RetarderSteep, "descent_from_frac", "1", (0.01, 0.0, 0.03, 0.001), 0.0, 0.0),
    // Edges that suck, gap and rounding move it by a metre or so along the box.
    s(P::WindBehind, "trailer_behind_cg_m", "m", (1.0, -4.0, 4.0, 0.2), 0.0, 0.0),
    s(P::CrosswindBehind, "trailer_behind_cg_m", "m", (1.0, -4.0, 4.0, 0.2), 0.0, 0.0),
    // The same of the truck in order, whose baseline shows it by the winds of its days.
    s(P::SideShare, "tractor_share_offset_frac", "1", (0.12, -0.25, 0.5, 0.05), 0.0, 0.0),
    s(P::SideBehind, "trailer_behind_cg_m", "m", (1.0, -4.0, 4.0, 0.2), 0.0, 0.0),
    // Two pairs of teeth carry the power in all gears but the direct one; a pair loses about 1 %.
    s(P::MeshLoss, "mesh_loss_frac", "1", (0.015, -0.05, 0.2, 0.005), 0.0, 0.0),
    // The engine's control unit smooths the pedal, or it only comes late.
    s(P::PedalLag, "lag_frac", "1", (0.5, 0.0, 1.0, 0.1), 0.0, 0.0),
    // A turbocharger has its speed at once, or over a good part of the load.
    s(P::TurboWidth, "threshold_width_frac", "1", (0.15, 0.0, 0.6, 0.03), 0.0, 0.0),
    // A viscous clutch comes over some kelvin, one of plates at once.
    s(P::FanBand, "band_k", "K", (3.0, 0.0, 12.0, 0.5), 0.0, 0.0),
    // A demand (TSC1) comes some tenths of a second before the engine brake does, what is reported as
    // it acts (ERC1) does not.
    s(P::StageLag, "lag_s", "s", (0.1, -0.5, 1.0, 0.02), 0.004, 0.1),
    // Curves are banked to the inside, and maps do not say so: by a third of the lateral acceleration at
    // 80 km/h, 17 m, or 6 % at a radius of 600 m, 36 m.
    s(P::CurveBank, "bank_rad_m", "rad m", (10.0, -20.0, 60.0, 1.0), 0.3, 15.0),
    // Where the frame carries the accelerometer.
    s(P::AccelYAhead, "ahead_of_cg_m", "m", (1.0, -6.0, 6.0, 0.2), 0.02, 2.0),
];

impl Spec {
    /// Scatter between drives before a baseline says more. Causes without a tolerance of their own
    /// get a small one (but not a free play, which cannot be negative, nor a fuel meter, whose scatter
    /// is that of the fuel's level): no truck is exactly its file, and a model of another form than the
    /// truth leaves a remainder that differs from drive to drive. Shapes have none.
    pub(crate) fn scatter(&self) -> f64 {
        let has_none = self.is_shape() || matches!(self.p, P::FreePlay | P::FuelFlow);
        if self.tolerance > 0.0 || has_none { self.tolerance } else { 0.02 * self.prior }
    }

    /// A form of a cause, not a size; so is where the side force acts on a truck in order.
    fn is_shape(&self) -> bool {
        let of_cause = CATALOGUE.iter().any(|h| h.shapes.contains(&self.p));
        of_cause || matches!(self.p, P::SideShare | P::SideBehind)
    }
}

impl P {
    /// What it is off by from the truck file, at `theta` with the reference at `zero`: causes count
    /// from the baseline, and where winds act from what the baseline has shown of that.
    pub(crate) fn of_truck(self, theta: &Theta, zero: &Theta) -> f64 {
        let own = match self {
            Self::WindShare | Self::CrosswindShare => zero[Self::SideShare as usize],
            Self::WindBehind | Self::CrosswindBehind => zero[Self::SideBehind as usize],
            _ => 0.0,
        };
        theta[self as usize] - zero[self as usize] + own
    }

    pub(crate) fn spec(self) -> &'static Spec {
        &SPECS[self as usize]
    }

    /// A fit moves it no farther than to the nearest of many dips: it is fitted from all of its
    /// starts.
    pub(crate) fn is_stuck(self) -> bool {
        matches!(self, Self::RetarderFrom | Self::RetarderSteep | Self::FanStart | Self::FadeStart)
    }

    /// Air, loads, tyres, steering: enters as a product, without a kink, so that a step to its second order
    /// is better than none.
    pub(crate) fn is_smooth(self) -> bool {
        matches!(
            self,
            Self::Headwind
                | Self::WindX
                | Self::WindY
                | Self::Crosswind
                | Self::Drag
                | Self::Rolling
                | Self::Mass
                | Self::PayloadX
                | Self::Bank
                | Self::CFront
                | Self::CDrive
                | Self::CTrailer
                | Self::SteerRatio
                | Self::SteerOffset
        )
    }

    /// A shape that is one of a few in truth.
    pub(crate) fn is_switch(self) -> bool {
        matches!(self, P::StiffnessFollows | P::StiffnessFollowsMass | P::FuelLowOver)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_parameter_stands_at_its_own_index() {
        for (i, spec) in SPECS.iter().enumerate() {
            assert_eq!(spec.p as usize, i, "{}", spec.key);
            assert!(spec.lo <= 0.0, "{}", spec.key);
            assert!(spec.step > 0.0 && spec.hi > spec.step);
            // What tolerances do beyond their columns is asked of those that have one.
            assert!(!spec.p.is_smooth() || spec.scatter() > 0.0, "{}", spec.key);
        }
    }
}
