//! Mailboxes: sending, writing a package in place, and receiving.

use crate::code::Code;
use crate::edge::{bytes, edge, failed, given, place, say, waiting};
use crate::node::NodeHandle;
use crate::objects::{NodeObject, ReceiverObject, SenderObject};
use crate::table;
use rohrpost_mailbox::{Label, Loan, Name, Options, OverflowPolicy, Package, Priority, Receiver, Sender, Shape, Type};
use std::ffi::c_void;
use std::mem::MaybeUninit;
use std::time::Duration;

/// The body's first 8 bytes are the system time of its making, nanoseconds since 1970, little-endian.
pub const ROHRPOST_OPTION_STAMPED: u8 = 2;
/// The body is a fault, not the answer that was asked for.
pub const ROHRPOST_OPTION_ERROR: u8 = 4;
/// Its receiver died while it had this package; it is handed out a second and last time.
pub const ROHRPOST_OPTION_REDELIVERED: u8 = 8;
/// Only the newest of one sender, receiver, type and id counts.
pub const ROHRPOST_OPTION_NEWEST: u8 = 16;

const _: () = {
    assert!(ROHRPOST_OPTION_STAMPED == Options::STAMPED.0 && ROHRPOST_OPTION_ERROR == Options::ERROR.0);
    assert!(ROHRPOST_OPTION_REDELIVERED == Options::REDELIVERED.0 && ROHRPOST_OPTION_NEWEST == Options::NEWEST.0);
};

/// A way into one mailbox.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct SenderHandle {
    /// Which; 0 is none.
    pub id: u64,
}

/// The receiving end of a mailbox.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct ReceiverHandle {
    /// Which; 0 is none.
    pub id: u64,
}

/// What a sender says of a package besides its body.
#[repr(C)]
pub struct PackageLabel {
    /// Mailbox that answers go to; 0: none.
    pub from: u32,
    /// What it is: `ROHRPOST_COMMAND(n)`, `ROHRPOST_REPLY(n)`, `ROHRPOST_DATA(n)`.
    pub kind: i16,
    /// Tells packages of one type apart.
    pub id: u16,
    /// How urgent, 255 most: the id of the sender's class.
    pub priority: u8,
    /// Bits `ROHRPOST_OPTION_...`.
    pub options: u8,
}

/// A package in hand.
#[repr(C)]
pub struct PackageInHand {
    /// Mailbox that it was sent to.
    pub to: u32,
    /// Mailbox that answers go to; also names the sender.
    pub from: u32,
    /// What it is.
    pub kind: i16,
    /// Tells packages of one type apart.
    pub id: u16,
    /// How urgent.
    pub priority: u8,
    /// Bits `ROHRPOST_OPTION_...`.
    pub options: u8,
    /// Bytes of the body.
    pub len: u16,
    /// The body, in shared memory.
    pub body: *const u8,
    /// When it was published, on the monotonic clock, ns.
    pub published_ns: u64,
}

/// What a mailbox does with a package that finds no free slot.
#[repr(u8)]
#[derive(Clone, Copy)]
pub enum Overflow {
    /// It takes the place of the newest of the least important, if it is more important.
    Displace = 0,
    /// It is refused.
    Reject = 1,
    /// For state: a newer package of the same sender, type and id replaces the older one, full or not.
    Latest = 2,
}

/// What a mailbox is asked to be. `ROHRPOST_MAILBOX_DEFAULT` is one.
#[repr(C)]
pub struct MailboxShape {
    /// Slots, 1 to 1024; at least as many as there are senders.
    pub slots: u16,
    /// Largest body, bytes.
    pub body_bytes_max: u16,
    /// One of `rohrpost_overflow`.
    pub overflow: u8,
    /// Senders that one participant may have there.
    pub claims: u8,
    /// Packages that waited longer are dropped when their turn comes, ns; 0: never.
    pub max_age_ns: u64,
}

fn label(label: &PackageLabel) -> Label {
    Label {
        from: Name::from_raw(label.from),
        kind: Type(label.kind),
        id: label.id,
        priority: Priority(label.priority),
        options: Options(label.options),
    }
}

