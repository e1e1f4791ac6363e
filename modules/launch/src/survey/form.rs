//! A look at a node as it travels from that node's launch to a tool elsewhere: postcard of forms of its types.
//!
//! The types of `rohrpost-mailbox` know no serialization, so `travels!` makes a form of each, field by field. What
//! arrives is a claim of another process: whatever the bytes are, reading them gives a look or an error.

#[cfg(test)]
mod tests;

use super::{MailboxSnapshot, ModuleSurvey, StreamSurvey, Survey, Usage, Working};
use crate::launcher::ChildState;
use rohrpost_mailbox::sys::Scheduling;
use rohrpost_mailbox::{
    Class, ClassTraffic, FlowInfo, FlowSecond, LATENCY_BUCKETS, Latency, Loss, MailboxDetail, MailboxInfo, Missed,
    ModuleState, Name, OverflowPolicy, ParticipantInfo, Party, Priority, RecordInfo, STREAM_KEEP_MAX, Shape, SlotInfo,
    Stamp, StreamId, StreamInfo, StreamShape, Type, VictimInfo, WaitingPackage,
};
use rohrpost_schema::Schema;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// What one look shows.
#[derive(Clone, Debug)]
pub enum Snapshot {
    /// A node.
    Survey(Box<Survey>),
    /// One of its mailboxes; none when it has none of this name.
    Mailbox(Option<Box<MailboxSnapshot>>),
}

impl Snapshot {
    /// As it travels.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        // Writing to a growing vector does not fail; an empty one is refused by its reader.
        postcard::to_stdvec(&self.form()).unwrap_or_default()
    }

    /// Reads what [`Snapshot::to_bytes`] wrote.
    ///
    /// # Errors
    /// When the bytes are of another kind.
    pub(crate) fn from_bytes(bytes: &[u8]) -> Result<Self, postcard::Error> {
        postcard::from_bytes(bytes).map(Self::of)
    }

    /// Tells the forms of different versions of this program apart: computed from the types below.
    pub(crate) fn format() -> u32 {
        SeenForm::schema().hash()
    }
}

/// A type that travels in another form, with the same content.
trait Travels {
    type Form;

    fn form(&self) -> Self::Form;

    fn of(form: Self::Form) -> Self;
}

/// Types that travel as they are.
macro_rules! plain {
    ($($ty:ty),*) => {$(
        impl Travels for $ty {
            type Form = Self;

            fn form(&self) -> Self {
                self.clone()
            }

            fn of(form: Self) -> Self {
                form
            }
        }
    )*};
}
plain! { bool, u8, u16, u32, u64, u128, i8, i16, String, (u32, u32), (u64, u64), [u64; Loss::ALL.len()], ChildState }

/// Types that travel as one of the above.
macro_rules! as_plain {
    ($($ty:ty => $plain:ty, $form:expr, $of:expr;)*) => {$(
        impl Travels for $ty {
            type Form = $plain;

            fn form(&self) -> $plain {
                let form: fn(&Self) -> $plain = $form;
                form(self)
            }

            fn of(form: $plain) -> Self {
                $of(form)
            }
        }
    )*};
}
as_plain! {
    Name => u32, |name| name.raw(), Self::from_raw;
    Class => u8, |class| class.0, Self;
    Priority => u8, |priority| priority.0, Self;
    Type => i16, |ty| ty.0, Self;
    usize => u64, |count| *count as u64, |count| Self::try_from(count).unwrap_or(Self::MAX);
    Duration => u64, |time| u64::try_from(time.as_nanos()).unwrap_or(u64::MAX), Self::from_nanos;
}

impl<T: Travels> Travels for Box<T> {
    type Form = T::Form;

    fn form(&self) -> T::Form {
        (**self).form()
    }

    fn of(form: T::Form) -> Self {
        Self::new(T::of(form))
    }
}

impl<T: Travels> Travels for Option<T> {
    type Form = Option<T::Form>;

    fn form(&self) -> Self::Form {
        self.as_ref().map(T::form)
    }

    fn of(form: Self::Form) -> Self {
        form.map(T::of)
    }
}

impl<T: Travels> Travels for Vec<T> {
    type Form = Vec<T::Form>;

    fn form(&self) -> Self::Form {
        self.iter().map(T::form).collect()
    }

