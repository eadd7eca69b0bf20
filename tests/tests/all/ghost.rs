//! The ghost of a run: the same truck under ordinary cruise control, and what is saved against it.

use planner::SpeedPlannerKind;
use sim::{GhostReport, Scenario, Status, Summary, World};

fn driven(scenario: &Scenario, with_ghost: bool) -> (Summary, Option<GhostReport>) {
    let mut world = World::new(scenario, 1).unwrap();
    if with_ghost {
        world.attach_ghost().unwrap();
    }
    (world.run(&mut ()).unwrap(), world.ghost())
}

fn of(name: &str, payload_kg: f64) -> Scenario {
    let mut scenario = Scenario::builtin(name).unwrap();
    scenario.truck.payload_kg = payload_kg;
    scenario
}

#[test]
fn a_ghost_changes_nothing_of_the_run_and_can_be_left_out() {
    let mut scenario = of("highway", 36_000.0);
    scenario.run.duration_s = 60.0;
    let (alone, none) = driven(&scenario, false);
    let (watched, ghost) = driven(&scenario, true);
    assert_eq!(alone.state_hash, watched.state_hash);
    assert!(none.is_none() && ghost.unwrap().time_s > 50.0);
    scenario.run.ghost = false;
    assert!(driven(&scenario, true).1.is_none());
}

#[test]
fn a_truck_that_drives_as_its_ghost_does_saves_nothing() {
    let mut scenario = of("highway-empty", 36_000.0);
    scenario.stack.speed_planner = SpeedPlannerKind::Cruise;
    scenario.stack.overspeed_m_s = 5.0 / 3.6;
    scenario.run.duration_s = 120.0;
    let (summary, ghost) = driven(&scenario, true);
    let ghost = ghost.unwrap();
    assert!((ghost.s_m - ghost.compared_s_m).abs() < 10.0, "{ghost:?}");
    assert!((ghost.fuel_g - ghost.ego_fuel_g).abs() < 1e-6 * summary.fuel_g, "{ghost:?}");
    assert!(ghost.saving_frac.unwrap().abs() < 1e-6, "{ghost:?}");
    assert_eq!((ghost.held_up_s, ghost.saving_frac), (0.0, ghost.free_saving_frac));
}

#[test]
fn cruise_control_rolls_above_its_set_speed_only_as_far_as_it_may() {
    let mut scenario = of("highway-empty", 36_000.0);
    scenario.stack.speed_planner = SpeedPlannerKind::Cruise;
    let fastest = |scenario: &Scenario| {
        let mut world = World::new(scenario, 1).unwrap();
        let mut fastest = 0.0_f64;
        while world.tick(&mut ()).unwrap() == Status::Running {
            fastest = fastest.max(world.truck().state().speed_m_s);
        }
        (fastest, world.summary())
    };
    let (held, strict) = fastest(&scenario);
    scenario.stack.overspeed_m_s = 5.0 / 3.6;
    let (rolled, eager) = fastest(&scenario);
    let set_m_s = scenario.stack.set_speed_m_s;
    assert!(held < set_m_s + 0.5, "{held}");
    assert!(rolled > set_m_s + 1.0 && rolled < set_m_s + 5.0 / 3.6 + 0.3, "{rolled}");
    assert!(eager.fuel_g < strict.fuel_g && eager.duration_s < strict.duration_s);
}

#[test]
fn looking_ahead_saves_6_percent_at_55_t_and_5_at_40_t_at_equal_time() {
    for (payload_kg, at_least) in [(36_000.0, 0.06), (21_000.0, 0.05)] {
        let (_, ghost) = driven(&of("highway-empty", payload_kg), true);
        let ghost = ghost.unwrap();
        assert!(ghost.saving_frac.unwrap() >= at_least, "{payload_kg}: {ghost:?}");
        // No traffic, so that nothing is lost to it, and little is left to the price of time.
        assert_eq!(ghost.held_up_m, 0.0);
        assert!((ghost.ego_time_s / ghost.time_s - 1.0).abs() < 0.03, "{ghost:?}");
    }
}

#[test]
fn what_is_lost_to_traffic_is_told_apart() {
    let (_, ghost) = driven(&of("highway", 36_000.0), true);
    let ghost = ghost.unwrap();
    assert!(ghost.held_up_s > 1.0 && ghost.held_up_m > 10.0, "{ghost:?}");
    assert!(ghost.free_saving_frac.unwrap() > ghost.saving_frac.unwrap() - 0.01, "{ghost:?}");
}
