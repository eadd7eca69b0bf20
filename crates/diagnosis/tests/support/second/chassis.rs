//! Tractor and semitrailer in the plane by generalised forces: every side force adds to the side
//! slip and to both yaw equations by where it acts; tyre forces build up over a relaxation length.

use super::super::sheet::{Figures, G};

use super::faults::Faults;

const TRACTOR_KG: f64 = 9200.0;
const TRACTOR_IZZ: f64 = 45_000.0;
const STEER_AHEAD_M: f64 = 2.35;
/// Drive axles' middle and the kingpin, behind the tractor's CG.
const DRIVE_BEHIND_M: f64 = 1.55;
const HITCH_M: f64 = 1.25;
const EMPTY_KG: f64 = 9800.0;
const EMPTY_IZZ: f64 = 170_000.0;
/// Behind the kingpin: CG of the empty trailer, of the load, middle of the axles.
const EMPTY_CG_M: f64 = 5.0;
const LOAD_CG_M: f64 = 5.764;
const AXLES_M: f64 = 7.9;
const GYRATION2_M2: f64 = 9.9;
/// Tyres' relaxation length, m.
const RELAXATION_M: f64 = 0.35;
/// Half of the distance between the drive axles, and between trailer axles.
const SPREAD_M: [f64; 2] = [0.70, 1.2];

/// Both bodies, moving.
pub(crate) struct Chassis {
    inverse: [[f64; 3]; 3],
    trailer_kg: f64,
    trailer_cg: f64,
    stiffness: [f64; 6],
    relaxation: [f64; 6],
    /// Side slip speed of the tractor's CG, yaw rates of tractor and trailer.
    speeds: [f64; 3],
    /// Trailer's heading behind the tractor's, rad.
    angle: f64,
    tyre_n: [f64; 6],
}

/// Side force and where: behind the tractor's CG, or behind the kingpin on the trailer.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Push {
    Tractor { force_n: f64, behind_m: f64 },
    Trailer { force_n: f64, behind_m: f64 },
}

/// Mass, yaw inertia and CG of the trailer with a load.
fn trailer(load_kg: f64, rearward_m: f64, gyration2: f64) -> (f64, f64, f64) {
    let mass = EMPTY_KG + load_kg;
    let load_at = LOAD_CG_M + rearward_m;
    let cg = (EMPTY_KG * EMPTY_CG_M + load_kg * load_at) / mass;
    let steiner = EMPTY_KG * (cg - EMPTY_CG_M).powi(2) + load_kg * (load_at - cg).powi(2);
    (mass, EMPTY_IZZ + load_kg * gyration2 + steiner, cg)
}

/// Loads of steer, drive and trailer axles together, N.
fn loads(load_kg: f64, rearward_m: f64) -> [f64; 3] {
    let (mass, _, cg) = trailer(load_kg, rearward_m, GYRATION2_M2);
    let behind = mass * cg / AXLES_M;
    let hitch = mass - behind;
    let base = STEER_AHEAD_M + DRIVE_BEHIND_M;
    let drive = (TRACTOR_KG * STEER_AHEAD_M + hitch * (STEER_AHEAD_M + HITCH_M)) / base;
    [TRACTOR_KG + hitch - drive, drive, behind].map(|m| m * G)
}

impl Chassis {
    /// Of a truck that weighs `total_kg` and whose load sheet says `sheet_load_kg`.
    pub(crate) fn new(total_kg: f64, sheet_load_kg: f64, f: &Figures, faults: &Faults) -> Self {
        let load_kg = (total_kg - TRACTOR_KG - EMPTY_KG).max(0.0);
        let mut rearward = f.payload_rearward_m;
        let mut gyration2 = GYRATION2_M2;
        let (mut follow, mut relax) = (false, [1.0; 3]);
        if let Some((x, shape)) = faults.get("payload_position") {
            rearward += x;
            gyration2 *= shape.at(1, 0.8, 1.25);
            follow = shape.choice(0, 2) == 1;
        }
        if let Some((x, shape)) = faults.get("mass") {
            // What is loaded beyond the sheet lies somewhere.
            let beyond = x * total_kg / (1.0 + x) / load_kg.max(8e3);
            rearward += beyond * shape.at(1, -1.5, 1.5);
            follow = shape.choice(0, 2) == 1;
        }
        let sheet = loads(sheet_load_kg, 0.0);
        let on = if follow { loads(load_kg, rearward) } else { sheet };
        let axle = |total: f64, axles: f64, tyres: f64| {
            let load = total / axles;
            7.4 * load * (1.0 - 0.18 * (load / tyres / 30e3 - 1.0))
        };
        let mut group = [axle(on[0], 1.0, 2.0), axle(on[1], 2.0, 4.0), axle(on[2], 3.0, 4.0)];
        let ids = [
            "cornering_stiffness_front",
            "cornering_stiffness_drive",
            "cornering_stiffness_trailer",
        ];
        // Axle groups where the loads of the sheet stand half way between empty and full.
        let half = loads(17_500.0, 0.0);
        for (k, id) in ids.iter().enumerate() {
            group[k] *= f.stiffness[k];
            if let Some((x, shape)) = faults.get(id) {
                // Pressure tells more under load; a soft carcass takes longer to build up force.
                let loaded = 1.0 + shape.at(0, 0.0, 0.35) * (on[k] / half[k] - 1.0);
                group[k] *= 1.0 + x * loaded;
                relax[k] = shape.at(1, 0.8, 1.4);
            }
        }
        let (m, izz, cg) = trailer(load_kg, rearward, gyration2);
        let mass = [
            [TRACTOR_KG + m, -m * HITCH_M, -m * cg],
            [-m * HITCH_M, TRACTOR_IZZ + m * HITCH_M * HITCH_M, m * HITCH_M * cg],
            [-m * cg, m * HITCH_M * cg, izz + m * cg * cg],
        ];
        let of = |g: [f64; 3]| [g[0], g[1], g[1], g[2], g[2], g[2]];
        Self {
            inverse: inverse(mass),
            trailer_kg: m,
            trailer_cg: cg,
            stiffness: of(group),
            relaxation: of(relax.map(|r| r * RELAXATION_M)),
            speeds: [0.0; 3],
            angle: 0.0,
            tyre_n: [0.0; 6],
        }
    }

