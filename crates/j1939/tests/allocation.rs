//! Decoding asks for no memory.

#[path = "../../planner/tests/support/counting.rs"]
mod counting;
mod typed;

use counting::requests_of;

#[test]
fn no_frame_of_a_log_costs_an_allocation() {
    let mut frames = Vec::new();
    assert!(requests_of(|| frames = typed::frames("t270_normal")) > 0, "the counter counts");
    let mut decoded = 0;
    let requests =
        requests_of(|| decoded = frames.iter().filter(|frame| typed::decode(frame)).count());
    assert_eq!((requests, decoded), (0, 15_582));
}
