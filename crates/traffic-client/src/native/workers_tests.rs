//! Pieces of a tick, done by whoever and in whatever order.

use std::sync::{Arc, Mutex};

use tractrix_core::{EgoState, Geometry};

use super::config::{Density, TrafficConfig};
use super::engine::Engine;
use super::lanes::LaneMap;
use super::workers::{InTurn, Piece, Workers};

/// The last piece first.
#[derive(Debug)]
struct Backwards;

impl Workers for Backwards {
    fn run<'a>(&self, pieces: Vec<Piece<'a>>) {
        pieces.into_iter().rev().for_each(|piece| piece());
    }
}

/// Threads that take the next piece when they are done with one.
#[derive(Debug)]
struct Threads(usize);

impl Workers for Threads {
    fn run<'a>(&self, pieces: Vec<Piece<'a>>) {
        let left = Mutex::new(pieces.into_iter());
        let work = || {
            loop {
                let next = left.lock().unwrap().next();
                let Some(piece) = next else { break };
                piece();
            }
        };
        std::thread::scope(|scope| {
            (0..self.0).for_each(|_| drop(scope.spawn(work)));
        });
    }
}

/// Dense traffic on three lanes with an ego in the second one, which brakes.
fn driven(workers: Arc<dyn Workers>, piece: usize) -> Engine {
    let config = TrafficConfig::family(Density::Dense, 25.0, 6);
    let map = Arc::new(LaneMap::straight(3, 4000.0, 3.75, 30.0));
    let mut e = Engine::new(Arc::new(config), Arc::clone(&map));
    (e.workers, e.piece) = (workers, piece);
    e.fill();
    let geometry =
        Geometry { front_m: 4.8, trailer_rear_m: 11.5, width_m: 2.55, ..Geometry::default() };
    e.state.fleet.retain(|f, i| f.s_m[i] < 900.0 || f.rear_m(i) > 1100.0);
    for k in 0..600 {
        let t_s = 0.1 * f64::from(k);
        let s_m = 1000.0 + 15.0 * t_s;
        let ego = EgoState { s_m, d_m: 5.6, speed_m_s: 15.0, ..EgoState::default() };
        e.ego.update(&ego, &geometry, &map, 0.0, 0.0);
        e.decide();
        e.commit();
    }
    e
}

#[test]
fn any_number_of_threads_and_any_order_of_the_pieces_give_the_same_bits() {
    let alone = driven(Arc::new(InTurn), 7);
    assert!(alone.state.fleet.len() > 100 && alone.state.lane_changes > 50);
    for workers in
        [Arc::new(Backwards) as Arc<dyn Workers>, Arc::new(Threads(2)), Arc::new(Threads(5))]
    {
        let other = driven(workers, 7);
        assert!(other.state == alone.state);
    }
}

#[test]
fn neighbours_beyond_the_end_of_a_piece_are_found() {
    // All in one piece, and in many: the same vehicles, whoever is the nearest and wherever the ego
    // is. (The distance driven is summed in another order.)
    let whole = driven(Arc::new(InTurn), usize::MAX);
    for piece in [1, 2, 13, 100] {
        let cut = driven(Arc::new(InTurn), piece);
        assert!(cut.state.fleet == whole.state.fleet, "pieces of {piece}");
    }
}