    /// Yaw rates of tractor and trailer, side slip of the tractor's CG.
    pub(crate) fn yaw(&self) -> [f64; 2] {
        [self.speeds[1], self.speeds[2]]
    }

    pub(crate) fn slip(&self) -> f64 {
        self.speeds[0]
    }

    /// Masses of tractor and trailer, kg, and the trailer's CG behind the kingpin, m.
    pub(crate) fn bodies(&self) -> (f64, f64, f64) {
        (TRACTOR_KG, self.trailer_kg, self.trailer_cg)
    }

    /// Goes on at `v` with road-wheel angle `delta`, a factor per axle group and side forces;
    /// returns the side acceleration of the tractor's CG, m/s².
    pub(crate) fn step(
        &mut self,
        v: f64,
        delta: f64,
        factor: [f64; 3],
        pushes: &[Push],
        dt: f64,
    ) -> f64 {
        let [slip, w, wt] = self.speeds;
        let m = self.trailer_kg;
        let mut right =
            [-(TRACTOR_KG + m) * v * w, HITCH_M * m * v * w, self.trailer_cg * m * v * w];
        let mut add = |force: f64, on: [f64; 3]| {
            for (r, o) in right.iter_mut().zip(on) {
                *r += o * force;
            }
        };
        for k in 0..6 {
            // Where the axle is, as the parts of slip and yaw rates in its side speed.
            let on = match k {
                0 => [1.0, STEER_AHEAD_M, 0.0],
                1 | 2 => [1.0, -(DRIVE_BEHIND_M + SPREAD_M[0] * (2.0 * k as f64 - 3.0)), 0.0],
                _ => [1.0, -HITCH_M, -(AXLES_M + SPREAD_M[1] * (k as f64 - 4.0))],
            };
            let side = on[0] * slip + on[1] * w + on[2] * wt;
            let turned = if k == 0 {
                delta
            } else if k > 2 {
                -self.angle
            } else {
                0.0
            };
            let goal = self.stiffness[k] * factor[[0, 1, 1, 2, 2, 2][k]] * (turned - side / v);
            let build = 1.0 - (-v * dt / self.relaxation[k]).exp();
            self.tyre_n[k] += (goal - self.tyre_n[k]) * build;
            add(self.tyre_n[k], on);
        }
        for p in pushes {
            match *p {
                Push::Tractor { force_n, behind_m } => add(force_n, [1.0, -behind_m, 0.0]),
                Push::Trailer { force_n, behind_m } => add(force_n, [1.0, -HITCH_M, -behind_m]),
            }
        }
        let rate = self.inverse.map(|r| r[0] * right[0] + r[1] * right[1] + r[2] * right[2]);
        for (s, r) in self.speeds.iter_mut().zip(rate) {
            *s += dt * r;
        }
        self.angle += dt * (self.speeds[1] - self.speeds[2]);
        rate[0] + v * w
    }
}

/// Inverse of a symmetric positive matrix by Gauss and Jordan.
fn inverse(mut a: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let mut x = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for i in 0..3 {
        let pivot = a[i][i];
        a[i] = a[i].map(|v| v / pivot);
        x[i] = x[i].map(|v| v / pivot);
        for j in (0..3).filter(|j| *j != i) {
            let by = a[j][i];
            for k in 0..3 {
                a[j][k] -= by * a[i][k];
                x[j][k] -= by * x[i][k];
            }
        }
    }
    x
}
