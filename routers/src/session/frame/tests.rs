use super::*;
use proptest::prelude::*;
use rohrpost_mailbox::{Head, Name, Type};

fn read(bytes: &[u8]) -> Result<SessionMessage<'_>, BadSessionFrame> {
    let (head, rest) = bytes.split_first_chunk().ok_or(BadSessionFrame::Damaged("short"))?;
    let head = SessionFrameHead::parse(head, LENGTH_MAX)?;
    SessionMessage::parse(head, rest.get(..head.length).ok_or(BadSessionFrame::Damaged("short"))?)
}

const TIME: TimeAnswer = TimeAnswer { asked_ns: 1, came_ns: 2, left_ns: 3, system_ns: 4, error_ns: 5, epoch: 6 };

const RECORD: RecordPart<'static> = RecordPart {
    place: 1,
    generation: 2,
    description: 3,
    incarnation: 4,
    len: 9,
    offset: 5,
    sequence: 6,
    epoch: 7,
    stamp_ns: 8,
    written_ns: 9,
    error_ns: 10,
    step: 11,
    sampled: 12,
    bytes: b"part",
};
const DESCRIPTION: DescriptionPart<'static> =
    DescriptionPart { place: 1, generation: 2, check: 3, len: 9, offset: 5, written: 4, bytes: b"part" };

fn each(check: impl Fn(&SessionMessage<'_>)) {
    let range = Range::module(Name::new(1, 200, 0, 0));
    let mut bytes = Vec::new();
    let ranges = Ranges::new(9, &[range, range], &mut bytes);
    let hello = SessionHello {
        system: 1,
        reaches_own: true,
        common: 2,
        system_digest: 3,
        incarnation: 4,
        attempt: 5,
        asked_ns: 6,
        name: "node brain",
    };
    let refusal = SessionRefusal {
        version: VERSION,
        reason: SessionRefusalReason::Common,
        yours: 1,
        ours: 2,
        text: "the server",
    };
    let head =
        Head { to: range.first, from: Name::new(1, 16, 0, 1), len: 3, kind: Type::command(16), ..Head::default() };
    for message in [
        SessionMessage::Hello(hello),
        SessionMessage::Welcome(Welcome { common: 1, incarnation: 2, time: TIME }),
        SessionMessage::Refusal(refusal),
        SessionMessage::Register(ranges),
        SessionMessage::Registered(RegistrationVerdict { number: 9, objection: None, range, holder: "" }),
        SessionMessage::Registered(RegistrationVerdict {
            number: 9,
            objection: Some(Objection::Taken),
            range,
            holder: "arm",
        }),
        SessionMessage::Package(Carried { hops: 2, published_ns: 7, head, body: &[1, 2, 3] }),
        SessionMessage::Ask(8),
        SessionMessage::Answer(TIME),
        SessionMessage::Record(RECORD),
        SessionMessage::Record(RecordPart { len: 0, offset: 0, bytes: &[], ..RECORD }),
        SessionMessage::Description(DESCRIPTION),
    ] {
        check(&message);
    }
}

#[test]
fn what_is_written_is_read() {
    each(|message| assert_eq!(read(&message.to_bytes()), Ok(*message)));
}

#[test]
fn a_frame_that_is_cut_short_is_damaged() {
    each(|message| {
        let bytes = message.to_bytes();
        for length in 0..bytes.len() - HEAD_BYTES {
            // Texts and parts may be shorter, and ranges fewer.
            let mut cut = bytes[..HEAD_BYTES + length].to_vec();
            cut[..4].copy_from_slice(&(length as u32).to_le_bytes());
            match (message, read(&cut)) {
                (_, Err(BadSessionFrame::Damaged(_))) => {}
                (
                    SessionMessage::Hello(_)
                    | SessionMessage::Refusal(_)
                    | SessionMessage::Registered(_)
                    | SessionMessage::Register(_)
                    | SessionMessage::Record(_)
                    | SessionMessage::Description(_),
                    Ok(_),
                ) => {}
                (_, other) => panic!("{message:?} cut to {length}: {other:?}"),
            }
        }
    });
}

#[test]
fn a_stream_of_something_else_is_told_from_another_version() {
    let hello = "GET / HTTP/1.1\r\n";
    assert_eq!(read(hello.as_bytes()), Err(BadSessionFrame::Damaged("unknown kind")));
    each(|message| {
        let mut bytes = message.to_bytes();
        if matches!(message, SessionMessage::Hello(_) | SessionMessage::Welcome(_)) {
            bytes[HEAD_BYTES + 4] = 9;
            assert_eq!(read(&bytes), Err(BadSessionFrame::Version(9)));
            bytes[HEAD_BYTES] = b'X';
            assert_eq!(read(&bytes), Err(BadSessionFrame::Foreign));
        }
    });
}

#[test]
fn refusals_say_what_differs_and_what_to_do() {
    let refusal = |reason| SessionRefusal { version: 7, reason, yours: 0xaa, ours: 0xbb, text: "node arm" }.to_string();
    for (reason, words) in [
        (SessionRefusalReason::Version, ["format 7", "same version"]),
        (SessionRefusalReason::Common, ["00000000000000aa", "00000000000000bb"]),
        (SessionRefusalReason::System, ["00000000000000aa", "node arm 00000000000000bb"]),
        (SessionRefusalReason::Full, ["as many clients", "`clients`"]),
        (SessionRefusalReason::Damaged, ["could not read", "node arm"]),
    ] {
        let said = refusal(reason);
        assert!(words.iter().all(|word| said.contains(word)), "{said}");
    }
    let range = Range::module(Name::new(1, 200, 0, 0));
    let verdict = RegistrationVerdict { number: 0, objection: Some(Objection::Taken), range, holder: "node arm" };
    assert_eq!(
        verdict.to_string(),
        "1.200.0.0 to 1.200.0.255 is hosted by node arm; end it, or give one of both another name"
    );
}

proptest! {
    #[test]
    fn no_bytes_are_read_wrongly(kind in 0u8..10, hops in 0u8..3, rest: Vec<u8>) {
        let mut bytes = (rest.len() as u32).to_le_bytes().to_vec();
        bytes.extend([kind, hops, 0, 0]);
        bytes.extend(rest);
        // The head of a package may be in the other byte order.
        if let Ok(message) = read(&bytes) && kind != SessionFrameKind::Package as u8 {
            prop_assert_eq!(&message.to_bytes(), &bytes, "{:?}", message);
        }
    }
}
