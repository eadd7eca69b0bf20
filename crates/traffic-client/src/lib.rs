//! Where the other vehicles come from: native IDM+MOBIL, SUMO over TraCI, recorded trajectories.
