//! Streams of the modules that come with Rohrpost: the simulated robot's pictures and points, a log's records with
//! their own times, and a map that is drawn from scans and interpolated odometry.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_builtin as builtin;
use rohrpost_mailbox::{Name, Next, Participant, StreamId, StreamReader};
use rohrpost_modules::interfaces::{CartographerProxy, MapCounts, PlayerProxy, Progress};
use rohrpost_modules::types::{ImageView, PointCloudView, Pose};
use rohrpost_robot::camera::{CAMERA, SimulatedCamera};
use rohrpost_robot::depth::{DEPTH_SENSOR, SimulatedDepth};
use rohrpost_robot::world::World;
use support::{Place, wait};

#[path = "../../tests/support/mod.rs"]
pub mod support;

const MAP: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/building.map");
const CONFIG: &str = r#"
installation = "robot-streams-NUMBER"
[system]
name = "robot"
id = 1
[classes]
motor = { id = 200, text = "Drives" }
player = { id = 170, text = "Plays" }
odometry = { id = 160, text = "Counts" }
laser = { id = 150, text = "Sees" }
camera = { id = 112, text = "Sees pictures" }
depth = { id = 104, text = "Sees points" }
mapper = { id = 96, text = "Draws" }
tool = { id = 16, text = "By hand" }
[nodes.main]
[time]
source = "simulation"
"#;

impl Place {
    /// With these built-in modules, in this order, and this log.
    fn with(modules: &str, log: &str) -> Self {
        Self::new(&(CONFIG.to_owned() + modules), &[("robot.log", log.as_bytes())])
    }

    /// Begins a module on a thread of this process, and waits until it is on.
    fn start(&self, module: &str, builtin: &'static str) {
        let name = self.name(module);
        let start = self.start_of(name);
        std::thread::spawn(move || builtin::run(builtin, start).unwrap().unwrap());
        self.wait_until_on(name, || ());
    }

    /// The stream of number 1, from its first record on.
    fn stream(&self, module: &str) -> StreamReader {
        let participant = Participant::join(&self.node, Name::new(1, 16, 99, 0)).unwrap();
        let mut reader = participant.stream_reader(StreamId { name: self.name(module), number: 1 }).unwrap();
        reader.seek(0);
        reader
    }
}

/// The newest record, and whether there are several.
fn newest<R>(reader: &mut StreamReader, look: impl Fn(&[u8]) -> R) -> R {
    wait("it writes records", || {
        let record = reader.newest().unwrap()?;
        (record.info().sequence >= 2).then(|| look(record.body()))
    })
}

