//! Our recorder: a queue, and a thread that writes.

use super::workload::{NAME, Workload};
use rohrpost_bench_local::harness::{Failure, OrFail};
use rohrpost_recording::{ChannelId, ChannelSpec, Message, Options, Session, Writer};
use rohrpost_schema::Type;
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

/// So many bytes may wait for the thread: a quarter of what the queue takes, so nothing is lost.
const WAITING_MAX: usize = 8 << 20;
/// How many come between two looks at what waits.
const LOOK_EACH: usize = 2 << 20;
const NAP: Duration = Duration::from_micros(200);

/// A recording with one channel.
pub(super) fn begin(folder: &Path) -> Result<(Writer, ChannelId), Failure> {
    let options = Options { leave_bytes: 0, ..Options::new(folder, "bench") };
    let mut writer = Writer::start(options, Session::default()).or_fail("starting a recording")?;
    let ty = Type::List(Box::new(Type::U8));
    let spec = ChannelSpec { name: NAME.0, item: NAME.1, ty: &ty, texts: BTreeMap::new() };
    let channel = writer.channel(&spec).or_fail("a channel")?;
    Ok((writer, channel))
}

/// Writes all, and closes the file.
pub(super) fn write(folder: &Path, workload: &Workload) -> Result<(), Failure> {
    let (mut writer, channel) = begin(folder)?;
    let mut unseen = 0;
    for (sequence, data) in workload.all() {
        unseen += data.len();
        if unseen >= LOOK_EACH {
            unseen = 0;
            while writer.status().waiting as usize * data.len() > WAITING_MAX {
                std::thread::sleep(NAP);
            }
        }
        let now_ns = u64::from(sequence) * 1000;
        let message = Message { arrival_ns: now_ns, stamp_ns: now_ns, epoch: 1, sequence, data };
        writer.write(channel, &message).or_fail("writing")?;
    }
    writer.finish().1.or_fail("closing the recording")
}
