//! Tractor and semitrailer in the plane: side slip, two yaw rates, articulation, from Newton's and
//! Euler's equations of the two bodies with the hitch force eliminated.

use super::sheet::{Figures, G};

const TRACTOR_KG: f64 = 9200.0;
const TRACTOR_IZZ: f64 = 45_000.0;
const STEER_AHEAD: f64 = 2.35;
const DRIVE: [f64; 2] = [1.55 - 0.70, 1.55 + 0.70];
const HITCH: f64 = 1.25;
const EMPTY_KG: f64 = 9800.0;
const EMPTY_IZZ: f64 = 170_000.0;
const EMPTY_CG: f64 = 5.0;
const TRAILER_AXLES: [f64; 3] = [7.9 - 1.2, 7.9, 7.9 + 1.2];
const PAYLOAD_CG: f64 = 5.764;
const PAYLOAD_GYRATION2: f64 = 9.9;

/// Side slip speed of the tractor's CG, yaw rates of tractor and trailer, their angle.
pub(crate) type State = [f64; 4];

/// Both bodies with one load.
pub(crate) struct Bodies {
    trailer_kg: f64,
    trailer_izz: f64,
    trailer_cg: f64,
    /// Axle stiffness: steer, two drive axles, three trailer axles, N/rad.
    stiffness: [f64; 6],
    inverse: [[f64; 3]; 3],
}

fn trailer(payload_kg: f64, rearward_m: f64) -> (f64, f64, f64) {
    let mass = EMPTY_KG + payload_kg;
    let place = PAYLOAD_CG + rearward_m;
    let cg = (EMPTY_KG * EMPTY_CG + payload_kg * place) / mass;
    let izz = EMPTY_IZZ
        + EMPTY_KG * (cg - EMPTY_CG).powi(2)
        + payload_kg * (PAYLOAD_GYRATION2 + (place - cg).powi(2));
    (mass, izz, cg)
}

fn axle(load_n: f64, tyres: f64) -> f64 {
    7.4 * load_n * (1.0 - 0.18 * (load_n / tyres / 30e3 - 1.0))
}

fn stiffness(payload_kg: f64, rearward_m: f64) -> [f64; 6] {
    let (mass, _, cg) = trailer(payload_kg, rearward_m);
    let on_axles = mass * cg / 7.9;
    let on_hitch = mass - on_axles;
    let base = STEER_AHEAD + 1.55;
    let on_drive = (TRACTOR_KG * STEER_AHEAD + on_hitch * (STEER_AHEAD + HITCH)) / base;
    let on_steer = TRACTOR_KG + on_hitch - on_drive;
    let (s, d, t) =
        (axle(on_steer * G, 2.0), axle(0.5 * on_drive * G, 4.0), axle(on_axles / 3.0 * G, 4.0));
    [s, d, d, t, t, t]
}

impl Bodies {
    /// `sheet_payload_kg` sets the tyres' stiffness unless they follow the true load.
    pub(crate) fn new(total_kg: f64, sheet_payload_kg: f64, f: &Figures) -> Self {
        let payload_kg = (total_kg - TRACTOR_KG - EMPTY_KG).max(0.0);
        let (m, izz, cg) = trailer(payload_kg, f.payload_rearward_m);
        let mut c = if f.tyres_follow {
            stiffness(payload_kg, f.payload_rearward_m)
        } else {
            stiffness(sheet_payload_kg, 0.0)
        };
        for (i, c) in c.iter_mut().enumerate() {
            *c *= f.stiffness[[0, 1, 1, 2, 2, 2][i]];
        }
        // Unknowns: side acceleration, both yaw accelerations.
        let a = [
            [TRACTOR_KG + m, -m * HITCH, -m * cg],
            [-HITCH * m, TRACTOR_IZZ + m * HITCH * HITCH, m * HITCH * cg],
            [-cg * m, cg * m * HITCH, izz + m * cg * cg],
        ];
        Self { trailer_kg: m, trailer_izz: izz, trailer_cg: cg, stiffness: c, inverse: inverse(a) }
    }

    /// Rate of the state at speed `v`, road-wheel angle `delta` and side forces on the two CGs, N; the last one is
    /// what turns the trailer about its CG to the right, Nm.
    pub(crate) fn rate(&self, s: &State, v: f64, delta: f64, side: [f64; 3]) -> State {
        let [slip, w, wt, angle] = *s;
        let c = &self.stiffness;
        let mut force = c[0] * (delta - (slip + STEER_AHEAD * w) / v);
        let mut moment = STEER_AHEAD * force;
        for (c, a) in c[1..3].iter().zip(DRIVE) {
            let f = -c * (slip - a * w) / v;
            force += f;
            moment -= a * f;
        }
        let (mut behind, mut turn) = (0.0, 0.0);
        for (c, l) in c[3..].iter().zip(TRAILER_AXLES) {
            let f = -c * ((slip - HITCH * w - l * wt) / v + angle);
            behind += f;
            turn += l * f;
        }
        behind += side[1];
        turn += self.trailer_cg * side[1] + side[2];
        let m = self.trailer_kg;
        let right = [
            force + side[0] + behind - (TRACTOR_KG + m) * v * w,
            moment - HITCH * behind + HITCH * m * v * w,
            -turn + self.trailer_cg * m * v * w,
        ];
        let x = self.inverse.map(|r| r[0] * right[0] + r[1] * right[1] + r[2] * right[2]);
        [x[0], x[1], x[2], w - wt]
    }

    /// One midpoint step.
    pub(crate) fn step(&self, s: &State, v: f64, delta: f64, side: [f64; 3], dt: f64) -> State {
        let k: State = self.rate(s, v, delta, side);
        let mid: State = core::array::from_fn(|i| s[i] + 0.5 * dt * k[i]);
        let k = self.rate(&mid, v, delta, side);
        core::array::from_fn(|i| s[i] + dt * k[i])
    }

    /// Masses of tractor and trailer, kg.
    pub(crate) fn masses(&self) -> [f64; 2] {
        debug_assert!(self.trailer_izz > 0.0);
        [TRACTOR_KG, self.trailer_kg]
    }
}

fn inverse(a: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let minor = |i: usize, j: usize| {
        let (r, s) = ((i + 1) % 3, (i + 2) % 3);
        let (c, d) = ((j + 1) % 3, (j + 2) % 3);
        a[r][c] * a[s][d] - a[r][d] * a[s][c]
    };
    let det: f64 = (0..3).map(|j| a[0][j] * minor(0, j)).sum();
    core::array::from_fn(|i| core::array::from_fn(|j| minor(j, i) / det))
}
