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
//! This crate knows no network, no configuration file and no message type. Reading order: `word` (the life of a slot),
//! `slots` (the protocol, and what each death leaves), `queue`, `doorbell`, then `segment`, `sender`, `receiver`, `node`,
//! `registry`, `inspect`, `traffic`.
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
mod clock;
mod counters;
mod doorbell;
mod entry;
mod files;
mod flows;
mod inspect;
mod latest;
mod layout;
mod lock;
mod memory;
mod name;
mod node;
mod package;
mod participant;
mod queue;
mod receiver;
mod registry;
mod segment;
mod sender;
mod slots;
#[cfg_attr(not(feature = "crash-points"), allow(unused))]
#[doc(hidden)]
pub mod step;
mod sync;
pub mod sys;
mod system_time;
mod traffic;
mod waiting;
mod watch;
mod word;

pub use clock::{monotonic_ns, realtime_ns};
pub use counters::{ClassTraffic, LATENCY_BUCKETS, Latency, Loss, saturating_sum};
pub use entry::{ModuleState, PARTICIPANTS_MAX, ParticipantInfo};
pub use flows::{FlowInfo, FlowSecond, Publications};
pub use inspect::{InspectError, MailboxDetail, MailboxInfo, Party, SlotInfo, VictimInfo, WaitingPackage};
pub use layout::{Shape, ShapeError, VERSION as LAYOUT_VERSION};
pub use name::{ALL_SYSTEMS, Class, Name, NameError, Priority, local};
pub use node::{LaunchLock, Node, NodeError, base_directory, node_directory, remove_base_if_empty};
pub use package::{BODY_BYTES_MAX, HEAD_BYTES, Head, Kind, Options, Short, Type};
pub use participant::Participant;
pub use receiver::{Package, Receiver};
pub use registry::CreateError;
pub use sender::{Label, Loan, SendError, Sender};
pub use slots::{Full, SLOTS_MAX};
pub use system_time::{SystemClock, SystemTime, TimeKeeper, TimeRecord, TimeSource};
pub use waiting::{Waiting, wait_any};
pub use watch::{Interest, Ready, WATCHES_MAX, Watch, Watches};
