//! The pose from wheel speed, yaw rate and satellites: as exact as it says, never jumping, and an
//! error where the truck is lost.

use std::sync::Arc;

use dynamics::{TruckModel, TruckParameters};
use planner::localise::{
    LocaliseError, Localiser, LocaliserConfig, MapProjection, Nmea, NmeaError,
};
use planner::{Stack, StackConfig};
use proj4rs::{Proj, transform::transform};
use proptest::prelude::*;
use road::{GeoReference, Road, builtin};
use tractrix_core::{
    EgoState, Fix, GuardReason, Motion, Pose, PoseSource, Scene, Stamped, Time, TrailerState,
    VehicleLimits, VehicleStatus,
};

const UTM: &str = "+proj=utm +zone=32 +ellps=WGS84 +units=m +no_defs";
const TMERC: &str = "+proj=tmerc +lat_0=48.1 +lon_0=11.5 +k=1 +x_0=1000 +y_0=-2000 +datum=WGS84";
const GEODETIC: &str = "+proj=longlat +datum=WGS84 +no_defs";

fn geo(projection: &str) -> GeoReference {
    let offset_m = [689_000.0, 5_330_000.0, 0.0];
    GeoReference { projection: projection.into(), offset_m, offset_heading_rad: 0.4 }
}

fn highway() -> Arc<Road> {
    Arc::new(builtin::highway().with_geo_reference(&geo(UTM)))
}

fn limits() -> VehicleLimits {
    let truck = TruckParameters::load("longhaul").unwrap();
    TruckModel::new(truck, 20_000.0).unwrap().vehicle_limits().unwrap()
}

/// Latitude and longitude of a map point, by an independent library.
fn on_earth(reference: &GeoReference, x_m: f64, y_m: f64) -> [f64; 2] {
    let [x, y, z] = reference.projected_m(x_m, y_m, 0.0);
    let mut point = (x, y, z);
    let proj = |text: &str| Proj::from_proj_string(text).unwrap();
    transform(&proj(&reference.projection), &proj(GEODETIC), &mut point).unwrap();
    [point.1.to_degrees(), point.0.to_degrees()]
}

/// A normal draw of a deterministic sequence.
fn normal(i: u64) -> f64 {
    let uniform = |n: u64| {
        let mixed = n.wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let mixed = (mixed ^ mixed >> 29).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        ((mixed ^ mixed >> 32) >> 11) as f64 / (1_u64 << 53) as f64
    };
    (0..12).map(|k| uniform(12 * i + k + 1)).sum::<f64>() - 6.0
}

/// What drives along the highway's right lane, and what its sensors say.
struct Drive {
    localiser: Localiser,
    road: Arc<Road>,
    reference: GeoReference,
    tick: u64,
    s_m: f64,
}

/// Errors of the sensors.
#[derive(Clone, Copy)]
struct Errors {
    speed_frac: f64,
    bias_rad_s: f64,
    fix_m: f64,
    /// What all fixes are off by, map x and y.
    shift_m: [f64; 2],
    fixes: bool,
}

const EXACT: Errors =
    Errors { speed_frac: 0.0, bias_rad_s: 0.0, fix_m: 0.0, shift_m: [0.0; 2], fixes: true };
const SPEED_M_S: f64 = 22.0;
const D_M: f64 = -1.875;
/// A fix is so many ticks old when it comes.
const LATE: u64 = 10;

impl Drive {
    fn new(config: LocaliserConfig) -> Self {
        let road = highway();
        let localiser = Localiser::new(config, &limits(), Arc::clone(&road)).unwrap();
        Self { localiser, road, reference: geo(UTM), tick: 0, s_m: 300.0 }
    }

    fn now(&self) -> Time {
        Time(self.tick as i64 * 10_000_000)
    }

    /// Truth at a tick: s, x, y, heading, yaw rate.
    fn truth(&self, tick: u64) -> [f64; 5] {
        // The lane is longer or shorter than the reference line in bends
        let s_m = self.s_m - SPEED_M_S * 0.01 * (self.tick - tick) as f64;
        let at = self.road.at(s_m, D_M);
        [s_m, at.x_m, at.y_m, at.heading_rad, SPEED_M_S * at.curvature_1_m]
    }

