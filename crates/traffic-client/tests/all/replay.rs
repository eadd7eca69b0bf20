//! Recorded traffic: files in, scenes out.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use road::{Road, builtin};
use tractrix_core::{EgoState, Scene, Time, TrafficSource, VehicleClass};
use traffic_client::replay::{
    Carriageway, Frame, Recording, ReplayConfig, ReplayTraffic, Row, load, read_parquet, road_of,
    to_parquet,
};

fn shared(path: &str) -> Option<PathBuf> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(path);
    if !file.exists() {
        eprintln!("skipped: no {}", file.display());
        return None;
    }
    Some(file)
}

/// Two cars on a straight road: one at 20 m/s in the right lane, one that changes to the left.
fn two_cars() -> Recording {
    let rows = (0..=200).flat_map(|k| {
        let t = 0.1 * f64::from(k);
        let left = (t / 10.0).min(1.0);
        [
            Row {
                id: 1,
                time_s: t,
                x_m: 100.0 + 20.0 * t,
                y_m: -1.8,
                length_m: Some(4.5),
                ..Row::default()
            },
            Row {
                id: 2,
                time_s: t,
                x_m: 150.0 + 15.0 * t,
                y_m: -1.8 + 3.6 * left,
                length_m: Some(16.0),
                ..Row::default()
            },
        ]
    });
    Recording::from_rows("two cars", Frame::Map, rows.collect(), 0.1).unwrap()
}

fn ego(s_m: f64) -> EgoState {
    EgoState { s_m, ..EgoState::default() }
}

#[test]
fn a_replay_shows_what_was_recorded_at_any_instant() {
    let road = Arc::new(builtin::flat(2000.0));
    let mut replay = ReplayTraffic::new(road, &two_cars(), ReplayConfig::default()).unwrap();
    for k in [0i64, 37, 555, 1234, 1999] {
        let t = 0.01 * k as f64;
        let scene = replay.advance(Time(k * 10_000_000), &ego(200.0)).unwrap();
        let car = scene.neighbours.iter().find(|n| n.id == 1).unwrap();
        assert!((car.front_s_m - (102.25 + 20.0 * t)).abs() < 1e-6);
        assert!((car.speed_m_s - 20.0).abs() < 1e-6 && car.class == VehicleClass::Car);
        let truck = scene.neighbours.iter().find(|n| n.id == 2).unwrap();
        assert_eq!(truck.class, VehicleClass::Truck);
        assert!((truck.length_m() - 16.0).abs() < 1e-9);
        if t < 9.0 {
            assert!((truck.lateral_speed_m_s - 0.36).abs() < 1e-6);
        }
    }
}

#[test]
fn a_replay_ends_with_the_recording_unless_it_is_asked_to_repeat() {
    let road = Arc::new(builtin::flat(2000.0));
    let count = |repeat| {
        let config = ReplayConfig { repeat, ..ReplayConfig::default() };
        let mut replay = ReplayTraffic::new(road.clone(), &two_cars(), config).unwrap();
        replay.advance(Time(0), &ego(200.0)).unwrap();
        replay.advance(Time(25_000_000_000), &ego(200.0)).unwrap().neighbours.len()
    };
    assert_eq!((count(false), count(true)), (0, 2));
}

#[test]
fn a_recording_beside_the_road_is_refused_by_name() {
    let road = Arc::new(builtin::flat(2000.0));
    let rows = (0..20).map(|k| Row {
        id: 1,
        time_s: 0.1 * f64::from(k),
        x_m: 5.0,
        y_m: 500.0,
        ..Row::default()
    });
    let recording = Recording::from_rows("far.csv", Frame::Map, rows.collect(), 0.1).unwrap();
    let e = ReplayTraffic::new(road, &recording, ReplayConfig::default()).unwrap_err();
    assert!(e.to_string().contains("far.csv") && e.to_string().contains("flat"), "{e}");
}

#[test]
fn a_recording_survives_parquet() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.parquet");
    let recording = two_cars();
    std::fs::write(&path, to_parquet(&recording).unwrap()).unwrap();
    let rows = read_parquet(&path).unwrap();
    assert_eq!(rows.len(), 402);
    let again = load(&path, Carriageway::Forward, 0.1).unwrap();
    assert_eq!(again.tracks.len(), 2);
    for (a, b) in recording.tracks.iter().zip(&again.tracks) {
        assert_eq!(
            (a.id, a.class, a.first, a.samples.len()),
            (b.id, b.class, b.first, b.samples.len())
        );
        for (p, q) in a.samples.iter().zip(&b.samples) {
            assert!((p.x_m - q.x_m).abs() < 1e-6 && (p.speed_m_s - q.speed_m_s).abs() < 1e-6);
        }
    }
    let e = load(&folder.path().join("none.parquet"), Carriageway::Forward, 0.1).unwrap_err();
    assert!(e.to_string().contains("none.parquet"));
}

#[test]
fn an_empty_file_is_said_to_be_empty() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("nothing.csv");
    std::fs::write(&file, " \n").unwrap();
    let e = load(&file, Carriageway::Forward, 0.1).unwrap_err().to_string();
    assert!(e.contains("nothing.csv: the file is empty"), "{e}");
}

#[test]
fn recorded_stretches_get_their_own_road_and_replay_without_jumps() {
    let Some(file) = shared("traffic_recorded/mapped_Middle_sample1.csv.gz") else { return };
    let recording = load(&file, Carriageway::Forward, 0.1).unwrap();
    let road: Arc<Road> = Arc::new(road_of(&recording, 2, f64::INFINITY).unwrap());
    assert!((600.0..800.0).contains(&road.length_m()), "{}", road.length_m());
    let width = road.lanes()[0].width_m(0.0);
    assert!((3.2..4.2).contains(&width), "{width}");
    let config = ReplayConfig { scene_radius_m: 1000.0, ..ReplayConfig::default() };
    let mut replay = ReplayTraffic::new(road, &recording, config).unwrap();
    let mut last: Scene = Scene::default();
    let (mut seen, mut odd) = (0, 0);
    for k in 0..290 {
        let scene = replay.advance(Time(k * 100_000_000), &ego(300.0)).unwrap();
        for n in &scene.neighbours {
            if let Some(before) = last.neighbours.iter().find(|b| b.id == n.id) {
                let moved = n.front_s_m - before.front_s_m;
                assert!((-2.0..5.0).contains(&moved), "{} moved {moved} m", n.id);
                odd += usize::from(!(-0.1..3.0).contains(&moved));
            }
        }
        seen += scene.neighbours.len();
        last = scene.clone();
    }
    assert!(seen > 15_000 && odd < seen / 100, "{odd} odd moves of {seen}");
}

#[test]
fn commonroad_scenarios_and_their_exports_agree() {
    let (Some(xml), Some(csv)) = (
        shared("commonroad_us101/USA_US101-5_1_T-1.xml"),
        shared("commonroad_us101/USA_US101-5_1_T-1.csv.gz"),
    ) else {
        return;
    };
    let a = load(&xml, Carriageway::Forward, 0.1).unwrap();
    let b = load(&csv, Carriageway::Forward, 0.1).unwrap();
    assert_eq!(a.tracks.len(), b.tracks.len());
    for (p, q) in a.tracks.iter().zip(&b.tracks) {
        assert_eq!((p.id, p.samples.len()), (q.id, q.samples.len()));
        assert!((p.samples[0].x_m - q.samples[0].x_m).abs() < 1e-3);
    }
}
