//! What goes out: messages of the run as its recording writes them, at no more than ten times their
//! usual rate in wall time. Of what is above that rate the latest is sent when there is room, so
//! that a run that stands still is seen where it stands. The run never waits.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use recording::{BUS_FRAMES, Listener, TOPICS, Topic, TopicMessage};

/// Messages per second of wall time, as multiples of a topic's usual rate.
const MAX_RATE: f64 = 10.0;
/// Messages at once, at least: the pieces of a long road.
const BURST: f64 = 64.0;
/// Messages on their way to the network.
const QUEUE: usize = 4096;
/// What was held back is looked after this often.
const IDLE: Duration = Duration::from_millis(10);

/// What may be said of a topic now.
struct Allowance {
    topic: Topic,
    messages: f64,
    at: Instant,
    /// The latest message that was held back.
    held: Option<TopicMessage>,
}

impl Allowance {
    fn take(&mut self, now: Instant) -> bool {
        let rate_hz = f64::from(self.topic.usual_rate_hz);
        let gained = MAX_RATE * rate_hz * now.saturating_duration_since(self.at).as_secs_f64();
        self.messages = (self.messages + gained).min(BURST.max(rate_hz));
        self.at = now;
        let may = self.messages >= 1.0;
        if may {
            self.messages -= 1.0;
        }
        may
    }
}

/// The run's side.
#[derive(Clone)]
pub(crate) struct Feed {
    allowances: Arc<Mutex<Vec<Allowance>>>,
    queue: SyncSender<TopicMessage>,
    dropped: Arc<AtomicU64>,
}

/// The network's side.
pub(crate) struct Outlet {
    feed: Feed,
    queued: Receiver<TopicMessage>,
}

/// A feed and its outlet.
pub(crate) fn feed(now: Instant) -> (Feed, Outlet) {
    let full = |topic: Topic| BURST.max(f64::from(topic.usual_rate_hz));
    let allowances = TOPICS.into_iter().chain([BUS_FRAMES]).map(|topic| Allowance {
        topic,
        messages: full(topic),
        at: now,
        held: None,
    });
    let (queue, queued) = sync_channel(QUEUE);
    let allowances = Arc::new(Mutex::new(allowances.collect()));
    let feed = Feed { allowances, queue, dropped: Arc::default() };
    (feed.clone(), Outlet { feed, queued })
}

impl Feed {
    /// What a recording calls for each message.
    pub(crate) fn listener(&self) -> Listener {
        let feed = self.clone();
        #[expect(clippy::disallowed_methods, reason = "rates are limited in wall time")]
        Box::new(move |_, message| feed.say(message, Instant::now()))
    }

    /// Messages that the network was too slow for.
    pub(crate) fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }

    fn say(&self, message: &TopicMessage, now: Instant) {
        let mut allowances = self.allowances();
        let Some(allowance) = allowances.iter_mut().find(|a| a.topic == message.topic) else {
            return;
        };
        if allowance.take(now) {
            match self.queue.try_send(message.clone()) {
                Ok(()) => {
                    allowance.held = None;
                    return;
                }
                Err(_) => {
                    self.dropped.fetch_add(1, Ordering::Relaxed);
                }
            }
        }
        match &mut allowance.held {
            Some(held) => held.cdr.clone_from(&message.cdr),
            none => *none = Some(message.clone()),
        }
    }

    fn allowances(&self) -> MutexGuard<'_, Vec<Allowance>> {
        self.allowances.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Outlet {
    /// The next messages: one that waits, or after a moment without any what was held back. `None`
    /// once there is nobody left who could say anything: the outlet holds a sender itself, so this
    /// is the caller's to find out.
    pub(crate) fn next(&self, now: impl Fn() -> Instant) -> Vec<TopicMessage> {
        match self.queued.recv_timeout(IDLE) {
            Ok(message) => vec![message],
            Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {
                let now = now();
                let mut allowances = self.feed.allowances();
                let held = allowances.iter_mut().filter(|a| a.held.is_some());
                held.filter_map(|a| if a.take(now) { a.held.take() } else { None }).collect()
            }
        }
    }
}

/// The time that a message of `/clock` says, ns.
pub(crate) fn clock_ns(message: &TopicMessage) -> Option<i64> {
    if message.topic.name != "/clock" {
        return None;
    }
    let sec = message.cdr.get(4..8)?.try_into().ok().map(i32::from_le_bytes)?;
    let nanosec = message.cdr.get(8..12)?.try_into().ok().map(u32::from_le_bytes)?;
    Some(i64::from(sec) * 1_000_000_000 + i64::from(nanosec))
}

#[cfg(test)]
#[expect(clippy::disallowed_methods, reason = "an instant to count from")]
mod tests {
    use super::*;

    fn clock(tick: u32) -> TopicMessage {
        let topic = *TOPICS.iter().find(|t| t.name == "/clock").unwrap();
        let mut cdr = vec![0, 1, 0, 0];
        cdr.extend((tick / 100).to_le_bytes());
        cdr.extend((tick % 100 * 10_000_000).to_le_bytes());
        TopicMessage { topic, cdr }
    }

    /// A second of wall time at a hundred times real time: 10,000 ticks go in, no more than ten
    /// times the usual 100 come out, and the last one is among them.
    #[test]
    fn a_fast_run_is_thinned_out_and_its_last_word_is_heard() {
        let start = Instant::now();
        let (feed, outlet) = feed(start);
        let mut heard = Vec::new();
        for tick in 0..10_000 {
            feed.say(&clock(tick), start + Duration::from_micros(100) * tick);
            heard.extend(outlet.queued.try_iter());
        }
        heard.extend(outlet.next(|| start + Duration::from_secs(2)));
        assert!((1_000..=1_101).contains(&heard.len()), "{}", heard.len());
        let times: Vec<i64> = heard.iter().filter_map(clock_ns).collect();
        assert!(times.is_sorted(), "in order");
        assert_eq!(times.last(), Some(&99_990_000_000));
        assert!(outlet.next(|| start + Duration::from_secs(3)).is_empty(), "said once");
    }

    /// In real time nothing is left out, and a network that takes nothing holds nobody up.
    #[test]
    fn a_run_in_real_time_is_heard_whole_and_a_deaf_network_is_counted() {
        let start = Instant::now();
        let (feed, outlet) = feed(start);
        let at = |tick: u32| start + Duration::from_millis(10) * tick;
        for tick in 0..5_000 {
            feed.say(&clock(tick), at(tick));
        }
        assert_eq!(feed.dropped(), 5_000 - QUEUE as u64);
        assert_eq!(outlet.queued.try_iter().count(), QUEUE);
        let last = outlet.next(|| at(5_001));
        assert_eq!(last.iter().filter_map(clock_ns).collect::<Vec<_>>(), [49_990_000_000]);
    }
}
