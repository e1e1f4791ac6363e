//! Shared memory that a mailbox takes, asked of the file system.

use crate::one_way::OwnNode;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::Failure;
use rohrpost_bench_local::rounds::{Contender, Row, Subject, Target, Versus, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_bench_local::statistics::Summary;
use rohrpost_mailbox::OverflowPolicy;
use std::os::unix::fs::MetadataExt;

const PAGE: usize = 4096;
/// A slot is the time, the head and the body, in whole cache lines.
const SLOT_PREFIX: usize = 8 + 16;
const LINE: usize = 64;
/// `st_blocks` counts in these, whatever the file system's own are.
const BLOCK: u64 = 512;

/// All of them: small and large, few slots and many.
pub(super) fn cases() -> Vec<Box<dyn Case>> {
    let shapes = [(1, 64), (8, 64), (32, 1024), (64, 64), (65, 64), (64, 16_384), (256, 256), (1024, 64), (1024, 4096)];
    shapes.map(|(slots, bytes)| -> Box<dyn Case> { Box::new(MemoryCase { slots, bytes }) }).into_iter().collect()
}

struct MemoryCase {
    slots: usize,
    bytes: usize,
}

impl MemoryCase {
    /// Slots, 64 B for each, and a page; the kernel gives whole pages.
    fn allowed_bytes(&self) -> usize {
        let slot = (SLOT_PREFIX + self.bytes).next_multiple_of(LINE);
        (self.slots * (slot + 64) + PAGE).next_multiple_of(PAGE)
    }

    /// What the file of a mailbox of this shape takes.
    fn taken_bytes(&self) -> Result<u64, Failure> {
        let ground = OwnNode::new(self.slots, self.bytes, OverflowPolicy::Displace)?;
        let _source = ground.source(false)?;
        let files = std::fs::read_dir(ground.path()).map_err(|error| Failure::of("node's directory", error))?;
        let sizes = files.filter_map(|file| {
            let file = file.ok()?;
            file.path().extension().is_some_and(|extension| extension == "mbx").then(|| file.metadata())
        });
        let sizes: Vec<_> = sizes.collect::<Result<_, _>>().map_err(|error| Failure::of("mailbox's file", error))?;
        match sizes.as_slice() {
            [one] => Ok(one.blocks() * BLOCK),
            files => Err(Failure::Failed(format!("{} files of one mailbox", files.len()))),
        }
    }
}

impl Case for MemoryCase {
    fn name(&self) -> String {
        format!("memory-{}-slots", self.slots)
    }

    fn run(&self, settings: &Settings) -> Result<Vec<Row>, Failure> {
        let ours = || Ok(Summary::single(self.taken_bytes()? as f64));
        let bare = || Ok(Summary::single((self.slots * self.bytes) as f64));
        let allowed = || Ok(Summary::single(self.allowed_bytes() as f64));
        let contenders = [
            Contender { name: "rohrpost", turn: Box::new(ours) },
            Contender { name: "slots + 64 B each + a page", turn: Box::new(allowed) },
            Contender { name: "bodies alone", turn: Box::new(bare) },
        ];
        let subject = Subject { case: self.name(), bytes: Some(self.bytes), unit: "B" };
        let versus = Versus { name: contenders[1].name, p50: Some(Target::AtMost(1.0)), p99: None };
        Ok(compare(&Settings { rounds: 1, ..settings.clone() }, &subject, &contenders, &[versus]))
    }
}
