//! Where the drives' work runs. The library starts no threads: a shell passes an executor.

use std::sync::Mutex;

/// Runs independent jobs, in any order or at once.
pub trait Executor: Sync {
    /// Calls `job(0), ..., job(count - 1)` once each and returns when all are done.
    fn run(&self, count: usize, job: &(dyn Fn(usize) + Sync));
}

/// Results of `count` jobs in their order. What an executor leaves out is done on this thread.
pub fn collect<T: Send>(
    executor: &dyn Executor,
    count: usize,
    job: impl Fn(usize) -> T + Sync,
) -> Vec<T> {
    let slots: Vec<Mutex<Option<T>>> = (0..count).map(|_| Mutex::new(None)).collect();
    executor.run(count, &|i| {
        let value = job(i);
        if let Ok(mut slot) = slots[i].lock() {
            *slot = Some(value);
        }
    });
    let done = slots.into_iter().map(|slot| slot.into_inner().ok().flatten());
    done.enumerate().map(|(i, value)| value.unwrap_or_else(|| job(i))).collect()
}

/// One job after the other on the caller's thread.
#[derive(Debug, Clone, Copy, Default)]
pub struct Serial;

impl Executor for Serial {
    fn run(&self, count: usize, job: &(dyn Fn(usize) + Sync)) {
        (0..count).for_each(job);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct EverySecond;

    impl Executor for EverySecond {
        fn run(&self, count: usize, job: &(dyn Fn(usize) + Sync)) {
            (0..count).rev().step_by(2).for_each(job);
        }
    }

    #[test]
    fn results_are_in_order_and_complete_whatever_the_executor_does() {
        assert_eq!(collect(&EverySecond, 5, |i| 10 * i), [0, 10, 20, 30, 40]);
        assert_eq!(collect(&Serial, 3, |i| i), [0, 1, 2]);
    }
}
