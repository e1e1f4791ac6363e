//! What is told of a file that was not closed.

use super::support::{file_of, memory_folder, said};
use crate::{Damage, ReadError, Reader, info, is_closed};
use rohrpost_schema::Type;

#[test]
fn a_file_that_was_not_closed_is_read_through() {
    let folder = memory_folder();
    let all = said(300, 5_000);
    let path = file_of(folder.path(), "base", &all);
    let whole = info(&path).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() - 3]).unwrap();
    let told = info(&path).unwrap();
    assert!(!told.is_closed);
    assert_eq!(
        (told.messages, told.chunks, told.first_ns, told.last_ns),
        (300, whole.chunks, whole.first_ns, whole.last_ns)
    );
    assert_eq!((&told.channels, &told.epochs), (&whole.channels, &whole.epochs));
    std::fs::write(&path, &bytes[..bytes.len() * 2 / 3]).unwrap();
    let told = info(&path).unwrap();
    assert!(!told.is_closed && told.messages < 300 && told.messages > 100);
    assert_eq!(told.damages.len(), 1);
    assert_eq!(told.damages[0].1, Damage::Cut);
}

#[test]
fn a_file_is_read_message_by_message_for_replay() {
    let folder = memory_folder();
    let all = said(300, 5_000);
    let path = file_of(folder.path(), "base", &all);
    assert!(is_closed(&path).unwrap());
    let mut reader = Reader::open(&path).unwrap();
    for said in &all {
        let (channel, message) = reader.next().unwrap().unwrap();
        assert_eq!((channel.topic.as_str(), channel.item.as_str()), (said.topic.as_str(), "scan"));
        assert_eq!(channel.ty.as_deref(), Some(&Type::Bytes));
        assert_eq!((message.arrival_ns, message.stamp_ns), (said.arrival_ns, said.stamp_ns));
        assert_eq!((message.epoch, message.sequence, message.data), (said.epoch, said.sequence, &said.data[..]));
    }
    assert!(reader.next().unwrap().is_none() && reader.is_closed());
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    assert!(!is_closed(&path).unwrap());
    let mut reader = Reader::open(&path).unwrap();
    let error = loop {
        match reader.next() {
            Ok(message) => assert!(message.is_some(), "the cut is an error"),
            Err(error) => break error,
        }
    };
    assert!(matches!(error, ReadError::Damaged { what: Damage::Cut, .. }), "{error}");
}
