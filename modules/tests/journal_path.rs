//! A module with a journal takes nothing from the heap for it, once it is warm: for ticks, readings of the clock,
//! publishing, receiving, commands and their replies, writing a stream and reading it.
//!
//! The module runs on a thread of this process; only that thread counts. One test, as a process has one output.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[path = "../../benches/src/counting.rs"]
pub mod counting;

use counting::{CountingHeap, heap_uses};
use rohrpost_config::Installation;
use rohrpost_mailbox::{Name, Node, StreamId, node_directory};
use rohrpost_modules::call::Caller;
use rohrpost_modules::interface::Proxy;
use rohrpost_modules::interfaces::{DriveError, Motor, MotorInterface, MotorProxy};
use rohrpost_modules::journal::JOURNAL_NUMBER;
use rohrpost_modules::runtime::{Context, Rate, Received, Start, Stream, Subscription, ToolLink, run_started};
use rohrpost_modules::types::{Pose, Twist};
use rohrpost_modules::{Module, ModuleError, interface};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Uses of the heap by the module's thread, as it knew at its last tick.
static USES: AtomicU64 = AtomicU64::new(0);
static TICKS: AtomicU64 = AtomicU64::new(0);
static RECEIVED: AtomicU64 = AtomicU64::new(0);

#[global_allocator]
static HEAP: CountingHeap = CountingHeap;

/// Knows where it hangs.
#[interface(class = "crane", crate = rohrpost_modules::macro_support)]
trait Crane {
    /// Where its hook hangs.
    #[stream(1)]
    fn hook() -> Pose;
}

struct Wheels {
    own: Subscription<Twist>,
    hook: Stream<Pose>,
    before_ns: u64,
    told: Twist,
}

impl Module for Wheels {
    type Settings = toml::Table;
    type Interfaces = (MotorInterface, CraneInterface);

    fn new(_: toml::Table, context: &mut Context) -> Result<Self, ModuleError> {
        context.set_period(Duration::from_millis(1));
        let own = context.subscribe(MotorInterface::MOTION, "motor.0", Rate::Each)?;
        let hook = context.stream(CraneInterface::HOOK, "crane.0")?;
        Ok(Self { own, hook, before_ns: 0, told: Twist::default() })
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        USES.store(heap_uses(), Ordering::Relaxed);
        TICKS.fetch_add(1, Ordering::Relaxed);
        context.publish_now(MotorInterface::MOTION, &self.told)?;
        let now_ns = context.now().ns;
        context.write(CraneInterface::HOOK, now_ns, &Pose::default())?;
        let newest = self.hook.newest()?.map(|record| record.stamp_ns());
        assert_eq!(newest, Some(now_ns));
        let _ = self.hook.try_next()?;
        let _ = self.hook.at(self.before_ns.midpoint(now_ns))?;
        self.before_ns = now_ns;
        Ok(())
    }

    fn received(&mut self, _: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        RECEIVED.fetch_add(data.read(&self.own)?.is_some().into(), Ordering::Relaxed);
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
        Ok(())
    }
}

const CONFIG: &str = r#"
installation = "journal-PID"
[system]
name = "robot"
id = 1
[classes]
motor = { id = 100, text = "Drives" }
crane = { id = 101, text = "Lifts" }
logd = { id = 24, text = "Records" }
tool = { id = 16, text = "By hand" }
[nodes.main]
[[module]]
name = "motor.0"
aliases = ["crane.0"]
program = "motor"
optional = true
[[module]]
name = "logd.0"
builtin = "logd"
[record]
directory = "."
exact = ["motor.0"]
"#;
const MOTOR: Name = Name::new(1, 100, 0, 0);

/// Calls, until there were so many ticks and so many data received.
fn work(motor: &MotorProxy, times: u64) {
    let began = Instant::now();
    let [ticks, received] = [&TICKS, &RECEIVED].map(|count| count.load(Ordering::Relaxed) + times);
    while TICKS.load(Ordering::Relaxed) < ticks || RECEIVED.load(Ordering::Relaxed) < received {
        motor.drive(0.5, 0.25).unwrap();
        assert!(began.elapsed() < Duration::from_secs(60), "it does not tick, or receives nothing");
    }
}

#[test]
fn a_journal_does_not_touch_the_heap() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("journal.toml");
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
    let motor = MotorProxy::new(&Caller::from(tool.link), MOTOR).with_timeout(Duration::from_secs(5));
    work(&motor, 1000);
    let id = StreamId { name: MOTOR, number: JOURNAL_NUMBER };
    let written = || node.inspect_stream(id).unwrap().unwrap().written;
    let (uses, pieces) = (USES.load(Ordering::Relaxed), written());
    assert!(uses > 0 && pieces > 0, "it counts");
    work(&motor, 2000);
    assert_eq!(USES.load(Ordering::Relaxed) - uses, 0, "uses of the heap after warming up");
    assert!(written() > pieces + 50, "{} records of the journal", written() - pieces);
    // The module's thread ends with the process; its node is nobody's then.
    let _ = std::fs::remove_dir_all(path);
}
