//! What a drive may cost: what was measured (`docs/results/truck.md`), and 5 %. The figures are the
//! same in every run; a change of them is a change of the code or the compiler.

/// Code and constants, bytes.
pub const TEXT_BYTES: usize = 596_000;
/// Stack, bytes.
pub const STACK_BYTES: usize = 51_500;

/// What the ticks of a drive cost.
#[derive(Debug)]
pub struct Cost {
    /// Instructions of a tick, mean.
    pub mean: u64,
    /// Instructions of the dearest tick without a speed plan.
    pub worst_tick: u64,
    /// Instructions of the dearest tick with one.
    pub worst_plan: u64,
    /// Ticks that allocate.
    pub allocating_ticks: usize,
    /// Allocations of all ticks.
    pub allocations: usize,
    /// Most heap at once, bytes, the road included.
    pub heap_bytes: usize,
}

/// Cruise control alone: nothing is allocated after the first tick.
pub const CRUISE: Cost = Cost {
    mean: 204_000,
    worst_tick: 708_000,
    worst_plan: 0,
    allocating_ticks: 1,
    allocations: 3,
    heap_bytes: 79_400,
};

/// Predictive among cars: only a speed plan allocates, and the first tick.
pub const PREDICTIVE: Cost = Cost {
    mean: 728_000,
    worst_tick: 924_000,
    worst_plan: 359_000_000,
    allocating_ticks: 2,
    allocations: 2_670,
    heap_bytes: 1_009_000,
};

/// Predictive over hills.
pub const HILLS: Cost = Cost {
    mean: 1_056_000,
    worst_tick: 1_135_000,
    worst_plan: 612_000_000,
    allocating_ticks: 2,
    allocations: 2_717,
    heap_bytes: 1_165_000,
};

impl Cost {
    /// Of no ticks.
    pub const NONE: Self = Self {
        mean: 0,
        worst_tick: 0,
        worst_plan: 0,
        allocating_ticks: 0,
        allocations: 0,
        heap_bytes: 0,
    };

    /// Names the first bound that is passed.
    pub fn within(&self, bounds: &Self) -> Result<(), &'static str> {
        let all = |cost: &Self| {
            [
                (cost.mean, "more instructions in the mean than the bound"),
                (cost.worst_tick, "more instructions in a tick than the bound"),
                (cost.worst_plan, "more instructions in a tick with a plan than the bound"),
                (cost.allocating_ticks as u64, "more ticks allocate than the bound"),
                (cost.allocations as u64, "more allocations than the bound"),
                (cost.heap_bytes as u64, "more heap than the bound"),
            ]
        };
        let passed = all(self).into_iter().zip(all(bounds)).find(|(cost, most)| cost.0 > most.0);
        passed.map_or(Ok(()), |(_, (_, what))| Err(what))
    }
}
