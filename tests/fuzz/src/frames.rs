//! Datagrams of routers: their check covers the whole, so a datagram is written again as it was read, byte for byte.

use rohrpost_mailbox::{HEAD_BYTES as PACKAGE_HEAD_BYTES, Head};
use rohrpost_routers::frame::{
    ASKED_PARTS_MAX, Frame, FrameHead, HEAD_BYTES, PART_REQUEST_BYTES_MAX, PARTS_MAX, ReplicaFrame, VERSION,
};
use rohrpost_routers::time::message::TimeMessage;

pub(crate) fn run(data: &[u8]) {
    validate(data);
    // A fuzzer does not find the check by trying, so it is added, as by a sender with mistakes of its own.
    if let Some((head, rest)) = data.split_first_chunk::<HEAD_BYTES>() {
        validate(&[&checked(head, rest)[..], rest].concat());
    }
}

/// The head with the check that belongs to it.
pub(crate) fn checked(head: &[u8; HEAD_BYTES], rest: &[u8]) -> [u8; HEAD_BYTES] {
    let mut head = *head;
    let (before, _) = head.split_at(HEAD_BYTES - 4);
    let check = crc32fast::hash(&[before, rest].concat());
    head[HEAD_BYTES - 4..].copy_from_slice(&check.to_le_bytes());
    head
}

fn validate(datagram: &[u8]) {
    let (head, frame) = match Frame::parse(datagram) {
        Ok(read) => read,
        Err(error) => return assert!(!error.to_string().is_empty()),
    };
    let rest = &datagram[HEAD_BYTES..];
    match frame {
        Frame::Packages(packages) => {
            let sizes: usize = packages.map(|(_, body)| PACKAGE_HEAD_BYTES + body.len()).sum();
            assert_eq!(sizes, rest.len(), "all of it");
            assert!(packages.into_iter().all(|(head, body)| usize::from(head.len) == body.len()));
        }
        Frame::Fragment(part) => {
            let end = part.offset as usize + part.bytes.len();
            assert!(part.index < part.count && part.count <= PARTS_MAX && end <= usize::from(part.head.len));
            assert_eq!(part.head_bytes()[..PACKAGE_HEAD_BYTES], rest[..PACKAGE_HEAD_BYTES]);
            assert_eq!(Head::from_bytes(&part.head_bytes()[PACKAGE_HEAD_BYTES..]), Ok(part.head));
        }
        Frame::Alive(alive) => assert_eq!(alive.to_bytes(), rest),
        Frame::Refusal(refusal) => assert_eq!(refusal.to_bytes(), rest),
        Frame::Replica(ReplicaFrame::Request(request)) => {
            let request = request.read();
            let mut bytes = [0; PART_REQUEST_BYTES_MAX];
            let len = request.write(&mut bytes);
            assert_eq!(bytes[..len], *rest);
            let asked = request.asked();
            assert!((1..=ASKED_PARTS_MAX).contains(&asked.count()));
        }
        Frame::Replica(ReplicaFrame::Record(part)) => {
            is_part(rest, &part.head_bytes(), (part.bytes, part.offset, part.len))
        }
        Frame::Replica(ReplicaFrame::Description(part)) => {
            is_part(rest, &part.head_bytes(), (part.bytes, part.offset, part.len));
        }
        Frame::Time(time) => {
            if let Ok(message) = TimeMessage::parse(head.kind, time) {
                assert_eq!((message.kind(), &message.to_bytes()[..]), (head.kind, time));
            }
        }
    }
    if datagram[2] == VERSION {
        assert_eq!(head.to_bytes(&[rest]), datagram[..HEAD_BYTES]);
        assert_eq!(FrameHead::parse(datagram), Ok((head, rest)));
    }
}

fn is_part(rest: &[u8], head: &[u8], (bytes, offset, len): (&[u8], u32, u32)) {
    assert!(offset as usize + bytes.len() <= len as usize);
    assert_eq!([head, bytes].concat(), rest);
}
