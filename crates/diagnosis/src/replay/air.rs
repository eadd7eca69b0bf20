//! Wind over the truck: air speed along and across it, and the side force.

use dynamics::effects::resistance::{on_course, side_n};

use super::inputs::{BLOCK, Inputs, cut, lanes, scaled};
use super::prepared::Prepared;
use crate::Plant;
use crate::causes::param::{P, Theta};

/// Wind as the parameters have it, m/s: along and across the truck, and over the map.
pub(super) struct Wind {
    head: f64,
    to_left: f64,
    to: [f64; 2],
}

impl Wind {
    pub(super) fn new(plant: &Plant, t: &Theta) -> Self {
        let file = &plant.truck.resistance;
        Self {
            head: file.headwind_m_s + t[P::Headwind as usize],
            to_left: file.crosswind_to_left_m_s + t[P::Crosswind as usize],
            to: [
                file.wind_to_x_m_s + t[P::WindX as usize],
                file.wind_to_y_m_s + t[P::WindY as usize],
            ],
        }
    }

    /// Nothing blows across.
    pub(super) fn still(&self) -> bool {
        self.to == [0.0, 0.0] && self.to_left == 0.0
    }

    /// Air speed relative to the truck: against the direction of travel, and to the left, m/s.
    #[inline(always)]
    pub(super) fn over<const L: usize>(
        &self,
        d: &Inputs,
        at: usize,
        v: &[f64; L],
    ) -> ([f64; L], [f64; L]) {
        let mut along: [f64; L] = lanes(|j| v[j] + self.head);
        let mut across = [self.to_left; L];
        if self.to != [0.0, 0.0] {
            let (sin, cos) = (cut::<L>(&d.course_sin, at), cut::<L>(&d.course_cos, at));
            for j in 0..L {
                let (behind, left) = on_course((self.to[0], self.to[1]), (sin[j], cos[j]));
                along[j] -= behind;
                across[j] += left;
            }
        }
        (along, across)
    }
}

/// Side force of the wind on the whole truck at the measured speed.
pub(super) struct SideForce<'a> {
    d: &'a Inputs,
    wind: Wind,
    area_m2_rad: f64,
    speed_scale: f64,
}

impl<'a> SideForce<'a> {
    pub(super) fn new(d: &'a Prepared, plant: &Plant, t: &Theta) -> Self {
        Self {
            d: &d.balance,
            wind: Wind::new(plant, t),
            area_m2_rad: plant.truck.resistance.side_force_area_m2_rad,
            speed_scale: 1.0 / (1.0 + t[P::SpeedScale as usize]),
        }
    }

    /// Force at the samples from `at` on, N, positive to the left.
    #[inline(always)]
    pub(super) fn block(&self, at: usize) -> [f64; BLOCK] {
        if self.wind.still() {
            return [0.0; BLOCK];
        }
        let v: [f64; BLOCK] = scaled(cut(&self.d.speed, at), self.speed_scale);
        let (along, across) = self.wind.over(self.d, at, &v);
        let tan: [f64; BLOCK] = lanes(|j| across[j].abs() / along[j].max(1.0));
        let yaw = arctangents(tan);
        let density = cut::<BLOCK>(&self.d.density, at);
        lanes(|j| {
            let squared = along[j] * along[j] + across[j] * across[j];
            side_n(density[j], self.area_m2_rad, yaw[j].copysign(across[j]), squared)
        })
    }
}

/// Arctangents of positive numbers: by their series where all are small, as those of air yaw are
/// in a light wind, else by the series of the half angle; one by one only beyond.
#[inline(always)]
pub(super) fn arctangents<const L: usize>(x: [f64; L]) -> [f64; L] {
    let largest = x.iter().fold(0.0, |a: f64, b| a.max(*b));
    if largest <= 0.1 {
        return lanes(|j| odd_series(x[j], 15));
    }
    let mut out: [f64; L] = lanes(|j| {
        let half = x[j] / (1.0 + (1.0 + x[j] * x[j]).sqrt());
        2.0 * odd_series(half, 27)
    });
    if largest > 0.5 {
        for (out, x) in out.iter_mut().zip(x).filter(|(_, x)| *x > 0.5) {
            *out = x.atan();
        }
    }
    out
}

/// `x - x³/3 + x⁵/5 - ...` up to the power `last`: what follows is below 1e-16 of the sum for 15 up
/// to 0.1 and for 27 up to 0.24.
#[inline(always)]
fn odd_series(x: f64, last: u32) -> f64 {
    let y = x * x;
    let mut sum = 1.0 / f64::from(last);
    for n in (1..last).step_by(2).rev() {
        sum = 1.0 / f64::from(n) - y * sum;
    }
    x * sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arctangents_are_those_of_the_library() {
        let of = |top: f64| -> [f64; 64] { lanes(|j| top * j as f64 / 63.0) };
        for x in [of(0.1), of(0.5), of(40.0)] {
            for (y, x) in arctangents(x).iter().zip(x) {
                assert!((y - x.atan()).abs() <= 4e-16 * x.atan(), "{x}: {y} {}", x.atan());
            }
        }
    }
}
