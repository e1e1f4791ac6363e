//! Names, packages and prioritised mailboxes in shared memory: the lowest layer of Rohrpost.
//!
//! ```text
//!  Participant ──sender(name)──▶ Sender ──send / loan──┐
//!                                                      ▼   segment of 1.200.0.0
//!                                          ┌────┬────┬────┬────┐  slots: Free → Filling → Ready → Taken → Free
//!                                          └────┴────┴────┴────┘
//!                                                      │   most important first; same sender and priority in order
//!  Participant ──receiver(name, shape)──▶ Receiver ◀───┘   read in place, freed on drop; sleeps on its participant's bell
//! ```
//!
//! This crate knows no network, no configuration file and no message type.
//!
//! # A mailbox is one file, mapped by its receiver and by each sender
//!
//! ```text
//!  byte                                                    who writes it
//!     0  what it is: version, name, shape                  its maker, before it has its name
//!    64  owner: participant, process, depth                the receiver
//!   128  ticket counter: the order of publishing           senders, with each package
//!   256  hints, one bit a slot: "look here"                senders set them, the receiver takes them
//!   384  sleeping? · level · retired?                      the receiver, seldom; senders read it with each package
//!   512  alert: "something above your level"               senders, seldom; the receiver reads it with each package
//!   640  counters, a row a class                           the receiver; of losses, whoever causes or finds them
//!  4096  words, one a slot: the only truth about it        one compare-and-swap at a time, see below
//!     …  slots: time of publishing, head, body             who holds the slot
//! ```
//!
//! What costs time is a cache line that goes from one processor to another. So each of these is in lines of its own, and in the
//! steady state of a package three of them move: hint, word, body.
//!
//! # The incarnation of a slot, and who may do what
//!
//! | its word says | body | who may change the word, and to what |
//! | --- | --- | --- |
//! | Free | nobody's | any sender *claims* it: Filling |
//! | Filling, by whom | the filler writes | the filler *publishes* it: Ready, or *abandons* it: Free. The receiver *reclaims* it if the filler is dead: Free |
//! | Ready, priority, ticket | nobody touches it | the receiver *takes* it: Taken. A more important sender *displaces* it: Filling. Its own sender *replaces* or *reuses* it in a `latest` mailbox: Free or Filling |
//! | Taken | the receiver reads | the receiver *releases* it: Free. The next owner *adopts* it: Ready once more, marked; the second time it is *poison*: Free |
//!
//! Nobody waits for anybody: each operation is a number of steps bounded by the slot count, and whoever finds a word changed goes
//! on with the next. A process may be killed between any two steps; `slots` begins with a table of what that leaves and who fixes
//! it, and the tests in `mailbox/proof` visit each step by its name.
//!
//! # Decisions
//!
//! - A receiver looks at the hints once per level, not once per package: else their cache line moves each time.
//! - SeqCst accesses order "publish, then read what the receiver says" on both sides. Loom knows that order of fences
//!   alone, so `sync` has one there.
//! - A receiver reads the ticket counter only if hints came while it looked: looking until none comes has no bound.
//! - A sender goes round in four slots while they are free again: their cache lines are still near.
//! - Each ringer that sees `polling` writes a byte into the pipe. One that cleared the mark for the others and died would
//!   lose their wake-ups.
//!
//! # Reading order
//!
//! 1. `word`, `slots`, `hot`: the protocol. `queue`: what the receiver knows, and when it must look. `latest`: what replaces what.
//! 2. `bell`, `doorbell`, `waiting`, `watch`: sleeping and waking.
//! 3. `layout`, `segment`, `memory`: the bytes, and the only addresses. `sync`: atomics, and what is asked of the processor.
//! 4. `sender`, `place`, `receiver`: what users hold; `routes`: what is on other nodes. `node`, `entry`, `participant`, `lock`, `registry`, `unlink`: who lives, and who owns what.
//! 5. `counters`, `traffic`, `flows`, `inspect`, `about`: what anyone may read. `system_time`: the node's time.
//!
//! An ordering that matters has a letter, and its partner says the same one: (A) to (J) in the slot core; `bell` goes on with (H)
//! and (I); `cell` has letters of its own.
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

mod about;
mod bell;
mod causes;
mod cell;
mod clock;
mod counters;
mod doorbell;
mod entry;
mod files;
mod flows;
mod full;
mod hot;
mod inspect;
mod latest;
mod layout;
mod lock;
mod mapped;
mod memory;
mod name;
mod node;
mod package;
mod participant;
mod place;
mod queue;
mod receiver;
mod registry;
mod routes;
mod segment;
mod sender;
mod slots;
#[cfg_attr(not(feature = "crash-points"), allow(unused))]
#[doc(hidden)]
pub mod step;
mod sync;
pub mod sys;
mod system_time;
mod throttle;
mod traffic;
mod unlink;
mod waiting;
mod watch;
mod word;
mod work;

pub use cell::SeqCount;
pub use clock::{monotonic_ns, realtime_ns, slept_ns, unslewed_ns};
pub use counters::{ClassTraffic, LATENCY_BUCKETS, Latency, Loss, saturating_sum};
pub use entry::{ModuleState, PARTICIPANTS_MAX, ParticipantInfo};
pub use flows::{FlowInfo, FlowSecond, Publications};
pub use full::OverflowPolicy;
pub use inspect::{InspectError, MailboxDetail, MailboxInfo, Party, SlotInfo, VictimInfo, WaitingPackage};
pub use layout::{Shape, ShapeError, VERSION as LAYOUT_VERSION};
pub use name::{ALL_SYSTEMS, Class, Name, NameError, Priority, local};
pub use node::{LaunchLock, Node, NodeError, base_directory, node_directory, remove_base_if_empty};
pub use package::{BODY_BYTES_MAX, HEAD_BYTES, Head, Kind, Options, Short, Type};
pub use participant::Participant;
pub use receiver::{Package, Receiver};
pub use registry::CreateError;
pub use routes::ROUTES_MAX;
pub use sender::{Label, Loan, SendError, Sender};
pub use slots::SLOTS_MAX;
pub use system_time::{ERROR_UNKNOWN_NS, SystemClock, SystemTime, TimeKeeper, TimeRecord, TimeSource, Watched};
pub use throttle::Throttle;
pub use waiting::{Waiting, wait_above, wait_any};
pub use watch::{Interest, Ready, WATCHES_MAX, Watch, Watches};
pub use work::{InHand, Work};
