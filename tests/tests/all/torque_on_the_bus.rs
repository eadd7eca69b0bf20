//! A pedal, as torque over the bus and back: what the truck behind the bus makes of it.

use dynamics::{TruckModel, TruckParameters};
use j1939::truck::{TORQUE_STEP_FRAC, Torque};

#[test]
fn a_pedal_asks_for_the_same_torque_at_both_ends_within_half_a_step() {
    let mut maps = 0;
    for name in TruckParameters::names() {
        let truck = TruckParameters::load(name).unwrap();
        let reference_nm = truck.engine.reference_torque_nm;
        let limits = TruckModel::new(truck, 20_000.0).unwrap().vehicle_limits().unwrap();
        let p = &limits.powertrain;
        maps += usize::from(p.pedal_map_nm.is_some());
        for n in 0..=40 {
            let (idle, most) = (p.idle_speed_rad_s, p.max_speed_rad_s);
            let speed = idle + f64::from(n) / 40.0 * (most - idle);
            for pedal in (0..=1000).map(|i| f64::from(i) * 1e-3) {
                let wanted_nm = p.pedal_torque_nm(pedal, speed);
                let sent = Torque::of_frac(wanted_nm / reference_nm);
                let heard_nm = sent.frac().unwrap() * reference_nm;
                let again_nm = p.pedal_torque_nm(p.pedal_frac(heard_nm, speed), speed);
                // The outermost pedals ask for no less and no more
                let reachable = [0.0, 1.0].map(|pedal| p.pedal_torque_nm(pedal, speed));
                let heard_nm = heard_nm.clamp(reachable[0].min(wanted_nm), reachable[1]);
                assert!((again_nm - heard_nm).abs() < 1e-6, "{name} {speed} {pedal}");
                let off_nm = (again_nm - wanted_nm).abs();
                let half_nm = 0.5 * TORQUE_STEP_FRAC * reference_nm;
                assert!(off_nm <= half_nm + 1e-6, "{name}: {off_nm} Nm at {speed}, {pedal}");
            }
        }
    }
    assert!(maps > 0, "no truck with a pedal map was looked at");
}
