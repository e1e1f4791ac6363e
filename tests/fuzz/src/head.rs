//! Heads of packages: sixteen bytes are one, fewer are an error that says so, and a head is written again as it was
//! read.

use rohrpost_mailbox::{HEAD_BYTES, Head, Kind, Options, Type};

pub(crate) fn run(data: &[u8]) {
    let head = match Head::from_bytes(data) {
        Ok(head) => head,
        Err(short) => {
            assert!(data.len() < HEAD_BYTES);
            assert_eq!((short.have, short.need), (data.len(), HEAD_BYTES));
            return;
        }
    };
    assert!(!head.options.has(Options::BIG_ENDIAN), "fields are this machine's");
    let bytes = head.to_bytes();
    assert_eq!(Head::from_bytes(&bytes), Ok(head));
    if data[15] & Options::BIG_ENDIAN.0 == u8::from(cfg!(target_endian = "big")) {
        assert_eq!(bytes, data[..HEAD_BYTES]);
    }
    match head.kind.kind() {
        Kind::Command(number) => assert_eq!(Type::command(number), head.kind),
        Kind::Reply(number) => assert_eq!(Type::reply(number), head.kind),
        Kind::Data(number) => assert_eq!(Type::data(number), head.kind),
        Kind::None => {}
    }
}
