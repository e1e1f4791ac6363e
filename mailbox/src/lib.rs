//! Names, packages and prioritised mailboxes in shared memory: the lowest layer of Rohrpost.
//!
//! ```text
//!  Participant ──sender(name)──▶ Sender ──send / loan──┐
//!                                                      ▼   segment of 1.200.0.0
//!                                          ┌────┬────┬────┬────┐  slots: Free → Filling → Ready → Taken → Free
//!                                          └────┴────┴────┴────┘
//!                                                      │   most important first; same sender and priority in order
//!  Participant ──receiver(name, shape)──▶ Receiver ◀───┘   read in place, freed on drop; sleeps on the bell
//! ```
//!
//! This crate knows no network, no configuration file and no message type.
//!
//! # A mailbox is one file, mapped by its receiver and by each sender
//!
//! ```text
//!  byte                                                    written by
//!     0  what it is: version, name, shape                  its maker, before it has its name
//!    64  owner: participant, process, depth                the receiver
//!   128  ticket counter: the order of publishing           senders, with each package
//!   256  hints, one bit a slot: "look here"                senders set them, the receiver takes them
//!   384  sleeping? · level · retired?                      the receiver, seldom; senders read it with each package
//!   512  alert: "something above your level"               senders, seldom; the receiver reads it with each package
//!   640  counters, a row a class                           the receiver; of losses, their cause or finder
//!  4096  words, one a slot: the only truth about it        one compare-and-swap at a time, see below
//!     …  slots: time of publishing, head, body             the holder of the slot
//! ```
//!
//! A cache line that moves between processors costs time. So each of these is in lines of its own, and in the
//! steady state of a package three of them move: hint, word, body.
//!
//! # The states of a slot, and the process that may change each
//!
//! | state | body | change |
//! | --- | --- | --- |
//! | Free | nobody's | any sender *claims*: Filling |
//! | Filling | the filler writes | filler *publishes*: Ready, or *abandons*: Free |
//! | | | receiver *reclaims* it from a dead filler: Free |
//! | Ready | nobody touches it | receiver *takes*: Taken |
//! | | | a more important sender *displaces*: Filling |
//! | | | its sender *replaces* or *reuses* it (`latest`): Free or Filling |
//! | Taken | the receiver reads | receiver *releases*: Free |
//! | | | next owner *adopts*: Ready, marked; the second time it is *poison*: Free |
//!
//! No process waits for another: the slot count bounds the steps of each operation, and a process that finds a word
//! changed goes on with the next. A process may be killed between any two steps; `slots/protocol.rs` begins with what
//! that leaves and what fixes it, and the tests in `mailbox/proof` visit each step by its name.
//!
//! # Decisions
//!
//! - A receiver looks at the hints once per level, not once per package: else their cache line moves each time.
//! - SeqCst accesses order "publish, then read what the receiver says" on both sides. Loom knows that order of fences
//!   alone, so `sync` has one there.
//! - A receiver reads the ticket counter only if hints came while it looked: looking until none comes has no bound.
//! - A sender goes round in four slots while they are free again: their cache lines are still near.
//! - Each ringer that sees `polling` writes a byte into the pipe. One that cleared the mark for
//!   the others and died would lose their wake-ups.
//!
//! # Reading order
//!
//! 1. `slots`: the protocol of slots. `sync`: its atomics and fences. `cell`: one writer, many readers.
//! 2. `wake`: sleeping and waking.
//! 3. `memory`: files, bytes, the only addresses.
//! 4. `label`, `sender`, `send_error`, `place`, `receiver`: what users hold.
//! 5. `node`: live processes, the names of their mailboxes, and which are on other nodes.
//! 6. `stream`: rings of stamped records.
//! 7. `figures`: what anyone may read. `system_time`: the node's time.
//!
//! An ordering that matters has a letter, and its partner says the same one: (A) to (J) in the slot core; `bell` goes
//! on with (H) and (I); `cell` has letters of its own.
//!
//! ```
//! use rohrpost_mailbox::{Label, Name, Node, Participant, Priority, Shape, Type};
//! # let dir = tempfile::tempdir()?;
//! let node = Node::create(&dir.path().join("node"), 0o700)?;
//! let participant = Participant::join(&node, Name::new(1, 200, 0, 0))?;
//! let mut receiver = participant.receiver(Name::new(1, 200, 0, 0), Shape::default())?;
//! let mut sender = participant.sender(receiver.name())?;
//! let label = |priority| Label { priority: Priority(priority), kind: Type::command(16), ..Label::default() };
//! sender.send(&label(10), &[b"later"])?;
//! sender.send(&label(20), &[b"first"])?;
//! assert_eq!(receiver.receive().body(), b"first");
//! assert_eq!(receiver.receive().body(), b"later");
//! assert!(receiver.try_receive().is_none());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod causes;
mod cell;
mod clock;
mod figures;
mod label;
mod memory;
mod name;
mod node;
mod package;
mod place;
mod receiver;
mod send_error;
mod sender;
mod slots;
#[cfg_attr(not(feature = "crash-points"), allow(unused))]
#[doc(hidden)]
pub mod step;
mod stream;
mod sync;
pub mod sys;
mod system_time;
mod throttle;
mod wake;

pub use cell::SeqCount;
pub use clock::{monotonic_ns, realtime_ns, slept_ns, unslewed_ns};
pub use figures::counters::{ClassTraffic, LATENCY_BUCKETS, Latency, Loss, saturating_sum};
pub use figures::flows::{FlowInfo, FlowSecond, Publications};
pub use figures::inspect::{InspectError, MailboxDetail, MailboxInfo, Party, SlotInfo, VictimInfo, WaitingPackage};
pub use label::Label;
pub use memory::layout::{Shape, ShapeError, VERSION as LAYOUT_VERSION};
pub use memory::owned::BadFile;
pub use name::{ALL_SYSTEMS, Class, Name, NameError, Priority, local};
pub use node::directory::{LaunchLock, Node, base_directory, node_directory, remove_base_if_empty};
pub use node::entry::{ModuleState, PARTICIPANTS_MAX, ParticipantInfo};
pub use node::error::NodeError;
pub use node::participant::Participant;
pub use node::process::{ParticipantProcess, ProcessError};
pub use node::registry::CreateError;
pub use node::routes::ROUTES_MAX;
pub use node::work::{InHand, Work};
pub use package::{BODY_BYTES_MAX, HEAD_BYTES, Head, Kind, Options, Short, Type};
pub use receiver::{Package, Receiver};
pub use send_error::SendError;
pub use sender::{Loan, Sender};
pub use slots::full::OverflowPolicy;
pub use slots::protocol::SLOTS_MAX;
pub use stream::{
    Around, HeldRecord, Missed, Next, OpenRecord, OriginRecord, RecordInfo, RecordPlace, ReplicaError, ReplicaWriter,
    STREAM_KEEP_MAX, STREAM_READERS_MAX, STREAM_SEQUENCE_MAX, Stamp, StreamError, StreamId, StreamInfo, StreamReader,
    StreamShape, StreamShapeError, StreamWriter, SuspendedRecord, WriteError,
};
pub use system_time::{
    CLOCK_SET_NS, ERROR_UNKNOWN_NS, SystemClock, SystemTime, TimeKeeper, TimeRecord, TimeSource, Watched,
};
pub use throttle::Throttle;
pub use wake::waiting::{Source, Waiting, wait_above, wait_any};
pub use wake::watch::{Interest, Ready, WATCHES_MAX, Watch, Watches};
