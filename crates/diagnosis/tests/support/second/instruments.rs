//! What the map and the sensors say: errors that drift, and a map whose grade is never quite right.

use rand_chacha::ChaCha8Rng;

use super::super::effects::Shape;
use super::super::sheet::Figures;

use super::colour::Colour;
use super::faults::Faults;
use super::road::Route;

/// Length over which the map's grade errs, m, and by how much.
const MAP_M: f64 = 110.0;
const MAP_GRADE: f64 = 0.0004;
/// How far the matched position wanders, m, and over which time, s.
const MATCH_M: f64 = 1.2;
const MATCH_S: f64 = 6.0;

/// Instruments of one drive.
pub(crate) struct Instruments {
    map: Colour,
    matched: Colour,
    lazy: f64,
    terrain: Colour,
    slow: Colour,
    grade: Option<(f64, Shape)>,
    shift: Option<(f64, Shape)>,
    speed: Option<(f64, Shape)>,
    yaw: Option<(f64, Shape)>,
    bank: Option<(f64, Shape)>,
}

impl Instruments {
    pub(crate) fn new(faults: &Faults, rng: &mut ChaCha8Rng) -> Self {
        Self {
            map: Colour::new(MAP_M, rng),
            matched: Colour::new(MATCH_S, rng),
            lazy: 0.0,
            terrain: Colour::new(2500.0, rng),
            slow: Colour::new(250.0, rng),
            grade: faults.get("grade_bias"),
            shift: faults.get("map_shift"),
            speed: faults.get("speed_scale"),
            yaw: faults.get("yaw_rate_bias"),
            bank: faults.get("road_bank"),
        }
    }

    /// Goes on by `way` m in `dt` s.
    pub(crate) fn go(&mut self, way: f64, rng: &mut ChaCha8Rng, dt: f64) {
        self.map.step(way, rng);
        self.terrain.step(way, rng);
        self.slow.step(dt, rng);
        let goal = MATCH_M * self.matched.step(dt, rng);
        super::colour::towards(&mut self.lazy, goal, dt, 2.0);
    }

    /// Where the truck seems to be, and the map's grade and curvature there.
    pub(crate) fn seen(&self, f: &Figures, route: &Route, place_m: f64) -> [f64; 3] {
        let seen = place_m + self.lazy;
        let mut off = f.map_shift_m;
        if let Some((x, shape)) = self.shift {
            off += x * (1.0 + shape.at(0, 0.0, 0.12) * self.terrain.now());
        }
        let mut grade = f.grade_bias + MAP_GRADE * self.map.now();
        if let Some((x, shape)) = self.grade {
            grade += x * (1.0 + shape.at(0, 0.0, 0.25) * self.terrain.now());
        }
        [seen, route.grade(seen + off) + grade, route.curvature(seen + off)]
    }

    /// Wheel speed as the tachograph has it.
    pub(crate) fn speed(&self, f: &Figures, v: f64) -> f64 {
        let hidden = self
            .speed
            .map_or(0.0, |(x, shape)| x * (1.0 + shape.at(0, -0.1, 0.1) * (v / 18.0 - 1.0)));
        v * (f.speed_scale + hidden)
    }

    /// Bias of the tractor's yaw rate, rad/s.
    pub(crate) fn yaw_bias(&self, f: &Figures) -> f64 {
        let hidden =
            self.yaw.map_or(0.0, |(x, shape)| x * (1.0 + shape.at(0, 0.0, 0.15) * self.slow.now()));
        f.yaw_bias + hidden
    }

    /// Bank of the road, rad.
    pub(crate) fn bank(&self, f: &Figures) -> f64 {
        let hidden =
            self.bank.map_or(0.0, |(x, shape)| x * (1.0 + shape.at(0, 0.0, 0.25) * self.map.now()));
        f.bank_rad + hidden
    }
}
