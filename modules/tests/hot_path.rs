//! A module's thread takes nothing from the heap, once it is warm, for: a command and its answer, publishing to
//! subscribers, receiving data of a plain type, writing to a stream, reading one by its newest record, one by one and
//! at a time, following one, and reading from a descriptor that it watches. (Data with a `Vec` inside, such as scans,
//! allocate that in decoding; output lines allocate their text.)
//!
//! The module runs on a thread of this process; only that thread counts. One test, as a process has one output.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[path = "../../benches/src/counting.rs"]
pub mod counting;

use counting::{CountingHeap, heap_uses};
use rohrpost_config::Installation;
use rohrpost_mailbox::{Interest, Name, Next, Node, Ready, node_directory};
use rohrpost_modules::call::CallError;
use rohrpost_modules::interfaces::{DriveError, Motor, MotorInterface, MotorProxy};
use rohrpost_modules::runtime::{
    Context, Rate, Received, Start, Stream, StreamSubscription, Subscription, ToolLink, run_started,
};
use rohrpost_modules::types::{Pose, Twist};
use rohrpost_modules::{Module, ModuleError, interface};
use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Uses of the heap by the module's thread, as it knew at its last tick.
static USES: AtomicU64 = AtomicU64::new(0);
static RECEIVED: AtomicU64 = AtomicU64::new(0);
static TICKS: AtomicU64 = AtomicU64::new(0);
/// Records of the stream that came one by one, those that the module was given, and values looked up by time.
static RECORDS: AtomicU64 = AtomicU64::new(0);
static FOLLOWED: AtomicU64 = AtomicU64::new(0);
static LOOKED_UP: AtomicU64 = AtomicU64::new(0);
/// Bytes written to the module's descriptor, and those that it read.
static WRITTEN: AtomicU64 = AtomicU64::new(0);
static READ: AtomicU64 = AtomicU64::new(0);
static FAR: Mutex<Option<UnixStream>> = Mutex::new(None);

#[global_allocator]
static HEAP: CountingHeap = CountingHeap;

/// Knows where it hangs.
#[interface(class = "crane", crate = rohrpost_modules::macro_support)]
trait Crane {
    /// Where its hook hangs.
    #[stream(1)]
    fn hook() -> Pose;
}

/// Publishes what it is told, and follows itself: so it is publisher, subscriber and server at once, of data and of a
/// stream.
struct Wheels {
    own: Subscription<Twist>,
    each: StreamSubscription<Pose>,
    hook: Stream<Pose>,
    /// Stamp of the record before, ns.
    before_ns: u64,
    told: Twist,
    port: UnixStream,
}

impl Module for Wheels {
    type Settings = toml::Table;
    type Interfaces = (MotorInterface, CraneInterface);

    fn new(_: toml::Table, context: &mut Context) -> Result<Self, ModuleError> {
        context.set_period(Duration::from_millis(1));
        // Both kinds of subscription: each value, and periodic.
        let own = context.subscribe(MotorInterface::MOTION, "motor.0", Rate::Each)?;
        let _ = context.subscribe(MotorInterface::MOTION, "motor.0", Rate::Every(Duration::from_millis(2)))?;
        let each = context.subscribe_stream(CraneInterface::HOOK, "crane.0")?;
        let hook = context.stream(CraneInterface::HOOK, "crane.0")?;
        let (far, port) = UnixStream::pair()?;
        context.watch(&port, Interest::Read)?;
        *FAR.lock().unwrap() = Some(far);
        Ok(Self { own, each, hook, before_ns: 0, told: Twist::default(), port })
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        USES.store(heap_uses(), Ordering::Relaxed);
        TICKS.fetch_add(1, Ordering::Relaxed);
        context.publish_now(MotorInterface::MOTION, &self.told)?;
        let now_ns = context.now().ns;
        context.write(CraneInterface::HOOK, now_ns, &Pose { x_m: self.told.speed_m_s, ..Pose::default() })?;
        let newest = self.hook.newest()?.map(|record| record.stamp_ns());
        assert_eq!(newest, Some(now_ns));
        while let Next::Record(record) = self.hook.try_next()? {
            assert_eq!((record.stamp_ns(), record.read()?.x_m), (now_ns, self.told.speed_m_s));
            RECORDS.fetch_add(1, Ordering::Relaxed);
        }
        let between = self.hook.at(self.before_ns.midpoint(now_ns))?;
        LOOKED_UP.fetch_add(between.is_ok().into(), Ordering::Relaxed);
        self.before_ns = now_ns;
        Ok(())
    }

