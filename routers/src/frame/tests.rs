use super::*;
use proptest::prelude::*;
use rohrpost_mailbox::{Name, Priority};

fn frame_head(kind: FrameKind) -> FrameHead {
    FrameHead { kind, system: 1, from: 2, to: 3, digest: 4, incarnation: 5, sequence: 6 }
}

fn datagram(kind: FrameKind, rest: &[u8]) -> Vec<u8> {
    [&frame_head(kind).to_bytes(&[rest]), rest].concat()
}

/// A datagram with a right check, so that only its content is wrong.
fn checked(mut datagram: Vec<u8>) -> Vec<u8> {
    let head = *datagram.first_chunk::<HEAD_BYTES>().unwrap();
    let check = check(&head, &[&datagram[HEAD_BYTES..]]);
    datagram[CHECK].copy_from_slice(&check.to_le_bytes());
    datagram
}

fn package(body: &[u8]) -> Vec<u8> {
    let head = Head { to: Name::new(1, 2, 3, 4), len: body.len() as u16, priority: Priority(9), ..Head::default() };
    [&head.to_bytes(), body].concat()
}

fn fragment(index: u16, count: u16, offset: u32, len: u16, bytes: usize) -> Vec<u8> {
    let head = Head { len, ..Head::default() };
    let part = Fragment { first: 1, index, count, offset, head, bytes: &[] };
    [&part.head_bytes()[..], &vec![7; bytes]].concat()
}

#[test]
fn what_is_written_reads_back() {
    let rest = [package(b"one"), package(b""), package(b"three")].concat();
    let bytes = datagram(FrameKind::Packages, &rest);
    let (head, frame) = Frame::parse(&bytes).unwrap();
    assert_eq!(head, frame_head(FrameKind::Packages));
    let Frame::Packages(packages) = frame else { panic!("{frame:?}") };
    let bodies: Vec<&[u8]> = packages.map(|(_, body)| body).collect();
    assert_eq!(bodies, [&b"one"[..], b"", b"three"]);

    let alive = Alive { heard_incarnation: 1, heard_next: 2, heard_lost: 3 };
    let bytes = datagram(FrameKind::Alive, &alive.to_bytes());
    assert_eq!(Frame::parse(&bytes), Ok((frame_head(FrameKind::Alive), Frame::Alive(alive))));

    for reason in [RefusalReason::Version, RefusalReason::Digest, RefusalReason::Stranger] {
        let refusal = Refusal { version: VERSION, reason, digest: 99 };
        let bytes = datagram(FrameKind::Refusal, &refusal.to_bytes());
        assert_eq!(Frame::parse(&bytes), Ok((frame_head(FrameKind::Refusal), Frame::Refusal(refusal))));
    }
    let bytes = datagram(FrameKind::Sync, b"of time");
    assert_eq!(Frame::parse(&bytes), Ok((frame_head(FrameKind::Sync), Frame::Time(b"of time"))));
}

#[test]
fn the_check_covers_all_parts_alike() {
    let whole = frame_head(FrameKind::Packages).to_bytes(&[b"one and two"]);
    assert_eq!(frame_head(FrameKind::Packages).to_bytes(&[b"one ", b"", b"and two"]), whole);
}