    /// One tick; the pose and the truth.
    fn step(&mut self, errors: Errors) -> (Result<Stamped<Pose>, LocaliseError>, [f64; 5]) {
        self.tick += 1;
        self.s_m += SPEED_M_S * 0.01;
        let now = self.now();
        let truth = self.truth(self.tick);
        let along = 1.0 - D_M * truth[4] / SPEED_M_S;
        let motion = Motion {
            speed_m_s: SPEED_M_S * along * (1.0 + errors.speed_frac),
            yaw_rate_rad_s: truth[4] + errors.bias_rad_s + 1e-3 * normal(self.tick),
        };
        self.localiser.moved(&Stamped { time: now, value: motion });
        if errors.fixes && self.tick.is_multiple_of(10) && self.tick > LATE {
            let [_, x, y, ..] = self.truth(self.tick - LATE);
            let noise = |k| errors.fix_m * normal(2 * self.tick + k + 1_000_000);
            let [x, y] = [x + errors.shift_m[0] + noise(0), y + errors.shift_m[1] + noise(1)];
            let [latitude_deg, longitude_deg] = on_earth(&self.reference, x, y);
            let value = Fix { latitude_deg, longitude_deg, course_rad: None };
            let time = now.plus_nanos(-(LATE as i64) * 10_000_000);
            self.localiser.fixed(&Stamped { time, value });
        }
        (self.localiser.pose(now), truth)
    }
}

#[test]
fn the_projection_agrees_with_an_independent_one() {
    for text in [UTM, TMERC, "+proj=utm +zone=33 +south +datum=WGS84"] {
        let reference = GeoReference { offset_m: [10.0, 20.0, 0.0], ..geo(text) };
        let ours = MapProjection::new(&reference).unwrap();
        for i in 0..400_u32 {
            let (x, y) = (500.0 * f64::from(i % 20), 700.0 * f64::from(i / 20));
            let [latitude, longitude] = on_earth(&reference, x, y);
            let [x_again, y_again] = ours.to_map_m(latitude, longitude);
            let off = (x_again - x).hypot(y_again - y);
            assert!(off < 1e-3, "{text}: {off} m at {x}, {y}");
            // The southern map lies at the pole, where longitudes mean little and nothing drives
            if text.contains("+south") {
                continue;
            }
            let [latitude_again, longitude_again] = ours.on_earth_deg(x, y).unwrap();
            let [x_again, y_again] = ours.to_map_m(latitude_again, longitude_again);
            let off = (x_again - x).hypot(y_again - y);
            assert!(off < 1e-4, "{text}: {off} m at {x}, {y}");
            assert!((latitude_again - latitude).abs() < 2e-8, "{text} at {x}, {y}");
            assert!((longitude_again - longitude).abs() < 2e-8, "{text} at {x}, {y}");
        }
    }
    let ours = MapProjection::new(&geo(UTM)).unwrap();
    assert_eq!([ours.on_earth_deg(f64::NAN, 0.0), ours.on_earth_deg(1e12, -1e12)], [None; 2]);
    for bad in ["", "+proj=lcc", "+proj=utm +zone=99", "+proj=tmerc +lat_0=x", "+proj=tmerc +a=7"] {
        let refused = MapProjection::new(&geo(bad)).unwrap_err();
        assert!(matches!(refused, LocaliseError::Projection(_)), "{bad}");
    }
}

