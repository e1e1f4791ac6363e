//! A module with a journal takes nothing from the heap for it, once it is warm: for ticks, readings of the clock,
//! publishing, receiving, commands and their replies, writing a stream and reading it, and for what a descriptor
//! brings.
//!
//! The module runs on a thread of this process; only that thread counts. One test, as a process has one output.

#![allow(clippy::unwrap_used, reason = "these are tests")]

pub mod warm;

use rohrpost_mailbox::{Interest, Next, Node, Ready, StreamId};
use rohrpost_modules::interfaces::{DriveError, Motor, MotorInterface};
use rohrpost_modules::journal::JOURNAL_NUMBER;
use rohrpost_modules::runtime::{Context, Rate, Received, Stream, Subscription};
use rohrpost_modules::types::{Pose, Twist};
use rohrpost_modules::{Module, ModuleError};
use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::sync::atomic::Ordering;
use std::time::Duration;
use warm::{Crane, CraneInterface, MOTOR, READ, RECEIVED, host, port, ticks, work};

struct Wheels {
    own: Subscription<Twist>,
    hook: Stream<Pose>,
    before_ns: u64,
    told: Twist,
    port: UnixStream,
    null: std::fs::File,
}

impl Module for Wheels {
    type Settings = toml::Table;
    type Interfaces = (MotorInterface, CraneInterface);

    fn new(_: toml::Table, context: &mut Context) -> Result<Self, ModuleError> {
        context.set_period(Duration::from_millis(1));
        let own = context.subscribe(MotorInterface::MOTION, "motor.0", Rate::Each)?;
        let hook = context.stream(CraneInterface::HOOK, "crane.0")?;
        let port = context.open_outside(|| {
            let port = port()?;
            port.set_nonblocking(true)?;
            Ok(port)
        })?;
        context.watch(&port, Interest::Read)?;
        let null = context.open_outside(|| std::fs::File::create("/dev/null"))?;
        Ok(Self { own, hook, before_ns: 0, told: Twist::default(), port, null })
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        ticks();
        context.publish_now(MotorInterface::MOTION, &self.told)?;
        let now_ns = context.now().ns;
        context.write(CraneInterface::HOOK, now_ns, &Pose::default())?;
        let newest = self.hook.newest()?.map(|record| record.stamp_ns());
        assert_eq!(newest, Some(now_ns));
        if let Next::Record(record) = self.hook.try_next()? {
            assert_eq!(record.stamp_ns(), now_ns);
        }
        let _ = self.hook.at(self.before_ns.midpoint(now_ns))?;
        self.hook.from(self.hook.position());
        self.before_ns = now_ns;
        Ok(())
    }

    fn ready(&mut self, context: &mut Context, _: Ready) -> Result<(), ModuleError> {
        let mut room = [0; 16];
        loop {
            match context.take_in_to(&mut room, |room| self.port.read(room)) {
                Ok(count) => {
                    assert!(room[count..].iter().all(|byte| *byte == 0));
                    assert_eq!(context.give_out(&room[..count], |bytes| self.null.write(bytes))?, count);
                    READ.fetch_add(count as u64, Ordering::Relaxed);
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => {
                    assert_eq!(room, [0; 16]);
                    return Ok(());
                }
                Err(error) => return Err(error.into()),
            }
        }
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

/// It has a journal.
const RECORD: &str = include_str!("../../tests/testbed/journal.toml");

#[test]
fn a_journal_does_not_touch_the_heap() {
    let hosted = host::<Wheels>("journal", &RECORD.replace("MODULE", "motor.0"));
    let before = work(&hosted.motor, 1000, 1000, |_| ());
    let id = StreamId { name: MOTOR, number: JOURNAL_NUMBER };
    let node = Node::open(hosted.place.node.path()).unwrap();
    let written = || node.inspect_stream(id).unwrap().unwrap().written;
    let pieces = written();
    assert!(pieces > 0, "it counts");
    assert_eq!(work(&hosted.motor, 2000, 2000, |_| ()) - before, 0, "uses of the heap after warming up");
    assert!(written() > pieces + 50, "{} records of the journal", written() - pieces);
}
