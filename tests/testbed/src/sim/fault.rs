//! What goes wrong in a simulated network.

use super::link::Quality;
use rohrpost_mailbox::Name;

/// What goes wrong.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Fault {
    /// A node's router is stopped, and goes on afterwards; with `whole` all of the computer.
    Freeze {
        /// Which.
        node: usize,
        /// Its modules too.
        whole: bool,
    },
    /// A node's router dies, and a new one comes.
    Restart {
        /// Which.
        node: usize,
    },
    /// Nothing goes this way.
    Cut {
        /// From there.
        from: usize,
        /// To here.
        to: usize,
    },
    /// The nodes of which the bit is set, and the others, do not reach each other.
    Split {
        /// Bit of each node.
        side: u64,
    },
    /// A link is bad.
    Bad {
        /// From there.
        from: usize,
        /// To here.
        to: usize,
        /// So bad.
        quality: Quality,
    },
    /// A module has no mailboxes.
    Absent {
        /// Where it is.
        node: usize,
        /// Which.
        module: Name,
    },
    /// The mailboxes of a module are full.
    Full {
        /// Where it is.
        node: usize,
        /// Which.
        module: Name,
    },
    /// A module dies, with a command in its hand, and a new one comes.
    ModuleRestart {
        /// Where it is.
        node: usize,
        /// Which.
        module: Name,
    },
    /// A computer sleeps.
    Sleep {
        /// Which.
        node: usize,
        /// By so much more than true it takes its sleep to be, ns.
        wrong_ns: i64,
    },
    /// A time daemon slews a computer's clock.
    Slew {
        /// Where.
        node: usize,
        /// By how much, ns a second.
        slewed_ppb: i64,
    },
    /// A node's router is started anew from a file that somebody has edited, and after that from the right one.
    Edited {
        /// Which.
        node: usize,
        /// Edition of the file.
        edition: usize,
    },
    /// Somebody repeats all that a node is told of the time, so much later.
    Echo {
        /// The receiver.
        to: usize,
        /// See above.
        delay_ns: u64,
    },
    /// The socket of a router does not take every other datagram.
    Unsendable {
        /// Where.
        node: usize,
    },
    /// Somebody sets CLOCK_REALTIME.
    Step {
        /// Where.
        node: usize,
        /// By how much, ns.
        by_ns: i64,
    },
    /// Datagrams that no router of this installation sent.
    Foreign {
        /// The receiver.
        to: usize,
        /// How many.
        count: u64,
    },
    /// A program of a node writes what it likes in its heads, and its router caps no priority.
    Intruder {
        /// Where.
        node: usize,
        /// How many packages.
        count: u64,
    },
    /// Datagrams such as a router could have sent, of an incarnation that never was or of a place far from its own.
    Forged {
        /// The node that they name as their sender.
        from: usize,
        /// The receiver.
        to: usize,
        /// How many.
        count: u64,
    },
    /// Datagrams such as a router sends to another port come to that of packages, one behind the other.
    Stray {
        /// The node that they name as their sender.
        from: usize,
        /// The receiver.
        to: usize,
        /// How many.
        count: u64,
    },
    /// A node sends another one parts of records and requests that nobody should send.
    Parts {
        /// The sender.
        from: usize,
        /// The receiver.
        to: usize,
        /// How many.
        count: u64,
    },
    /// Datagrams that were sent long ago come once more.
    Replay {
        /// The receiver.
        to: usize,
        /// How many.
        count: u64,
    },
}

/// A fault with its times.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Planned {
    /// When it begins, true ns.
    pub from_ns: u64,
    /// When it is over, true ns.
    pub until_ns: u64,
    /// What it is.
    pub fault: Fault,
}