#[test]
fn the_simulated_robot_writes_what_it_sees_and_only_under_the_names_that_it_has() {
    let sim = |name: &str, aliases: &str| {
        format!(
            "[[module]]\nname = \"{name}\"\naliases = [{aliases}]\nbuiltin = \"sim\"\n\
             settings = {{ map = \"{MAP}\", camera-rate-hz = 50, depth-rate-hz = 50 }}\n"
        )
    };
    let all = sim("motor.0", r#""odometry.0", "laser.0", "camera.0", "depth.0""#);
    let sizes = "[module.stream.image]\nrecord = \"1 MiB\"\n[module.stream.points]\nrecord = \"2500 KiB\"\nkeep = 4\n";
    let place = Place::with(&(all + sizes + &sim("motor.1", r#""odometry.1", "laser.1""#)), "");
    place.start("motor.0", "sim");
    place.start("motor.1", "sim");
    // It stands where the map says.
    let world = World::parse(&std::fs::read_to_string(MAP).unwrap()).unwrap();
    let mut camera = SimulatedCamera::new(CAMERA);
    let mut pixels = vec![0; camera.image().raw_bytes() as usize];
    camera.render(&world, &world.start(), &mut pixels);
    newest(&mut place.stream("camera.0"), |body| {
        let image: ImageView<'_> = postcard::from_bytes(body).unwrap();
        image.check().unwrap();
        assert_eq!((image.width_px, image.height_px), (640, 480));
        assert!(*image.pixels == pixels, "another picture");
    });
    let mut depth = SimulatedDepth::new(DEPTH_SENSOR);
    let mut points = vec![0; depth.cloud().raw_bytes() as usize];
    depth.look(&world, &world.start(), &mut points);
    newest(&mut place.stream("depth.0"), |body| {
        let cloud: PointCloudView<'_> = postcard::from_bytes(body).unwrap();
        assert!(cloud.points().unwrap().len() >= 200_000);
        assert!(*cloud.points == points, "other points");
    });
    newest(&mut place.stream("odometry.1"), |_| {});
    assert!(place.stream("camera.1").newest().unwrap().is_none(), "no name, no pictures");
}

#[test]
fn records_too_small_for_what_a_module_writes_are_told_before_it_runs() {
    let sim = |streams: &str| {
        let modules = format!(
            "[[module]]\nname = \"motor.0\"\naliases = [\"odometry.0\", \"laser.0\", \"camera.0\"]\nbuiltin = \"sim\"\n\
             settings = {{ map = \"{MAP}\" }}\n{streams}"
        );
        let place = Place::with(&modules, "");
        builtin::check(&place.installation).into_iter().map(|problem| problem.message).collect::<Vec<String>>()
    };
    assert_eq!(sim("[module.stream.image]\nrecord = \"1 MiB\"\n"), Vec::<String>::new());
    let [told] = &sim("")[..] else { panic!("one problem") };
    let right = "module `motor.0`: stream `image` has records of up to 921625 bytes, and takes 4096; write `record = \
                 \"901 KiB\"` or more in [module.stream.image]";
    assert_eq!(told, right);
}

/// Every half second of the log, and what is 1 m/s; each fourth line stands behind the two after it. Ten scans.
const ODOMETRIES: u32 = 100;
const SCANS: u32 = 10;
const SPEED: u32 = 20;

fn log() -> String {
    let mut lines: Vec<String> =
        (0..ODOMETRIES).map(|n| format!("ODOM {x} 0 0 1 0 0 {x} host 0\n", x = f64::from(n) / 2.0)).collect();
    for four in lines.chunks_exact_mut(4) {
        four[1..].rotate_left(1);
    }
    let scan = |n: u32| format!("FLASER 3 1 2 1 {x} 0 0 0 0 0 {at} host 0\n", x = 20 + n, at = f64::from(n) + 0.25);
    for n in (1..=SCANS).rev() {
        // Behind odometry that is up to 0.75 s later.
        lines.insert(2 * n as usize + 2, scan(n));
    }
    lines.concat()
}

/// How the map came about, how the log was played, and the pose of the last scan.
fn play(pose_from: &str, late: &str) -> (Place, MapCounts, Progress, Pose) {
    let modules = format!(
        "[[module]]\nname = \"mapper.0\"\nbuiltin = \"mapper\"\ncalls = [\"laser.0\", \"odometry.0\"]\n\
         settings = {{ laser = \"laser.0\", odometry = \"odometry.0\", pose-from = \"{pose_from}\" }}\n\
         [[module]]\nname = \"player.0\"\naliases = [\"odometry.0\", \"laser.0\"]\nbuiltin = \"carmen\"\n\
         settings = {{ file = \"robot.log\", speed = {SPEED} }}\n\
         [module.stream.odometry]\nkeep = 256\nlate = \"{late}\"\n[module.stream.scan]\nlate = \"100 ms\"\n"
    );
    let place = Place::with(&modules, &log());
    place.start("mapper.0", "mapper");
    place.start("player.0", "carmen");
    let player: PlayerProxy = place.proxy("player.0");
    let progress = wait("the log ends", || player.progress().ok().filter(|progress| progress.finished));
    let mapper: CartographerProxy = place.proxy("mapper.0");
    let counts = wait("all scans are worked off", || {
        let counts = mapper.counts().ok()?;
        (counts.mapped + counts.without_pose == u64::from(SCANS)).then_some(counts)
    });
    let (_, pose) = mapper.pose().unwrap();
    (place, counts, progress, pose)
}

#[test]
fn records_of_a_log_have_their_own_times_whatever_their_order() {
    let (place, _, progress, _) = play("scan", "100 ms");
    assert_eq!((progress.odometries, progress.late, progress.discarded), (ODOMETRIES.into(), 0, 0));
    let mut stamps_ns = Vec::new();
    let mut reader = place.stream("odometry.0");
    while let Next::Record(record) = reader.try_next().unwrap() {
        stamps_ns.push(record.info().stamp.ns);
    }
    assert!(!stamps_ns.is_sorted(), "written in the order of the log");
    stamps_ns.sort_unstable();
    let step_ns = u64::from(500_000_000 / SPEED);
    assert_eq!(stamps_ns.len(), ODOMETRIES as usize);
    assert!(stamps_ns.windows(2).all(|pair| pair[1] - pair[0] == step_ns), "{stamps_ns:?}");
}

#[test]
fn records_that_their_stream_does_not_take_are_counted() {
    let (_place, _, progress, _) = play("scan", "refuse");
    // Of each four, the one that stands behind two others.
    assert_eq!((progress.late, progress.odometries), (u64::from(ODOMETRIES / 4), u64::from(ODOMETRIES * 3 / 4)));
    assert_eq!(progress.scans, u64::from(SCANS));
}

#[test]
fn scans_are_placed_by_their_own_pose_or_by_odometry_at_their_time() {
    let last = f64::from(SCANS);
    for (pose_from, x_m) in [("scan", 20.0 + last), ("odometry", last + 0.25)] {
        let (_place, counts, _, pose) = play(pose_from, "100 ms");
        assert_eq!((counts.scans, counts.mapped, counts.without_pose), (SCANS.into(), SCANS.into(), 0));
        assert_eq!(counts.odometries, u64::from(ODOMETRIES));
        assert!((pose.x_m - x_m).abs() < 1e-6, "{pose_from}: {} m and not {x_m} m", pose.x_m);
    }
}
