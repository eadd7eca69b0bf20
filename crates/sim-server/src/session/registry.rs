//! The sessions of a server.

use std::collections::BTreeMap;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::dashboard::Shared;

/// The session that `run` starts with.
pub(crate) const DEFAULT: &str = "default";

/// The sessions, by id; a bounded number.
pub(crate) struct Registry {
    most: usize,
    inner: Mutex<Inner>,
}

#[derive(Default)]
struct Inner {
    /// None: about to begin.
    sessions: BTreeMap<Arc<str>, Option<Arc<Shared>>>,
    /// Ids that were given.
    begun: u64,
    /// No more of them begin.
    closed: bool,
}

impl Registry {
    /// No session yet, and at most so many.
    pub(crate) fn new(most: usize) -> Arc<Self> {
        Arc::new(Self { most, inner: Mutex::default() })
    }

    /// Sessions at once, at most.
    pub(crate) const fn most(&self) -> usize {
        self.most
    }

    /// A place for a session that is about to begin; none when all are taken.
    pub(crate) fn claim(self: &Arc<Self>, id: Option<&str>) -> Option<Claim> {
        let mut inner = self.lock();
        if inner.closed || inner.sessions.len() >= self.most {
            return None;
        }
        inner.begun += 1;
        let id: Arc<str> = id.map_or_else(|| format!("s{}", inner.begun).into(), Arc::from);
        inner.sessions.insert(Arc::clone(&id), None);
        Some(Claim { registry: Arc::clone(self), id })
    }

    /// A session that has begun.
    pub(crate) fn get(&self, id: &str) -> Option<Arc<Shared>> {
        self.lock().sessions.get(id).cloned().flatten()
    }

    /// All that have begun, by id.
    pub(crate) fn all(&self) -> Vec<Arc<Shared>> {
        self.lock().sessions.values().flatten().cloned().collect()
    }

    /// Sessions, those about to begin among them.
    pub(crate) fn count(&self) -> usize {
        self.lock().sessions.len()
    }

    /// Ends all sessions between two ticks; no other one begins.
    pub(crate) fn stop_all(&self) {
        self.lock().closed = true;
        for session in self.all() {
            session.stop.store(true, Ordering::Relaxed);
        }
    }

    /// Ends those that nobody has asked for, nor looked at, for so long; says which.
    pub(crate) fn stop_idle(&self, longest: Duration) -> Vec<Arc<Shared>> {
        let is_idle = |session: &Arc<Shared>| {
            session.idle() > longest && !session.stop.swap(true, Ordering::Relaxed)
        };
        self.all().into_iter().filter(is_idle).collect()
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A place among the sessions. It is free again when this goes.
pub(crate) struct Claim {
    registry: Arc<Registry>,
    id: Arc<str>,
}

impl Claim {
    /// The session's id.
    pub(crate) const fn id(&self) -> &Arc<str> {
        &self.id
    }

    /// The session has begun; it ends at once where all are to end.
    pub(crate) fn fill(&self, session: &Arc<Shared>) {
        let mut inner = self.registry.lock();
        inner.sessions.insert(Arc::clone(&self.id), Some(Arc::clone(session)));
        if inner.closed {
            session.stop.store(true, Ordering::Relaxed);
        }
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        self.registry.lock().sessions.remove(&self.id);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_bounded_and_free_again() {
        let registry = Registry::new(2);
        let first = registry.claim(Some(DEFAULT)).unwrap();
        let second = registry.claim(None).unwrap();
        assert_eq!((&**first.id(), &**second.id()), (DEFAULT, "s2"));
        assert!(registry.claim(None).is_none());
        assert!(registry.get(DEFAULT).is_none(), "not begun yet");
        drop(second);
        let third = registry.claim(None).unwrap();
        assert_eq!(&**third.id(), "s3", "an id is not given twice");
        assert_eq!(registry.count(), 2);
        registry.stop_all();
        drop((first, third));
        assert!(registry.claim(None).is_none(), "the server ends");
    }
}
