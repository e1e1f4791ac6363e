//! A module's thread takes nothing from the heap, once it is warm, for: a command and its answer, publishing to
//! subscribers, receiving data of a plain type, writing to a stream, reading one by its newest record, one by one and
//! at a time, following one, and reading from a descriptor that it watches. (Data with a `Vec` inside, such as scans,
//! allocate that in decoding; output lines allocate their text.)
//!
//! The module runs on a thread of this process; only that thread counts. One test, as a process has one output.

#![allow(clippy::unwrap_used, reason = "these are tests")]

pub mod warm;

use rohrpost_mailbox::{Interest, Next, Ready};
use rohrpost_modules::call::CallError;
use rohrpost_modules::interfaces::{DriveError, Motor, MotorInterface, MotorProxy};
use rohrpost_modules::runtime::{Context, Rate, Received, Stream, StreamSubscription, Subscription};
use rohrpost_modules::types::{Pose, Twist};
use rohrpost_modules::{Module, ModuleError};
use std::io::Read;
use std::os::unix::net::UnixStream;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;
use warm::{Crane, CraneInterface, READ, RECEIVED, host, port, ticks, work};

/// Records of the stream that came one by one, those that the module was given, and values looked up by time.
static RECORDS: AtomicU64 = AtomicU64::new(0);
static FOLLOWED: AtomicU64 = AtomicU64::new(0);
static LOOKED_UP: AtomicU64 = AtomicU64::new(0);

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
        let port = port()?;
        context.watch(&port, Interest::Read)?;
        Ok(Self { own, each, hook, before_ns: 0, told: Twist::default(), port })
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        ticks();
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

/// Calls that fail, and data that are asked for.
fn call(motor: &MotorProxy) {
    assert!(matches!(motor.halt(), Err(CallError::Module(_, DriveError::NotFinite))));
    // There is none before the first tick.
    if let Ok((_, twist)) = motor.motion() {
        assert!([Twist::default(), Twist { speed_m_s: 0.5, turn_rate_rad_s: 0.25 }].contains(&twist));
    }
}

#[test]
fn a_modules_thread_does_not_touch_the_heap() {
    let hosted = host::<Wheels>("hot", "spin = \"10 us\"\n");
    // Longer than a renewal of the subscriptions takes to come.
    let before = work(&hosted.motor, 1500, 1000, call);
    assert_eq!(work(&hosted.motor, 3000, 2000, call) - before, 0, "uses of the heap after warming up");
    let (_, twist) = hosted.motor.motion().unwrap();
    assert_eq!(twist, Twist { speed_m_s: 0.5, turn_rate_rad_s: 0.25 });
    for (count, what) in [(&RECORDS, "one by one"), (&FOLLOWED, "followed"), (&LOOKED_UP, "looked up by time")] {
        assert!(count.load(Ordering::Relaxed) > 3000, "records {what}: {count:?}");
    }
}