    fn ready(&mut self, _: &mut Context, _: Ready) -> Result<(), ModuleError> {
        READ.fetch_add(self.port.read(&mut [0; 16])? as u64, Ordering::Relaxed);
        Ok(())
    }

    fn received(&mut self, _: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        if data.read(&self.own)?.is_some() {
            RECEIVED.fetch_add(1, Ordering::Relaxed);
        }
        FOLLOWED.fetch_add(data.read(&self.each)?.is_some().into(), Ordering::Relaxed);
        Ok(())
    }
}

impl Crane for Wheels {}

impl Motor for Wheels {
    fn drive(&mut self, speed_m_s: f64, turn_rate_rad_s: f64) -> Result<(), DriveError> {
        self.told = Twist { speed_m_s, turn_rate_rad_s };
        Ok(())
    }

    fn halt(&mut self) -> Result<(), DriveError> {
        Err(DriveError::NotFinite)
    }
}

const CONFIG: &str = r#"
installation = "hot-PID"
[system]
name = "robot"
id = 1
[classes]
motor = { id = 100, text = "Drives" }
crane = { id = 101, text = "Lifts" }
tool = { id = 16, text = "By hand" }
[nodes.main]
[[module]]
name = "motor.0"
aliases = ["crane.0"]
program = "motor"
optional = true
spin = "10 us"
"#;
const MOTOR: Name = Name::new(1, 100, 0, 0);

/// Calls, until there were so many ticks and so many data received.
fn work(motor: &MotorProxy, ticks: u64, received: u64) {
    let (began, mut moves) = (Instant::now(), None);
    let (ticks_then, received_then) = (TICKS.load(Ordering::Relaxed), RECEIVED.load(Ordering::Relaxed));
    while TICKS.load(Ordering::Relaxed) < ticks_then + ticks
        || RECEIVED.load(Ordering::Relaxed) < received_then + received
        || READ.load(Ordering::Relaxed) + 50 < WRITTEN.load(Ordering::Relaxed)
    {
        motor.drive(0.5, 0.25).unwrap();
        let written = FAR.lock().unwrap().as_mut().unwrap().write(b"x").unwrap();
        WRITTEN.fetch_add(written as u64, Ordering::Relaxed);
        assert!(matches!(motor.halt(), Err(CallError::Module(_, DriveError::NotFinite))));
        // There is none before the first tick.
        moves = motor.motion().ok();
        assert!(began.elapsed() < Duration::from_secs(60), "it does not tick, or receives nothing");
    }
    assert_eq!(moves.map(|(_, twist)| twist), Some(Twist { speed_m_s: 0.5, turn_rate_rad_s: 0.25 }));
}

#[test]
fn a_modules_thread_does_not_touch_the_heap() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("hot.toml");
    std::fs::write(&file, CONFIG.replace("PID", &std::process::id().to_string())).unwrap();
    let installation = Arc::new(Installation::load(&file).unwrap());
    let start = Start { installation: installation.clone(), name: MOTOR, launcher: None, restarts: 0, off: false };
    let module = std::thread::spawn(move || run_started::<Wheels>(start));

    let path = node_directory(&installation.name, "main");
    let node = Node::create(&path, 0o700).unwrap();
    let mut tool = ToolLink::join(&installation, &node, "main", Duration::from_secs(5)).unwrap();
    let began = Instant::now();
    while tool.status(MOTOR).is_err() {
        assert!(began.elapsed() < Duration::from_secs(60) && !module.is_finished(), "it does not start");
        std::thread::yield_now();
    }
    let link = rohrpost_modules::call::Caller::from(tool.link);
    let motor =
        <MotorProxy as rohrpost_modules::interface::Proxy>::new(&link, MOTOR).with_timeout(Duration::from_secs(5));
    // Longer than a renewal of the subscriptions takes to come.
    work(&motor, 1500, 1000);
    let before = USES.load(Ordering::Relaxed);
    assert!(before > 0, "it counts");
    work(&motor, 3000, 2000);
    assert_eq!(USES.load(Ordering::Relaxed) - before, 0, "uses of the heap after warming up");
    for (count, what) in [(&RECORDS, "one by one"), (&FOLLOWED, "followed"), (&LOOKED_UP, "looked up by time")] {
        assert!(count.load(Ordering::Relaxed) > 3000, "records {what}: {count:?}");
    }
    // The module's thread ends with the process; its node is nobody's then.
    let _ = std::fs::remove_dir_all(path);
}