    fn of(form: Self::Form) -> Self {
        form.into_iter().map(T::of).collect()
    }
}

/// Makes the forms of structs and enums. Fields behind `without` stay behind; they arrive as the value given there.
macro_rules! travels {
    () => {};
    (
        struct $ty:ident as $form:ident { $($field:ident: $of:ty,)* } $(without { $($left:ident: $value:expr),* })?;
        $($rest:tt)*
    ) => {
        #[derive(Serialize, Deserialize, Schema)]
        struct $form {
            $($field: <$of as Travels>::Form,)*
        }

        impl Travels for $ty {
            type Form = $form;

            fn form(&self) -> $form {
                $form { $($field: self.$field.form(),)* }
            }

            fn of(form: $form) -> Self {
                Self { $($field: Travels::of(form.$field),)* $($($left: $value,)*)? }
            }
        }

        travels! { $($rest)* }
    };
    (
        enum $ty:ident as $form:ident {
            $($choice:ident $(($inner:ident: $of:ty))? $({ $($field:ident: $its:ty),* })?,)*
        };
        $($rest:tt)*
    ) => {
        #[derive(Serialize, Deserialize, Schema)]
        enum $form {
            $($choice $((<$of as Travels>::Form))? $({ $($field: <$its as Travels>::Form),* })?,)*
        }

        impl Travels for $ty {
            type Form = $form;

            fn form(&self) -> $form {
                match self {
                    $(Self::$choice $(($inner))? $({ $($field),* })? => {
                        $form::$choice $(($inner.form()))? $({ $($field: $field.form()),* })?
                    })*
                }
            }

            fn of(form: $form) -> Self {
                match form {
                    $($form::$choice $(($inner))? $({ $($field),* })? => {
                        Self::$choice $((Travels::of($inner)))? $({ $($field: Travels::of($field)),* })?
                    })*
                }
            }
        }

        travels! { $($rest)* }
    };
}

