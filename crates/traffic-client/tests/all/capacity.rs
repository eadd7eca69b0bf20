//! What a level road serves, against the Highway Capacity Manual. Once, 1,190 to 1,310 of the 1,800
//! vehicles per hour and lane of the dense family came onto the road, past a queue that stood in its
//! first 200 m, and those beyond a queue of 50 were lost without a word.

use traffic_client::native::{Density, TrafficConfig};
use traffic_client::serve::{Served, serve};

/// A level road at 25 m/s that is asked for more than it carries.
fn at_capacity(truck_share_frac: f64) -> Served {
    let demand = TrafficConfig {
        max_speed_m_s: 25.0,
        truck_share_frac,
        van_share_frac: 0.0,
        spawn_probability: 2300.0 / 36_000.0,
        ..TrafficConfig::default()
    };
    serve(&demand).unwrap()
}

#[test]
fn a_lane_of_cars_and_one_with_trucks_carry_what_the_highway_capacity_manual_says() {
    // HCM 2016, Exhibit 12-4: 2,250 passenger cars per hour and lane at a free speed of 88 km/h;
    // 2,000 to 2,200 are usual. Equation 12-10 with a truck as two to 2.5 cars: 20 % of them leave
    // 77 to 83 % of it.
    let (cars, mixed) = (at_capacity(0.0), at_capacity(0.2));
    assert!((2000.0..2200.0).contains(&cars.flow_veh_h_lane), "{cars:?}");
    assert!((1750.0..1900.0).contains(&mixed.flow_veh_h_lane), "{mixed:?}");
    // Whoever finds no room waits before the road, where they are counted, not on it.
    for served in [cars, mixed] {
        assert!(served.waiting > 50, "{served:?}");
        assert!(served.entry_speed_m_s > 20.0, "a queue at the start: {served:?}");
    }
}

#[test]
fn a_family_serves_what_it_names_or_as_much_as_its_drivers_carry() {
    for max_speed_m_s in [12.5, 15.0] {
        for density in Density::ALL {
            let config = TrafficConfig::family(density, max_speed_m_s, 2);
            let served = serve(&config).unwrap();
            let most = config.capacity().flow_veh_h_lane;
            let due = config.asked_veh_h_lane().min(0.85 * most);
            // Arrivals are drawn: a quarter of an hour on two lanes counts half of it.
            let by_chance = 3.0 * (2.0 * due).sqrt();
            let name = format!("{density:?} {max_speed_m_s}: {served:?} of {most:.0}");
            assert!(served.flow_veh_h_lane > due - by_chance, "{name}");
            assert!(served.entry_speed_m_s > 0.8 * max_speed_m_s, "{name}");
            assert!((served.waiting > 20) == (density == Density::Dense), "{name}");
        }
    }
}
