//! Recordings of what modules publish, as [MCAP](https://mcap.dev/spec) files.
//!
//! ```text
//! write ─▶ Inbox: chunks in memory ─▶ Recorder, a thread ─▶ NAME-0001.mcap, NAME-0002.mcap, …
//!            │ full                      │ the disk fails
//!            ▼                           ▼
//!     counted as lost             Status; again, with a new file
//!
//! cut, killed, damaged file ─▶ recover ─▶ whole file ─▶ info, cut, merge, Reader ─▶ Player: what is due, and when
//!                                                   └─▶ draw: for Rerun and Foxglove
//! ```
//!
//! [`Writer::write`] takes as long as copying the message, whatever the disk does. What does not fit the bounded queue
//! is counted as lost, by channel and cause, in [`Status`] and in the file. A channel never takes more of the queue
//! than is free: one that floods it leaves room to the others. A process that is killed loses what had not left its
//! memory: at most [`Options::flush`]. A loss of power takes what was not synced: at most [`Options::sync`] more.
//!
//! ```
//! use rohrpost_recording::{ChannelSpec, Message, Options, Session, Writer, info};
//! use rohrpost_schema::Type;
//!
//! let folder = tempfile::tempdir()?;
//! let mut writer = Writer::start(Options::new(folder.path(), "base"), Session::default())?;
//! let spec = ChannelSpec { name: "motor.0", item: "speed", ty: &Type::U8, texts: Default::default() };
//! let speed = writer.channel(&spec)?;
//! writer.write(speed, &Message { arrival_ns: 12, stamp_ns: 10, epoch: 1, sequence: 0, data: &[7] })?;
//! writer.finish().1?;
//!
//! let info = info(&folder.path().join("base-0001.mcap"))?;
//! assert_eq!((info.messages, info.channels[0].topic.as_str()), (1, "motor.0/speed"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # The format, and why
//!
//! - **MCAP:** Rerun, Foxglove and libraries of many languages read it, and each file describes its types itself.
//! - **Postcard as it came:** nothing is converted while recording. The schema is the description that modules hand out
//!   (`rohrpost-schema`), so bytes become values again without the program that wrote them.
//! - **The order is that of arrival.** Log time is the time of arrival, publish time the stamp. Readers that sort by
//!   time use the index.
//! - **A channel for each epoch of system time,** with the epoch in its metadata: after a step, times contradict each
//!   other, and the epoch of a message must survive cutting and merging. The topic stays the same.
//! - **Chunks go to the file whole, with their length:** a reader finds all of them, though the writer was killed.
//! - **Channels are described in a chunk of their own,** in the first chunks that use them, now and then behind those,
//!   and in the index: one damaged chunk costs its messages only.
//! - **Each file stands alone:** session, configuration, descriptions of modules, types and channels are in each;
//!   counts of lost messages are those since its beginning. It begins with the newest message of each channel that
//!   is not among its first messages, in channels that say so ([`format::key::REPEATED`]): nothing counts them a second
//!   time.
//! - **A failed file is cut back** to its last whole chunk, so that no message is in two files.
//! - **Nothing is overwritten,** neither by a recorder nor by `recover`, `cut`, `merge` and `draw`.
//! - **What other programs draw is made afterwards** ([`draw`]), or beside what is recorded ([`Options::drawn`]), in
//!   channels that say so: Rerun shows postcard as bytes only. Replay leaves these channels out; `cut` and `merge` keep
//!   them.
//! - **Files of other programs stay theirs:** what is made of them has their profile, metadata and attachments, and our
//!   words mean nothing there.
//!
//! Knows no mailbox, no module and no clock but that of its periods: times are arguments.

#![forbid(unsafe_code)]

mod about;
mod batch;
mod control;
mod current;
mod cut;
mod damages;
mod described;
mod disk;
mod drawn;
mod error;

pub mod format;
mod inbox;
mod info;
mod loss;
mod merge;
mod newest;
mod options;
mod order;
mod pace;
mod part_file;
mod player;
mod read;
mod reader;
mod recorder;
mod recover;
mod rewrite;
mod rotate;
mod selection;
mod shape;
mod shared;
mod status;
#[cfg(test)]
mod tests;
mod write;
mod writer;

pub use batch::Message;
pub use control::{CONTROL_LINE_BYTES_MAX, ControlAnswer, ControlCommand, ControlError, ControlLines};
pub use cut::{CutError, cut};
pub use described::DescribedModule;
pub use disk::is_being_written;
pub use drawn::{DrawError, DrawOptions, Drawn, DrawnBeside, draw};
pub use error::{Damage, DiskError, FileLimit, ReadError, RewriteError, Shown};
pub use info::{AttachmentInfo, ChannelInfo, EpochInfo, ForeignTexts, Info, info};
pub use loss::{LossCause, Losses};
pub use merge::{MergeError, merge};
pub use newest::Earlier;
pub use options::{Options, Session};
pub use order::{FileChange, MARK_BYTES_MAX, Mark, OrderError, PendingOrder};
pub use pace::Pace;
pub use part_file::PartFile;
pub use player::{Cue, Player};
pub use read::last::{LastMessage, last_message};
pub use reader::{Reader, RecordedChannel, is_closed};
pub use recover::{RecoverError, Recovered, recover, recovered_path};
pub use rewrite::Progress;
pub use rotate::Rotation;
pub use selection::{SelectError, Selection};
pub use status::{ChannelId, ChannelStatus, Failures, Problem, Status};
pub use writer::{ChannelError, ChannelSpec, OtherInterface, StartError, WriteError, Writer};
