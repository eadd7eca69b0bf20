//! The recorder of the main job: owned ticks over a bounded channel to the writer's thread.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

use road::Road;
use tractrix_core::{EgoState, Plan, Recorder, Scene, Tick, Time};

use super::bodies::{Combination, ego_markers, neighbour_marker, tractor_pose};
use super::file::{Channel, McapFile};
use super::ros::standard::{
    Clock, Header, MarkerArray, Odometry, Path as RosPath, Pose, PoseStamped, PoseWithCovariance,
    Quaternion, Stamp, TfMessage, Transform, TransformStamped, Twist, TwistWithCovariance, Vector3,
};
use super::ros::truck::{PlanState, Scene as RosScene, SceneVehicle, TruckState};
use crate::failure::Failure;

/// What a recording says about its run.
pub(crate) struct RunHeader {
    /// Name and value: seed, version, revision, start of the run.
    pub(crate) metadata: BTreeMap<String, String>,
    /// The scenario as it was run.
    pub(crate) scenario_toml: String,
    /// The road that was driven.
    pub(crate) road: Arc<Road>,
    /// The ego's lengths.
    pub(crate) combination: Combination,
}

/// Ticks in flight to the writer; the world waits when the writer is this far behind.
const QUEUE_TICKS: usize = 512;
/// Scene, path and markers are recorded at most this often.
const SCENE_PERIOD: Time = Time(100_000_000);
/// Chunks are closed this often (simulated).
const FLUSH_PERIOD: Time = Time(1_000_000_000);

/// One tick on its way to the writer.
struct Record {
    now: Time,
    ego: EgoState,
    /// Without its speed profile, and without its path except at the scene's rate.
    plan: Plan,
    scene: Option<Scene>,
}

/// A recording under way.
pub(crate) struct Recording {
    sender: SyncSender<Record>,
    thread: JoinHandle<Result<McapFile, Failure>>,
    broken: bool,
    scene_due: Time,
}

impl Recording {
    /// Creates the file, writes what is known before the first tick, and starts the writer.
    ///
    /// # Errors
    /// [`Failure::Input`] when the file cannot be created.
    pub(crate) fn create(path: &Path, header: RunHeader) -> Result<Self, Failure> {
        let mut file = McapFile::create(path)?;
        file.metadata("run", header.metadata)?;
        file.attach("scenario.toml", "application/toml", header.scenario_toml.as_bytes())?;
        let mut tracks = Tracks::open(file, header.road, header.combination)?;
        tracks.file.flush()?;
        let (sender, receiver) = sync_channel(QUEUE_TICKS);
        let thread = spawn(move || tracks.run(&receiver))?;
        Ok(Self { sender, thread, broken: false, scene_due: Time::ZERO })
    }

    /// Whether the writer has given up; the run must end, [`Self::finish`] says why.
    pub(crate) const fn is_broken(&self) -> bool {
        self.broken
    }

    /// Waits until everything is written, attaches the summary and closes the file.
    ///
    /// # Errors
    /// [`Failure::Work`] names the file and what went wrong, at whatever tick it did.
    pub(crate) fn finish(self, summary_json: &str) -> Result<(), Failure> {
        drop(self.sender);
        let mut file = self
            .thread
            .join()
            .map_err(|_| Failure::Work("the recording thread panicked".to_owned()))??;
        file.attach("summary.json", "application/json", summary_json.as_bytes())?;
        file.finish()
    }
}

impl Recorder for Recording {
    fn record(&mut self, tick: &Tick<'_>) {
        let scene_due = tick.now >= self.scene_due;
        if scene_due {
            self.scene_due = tick.now.plus_nanos(SCENE_PERIOD.0);
        }
        let p = tick.plan;
        let record = Record {
            now: tick.now,
            ego: *tick.ego,
            plan: Plan {
                path: if scene_due { p.path.clone() } else { Vec::new() },
                speed: Vec::new(),
                guard: p.guard.clone(),
                maneuver: p.maneuver,
                refusal: p.refusal,
                speed_status: p.speed_status,
                reference_speed_m_s: p.reference_speed_m_s,
                target_speed_m_s: p.target_speed_m_s,
                target_accel_m_s2: p.target_accel_m_s2,
                target_d_m: p.target_d_m,
                lateral_error_m: p.lateral_error_m,
                lane: p.lane,
                following: p.following,
                command: p.command,
            },
            scene: scene_due.then(|| tick.scene.clone()),
        };
        if !self.broken {
            self.broken = self.sender.send(record).is_err();
        }
    }
}

#[expect(clippy::disallowed_methods, reason = "the shell owns the writer's thread")]
fn spawn<T: Send + 'static>(
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<JoinHandle<T>, Failure> {
    Ok(std::thread::spawn(work))
}

