//! A finished recording for viewers of Foxglove's protocol: its channels, its bytes, its times. They
//! play, pause, seek and choose the speed, all of them together; behind the door of
//! [`crate::foxglove_door`].

mod transport;

use std::collections::{BTreeMap, VecDeque};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use foxglove::websocket::{
    Capability, ChannelView, Client, PlaybackCommand, PlaybackControlRequest, PlaybackState,
    PlaybackStatus, ServerListener, Status,
};
use foxglove::{
    ChannelBuilder, Context, FoxgloveError, RawChannel, Schema, WebSocketServer,
    WebSocketServerHandle,
};
use recording::{MOST_LATCHED, PlayedChannel, PlayedMessage, Player, RecordingError};
use tokio::runtime;
use tractrix_core::Time;

use self::transport::{SPEEDS, Transport};
use crate::failure::Failure;
use crate::foxglove_door::{Door, nanoseconds, stamp};

/// Messages on their way to a viewer; of more the oldest are lost to it.
const BACKLOG: usize = 4096;
/// Viewers are told the time this often at most, and a pause is looked at so often (wall time).
const TIME_PERIOD: Duration = Duration::from_millis(20);
const LOOK: Duration = Duration::from_millis(100);
/// Messages between two looks at what viewers ask.
const BATCH: usize = 256;
/// Viewers hear of a seek before they get what is there.
const SETTLE: Duration = Duration::from_millis(20);

/// What viewers and the player's thread share.
struct Deck {
    start: Instant,
    inner: Mutex<Inner>,
    asked: Condvar,
    /// By their numbers in the file; true: latched.
    channels: BTreeMap<u16, (Arc<RawChannel>, bool)>,
    /// Set when it has started.
    server: OnceLock<WebSocketServerHandle>,
}

struct Inner {
    transport: Transport,
    /// Where to, when a viewer has asked.
    seek: Option<Time>,
    /// What is to be seen now: of each channel its last message, of latched ones all.
    seen: BTreeMap<u16, VecDeque<PlayedMessage>>,
    /// The last message has been told.
    has_ended: bool,
}

/// Serves a recording on 127.0.0.1 until `stop`; port 0 takes a free one. Pages of these origins may
/// show it, beside those of this computer and Foxglove's own.
///
/// # Errors
/// [`Failure::Input`]: no finished recording, or a port that is taken; [`Failure::Work`]: the file
/// cannot be read any more.
pub(crate) fn serve(
    file: &Path,
    port: u16,
    pages: Vec<String>,
    runtime: &runtime::Handle,
    stop: &AtomicBool,
) -> Result<(), Failure> {
    let mut player = Player::open(file)?;
    let door = Door::open(port)?;
    let context = Context::new();
    let span = player.span();
    let deck = Arc::new(Deck::new(&context, &player).map_err(Failure::work)?);
    let server = WebSocketServer::new()
        .name("tractrix")
        .context(&context)
        .capabilities([Capability::Time])
        .playback_time_range(nanoseconds(span[0]), nanoseconds(span[1]))
        .listener(Arc::clone(&deck) as Arc<dyn ServerListener>)
        .message_backlog_size(BACKLOG);
    let server = door.start(server, runtime)?;
    let server = deck.server.get_or_init(|| server);
    door.let_in(server, pages, runtime)?;
    let played = deck.play(&mut player, server, stop);
    if let Err(why) = &played {
        server.publish_status(Status::error(why.to_string()));
    }
    played.map_err(|why| Failure::from(why).under_way())
}

impl Deck {
    fn new(context: &Arc<Context>, player: &Player) -> Result<Self, FoxgloveError> {
        let open = |channel: PlayedChannel| {
            let builder = ChannelBuilder::new(channel.topic).context(context);
            let builder = builder.message_encoding(&channel.encoding);
            let schema = channel.schema.map(|(name, kind, text)| Schema::new(name, kind, text));
            Ok((channel.id, (builder.schema(schema).build_raw()?, channel.is_latched)))
        };
        let channels: Result<_, FoxgloveError> = player.channels().into_iter().map(open).collect();
        let transport = Transport::new(player.span());
        let seek = Some(player.span()[0]);
        let inner = Inner { transport, seek, seen: BTreeMap::new(), has_ended: false };
        #[expect(clippy::disallowed_methods, reason = "viewers live in wall time")]
        let start = Instant::now();
        let (inner, asked, channels) = (Mutex::new(inner), Condvar::new(), channels?);
        Ok(Self { start, inner, asked, channels, server: OnceLock::new() })
    }