travels! {
    enum Snapshot as SeenForm {
        Survey(survey: Box<Survey>),
        Mailbox(look: Option<Box<MailboxSnapshot>>),
    };
    struct Survey as SurveyForm {
        node: String,
        at_ns: u64,
        modules: Vec<ModuleSurvey>,
        mailboxes: Vec<MailboxInfo>,
        streams: Vec<StreamSurvey>,
        classes: Vec<ClassTraffic>,
        flows: Vec<FlowInfo>,
    };
    struct ModuleSurvey as ModuleForm {
        node: String,
        at_ns: Option<u64>,
        name: Name,
        aliases: Vec<Name>,
        process: Option<ParticipantInfo>,
        usage: Option<Usage>,
        scheduling: Option<Scheduling>,
        received: u64,
        bytes_in: u64,
        lost: u64,
        losses: [u64; Loss::ALL.len()],
        waited: Latency,
        sent: u64,
        bytes_out: u64,
        depth: u32,
        working: Option<Working>,
        in_turn: Option<Duration>,
        child: Option<ChildState>,
    } without { error: None };
    // For how long it lasts is in the module's own form; what lasts long is there, too, with the names of functions.
    struct ParticipantInfo as ProcessForm {
        module: Name,
        pid: u32,
        incarnation: u32,
        state: Option<ModuleState>,
        complains: bool,
        errors: u32,
        restarts: u32,
        joined_ns: u64,
    } without { in_hand: None };
    enum ModuleState as StateForm { Starting, Off, On, Error, Stopping, StandsBy, };
    struct Usage as UsageForm { cpu: Duration, memory_bytes: u64, };
    struct Working as WorkingForm { part: String, lasts: Duration, };
    enum Scheduling as SchedulingForm { Fifo(priority: u8), Normal(nice: i8), };
    struct MailboxInfo as MailboxForm {
        name: Name,
        shape: Shape,
        owner: Option<u32>,
        adoptions: u32,
        depth: u32,
        depth_max: u32,
        sent: u64,
        classes: Vec<ClassTraffic>,
    };
    struct Shape as ShapeForm {
        slots: u16,
        body_bytes_max: u16,
        full: OverflowPolicy,
        max_age: Option<Duration>,
        claims: u8,
    };
    struct StreamSurvey as StreamForm { node: String, at_ns: u64, info: StreamInfo, };
    struct StreamInfo as StreamInfoForm {
        id: StreamId,
        shape: StreamShape,
        writer: Option<Party>,
        adoptions: u32,
        written: u64,
        refused: u64,
        oldest: Option<RecordInfo>,
        newest: Option<RecordInfo>,
        readers: u16,
        reader_modules: Vec<Name>,
        holding: u16,
        sleeping: u16,
        missed: Missed,
    };
    struct Missed as MissedForm { lost: u64, sampled: u64, passed_over: u64, };
    struct StreamId as StreamIdForm { name: Name, number: u16, };
    struct RecordInfo as RecordForm {
        sequence: u64,
        stamp: Stamp,
        written_ns: u64,
        len_bytes: usize,
        incarnation: u32,
    };
    struct Stamp as StampForm { epoch: u64, ns: u64, };
    enum OverflowPolicy as FullForm { Displace, Latest, Reject, };
    struct ClassTraffic as ClassForm {
        class: Option<Class>,
        received: u64,
        body_bytes: u64,
        losses: [u64; Loss::ALL.len()],
        latency: Latency,
    };
    struct FlowInfo as FlowForm {
        pid: u32,
        module: Name,
        incarnation: u32,
        from: Name,
        to: Name,
        kind: Type,
        packages: u64,
        bytes: u64,
        refused: u64,
        first_ns: u64,
        last_ns: u64,
        interval_squares_ns2: u128,
        age_sum_ns: u64,
        seconds: Vec<FlowSecond>,
    };
    struct FlowSecond as SecondForm { second: u64, interval_ns: Option<(u64, u64)>, bytes: (u32, u32), };
    struct MailboxSnapshot as LookForm { stopped: Vec<u32>, detail: MailboxDetail, };
    struct MailboxDetail as DetailForm {
        info: MailboxInfo,
        receiver: Option<Party>,
        is_retired: bool,
        slots: Vec<SlotInfo>,
    };
    enum SlotInfo as SlotForm {
        Free,
        Filling { by: Party, victim: Option<VictimInfo> },
        Ready(package: WaitingPackage),
        Taken(package: WaitingPackage),
    };
    struct WaitingPackage as WaitingForm { priority: Priority, ticket: u64, is_redelivered: bool, };
    struct VictimInfo as VictimForm { priority: Priority, is_replaced: bool, };
    struct Party as PartyForm { participant: u16, pid: Option<u32>, module: Name, is_alive: bool, };
}

#[derive(Serialize, Deserialize, Schema)]
struct StreamShapeForm {
    record_bytes: u32,
    keep: u32,
    readers: u16,
    late_ns: u64,
}

impl Travels for StreamShape {
    type Form = StreamShapeForm;

    fn form(&self) -> StreamShapeForm {
        let Self { record_bytes, keep, readers, late } = *self;
        StreamShapeForm { record_bytes, keep, readers, late_ns: late.form() }
    }

    /// No stream keeps more than it can: its size is computed from this.
    fn of(form: StreamShapeForm) -> Self {
        let StreamShapeForm { record_bytes, keep, readers, late_ns } = form;
        Self { record_bytes, keep: keep.min(STREAM_KEEP_MAX), readers, late: Duration::of(late_ns) }
    }
}

/// Most buckets are empty: those that are not, with their numbers.
#[derive(Serialize, Deserialize, Schema)]
struct LatencyForm {
    max_ns: u64,
    sum_ns: u64,
    buckets: Vec<(u8, u32)>,
}

impl Travels for Latency {
    type Form = LatencyForm;

    fn form(&self) -> LatencyForm {
        let counted = (0u8..).zip(&self.buckets).filter(|(_, count)| **count > 0);
        let buckets = counted.map(|(at, count)| (at, *count)).collect();
        LatencyForm { max_ns: self.max.form(), sum_ns: self.sum.form(), buckets }
    }

    fn of(form: LatencyForm) -> Self {
        let mut buckets = [0; LATENCY_BUCKETS];
        for (at, count) in form.buckets {
            if let Some(bucket) = buckets.get_mut(usize::from(at)) {
                *bucket = count;
            }
        }
        Self { max: Duration::from_nanos(form.max_ns), sum: Duration::from_nanos(form.sum_ns), buckets }
    }
}
