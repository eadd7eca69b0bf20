//! The jobs of a diagnosis on the machine's cores. The diagnosis itself starts no threads; its shells
//! do.

use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicUsize, Ordering};

use diagnosis::Executor;

/// As many threads as there are cores.
#[derive(Debug, Clone, Copy)]
pub struct Threads(usize);

impl Threads {
    /// For this machine.
    #[must_use]
    pub fn available() -> Self {
        Self(std::thread::available_parallelism().map_or(1, NonZeroUsize::get))
    }
}

impl Executor for Threads {
    fn run(&self, count: usize, job: &(dyn Fn(usize) + Sync)) {
        let next = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for _ in 0..self.0.min(count) {
                scope.spawn(|| {
                    loop {
                        let index = next.fetch_add(1, Ordering::Relaxed);
                        if index >= count {
                            return;
                        }
                        job(index);
                    }
                });
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_job_runs_once() {
        let done: Vec<AtomicUsize> = (0..37).map(|_| AtomicUsize::new(0)).collect();
        Threads(3).run(37, &|i| {
            done[i].fetch_add(1, Ordering::Relaxed);
        });
        assert!(done.iter().all(|d| d.load(Ordering::Relaxed) == 1));
        Threads(3).run(0, &|_| unreachable!());
    }
}
