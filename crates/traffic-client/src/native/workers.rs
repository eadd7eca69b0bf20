//! The pieces of a tick, which may be done at once.
//!
//! The fleet is cut into pieces of [`PIECE`] vehicles, whoever does them: what a piece gives depends
//! on the state at its start only, and pieces are put together in their order. So every number of
//! threads gives the same bits. Threads themselves are the caller's: [`Workers`] is an argument.

use std::fmt::Debug;
use std::ops::Range;

/// Vehicles of a piece.
pub(super) const PIECE: usize = 4096;

/// Work that does not depend on that of other pieces.
pub type Piece<'a> = Box<dyn FnOnce() + Send + 'a>;

/// Does pieces of work.
pub trait Workers: Debug + Send + Sync {
    /// Does every piece once, in any order and on any number of threads, and returns when all are
    /// done.
    fn run<'a>(&self, pieces: Vec<Piece<'a>>);
}

/// One piece after the other, on the thread of the caller.
#[derive(Debug, Clone, Copy, Default)]
pub struct InTurn;

impl Workers for InTurn {
    fn run<'a>(&self, pieces: Vec<Piece<'a>>) {
        for piece in pieces {
            piece();
        }
    }
}

/// Does `work` with every item and its number; results in the order of the items. A single item is
/// done where it is.
pub(super) fn in_pieces<T: Send, R: Send>(
    workers: &dyn Workers,
    items: impl Iterator<Item = T>,
    work: impl Fn(usize, T) -> R + Sync,
) -> Vec<R> {
    let items: Vec<T> = items.collect();
    if items.len() <= 1 {
        return items.into_iter().map(|item| work(0, item)).collect();
    }
    let mut results: Vec<Option<R>> = items.iter().map(|_| None).collect();
    let work = &work;
    let pieces = items.into_iter().zip(&mut results).enumerate();
    let pieces = pieces.map(|(k, (item, result))| -> Piece<'_> {
        Box::new(move || *result = Some(work(k, item)))
    });
    workers.run(pieces.collect());
    results.into_iter().flatten().collect()
}

/// Ranges of `piece` out of one.
pub(super) fn ranges(of: Range<usize>, piece: usize) -> impl Iterator<Item = Range<usize>> {
    of.clone().step_by(piece).map(move |from| from..of.end.min(from + piece))
}
