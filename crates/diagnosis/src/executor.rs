//! Where the drives' work runs. The library starts no threads: a shell passes an executor.

/// Runs independent jobs, in any order or at once.
pub trait Executor: Sync {
    /// Calls `job(0), ..., job(count - 1)` once each and returns when all are done.
    fn run(&self, count: usize, job: &(dyn Fn(usize) + Sync));
}

/// One job after the other on the caller's thread.
#[derive(Debug, Clone, Copy, Default)]
pub struct Serial;

impl Executor for Serial {
    fn run(&self, count: usize, job: &(dyn Fn(usize) + Sync)) {
        (0..count).for_each(job);
    }
}
