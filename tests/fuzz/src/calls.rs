//! Incoming commands, replies and data: envelopes, arguments, and the decision whether a command runs.

use crate::split::Bytes;
use rohrpost_config::Principal;
use rohrpost_launch::launcher::Children;
use rohrpost_mailbox::Name;
use rohrpost_modules::call::{CallEnvelope, Deduplicator, Fault, ReplyEnvelope, Request, Verdict};
use rohrpost_modules::common::{Change, DataHead, DescriptionPart, SetParameters, Status, Subscribe};
use rohrpost_modules::interfaces::Page;
use rohrpost_modules::runtime::read_arguments;
use rohrpost_modules::schema::Data;
use rohrpost_modules::types::{Image, LaserScan, OccupancyGrid, Odometry, PointCloud, Twist};

pub(crate) fn run(data: &[u8]) {
    envelopes(data);
    let Some((which, body)) = data.split_first() else { return };
    match which % 16 {
        0 => round::<Status>(body),
        1 => round::<Subscribe>(body),
        2 => round::<SetParameters>(body),
        3 => round::<Vec<Change>>(body),
        4 => round::<DescriptionPart>(body),
        5 => round::<Page>(body),
        6 => round::<Fault>(body),
        7 => round::<LaserScan>(body),
        8 => round::<OccupancyGrid>(body),
        9 => round::<(Odometry, Twist)>(body),
        10 => round::<(String, Option<char>, u128, i16)>(body),
        11 => round::<Children>(body),
        14 => round::<Image>(body),
        15 => round::<PointCloud>(body),
        _ => once(body),
    }
}

fn envelopes(body: &[u8]) {
    match CallEnvelope::split(body) {
        Ok((envelope, arguments)) => assert_eq!([&envelope.to_bytes()[..], arguments].concat(), body),
        Err(short) => assert!(short.have == body.len() && short.have < short.need),
    }
    match ReplyEnvelope::split(body) {
        Ok((envelope, result)) => assert_eq!([&envelope.to_bytes()[..], result].concat(), body),
        Err(short) => assert!(short.have == body.len() && short.have < short.need),
    }
    match DataHead::split(body) {
        Some((head, value)) => assert_eq!([&head.to_bytes()[..], value].concat(), body),
        None => assert!(body.len() < DataHead::BYTES),
    }
}

/// Arguments survive a round trip.
fn round<T: Data + std::fmt::Debug>(body: &[u8]) {
    let read: T = match read_arguments(body) {
        Ok(read) => read,
        Err(fault) => return assert!(matches!(&fault, Fault::Arguments(why) if !why.is_empty()), "{fault}"),
    };
    let bytes = postcard::to_stdvec(&read).unwrap_or_else(|error| panic!("{read:?}: {error}"));
    let again: T = read_arguments(&bytes).unwrap_or_else(|fault| panic!("{read:?}: {fault}"));
    // By text, since a NaN is not itself.
    assert_eq!(format!("{again:?}"), format!("{read:?}"));
}

/// Commands of some callers, in any order, with any age: a repeat of a command that has run does not run again.
fn once(body: &[u8]) {
    let mut bytes = Bytes(body);
    let mut now_ns = bytes.long();
    let mut once = Deduplicator::new(now_ns, &[]);
    while !bytes.is_empty() {
        let flags = bytes.byte();
        // Steps of 0 to 2.5 s, sometimes of 2^63 ns.
        let step = u64::from(bytes.byte()) * 10_000_000;
        now_ns = if flags & 8 == 0 { now_ns.saturating_add(step) } else { now_ns.saturating_add(1 << 63) };
        let request = Request {
            from: Name::new(1, bytes.byte(), 0, 1),
            principal: Principal::System(flags >> 6),
            incarnation: u32::from(bytes.byte() % 4),
            sequence: if flags & 16 == 0 { bytes.byte().into() } else { bytes.word() },
            valid_for_ns: u64::from(bytes.word()) * 1000,
            age_ns: if flags & 32 == 0 { u64::from(bytes.word()) * 1000 } else { bytes.long() },
            repeat: flags & 1 != 0,
            redelivered: flags & 2 != 0,
            idempotent: flags & 4 != 0,
        };
        if once.validate(&request, now_ns) == Verdict::Run {
            let answer = bytes.take(3);
            once.done(&request, now_ns, flags & 128 != 0, answer);
            let repeated = once.validate(&Request { repeat: true, ..request }, now_ns);
            assert_eq!(repeated, Verdict::Again(flags & 128 != 0, answer), "{request:?}");
        }
    }
}
