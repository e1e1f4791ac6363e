//! The functions that every module has (seed 002, 2.2.1), numbers 1 to 15 of the commands.

use crate::parameter::{Parameter, Refusal};
use rohrpost_mailbox::{LAYOUT_VERSION, ModuleState, SystemClock, TimeSource};
use rohrpost_schema::{Data, Schema};
use serde::{Deserialize, Serialize};

/// Switches the module on. No arguments, no result.
pub const ON: u16 = 1;
/// Switches the module off: its safe state.
pub const OFF: u16 = 2;
/// Asks for [`Status`].
pub const STATUS: u16 = 3;
/// Asks for the newest data of a number (u16): its time (u64 ns since 1970) and itself.
pub const GET_DATA: u16 = 4;
/// Subscribes: [`Subscribe`].
pub const SUBSCRIBE: u16 = 5;
/// Ends a subscription: [`Unsubscribe`].
pub const UNSUBSCRIBE: u16 = 6;
/// Sets which output lines the module sends: [`OutputLevel`]. The answer is the level before, as in [`Status`].
pub const OUTPUT_LEVEL: u16 = 7;
/// Asks for a part of the description, from a byte on (u32): [`DescriptionPart`].
pub const DESCRIBE: u16 = 8;
/// Asks for parameters with their present values, from an index on (u16): [`ParameterPage`].
pub const PARAMETERS: u16 = 9;
/// Sets parameters: [`SetParameters`]. Returns `Result<Vec<Change>, Refusal>`.
pub const SET_PARAMETERS: u16 = 10;
/// Asks for system time as the module's node has it: [`TimeReport`], made when the command is run.
pub const TIME: u16 = 11;
/// Asks what came of its exchange with others, from an index on (u16): [`ExchangePage`].
pub const EXCHANGE: u16 = 12;
/// Numbers from here on are the interfaces' own.
pub const FIRST_OWN: u16 = 16;

/// Hash that commands to the common functions carry, which are of no interface: raised whenever one of them changes.
pub const HASH: u32 = 4;

/// The version of this program, and those of what programs of one node have to have in common.
pub fn versions() -> String {
    let version = env!("CARGO_PKG_VERSION");
    format!("{version} (layout of shared memory {LAYOUT_VERSION}, common functions {HASH})")
}

/// Bytes of a description that go into one reply, so that it fits every reply mailbox.
pub const DESCRIPTION_PART: usize = 768;

/// Bytes of parameters that go into one reply, for the same reason; a single one that is longer goes alone.
pub const PARAMETER_PAGE: usize = 768;

/// Others that go into one reply, so that it fits every reply mailbox.
pub const EXCHANGE_PAGE: usize = 8;

/// How a module is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Status {
    /// What it is doing.
    pub state: State,
    /// Why, when it is in error; else what does not work although it is on, such as a subscription that is refused; or
    /// empty.
    pub error: String,
    /// Tells this incarnation of the module from earlier ones.
    pub incarnation: u32,
    /// Time since it started, ms.
    pub uptime_ms: u64,
    /// Subscriptions to its data at present.
    pub subscribers: u32,
    /// Periods of subscriptions in which nothing could be delivered, and packages that found a subscriber's mailbox
    /// full.
    pub missed: u64,
    /// Packages that it should have received by its own subscriptions and did not (gaps in their numbers).
    pub lost: u64,
    /// Output lines that found no room.
    pub output_lost: u64,
    /// Output lines that were suppressed, since there were too many of them.
    pub output_suppressed: u64,
    /// Which output lines it sends; none when the configuration has no class `output`.
    pub output_level: Option<OutputLevel>,
    /// Packages that it did not take.
    pub refused: Refused,
}

/// Packages that a module did not take in this incarnation of it, by cause.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Refused {
    /// Commands from classes that `[access]` does not let command it.
    pub not_allowed: u64,
    /// Commands and subscriptions for which there was no place: the sender holds its share of them, or all are taken.
    pub no_place: u64,
    /// Packages that are no commands where commands are taken, or no data where data are.
    pub malformed: u64,
    /// Data of a subscription that there is not.
    pub unasked: u64,
    /// Data from another module than the one that is subscribed to.
    pub other_publisher: u64,
    /// Data of another number than the one that is subscribed to.
    pub other_number: u64,
    /// Data that an earlier incarnation of the module asked for.
    pub earlier_incarnation: u64,
}

/// What a module is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[serde(rename_all = "lowercase")] // in JSON; postcard knows numbers only
pub enum State {
    /// Not ready for commands yet.
    Starting,
    /// Ready, and switched off.
    Off,
    /// Working.
    On,
    /// It has stopped working.
    Error,
    /// About to end.
    Stopping,
}

impl From<ModuleState> for State {
    fn from(state: ModuleState) -> Self {
        match state {
            ModuleState::Starting | ModuleState::StandsBy => Self::Starting,
            ModuleState::Off => Self::Off,
            ModuleState::On => Self::On,
            ModuleState::Error => Self::Error,
            ModuleState::Stopping => Self::Stopping,
        }
    }
}

/// Asks for continuous data. Sent again before the lease ends, it renews it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Subscribe {
    /// Kind of data.
    pub number: u16,
    /// Chosen by the subscriber; the packages carry it.
    pub id: u16,
    /// 0: each value; else the newest value once a period, µs.
    pub period_us: u32,
    /// Without renewal it ends after this time, ms.
    pub lease_ms: u32,
    /// To which of the subscriber's mailboxes the packages go: local id 2 (data) or above.
    pub mailbox: u8,
}

