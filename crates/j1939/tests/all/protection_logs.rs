//! Counters and checksums of real trucks.

use std::collections::BTreeMap;

use crate::typed;
use j1939::Frame;
use j1939::check::{Carrier, Checker, Policy, Verdict};

/// How often each verdict comes, by source, for the frames of a group.
fn verdicts(log: &str, carrier: Carrier, policy: Policy) -> BTreeMap<(u8, &'static str), usize> {
    let of_group = |frame: &Frame| frame.id().pgn() == carrier.pgn;
    let mut checkers = BTreeMap::new();
    let mut counts = BTreeMap::new();
    for frame in typed::frames(log).into_iter().filter(of_group) {
        let sa = frame.id().sa();
        let new = || Checker::new(carrier.protection, policy);
        let verdict = match checkers.entry(sa).or_insert_with(new).check(&frame) {
            Verdict::Good => "good",
            Verdict::Unprotected => "unprotected",
            Verdict::Missing => "missing",
            Verdict::Checksum { .. } => "checksum",
            Verdict::Stuck { .. } => "stuck",
            Verdict::Jump { .. } => "jump",
        };
        *counts.entry((sa, verdict)).or_default() += 1;
    }
    counts
}

/// The sensor's sum is that of XBR. Its log lost frames, which the counter shows.
#[test]
fn every_checksum_of_a_real_steering_sensor_is_right() {
    let counts = verdicts("uthp_modern_parked", Carrier::SAS, Policy::Required);
    assert_eq!(counts, BTreeMap::from([((0x13, "good"), 2_461), ((0x13, "jump"), 26)]));
}

/// A truck of 2014 does not protect its torque demands, and neither does who injects them.
#[test]
fn torque_demands_of_an_old_truck_pass_where_the_policy_lets_them() {
    for (policy, verdict) in [(Policy::WherePresent, "unprotected"), (Policy::Required, "missing")]
    {
        let counts = verdicts("t270_tsc1", Carrier::TSC1, policy);
        assert_eq!(counts, BTreeMap::from([((0x03, verdict), 619), ((0x0B, verdict), 923)]));
    }
}
