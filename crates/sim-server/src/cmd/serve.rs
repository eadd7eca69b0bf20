//! `serve`: the server without a run; sessions are asked for over HTTP.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use clap::Parser;
use clap::builder::RangedU64ValueParser;

use crate::dashboard::{self, AccessArgs, Dashboard, Hub, Metrics};
use crate::failure::Failure;
use crate::output;
use crate::run_folder::RunFolder;
use crate::session::Registry;

/// Serves sessions that are asked for over HTTP, and the runs that they leave.
#[derive(Debug, Parser)]
pub(crate) struct Args {
    /// Port; 0 takes a free one.
    #[arg(long, default_value_t = 8080, value_parser = RangedU64ValueParser::<u16>::new())]
    port: u16,
    /// Sessions at once, at most (1 to 64). Each drives in a thread of its own.
    #[arg(long, default_value_t = 8, value_name = "N", value_parser = RangedU64ValueParser::<usize>::new().range(1..=64))]
    sessions: usize,
    /// A session that nobody has asked for, nor looked at, for so long is ended, with its summary.
    #[arg(long, default_value_t = 86_400, value_name = "S", value_parser = RangedU64ValueParser::<u64>::new().range(1..=31_536_000))]
    session_idle_s: u64,
    /// Folder of the runs: each has one of its own in it.
    #[arg(long, default_value = "runs", value_name = "DIR")]
    runs: PathBuf,
    /// Folder whose roads, trucks and recordings scenarios from outside may name; otherwise they
    /// may name what is built in.
    #[arg(long, value_name = "DIR")]
    assets: Option<PathBuf>,
    #[command(flatten)]
    access: AccessArgs,
}

/// Sessions have this time to write their summaries.
const LONGEST_END: Duration = Duration::from_secs(60);
/// How often they are looked for.
const LOOK: Duration = Duration::from_millis(20);
/// How often those are looked for that nobody wants any more.
const IDLE_LOOK: Duration = Duration::from_millis(500);

/// Runs the command: until a signal.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    if let Some(assets) = args.assets.as_ref().filter(|assets| !assets.is_dir()) {
        return Err(Failure::Input(format!("--assets {}: not a folder", assets.display())));
    }
    let access = args.access.read()?;
    let listener = dashboard::bind(&access, args.port)?;
    let address = listener.local_addr().map_err(Failure::work)?;
    let sessions = Registry::new(args.sessions);
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .map_err(Failure::work)?;
    let hub = Hub::new(
        sessions.clone(),
        Metrics::new(),
        RunFolder::Of(args.runs.clone()),
        args.assets.clone(),
        access,
    );
    runtime.spawn(Dashboard::new(listener, Arc::clone(&hub)).serve());
    runtime.spawn(end_idle(Arc::clone(&sessions), Duration::from_secs(args.session_idle_s)));
    output::note(&format!("serving: http://{address}  (Ctrl-C ends it)"));
    runtime.block_on(async {
        crate::signals::stop_signal().await;
        sessions.stop_all();
        let ended = async {
            while sessions.count() > 0 {
                tokio::time::sleep(LOOK).await;
            }
        };
        tokio::select! {
            _ = tokio::time::timeout(LONGEST_END, ended) => {}
            _ = crate::signals::stop_signal() => {}
        }
        hub.end().await;
    });
    runtime.shutdown_background();
    match sessions.count() {
        0 => Ok(()),
        left => Err(Failure::Work(format!("{left} sessions did not end in time"))),
    }
}

/// Ends sessions that nobody wants any more, until the runtime ends.
async fn end_idle(sessions: Arc<Registry>, longest: Duration) {
    loop {
        tokio::time::sleep(IDLE_LOOK).await;
        for session in sessions.stop_idle(longest) {
            let (id, after_s) = (session.id(), longest.as_secs());
            output::note(&format!("session {id}: ended, nobody asked for it for {after_s} s"));
        }
    }
}