/// Ends a subscription.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Unsubscribe {
    /// As it was subscribed.
    pub id: u16,
    /// Likewise.
    pub mailbox: u8,
}

/// System time at a module, when it ran the command that asks for it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct TimeReport {
    /// Nanoseconds since 1970.
    pub ns: u64,
    /// Times of different epochs cannot be subtracted.
    pub epoch: u64,
    /// How far off it is at most, ns.
    pub error_ns: u64,
    /// Where it comes from: `local`, `master`, `simulation`, `log`. Only nodes with source `master` share one clock.
    pub source: String,
}

impl TimeReport {
    /// What a clock says now.
    pub fn of(clock: &SystemClock) -> Self {
        let (now, record) = (clock.now(), clock.record());
        let source = record.map_or(TimeSource::Local, |record| record.source).name().into();
        let error_ns = u64::try_from(now.error.as_nanos()).unwrap_or(u64::MAX);
        Self { ns: now.ns, epoch: now.epoch, error_ns, source }
    }
}

/// What came of a module's exchange with another one, in this incarnation of the module.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Exchange {
    /// The other one, such as `laser.0`.
    pub module: String,
    /// Which of its data is followed; none: these are calls of its functions.
    pub data: Option<u16>,
    /// Packages of data that came, or calls that have ended.
    pub packages: u64,
    /// Commands that were sent again, since the answer was long in coming.
    pub repeated: u64,
    /// Packages of data that should have come and did not (gaps in their numbers), or calls to which the other one gave
    /// no answer: not in their time, and (of the last 64 that were given up) not until now.
    pub lost: u64,
    /// Calls that were given up, and answered when their time was over. None of data.
    pub late: u64,
}

/// Some of the modules with which a module exchanges something.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct ExchangePage {
    /// All there are.
    pub total: u16,
    /// From the one that was asked for on, at most [`EXCHANGE_PAGE`].
    pub exchanges: Vec<Exchange>,
}

/// Which output lines a module sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, Schema)]
#[serde(rename_all = "lowercase")] // in JSON; postcard knows numbers only
pub enum OutputLevel {
    /// Errors alone.
    Error,
    /// And warnings.
    Warn,
    /// And what a user wants to know.
    Info,
    /// And what a developer wants to know.
    Debug,
    /// Everything.
    Trace,
}

/// A part of a description's bytes (see [`rohrpost_schema::Description`]).
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct DescriptionPart {
    /// Bytes of the whole.
    pub total: u32,
    /// From the byte that was asked for.
    pub bytes: Vec<u8>,
}

/// Some of a module's parameters, in the order of its struct.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ParameterPage {
    /// Parameters of the module.
    pub total: u16,
    /// Times that parameters were set in this incarnation of the module: pages with different ones do not belong
    /// together.
    pub changes: u32,
    /// Those from the index that was asked for.
    pub parameters: Vec<Parameter>,
}

/// Sets parameters, all of them or none.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct SetParameters {
    /// Names and values; a value is postcard of the parameter's type.
    pub values: Vec<(String, Vec<u8>)>,
    /// Only says what would be refused for its name, type or range; the module itself is not asked.
    pub only_check: bool,
}

/// A parameter that was set.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Change {
    /// The parameter.
    pub name: String,
    /// Its value before, postcard.
    pub old: Vec<u8>,
    /// Its value now, postcard.
    pub new: Vec<u8>,
}

/// Before the value in a package of subscribed data, all little-endian:
/// `system time u64 ns │ sequence u32 │ missed u32 │ incarnation u32 │ value (postcard)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DataHead {
    /// When the data was true, ns since 1970.
    pub stamp_ns: u64,
    /// Counts the packages of this subscription; a gap is a loss.
    pub sequence: u32,
    /// Periods so far in which nothing could be delivered, and packages that found the mailbox full.
    pub missed: u32,
    /// Of the subscriber, as the envelope of its request had it: a later incarnation of the subscriber takes no data
    /// that an earlier one asked for. 0 for data that nobody asked for, such as lines of output.
    pub incarnation: u32,
}

impl DataHead {
    /// Bytes of it.
    pub const BYTES: usize = 20;

    /// As it stands in a body.
    pub fn to_bytes(&self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        bytes[..8].copy_from_slice(&self.stamp_ns.to_le_bytes());
        bytes[8..12].copy_from_slice(&self.sequence.to_le_bytes());
        bytes[12..16].copy_from_slice(&self.missed.to_le_bytes());
        bytes[16..].copy_from_slice(&self.incarnation.to_le_bytes());
        bytes
    }

    /// Splits a body into head and value; none when it is too short.
    pub fn split(body: &[u8]) -> Option<(Self, &[u8])> {
        let (stamp, rest) = body.split_first_chunk()?;
        let (sequence, rest) = rest.split_first_chunk()?;
        let (missed, rest) = rest.split_first_chunk()?;
        let (incarnation, value) = rest.split_first_chunk()?;
        let head = Self {
            stamp_ns: u64::from_le_bytes(*stamp),
            sequence: u32::from_le_bytes(*sequence),
            missed: u32::from_le_bytes(*missed),
            incarnation: u32::from_le_bytes(*incarnation),
        };
        Some((head, value))
    }
}

const fn _all_common_types_are_data() {
    const fn data<T: Data>() {}
    data::<Status>();
    data::<Subscribe>();
    data::<Unsubscribe>();
    data::<TimeReport>();
    data::<ExchangePage>();
    data::<OutputLevel>();
    data::<DescriptionPart>();
    data::<SetParameters>();
    data::<Result<Vec<Change>, Refusal>>();
}
