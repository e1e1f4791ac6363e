//! What tests of hot paths share: a module on a thread of this process, of which the uses of the heap are counted, once
//! it is warm.

#[path = "../../../benches/src/counting.rs"]
pub mod counting;
#[path = "../support/mod.rs"]
pub mod support;

use counting::{CountingHeap, heap_uses};
use rohrpost_mailbox::Name;
use rohrpost_modules::interface::Proxy;
use rohrpost_modules::interfaces::MotorProxy;
use rohrpost_modules::runtime::run_started;
use rohrpost_modules::types::Pose;
use rohrpost_modules::{Module, interface};
use std::io::Write;
use std::os::unix::net::UnixStream;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use support::{PATIENCE, Place};

#[global_allocator]
static HEAP: CountingHeap = CountingHeap;

/// Uses of the heap by the module's thread, as it knew at its last tick.
static USES: AtomicU64 = AtomicU64::new(0);
static TICKS: AtomicU64 = AtomicU64::new(0);
/// Data that came to the module.
pub static RECEIVED: AtomicU64 = AtomicU64::new(0);
/// Bytes written to the module's descriptor.
static WRITTEN: AtomicU64 = AtomicU64::new(0);
/// Those that it read.
pub static READ: AtomicU64 = AtomicU64::new(0);
static FAR: Mutex<Option<UnixStream>> = Mutex::new(None);

/// The module.
pub const MOTOR: Name = Name::new(1, 100, 0, 0);

const CONFIG: &str = r#"
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
"#;

/// Knows where it hangs.
#[interface(class = "crane", crate = rohrpost_modules::macro_support)]
pub trait Crane {
    /// Where its hook hangs.
    #[stream(1)]
    fn hook() -> Pose;
}

/// The module's tick begins.
pub fn ticks() {
    USES.store(heap_uses(), Ordering::Relaxed);
    TICKS.fetch_add(1, Ordering::Relaxed);
}

/// The module's end of a connection.
pub fn port() -> std::io::Result<UnixStream> {
    let (far, port) = UnixStream::pair()?;
    *FAR.lock().unwrap() = Some(far);
    Ok(port)
}

/// A module that runs. Its thread ends with the process; its node is nobody's then.
pub struct Hosted {
    /// Calls it.
    pub motor: MotorProxy,
    /// Where it runs.
    pub place: Place,
}

/// Starts it, as `motor.0` of an installation with this in its file too.
pub fn host<M: Module>(name: &str, more: &str) -> Hosted {
    let place = Place::new(&format!("installation = \"{name}-NUMBER\"{CONFIG}{more}"), &[]);
    let start = place.start_of(MOTOR);
    let module = std::thread::spawn(move || run_started::<M>(start));
    place.wait_until_on(MOTOR, || assert!(!module.is_finished(), "it does not start"));
    let motor = MotorProxy::new(&place.caller(), MOTOR).with_timeout(Duration::from_secs(5));
    Hosted { motor, place }
}

/// Calls, and writes to its descriptor, until there were so many ticks more and so many data received; all uses of the
/// heap so far.
pub fn work(motor: &MotorProxy, ticks: u64, received: u64, mut call: impl FnMut(&MotorProxy)) -> u64 {
    let began = Instant::now();
    let [ticks, received] =
        [(&TICKS, ticks), (&RECEIVED, received)].map(|(count, more)| count.load(Ordering::Relaxed) + more);
    while TICKS.load(Ordering::Relaxed) < ticks
        || RECEIVED.load(Ordering::Relaxed) < received
        || READ.load(Ordering::Relaxed) + 50 < WRITTEN.load(Ordering::Relaxed)
    {
        motor.drive(0.5, 0.25).unwrap();
        let written = FAR.lock().unwrap().as_mut().unwrap().write(b"x").unwrap();
        WRITTEN.fetch_add(written as u64, Ordering::Relaxed);
        call(motor);
        assert!(began.elapsed() < PATIENCE, "it does not tick, or receives nothing");
    }
    let uses = USES.load(Ordering::Relaxed);
    assert!(uses > 0, "it counts");
    uses
}
