//! What handles stand for.

use crate::lender::Lender;
use rohrpost_config::Installation;
use rohrpost_mailbox::{
    HeldRecord, Loan, OpenRecord, Package, Participant, Receiver, Sender, StreamReader, StreamWriter, SystemClock,
    Watches,
};
use std::sync::Arc;

/// A node that a thread takes part in.
pub(crate) struct NodeObject {
    pub(crate) participant: Arc<Participant>,
    /// Descriptors that it waits for besides mailboxes; made with the first of them.
    pub(crate) watches: Option<Watches>,
    pub(crate) clock: SystemClock,
    /// Knows names; none for a node that was opened by its directory.
    pub(crate) installation: Option<Arc<Installation>>,
}

pub(crate) type SenderObject = Lender<Sender, Loan<'static>>;
pub(crate) type ReceiverObject = Lender<Receiver, Package<'static>>;
pub(crate) type WriterObject = Lender<StreamWriter, OpenRecord<'static>>;
pub(crate) type ReaderObject = Lender<StreamReader, HeldRecord<'static>>;

/// What a handle stands for.
pub(crate) enum Object {
    Node(NodeObject),
    Sender(SenderObject),
    Receiver(ReceiverObject),
    Writer(WriterObject),
    Reader(ReaderObject),
}

/// A kind of object.
pub(crate) trait Kind: Sized {
    /// Its number in handles; not 0.
    const NUMBER: u8;
    /// What messages call it.
    const WHAT: &'static str;
    fn store(self) -> Object;
    fn find(object: &mut Object) -> Option<&mut Self>;
    fn take(object: Object) -> Option<Self>;
}

macro_rules! kinds {
    ($($variant:ident($object:ident) $number:literal $what:literal),*) => {$(
        impl Kind for $object {
            const NUMBER: u8 = $number;
            const WHAT: &'static str = $what;

            fn store(self) -> Object {
                Object::$variant(self)
            }

            fn find(object: &mut Object) -> Option<&mut Self> {
                if let Object::$variant(object) = object { Some(object) } else { None }
            }

            fn take(object: Object) -> Option<Self> {
                if let Object::$variant(object) = object { Some(object) } else { None }
            }
        }
    )*};
}
kinds! {
    Node(NodeObject) 1 "node",
    Sender(SenderObject) 2 "sender",
    Receiver(ReceiverObject) 3 "receiver",
    Writer(WriterObject) 4 "writer of a stream",
    Reader(ReaderObject) 5 "reader of a stream"
}