    /// Tells viewers what is due, until `stop`.
    fn play(
        &self,
        player: &mut Player,
        server: &WebSocketServerHandle,
        stop: &AtomicBool,
    ) -> Result<(), RecordingError> {
        let mut next = None;
        let mut told: Option<(Duration, Time)> = None;
        while !stop.load(Ordering::Relaxed) {
            let seek = self.lock().seek.take();
            if let Some(to) = seek {
                #[expect(clippy::disallowed_methods, reason = "viewers live in wall time")]
                std::thread::sleep(SETTLE);
                let seen = player.seek(to)?;
                next = player.next_message()?;
                self.show(seen);
                continue;
            }
            let mut inner = self.lock();
            let now = inner.transport.now(self.wall());
            let mut left = BATCH;
            while inner.seek.is_none() && left > 0 {
                let Some(message) = next.take_if(|m: &mut PlayedMessage| m.time <= now) else {
                    break;
                };
                self.tell(&mut inner, message);
                next = player.next_message()?;
                left -= 1;
            }
            let wall = self.wall();
            // One that stands is told once
            if told.is_none_or(|(at, time)| time != now && wall.saturating_sub(at) >= TIME_PERIOD) {
                told = Some((wall, now));
                server.broadcast_time(nanoseconds(now));
            }
            if next.is_none() && inner.transport.is_at_end(wall) && !inner.has_ended {
                inner.has_ended = true;
                inner.transport.pause(wall);
                server.broadcast_playback_state(inner.state(wall, false));
            }
            let due = next.as_ref().and_then(|m| inner.transport.until(m.time, wall));
            let wait = if left == 0 { Duration::ZERO } else { due.unwrap_or(LOOK).min(LOOK) };
            if !wait.is_zero() && inner.seek.is_none() {
                // Whoever is poisoned has said so
                drop(self.asked.wait_timeout(inner, wait));
            }
        }
        Ok(())
    }

    /// After a seek: what is to be seen there, to everybody.
    fn show(&self, seen: Vec<PlayedMessage>) {
        let mut inner = self.lock();
        if inner.seek.is_none() {
            inner.seen.clear();
            seen.into_iter().for_each(|message| self.tell(&mut inner, message));
        }
    }

    /// Hands a message to the viewers that want its channel, and keeps it for those who come late.
    fn tell(&self, inner: &mut Inner, message: PlayedMessage) {
        let Some((channel, is_latched)) = self.channels.get(&message.channel) else { return };
        channel.log_with_meta(&message.data, stamp(message.time));
        let seen = inner.seen.entry(message.channel).or_default();
        if seen.len() >= if *is_latched { MOST_LATCHED } else { 1 } {
            seen.pop_front();
        }
        seen.push_back(message);
    }

    fn wall(&self) -> Duration {
        self.start.elapsed()
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Inner {
    fn state(&self, wall: Duration, did_seek: bool) -> PlaybackState {
        let status = match (self.transport.is_playing(), self.has_ended) {
            (true, _) => PlaybackStatus::Playing,
            (false, true) => PlaybackStatus::Ended,
            (false, false) => PlaybackStatus::Paused,
        };
        PlaybackState {
            status,
            current_time: nanoseconds(self.transport.now(wall)),
            playback_speed: self.transport.speed() as f32,
            did_seek,
            request_id: None,
        }
    }
}

impl ServerListener for Deck {
    fn on_client_connect(&self) {
        if let Some(server) = self.server.get() {
            let state = self.lock().state(self.wall(), false);
            server.broadcast_time(state.current_time);
            server.broadcast_playback_state(state);
        }
    }

    /// A viewer that comes late sees what is to be seen now.
    fn on_subscribe(&self, viewer: Client, channel: ChannelView<'_>) {
        let inner = self.lock();
        let wanted = self.channels.iter().find(|(_, (known, _))| known.id() == channel.id());
        let Some((id, (known, _))) = wanted else { return };
        for message in inner.seen.get(id).into_iter().flatten() {
            known.log_with_meta_to_sink(&message.data, stamp(message.time), viewer.sink_id());
        }
    }

    fn on_playback_control_request(&self, asked: PlaybackControlRequest) -> Option<PlaybackState> {
        let mut inner = self.lock();
        let wall = self.wall();
        let speed = f64::from(asked.playback_speed);
        if !inner.transport.set_speed(speed, wall)
            && let Some(server) = self.server.get()
        {
            let (low, high) = SPEEDS.into_inner();
            let why = format!("playback_speed = {speed}: expected {low} to {high}");
            server.publish_status(Status::warning(why));
        }
        let mut seek = asked
            .seek_time
            .map(|to| inner.transport.seek(Time(i64::try_from(to).unwrap_or(i64::MAX)), wall));
        match asked.playback_command {
            PlaybackCommand::Play => {
                // Behind the end again from the start
                if seek.is_none() && inner.transport.is_at_end(wall) {
                    seek = Some(inner.transport.seek(Time::ZERO, wall));
                }
                inner.transport.play(wall);
            }
            PlaybackCommand::Pause => inner.transport.pause(wall),
        }
        if seek.is_some() {
            inner.seek = seek;
            inner.has_ended = false;
        }
        let state = inner.state(wall, seek.is_some());
        drop(inner);
        self.asked.notify_one();
        Some(state)
    }
}