#[test]
fn the_error_is_what_the_deviation_says_and_the_lane_is_kept() {
    let errors = Errors { speed_frac: 0.002, bias_rad_s: 0.001, fix_m: 0.05, ..EXACT };
    let mut drive = Drive::new(LocaliserConfig::default());
    let (mut squares, mut worst, mut within, mut count) = (0.0, 0.0_f64, 0, 0);
    for _ in 0..12_000 {
        let (pose, truth) = drive.step(errors);
        if drive.tick < 1_000 {
            continue;
        }
        let pose = pose.unwrap().value;
        let error = (pose.x_m - truth[1]).hypot(pose.y_m - truth[2]);
        let [sd_m, _] = drive.localiser.deviation();
        within += usize::from(error < 3.0 * sd_m + 0.05);
        count += 1;
        squares += error * error;
        worst = worst.max((pose.d_m - D_M).abs());
    }
    let rms = (squares / f64::from(count as u32)).sqrt();
    assert!(rms < 0.08, "{rms} m");
    assert!(worst < 0.2, "{worst} m across");
    assert!(within * 100 > count * 95, "{within} of {count}");
}

/// Fixes that suddenly lie 1.5 m to the side (another base station) move the truck slowly, and no
/// guard takes offence; the pose gets there all the same.
#[test]
fn a_correction_is_spread_and_trips_no_guard() {
    let config = LocaliserConfig { gate_sd: 100.0, ..LocaliserConfig::default() };
    let mut drive = Drive::new(config);
    let limits = limits();
    let mut stack = Stack::new(StackConfig::default(), &limits).unwrap();
    let shift_m = [1.2, -0.9];
    let mut last: Option<(Pose, [f64; 5])> = None;
    let (mut fastest, mut at_end) = (0.0_f64, f64::NAN);
    for i in 0..3_000 {
        let errors = Errors { shift_m: if i < 1_000 { [0.0; 2] } else { shift_m }, ..EXACT };
        let (pose, truth) = drive.step(errors);
        let Ok(pose) = pose else { continue };
        let p = pose.value;
        if let Some((before, truth_before)) = last {
            let moved = [p.x_m - before.x_m, p.y_m - before.y_m];
            let meant = [truth[1] - truth_before[1], truth[2] - truth_before[2]];
            let extra = (moved[0] - meant[0]).hypot(moved[1] - meant[1]);
            if i > 900 {
                fastest = fastest.max(extra);
            }
        }
        last = Some((p, truth));
        at_end = (p.x_m - truth[1] - shift_m[0]).hypot(p.y_m - truth[2] - shift_m[1]);
        let ego = EgoState {
            x_m: p.x_m,
            y_m: p.y_m,
            yaw_rad: p.yaw_rad,
            s_m: p.s_m,
            d_m: p.d_m,
            speed_m_s: SPEED_M_S,
            yaw_rate_rad_s: truth[4],
            trailer: TrailerState {
                articulation_rad: p.articulation_rad,
                yaw_rate_rad_s: p.trailer_yaw_rate_rad_s,
            },
            ..EgoState::default()
        };
        let now = drive.now();
        let scene = Scene { time: now, neighbours: Vec::new() };
        let status = VehicleStatus::default();
        let ego = Stamped { time: pose.time, value: ego };
        let plan = stack.tick(now, &ego, &status, &scene, &drive.road, &limits);
        assert!(!plan.guard.contains(&GuardReason::Jump), "{:?} at {i}", plan.guard);
        assert!(!plan.guard.contains(&GuardReason::Stale), "{:?} at {i}", plan.guard);
    }
    // 0.3 m/s at 100 Hz, and the heading that the filter is misled to for a while
    assert!(fastest < 0.01, "{fastest} m in a tick");
    assert!(at_end < 0.1, "{at_end} m");
}

#[test]
fn without_fixes_the_truck_says_how_lost_it_is_and_then_that_it_is_lost() {
    let mut drive = Drive::new(LocaliserConfig::default());
    for _ in 0..1_000 {
        drive.step(EXACT).0.ok();
    }
    let [before, _] = drive.localiser.deviation();
    let silent = Errors { fixes: false, ..EXACT };
    let lost = (0..60_000).find_map(|_| drive.step(silent).0.err()).expect("it is never lost");
    assert!(matches!(lost, LocaliseError::Uncertain { .. }), "{lost}");
    let [sd, _] = drive.localiser.deviation();
    assert!(before < 0.06 && sd > 0.5, "{before} {sd}");
}

