//! What classes received and who sent what to whom, as it travels.

use rohrpost_mailbox::{Class, ClassTraffic, FlowInfo, FlowSecond, LATENCY_BUCKETS, Latency, Loss, Name, Type};
use rohrpost_schema::Schema;
use serde::{Deserialize, Serialize};
use std::time::Duration;

#[derive(Serialize, Deserialize, Schema)]
pub(super) struct ClassForm {
    class: Option<u8>,
    received: u64,
    body_bytes: u64,
    losses: [u64; Loss::ALL.len()],
    waited: LatencyForm,
}

/// Most buckets are empty: those that are not, with their numbers.
#[derive(Serialize, Deserialize, Schema)]
pub(super) struct LatencyForm {
    max_ns: u64,
    sum_ns: u64,
    buckets: Vec<(u8, u32)>,
}

#[derive(Serialize, Deserialize, Schema)]
pub(super) struct FlowForm {
    pid: u32,
    module: u32,
    incarnation: u32,
    from: u32,
    to: u32,
    kind: i16,
    packages: u64,
    bytes: u64,
    refused: u64,
    first_ns: u64,
    last_ns: u64,
    interval_squares_ns2: u128,
    age_sum_ns: u64,
    seconds: Vec<SecondForm>,
}

#[derive(Serialize, Deserialize, Schema)]
struct SecondForm {
    second: u64,
    interval_ns: Option<(u64, u64)>,
    bytes: (u32, u32),
}

pub(super) fn class_form(class: &ClassTraffic) -> ClassForm {
    ClassForm {
        class: class.class.map(|class| class.0),
        received: class.received,
        body_bytes: class.body_bytes,
        losses: class.losses,
        waited: latency_form(&class.latency),
    }
}

pub(super) fn class(form: ClassForm) -> ClassTraffic {
    ClassTraffic {
        class: form.class.map(Class),
        received: form.received,
        body_bytes: form.body_bytes,
        losses: form.losses,
        latency: latency(form.waited),
    }
}

pub(super) fn latency_form(latency: &Latency) -> LatencyForm {
    let counted = (0u8..).zip(&latency.buckets).filter(|(_, count)| **count > 0);
    let buckets = counted.map(|(at, count)| (at, *count)).collect();
    LatencyForm { max_ns: ns(latency.max), sum_ns: ns(latency.sum), buckets }
}

pub(super) fn latency(form: LatencyForm) -> Latency {
    let mut buckets = [0; LATENCY_BUCKETS];
    for (at, count) in form.buckets {
        if let Some(bucket) = buckets.get_mut(usize::from(at)) {
            *bucket = count;
        }
    }
    Latency { max: Duration::from_nanos(form.max_ns), sum: Duration::from_nanos(form.sum_ns), buckets }
}

pub(super) fn flow_form(flow: &FlowInfo) -> FlowForm {
    let second = |second: &FlowSecond| SecondForm {
        second: second.second,
        interval_ns: second.interval_ns,
        bytes: second.bytes,
    };
    FlowForm {
        pid: flow.pid,
        module: flow.module.raw(),
        incarnation: flow.incarnation,
        from: flow.from.raw(),
        to: flow.to.raw(),
        kind: flow.kind.0,
        packages: flow.packages,
        bytes: flow.bytes,
        refused: flow.refused,
        first_ns: flow.first_ns,
        last_ns: flow.last_ns,
        interval_squares_ns2: flow.interval_squares_ns2,
        age_sum_ns: flow.age_sum_ns,
        seconds: flow.seconds.iter().map(second).collect(),
    }
}

pub(super) fn flow(form: FlowForm) -> FlowInfo {
    let second =
        |form: SecondForm| FlowSecond { second: form.second, interval_ns: form.interval_ns, bytes: form.bytes };
    FlowInfo {
        pid: form.pid,
        module: Name::from_raw(form.module),
        incarnation: form.incarnation,
        from: Name::from_raw(form.from),
        to: Name::from_raw(form.to),
        kind: Type(form.kind),
        packages: form.packages,
        bytes: form.bytes,
        refused: form.refused,
        first_ns: form.first_ns,
        last_ns: form.last_ns,
        interval_squares_ns2: form.interval_squares_ns2,
        age_sum_ns: form.age_sum_ns,
        seconds: form.seconds.into_iter().map(second).collect(),
    }
}

pub(super) fn ns(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}
