//! What differs from drive to drive without anything being wrong. Spreads are those of the first
//! family (they are what the world has); the distribution is triangular, and the wind's is that of
//! two directions.

use rand_chacha::ChaCha8Rng;

use super::super::random::between;
use super::super::sheet::Figures;

/// Triangular number of standard deviation one.
fn triangular(rng: &mut ChaCha8Rng) -> f64 {
    6.0_f64.sqrt() * 0.5 * (between(rng, -1.0, 1.0) + between(rng, -1.0, 1.0))
}

/// The truck of one drive; `scale` 1: as usual.
pub(crate) fn draw(scale: f64, rng: &mut ChaCha8Rng) -> Figures {
    let mut n = |sigma: f64| scale * sigma * triangular(rng);
    let mut f = Figures::SHEET;
    f.mass_scale *= 1.0 + n(0.004);
    f.payload_rearward_m = n(0.03);
    f.rolling *= 1.0 + n(0.015);
    f.drag_area *= 1.0 + n(0.012);
    f.wind = [n(0.5), n(0.5)];
    f.headwind = n(0.2);
    f.crosswind = n(0.3);
    f.friction_scale *= 1.0 + n(0.02);
    f.auxiliary_w += n(400.0);
    f.efficiency *= 1.0 + n(0.002);
    f.fuel_scale *= 1.0 + n(0.005);
    f.boost_lag_s *= 1.0 + n(0.02);
    f.pedal_delay_s += n(0.003);
    f.engine_brake_scale *= 1.0 + n(0.015);
    f.brake_scale *= 1.0 + n(0.015);
    f.brake_delay_s += n(0.004);
    f.stiffness = [1.0 + n(0.01), 1.0 + n(0.01), 1.0 + n(0.01)];
    f.steer_ratio *= 1.0 + n(0.003);
    f.steer_offset_rad = n(0.004);
    f.bank_rad = n(2.5e-4);
    f.grade_bias = n(1e-4);
    f.map_shift_m = n(2.5);
    f.speed_scale *= 1.0 + n(0.001);
    f.yaw_bias = n(2.5e-4);
    f.trailer_yaw_bias = n(2.5e-4);
    f.accel_bias = [n(0.02), n(0.02)];
    f
}
