//! The simulated truck's pose: truth, or noise of the stated size, rate and latency.

use sim::{PlantPose, PoseNoise};
use tractrix_core::{EgoState, Pose, PoseSource, Stamped, Time};

fn truth(i: i64) -> Stamped<EgoState> {
    let value = EgoState { x_m: i as f64, s_m: i as f64, yaw_rad: 0.0, ..EgoState::default() };
    Stamped { time: Time(i * 10_000_000), value }
}

fn measured(noise: PoseNoise, seed: u64, ticks: i64) -> Vec<Stamped<Pose>> {
    let mut source = PlantPose::new(noise, seed, &truth(0));
    (0..ticks)
        .map(|i| {
            source.feed(&truth(i));
            source.pose(truth(i).time).unwrap()
        })
        .collect()
}

#[test]
fn without_noise_it_is_the_truth_at_once() {
    for (i, pose) in measured(PoseNoise::default(), 1, 100).iter().enumerate() {
        let truth = truth(i as i64);
        let value = Pose { x_m: truth.value.x_m, s_m: truth.value.s_m, ..Pose::default() };
        assert_eq!(*pose, Stamped { time: truth.time, value });
    }
}

#[test]
fn rate_and_latency_are_those_stated() {
    let noise = PoseNoise { period_s: 0.1, latency_s: 0.05, ..PoseNoise::default() };
    let poses = measured(noise, 1, 100);
    for (i, pose) in poses.iter().enumerate() {
        let newest = (i as i64 - 5).max(0) / 10 * 10;
        assert_eq!(pose.time, truth(newest).time, "at {i}");
    }
}

#[test]
fn the_noise_has_its_standard_deviation_and_its_persistence_and_repeats_with_the_seed() {
    let noise = PoseNoise { position_m: 0.5, persists_s: 0.02, ..PoseNoise::default() };
    let run = |seed| -> Vec<f64> {
        let poses = measured(noise, seed, 20_000);
        poses.iter().enumerate().map(|(i, p)| p.value.x_m - i as f64).collect()
    };
    let (a, b) = (run(7), run(8));
    assert_eq!(a, run(7));
    assert_ne!(a, b);
    let mean = |v: &mut dyn Iterator<Item = f64>| v.sum::<f64>() / 20_000.0;
    let sd = mean(&mut a.iter().map(|e| e * e)).sqrt();
    assert!((sd - 0.5).abs() < 0.02, "{sd}");
    let kept = mean(&mut a.windows(2).map(|w| w[0] * w[1])) / (sd * sd);
    assert!((kept - (-0.5_f64).exp()).abs() < 0.03, "{kept}");
    assert!(mean(&mut a.iter().copied()).abs() < 0.02);
}
