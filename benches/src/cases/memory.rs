//! Shared memory that a mailbox takes, asked of the file system.

use crate::one_way::OwnNode;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Failure, OrFail};
use rohrpost_bench_local::rounds::{Contender, Row, Subject, at_most, compare};
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
pub(super) fn cases() -> Vec<Case> {
    let shapes = [(1, 64), (8, 64), (32, 1024), (64, 64), (65, 64), (64, 16_384), (256, 256), (1024, 64), (1024, 4096)];
    shapes
        .map(|(slots, bytes)| {
            let shape = MemoryCase { slots, bytes };
            Case::new(format!("memory-{slots}-slots"), bytes, "B", move |settings, subject| {
                Ok(shape.measure(settings, subject))
            })
        })
        .into()
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
        let files = std::fs::read_dir(ground.path()).or_fail("node's directory")?;
        let sizes = files.filter_map(|file| {
            let file = file.ok()?;
            file.path().extension().is_some_and(|extension| extension == "mbx").then(|| file.metadata())
        });
        let sizes: Vec<_> = sizes.collect::<Result<_, _>>().or_fail("mailbox's file")?;
        match sizes.as_slice() {
            [one] => Ok(one.blocks() * BLOCK),
            files => Err(Failure::Failed(format!("{} files of one mailbox", files.len()))),
        }
    }

    fn measure(&self, settings: &Settings, subject: &Subject) -> Vec<Row> {
        let fixed = |name, bytes| Contender::fixed(name, Summary::single(bytes as f64));
        let contenders = [
            Contender::single("rohrpost", || Ok(self.taken_bytes()? as f64)),
            fixed("slots + 64 B each + a page", self.allowed_bytes()).beside(at_most(1.0), None),
            fixed("bodies alone", self.slots * self.bytes),
        ];
        compare(&Settings { rounds: 1, ..settings.clone() }, subject, &contenders)
    }
}