fn shape(shape: &MailboxShape) -> Result<Shape, Code> {
    let codes = [Overflow::Displace, Overflow::Reject, Overflow::Latest].map(|code| code as u8);
    let at = codes.iter().position(|code| *code == shape.overflow);
    let full = at.map(|at| OverflowPolicy::ALL[at]).ok_or_else(|| {
        say(Code::Value, format_args!("`overflow` is {}; it is one of rohrpost_overflow, 0 to 2", shape.overflow))
    })?;
    let max_age = Some(shape.max_age_ns).filter(|ns| *ns > 0).map(Duration::from_nanos);
    let (slots, body_bytes_max, claims) = (shape.slots, shape.body_bytes_max, shape.claims);
    Ok(Shape { slots, body_bytes_max, full, max_age, claims })
}

/// Opens a mailbox for sending: one of this node, or one that a router leads to.
///
/// The caller owns the sender, and closes it by `rohrpost_sender_close`. Thread: that of the node, as for all calls
/// with the sender.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_sender_open(
    node: NodeHandle,
    name: u32,
    sender: Option<&mut MaybeUninit<SenderHandle>>,
) -> Code {
    edge(|| {
        let out = place(sender, "sender")?.write(SenderHandle { id: 0 });
        out.id = table::open(|| {
            let participant = table::with(node.id, |node: &mut NodeObject| Ok(node.participant.clone()))?;
            Ok(SenderObject::new(participant.sender(Name::from_raw(name)).map_err(failed)?))
        })?;
        Ok(())
    })
}

/// Closes a sender; what it has lent is given up.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_sender_close(sender: SenderHandle) -> Code {
    edge(|| table::close::<SenderObject>(sender.id).map(drop))
}

/// Sends a package with a body of `len` bytes, which are copied. No system call unless the receiver sleeps.
///
/// # Safety
/// `body` is null, or points to `len` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rohrpost_send(
    sender: SenderHandle,
    label: Option<&PackageLabel>,
    body: *const c_void,
    len: usize,
) -> Code {
    edge(|| {
        let label = self::label(given(label, "label")?);
        // SAFETY: the caller's promise.
        let body = unsafe { bytes(body, len, "body") }?;
        table::with(sender.id, |sender: &mut SenderObject| unlent(sender)?.send(&label, &[body]).map_err(failed))
    })
}

/// Lends a slot of the mailbox to write a package in place: `body` is its place, of `room` bytes. Until it is sent by
/// `rohrpost_loan_send` or given up by `rohrpost_loan_drop`, the sender is busy. The place is aligned to nothing.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_loan(
    sender: SenderHandle,
    priority: u8,
    body: Option<&mut MaybeUninit<*mut u8>>,
    room: Option<&mut MaybeUninit<usize>>,
) -> Code {
    edge(|| {
        let (body, room) = (place(body, "body")?, place(room, "room")?);
        table::with(sender.id, |sender: &mut SenderObject| {
            unlent(sender)?;
            let tell = |loan: &mut Loan<'_>| {
                let lent = loan.body();
                room.write(lent.len());
                body.write(lent.as_mut_ptr());
            };
            // SAFETY: nothing of the sender is kept but the loan.
            unsafe { sender.lend(|sender| sender.loan(Priority(priority)), tell) }.map_err(failed)
        })
    })
}

/// Sends the first `len` bytes of what is lent. The priority is the one that it was lent for. It is no longer lent
/// then, also when this fails, but for a null `label`.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_loan_send(sender: SenderHandle, label: Option<&PackageLabel>, len: usize) -> Code {
    edge(|| {
        let label = self::label(given(label, "label")?);
        table::with(sender.id, |sender: &mut SenderObject| {
            lent(sender.lent().take())?.send(&label, len).map_err(failed)
        })
    })
}

/// Gives up what is lent: nothing is sent.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_loan_drop(sender: SenderHandle) -> Code {
    edge(|| table::with(sender.id, |sender: &mut SenderObject| lent(sender.lent().take()).map(drop)))
}

/// A sender that has lent nothing.
fn unlent(sender: &mut SenderObject) -> Result<&mut Sender, Code> {
    let busy = || say(Code::Busy, format_args!("this sender has lent a slot: send or drop it first"));
    sender.free().ok_or_else(busy)
}