#[test]
fn fixes_that_do_not_fit_the_motion_are_not_believed_and_then_the_truck_is_lost() {
    let mut drive = Drive::new(LocaliserConfig::default());
    let pose = (0..1_000).map(|_| drive.step(EXACT).0).last().unwrap();
    pose.unwrap();
    let off = Errors { shift_m: [0.0, 20.0], ..EXACT };
    let lost = (0..1_500).find_map(|_| drive.step(off).0.err()).expect("it believes anything");
    assert!(matches!(lost, LocaliseError::Disagrees(10)), "{lost}");
    // It is found anew where the fixes are
    let (pose, truth) = (0..1_500).map(|_| drive.step(off)).last().unwrap();
    let pose = pose.unwrap().value;
    assert!((pose.x_m - truth[1]).hypot(pose.y_m - truth[2] - 20.0) < 0.2);
}

#[test]
fn in_a_steady_turn_the_trailer_turns_as_the_tractor_does() {
    let limits = limits();
    let mut localiser = Localiser::new(LocaliserConfig::default(), &limits, highway()).unwrap();
    let rate = 0.05;
    let value = Motion { speed_m_s: 10.0, yaw_rate_rad_s: rate };
    let at = highway().at(300.0, D_M);
    let [latitude_deg, longitude_deg] = on_earth(&geo(UTM), at.x_m, at.y_m);
    for i in 0..2_000 {
        localiser.moved(&Stamped { time: Time(i * 10_000_000), value });
        if i == 1_990 {
            let fix = Fix { latitude_deg, longitude_deg, course_rad: None };
            localiser.fixed(&Stamped { time: Time(i * 10_000_000), value: fix });
        }
    }
    let pose = localiser.pose(Time::ZERO).unwrap().value;
    assert!((pose.trailer_yaw_rate_rad_s - rate).abs() < 1e-6, "{}", pose.trailer_yaw_rate_rad_s);
    // Eq. 1: L_2 r = v_y,hitch cos(psi) - v sin(psi)
    let g = &limits.geometry;
    let (sin, cos) = pose.articulation_rad.sin_cos();
    let hitch = pose.lateral_speed_m_s + rate * g.hitch_ahead_m;
    assert!((g.hitch_to_trailer_axle_m * rate - (hitch * cos - 10.0 * sin)).abs() < 1e-6);
    assert!(pose.articulation_rad < -0.02, "the trailer trails to the outside of a left turn");
}

#[test]
fn a_road_that_does_not_contain_the_pose_is_named_and_a_map_without_a_place_refused() {
    let plain = Arc::new(builtin::highway().with_geo_reference(&geo("")));
    let refused = Localiser::new(LocaliserConfig::default(), &limits(), plain).unwrap_err();
    assert!(refused.to_string().contains("projection"), "{refused}");
    let mut localiser = Localiser::new(LocaliserConfig::default(), &limits(), highway()).unwrap();
    assert_eq!(localiser.pose(Time::ZERO), Err(LocaliseError::Unknown));
    let still = Motion::default();
    localiser.moved(&Stamped { time: Time::ZERO, value: still });
    let [latitude_deg, longitude_deg] = on_earth(&geo(UTM), 3_000.0, -90_000.0);
    let value = Fix { latitude_deg, longitude_deg, course_rad: None };
    localiser.fixed(&Stamped { time: Time::ZERO, value });
    let away = localiser.pose(Time::ZERO).unwrap_err();
    assert!(matches!(away, LocaliseError::OffRoad { .. }), "{away}");
}

fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![4 => -200.0..200.0, 1 => any::<f64>(), 1 => Just(f64::NAN)]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]

    #[test]
    fn whatever_sensors_and_receivers_say_a_pose_is_finite(
        steps in prop::collection::vec(
            (any_number(), any_number(), any_number(), any_number(), -2_000_000_000..2_000_000_000_i64),
            1..40,
        ),
    ) {
        let mut drive = Drive::new(LocaliserConfig::default());
        for _ in 0..200 {
            drive.step(EXACT).0.ok();
        }
        let mut time = drive.now();
        for (a, b, c, d, step) in steps {
            time = time.plus_nanos(step);
            let motion = Motion { speed_m_s: a, yaw_rate_rad_s: b };
            drive.localiser.moved(&Stamped { time, value: motion });
            let fix = Fix { latitude_deg: c, longitude_deg: d, course_rad: Some(a) };
            drive.localiser.fixed(&Stamped { time, value: fix });
            if let Ok(pose) = drive.localiser.pose(time) {
                let p = pose.value;
                let all = [p.x_m, p.y_m, p.z_m, p.yaw_rad, p.s_m, p.d_m, p.articulation_rad];
                prop_assert!(all.iter().all(|v| v.is_finite()), "{:?}", p);
            }
        }
    }

    #[test]
    fn no_line_breaks_the_reader(
        bytes in prop::collection::vec(any::<u8>(), 0..130),
        fields in prop::collection::vec("[0-9A-Z.,-]{0,9}", 0..16),
        kind in prop::sample::select(vec!["GPRMC", "GNGGA", "XXRMC", "GP", ""]),
    ) {
        let mut nmea = Nmea::default();
        let _ = nmea.sentence(&bytes);
        let line = sentence(&format!("{kind},{}", fields.join(",")));
        if let Ok(Some(fix)) = nmea.sentence(line.as_bytes()) {
            prop_assert!(fix.latitude_deg.abs() <= 90.0 && fix.longitude_deg.abs() <= 180.0);
        }
    }
}

/// A sentence with its checksum.
fn sentence(body: &str) -> String {
    format!("${body}*{:02X}\r\n", body.bytes().fold(0, |xor, byte| xor ^ byte))
}

#[test]
fn sentences_of_receivers_are_read() {
    let mut nmea = Nmea::default();
    let gga = b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47";
    let fix = nmea.sentence(gga).unwrap().unwrap();
    assert!((fix.latitude_deg - 48.1173).abs() < 1e-9, "{fix:?}");
    assert!((fix.longitude_deg - (11.0 + 31.0 / 60.0)).abs() < 1e-9);
    assert_eq!(fix.course_rad, None);
    let rmc = b"$GPRMC,123520,A,4807.038,S,01131.000,W,022.4,084.4,230394,003.1,W*6A";
    assert_eq!(nmea.sentence(rmc), Err(NmeaError::Checksum));
    let rmc = sentence("GPRMC,123520,A,4807.038,S,01131.000,W,022.4,084.4,230394,003.1,W");
    let fix = nmea.sentence(rmc.as_bytes()).unwrap().unwrap();
    assert!(fix.latitude_deg < 0.0 && fix.longitude_deg < 0.0);
    assert!((fix.course_rad.unwrap() - 84.4_f64.to_radians()).abs() < 1e-12);
    // Of one instant the first counts, and GGA no more
    assert_eq!(nmea.sentence(rmc.as_bytes()), Ok(None));
    assert_eq!(nmea.sentence(gga), Ok(None));
    for none in ["GPRMC,123521,V,,,,,,,230394,,", "GPGSV,3,1,11", "GPGGA,1,,,,,0,,,,,,,,"] {
        assert_eq!(Nmea::default().sentence(sentence(none).as_bytes()), Ok(None), "{none}");
    }
    for (bad, error) in [
        ("GPGGA,123519,9907.0,N,01131.0,E,1", NmeaError::Field(2)),
        ("GPGGA,123519,4861.0,N,01131.0,E,1", NmeaError::Field(2)),
        ("GPGGA,123519,4807.0,X,01131.0,E,1", NmeaError::Field(2)),
        ("GPGGA,123519,4807.0,N,nan,E,1", NmeaError::Field(4)),
        ("GPGGA,noon,4807.0,N,01131.0,E,1", NmeaError::Field(1)),
        ("GPGGA,123519", NmeaError::Field(6)),
    ] {
        assert_eq!(Nmea::default().sentence(sentence(bad).as_bytes()), Err(error), "{bad}");
    }
    assert_eq!(Nmea::default().sentence(&[b'$'; 500]), Err(NmeaError::Form));
    assert_eq!(Nmea::default().sentence(b"\xFF*00"), Err(NmeaError::Form));
}