/// The open topics.
struct Tracks {
    file: McapFile,
    road: Arc<Road>,
    combination: Combination,
    flush_due: Time,
    clock: Channel<Clock>,
    tf: Channel<TfMessage>,
    odometry: Channel<Odometry>,
    truck: Channel<TruckState>,
    plan: Channel<PlanState>,
    path: Channel<RosPath>,
    scene: Channel<RosScene>,
    markers: Channel<MarkerArray>,
}

impl Tracks {
    fn open(
        mut file: McapFile,
        road: Arc<Road>,
        combination: Combination,
    ) -> Result<Self, Failure> {
        Ok(Self {
            clock: file.channel("/clock")?,
            tf: file.channel("/tf")?,
            odometry: file.channel("/odom")?,
            truck: file.channel("/truck/state")?,
            plan: file.channel("/truck/plan")?,
            path: file.channel("/plan/path")?,
            scene: file.channel("/scene")?,
            markers: file.channel("/markers")?,
            file,
            road,
            combination,
            flush_due: FLUSH_PERIOD,
        })
    }

    fn run(mut self, records: &Receiver<Record>) -> Result<McapFile, Failure> {
        while let Ok(record) = records.recv() {
            self.write(&record)?;
            if record.now >= self.flush_due {
                self.flush_due = record.now.plus_nanos(FLUSH_PERIOD.0);
                self.file.flush()?;
            }
        }
        Ok(self.file)
    }

    fn write(&mut self, record: &Record) -> Result<(), Failure> {
        let Record { now, ego, plan, scene } = record;
        let stamp = Stamp::of(*now);
        let header = Header { stamp, frame_id: "map" };
        let pose = tractor_pose(ego, &self.road);
        let grade_rad = self.road.at(ego.s_m, ego.d_m).grade_rad;
        let file = &mut self.file;
        file.write(&self.clock, *now, &Clock { clock: stamp })?;
        file.write(&self.tf, *now, &transforms(stamp, &pose, ego, &self.combination))?;
        file.write(&self.odometry, *now, &odometry(header.clone(), pose, ego))?;
        let truck = TruckState::new(header.clone(), ego, grade_rad, &plan.command);
        file.write(&self.truck, *now, &truck)?;
        file.write(&self.plan, *now, &PlanState::new(header.clone(), plan))?;
        let Some(scene) = scene else { return Ok(()) };
        let poses = plan.path.iter().map(|p| {
            let at = self.road.at(p.s_m, p.d_m);
            let orientation =
                Quaternion::from_yaw_pitch_roll(p.yaw_rad, -at.grade_rad, at.bank_rad);
            let pose = Pose { position: Vector3 { x: p.x_m, y: p.y_m, z: at.z_m }, orientation };
            PoseStamped { header: header.clone(), pose }
        });
        let path = RosPath { header: header.clone(), poses: poses.collect() };
        file.write(&self.path, *now, &path)?;
        let vehicles = scene.neighbours.iter().map(SceneVehicle::from).collect();
        file.write(&self.scene, *now, &RosScene { header: header.clone(), vehicles })?;
        let markers = ego_markers(&header, ego, &self.combination)
            .into_iter()
            .chain(scene.neighbours.iter().map(|n| neighbour_marker(&header, n, &self.road)))
            .collect();
        file.write(&self.markers, *now, &MarkerArray { markers })
    }
}

/// `map` to `base_link` (the reference point) and `base_link` to `trailer` (the hitch, turned by
/// the articulation).
fn transforms(stamp: Stamp, pose: &Pose, ego: &EgoState, c: &Combination) -> TfMessage {
    let hitch = Vector3 { x: c.hitch_m, y: 0.0, z: 0.0 };
    let turned = Quaternion::from_yaw_pitch_roll(ego.trailer.articulation_rad, 0.0, 0.0);
    TfMessage {
        transforms: vec![
            TransformStamped {
                header: Header { stamp, frame_id: "map" },
                child_frame_id: "base_link",
                transform: Transform { translation: pose.position, rotation: pose.orientation },
            },
            TransformStamped {
                header: Header { stamp, frame_id: "base_link" },
                child_frame_id: "trailer",
                transform: Transform { translation: hitch, rotation: turned },
            },
        ],
    }
}

fn odometry(header: Header, pose: Pose, ego: &EgoState) -> Odometry {
    let twist = Twist {
        linear: Vector3 { x: ego.speed_m_s, y: ego.lateral_speed_m_s, z: 0.0 },
        angular: Vector3 { x: 0.0, y: 0.0, z: ego.yaw_rate_rad_s },
    };
    Odometry {
        header,
        child_frame_id: "base_link",
        pose: PoseWithCovariance { pose, covariance: [0.0; 36] },
        twist: TwistWithCovariance { twist, covariance: [0.0; 36] },
    }
}
