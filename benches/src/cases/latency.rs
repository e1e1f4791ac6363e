//! How long a package is on its way, one at a time.

use super::Case;
use crate::floors::{HandOver, Lanes, Wake};
use crate::harness::{Cell, Failure, Placement, Scheduling, Shared, time_two_processes};
use crate::ours::{How, Mailboxes};
use crate::rounds::{Contender, Row, Subject, Target, Versus, compare};
use crate::settings::Settings;
use std::time::Duration;

/// All of them.
pub(super) fn cases() -> Vec<Box<dyn Case>> {
    vec![Box::new(Blocking { bytes: 64 })]
}

struct Blocking {
    bytes: usize,
}

impl Case for Blocking {
    fn name(&self) -> String {
        "blocking".into()
    }

    fn run(&self, settings: &Settings) -> Result<Vec<Row>, Failure> {
        let cell = Cell {
            bytes: self.bytes,
            messages: settings.count(20_000),
            warm_up: settings.count(2_000),
            placement: Placement::TwoCores,
            scheduling: Scheduling::Fifo,
            pace: None,
            cap: Duration::from_secs(2),
        };
        let ours = Contender::sampled("rohrpost", || {
            let directory = tempfile::Builder::new().prefix("rohrpost-bench-").tempdir_in("/dev/shm");
            let directory = directory.map_err(|error| Failure::of("/dev/shm", error))?;
            let path = directory.path().join("node");
            time_two_processes(&cell, |end, meetings| Mailboxes::open(&path, end, cell.bytes, How::Blocking, meetings))
        });
        let futex = Contender::sampled("futex", || {
            let lanes = Shared::<Lanes>::new()?;
            time_two_processes(&cell, |end, _| Ok(HandOver::new(&lanes, end, Wake::Futex)))
        });
        let subject = Subject { case: self.name(), bytes: Some(self.bytes), unit: "us" };
        let versus = Versus { name: "futex", p50: Some(Target::AtMost(1.10)), p99: Some(Target::AtMost(1.15)) };
        Ok(compare(settings, &subject, &[ours, futex], &[versus]))
    }
}