#[test]
fn what_is_wrong_says_why() {
    let damaged = |why| Err(BadFrame::Damaged(why));
    let changed = |at: usize, to: u8| {
        let mut bytes = datagram(FrameKind::Packages, &package(b"body"));
        bytes[at] = to;
        bytes
    };
    let long_sequence = FrameHead { sequence: SEQUENCE_MAX + 1, ..frame_head(FrameKind::Sync) }.to_bytes(&[]).to_vec();
    let no_incarnation = FrameHead { incarnation: 0, ..frame_head(FrameKind::Sync) }.to_bytes(&[]).to_vec();
    for (bytes, why) in [
        (vec![], Err(BadFrame::Foreign)),
        (b"Rp".to_vec(), Err(BadFrame::Foreign)),
        (vec![0; 100], Err(BadFrame::Foreign)),
        (changed(20, 1), damaged("the check differs")),
        (changed(2, VERSION + 1), damaged("the check differs")),
        (checked(changed(2, VERSION - 1)), Err(BadFrame::Version(VERSION - 1))),
        (checked(changed(3, 9)), damaged("unknown kind")),
        (checked(changed(7, 1)), Err(BadFrame::Sealed)),
        (no_incarnation, damaged("incarnation 0")),
        (long_sequence, damaged("a sequence that no router reaches")),
        (datagram(FrameKind::Packages, &[]), damaged("a package is cut short")),
        (datagram(FrameKind::Packages, &package(b"body")[..19]), damaged("a package is cut short")),
        (datagram(FrameKind::Packages, &[package(b"body"), vec![1]].concat()), damaged("a package is cut short")),
        (datagram(FrameKind::Alive, &[0; 23]), damaged("an alive frame has 24 bytes")),
        (datagram(FrameKind::Refusal, &[1; 15]), damaged("a refusal has 16 bytes")),
        (datagram(FrameKind::Refusal, &[0; 16]), damaged("unknown reason of a refusal")),
        (datagram(FrameKind::Refusal, &[1; 16]), damaged("unknown reason of a refusal")),
        (datagram(FrameKind::Fragment, &[0; 31]), damaged("a fragment is cut short")),
    ] {
        assert_eq!(Frame::parse(&bytes).map(|_| ()), why, "{bytes:02x?}");
    }
}

#[test]
fn a_refusal_is_read_in_every_version() {
    let refusal = Refusal { version: 77, reason: RefusalReason::Version, digest: 99 };
    let mut bytes = datagram(FrameKind::Refusal, &refusal.to_bytes());
    bytes[2] = 77;
    assert_eq!(Frame::parse(&checked(bytes)).map(|(_, frame)| frame), Ok(Frame::Refusal(refusal)));
}

#[test]
fn fragments_that_cannot_be_are_refused() {
    for (index, count, offset, len, bytes, sound, why) in [
        (0, 3, 0, 250, 100, true, "the first"),
        (1, 3, 100, 250, 100, true, "one between"),
        (2, 3, 200, 250, 50, true, "the last"),
        (2, 3, 200, 300, 100, true, "a last that is full"),
        (0, 1, 0, 100, 100, false, "a whole package is no fragment"),
        (3, 3, 300, 250, 100, false, "behind the last"),
        (2, 3, 200, 250, 49, false, "the last is too short"),
        (2, 3, 200, 250, 51, false, "the last is too long"),
        (1, 3, 90, 250, 100, false, "overlaps the first"),
        (1, 3, 110, 250, 100, false, "leaves a gap"),
        (0, 4, 0, 250, 100, false, "more parts than there are"),
        (0, 2, 0, 250, 100, false, "fewer parts than there are"),
        (0, 3, 0, 250, 0, false, "empty"),
        (1, 2, 0, 100, 100, false, "a last without others"),
        (0, 257, 0, 257, 1, false, "more parts than are taken"),
        (255, 256, 255, 256, 1, true, "as many as are taken"),
    ] {
        let bytes = datagram(FrameKind::Fragment, &fragment(index, count, offset, len, bytes));
        assert_eq!(Frame::parse(&bytes).is_ok(), sound, "{why}");
    }
}

proptest! {
    #[test]
    fn no_bytes_bring_it_down(bytes: Vec<u8>, kind in 0u8..24) {
        let _ = Frame::parse(&bytes);
        let mut bytes = [&frame_head(FrameKind::Packages).to_bytes(&[]), &bytes[..]].concat();
        bytes[3] = kind;
        let _ = Frame::parse(&checked(bytes)).map(|(_, frame)| if let Frame::Packages(packages) = frame {
            assert!(packages.count() > 0);
        });
    }

    #[test]
    fn a_flipped_bit_is_noticed(body: Vec<u8>, bit: prop::sample::Index) {
        let mut bytes = datagram(FrameKind::Packages, &package(&body[..body.len().min(1000)]));
        let bit = bit.index(bytes.len() * 8);
        bytes[bit / 8] ^= 1 << (bit % 8);
        prop_assert!(Frame::parse(&bytes).is_err());
    }
}