fn lent(loan: Option<Loan<'static>>) -> Result<Loan<'static>, Code> {
    loan.ok_or_else(|| say(Code::Value, format_args!("this sender has lent nothing: call rohrpost_loan first")))
}

/// Makes this process the receiver of a mailbox; with a null `shape`, of the usual one. What an earlier receiver left
/// there is received first, if the shape is the same.
///
/// The caller owns the receiver, and closes it by `rohrpost_receiver_close` or `rohrpost_receiver_remove`. Thread: that
/// of the node, as for all calls with the receiver.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_receiver_open(
    node: NodeHandle,
    name: u32,
    shape: Option<&MailboxShape>,
    receiver: Option<&mut MaybeUninit<ReceiverHandle>>,
) -> Code {
    edge(|| {
        let out = place(receiver, "receiver")?.write(ReceiverHandle { id: 0 });
        let shape = shape.map(self::shape).transpose()?.unwrap_or_default();
        out.id = table::open(|| {
            let participant = table::with(node.id, |node: &mut NodeObject| Ok(node.participant.clone()))?;
            Ok(ReceiverObject::new(participant.receiver(Name::from_raw(name), shape).map_err(failed)?))
        })?;
        Ok(())
    })
}

/// Takes the most important package, to be read in place. Waits for one at most `timeout_ns`, 0: not at all, below 0:
/// for ever, which no signal ends (`rohrpost_wait` returns then); `ROHRPOST_NOTHING` when there is none. The package is
/// in hand until the next such call, whatever that returns, or until it is released or the receiver is closed. Its
/// bytes are aligned to nothing.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_receive(
    receiver: ReceiverHandle,
    timeout_ns: i64,
    package: Option<&mut MaybeUninit<PackageInHand>>,
) -> Code {
    receive(receiver, timeout_ns, 0, package)
}

/// The same; before it sleeps, it looks again and again for `spin_ns`, which takes a whole processor.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_receive_spinning(
    receiver: ReceiverHandle,
    timeout_ns: i64,
    spin_ns: u64,
    package: Option<&mut MaybeUninit<PackageInHand>>,
) -> Code {
    receive(receiver, timeout_ns, spin_ns, package)
}

fn receive(
    receiver: ReceiverHandle,
    timeout_ns: i64,
    spin_ns: u64,
    package: Option<&mut MaybeUninit<PackageInHand>>,
) -> Code {
    match timeout_ns {
        0 => hand_out(receiver, package, |receiver| receiver.try_receive()),
        _ => hand_out(receiver, package, |receiver| receiver.receive_timeout(waiting(timeout_ns, spin_ns))),
    }
}

#[inline(always)]
fn hand_out(
    receiver: ReceiverHandle,
    package: Option<&mut MaybeUninit<PackageInHand>>,
    take: impl FnOnce(&'static mut Receiver) -> Option<Package<'static>>,
) -> Code {
    edge(|| {
        let out = place(package, "package")?;
        table::with(receiver.id, |receiver: &mut ReceiverObject| {
            let tell = |package: &mut Package<'_>| _ = out.write(in_hand(package));
            // SAFETY: nothing of the receiver is kept but the package.
            unsafe { receiver.lend(|receiver| take(receiver).ok_or(()), tell) }.map_err(|()| Code::Nothing)
        })
    })
}

#[inline(always)]
fn in_hand(package: &Package<'_>) -> PackageInHand {
    let head = package.head();
    PackageInHand {
        to: head.to.raw(),
        from: head.from.raw(),
        kind: head.kind.0,
        id: head.id,
        priority: head.priority.0,
        options: head.options.0,
        len: head.len,
        body: package.body().as_ptr(),
        published_ns: package.published_ns(),
    }
}

/// Frees the slot of the package in hand, if there is one.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_receiver_release(receiver: ReceiverHandle) -> Code {
    edge(|| {
        table::with(receiver.id, |receiver: &mut ReceiverObject| {
            receiver.lent().take();
            Ok(())
        })
    })
}

/// Closes a receiver. The mailbox stays, and with it what waits there, for the next one.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_receiver_close(receiver: ReceiverHandle) -> Code {
    edge(|| table::close::<ReceiverObject>(receiver.id).map(drop))
}

/// Closes a receiver and removes its mailbox; `lost`, which may be null, is how many packages waited there.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_receiver_remove(receiver: ReceiverHandle, lost: Option<&mut MaybeUninit<usize>>) -> Code {
    edge(|| {
        let count = table::close::<ReceiverObject>(receiver.id)?.take().close();
        if let Some(lost) = lost {
            lost.write(count);
        }
        Ok(())
    })
}
