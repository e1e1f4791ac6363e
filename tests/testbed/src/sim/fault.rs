//! What goes wrong in a simulated network.

use super::link::Quality;
use rohrpost_mailbox::Name;

#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Fault {
    /// A node's router is stopped, and goes on afterwards; with `whole` all of the computer.
    Freeze {
        node: usize,
        /// Its modules too.
        whole: bool,
    },
    /// A node's router dies, and a new one comes.
    Restart {
        node: usize,
    },
    /// Nothing goes this way.
    Cut {
        from: usize,
        to: usize,
    },
    /// The nodes of which the bit is set, and the others, do not reach each other.
    Split {
        /// Bit of each node.
        side: u64,
    },
    /// A link is bad.
    Bad {
        from: usize,
        to: usize,
        quality: Quality,
    },
    /// A module has no mailboxes.
    Absent {
        node: usize,
        module: Name,
    },
    /// The mailboxes of a module are full.
    Full {
        node: usize,
        module: Name,
    },
    /// A module dies, with a command in its hand, and a new one comes.
    ModuleRestart {
        node: usize,
        module: Name,
    },
    /// All processes of a node die at once, and start again.
    Death {
        node: usize,
    },
    /// A module with a lease cannot be on at a node.
    Unready {
        node: usize,
    },
    /// A computer sleeps.
    Sleep {
        node: usize,
        /// By so much more than true it takes its sleep to be, ns.
        wrong_ns: i64,
    },
    /// A time daemon slews a computer's clock.
    Slew {
        node: usize,
        slewed_ppb: i64,
    },
    /// A node's router is started anew from a file that somebody has edited, and after that from the right one.
    Edited {
        node: usize,
        edition: usize,
    },
    /// Somebody repeats all that a node is told of the time, so much later.
    Echo {
        to: usize,
        delay_ns: u64,
    },
    /// The socket of a router does not take every other datagram.
    Unsendable {
        node: usize,
    },
    Step {
        node: usize,
        by_ns: i64,
    },
    /// Datagrams that no router of this installation sent.
    Foreign {
        to: usize,
        count: u64,
    },
    /// A program of a node writes what it likes in its heads, and its router caps no priority.
    Intruder {
        node: usize,
        count: u64,
    },
    /// Datagrams such as a router could have sent, of an incarnation that never was or of a place far from its own.
    Forged {
        /// The node that they name as their sender.
        from: usize,
        to: usize,
        count: u64,
    },
    /// Datagrams such as a router sends to another port come to that of packages, one behind the other.
    Stray {
        /// The node that they name as their sender.
        from: usize,
        to: usize,
        count: u64,
    },
    /// A node sends another one parts of records and requests that nobody should send.
    Parts {
        from: usize,
        to: usize,
        count: u64,
    },
    /// Datagrams that were sent long ago come once more.
    Replay {
        to: usize,
        count: u64,
    },
}

#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Planned {
    /// When it begins, true ns.
    pub(crate) from_ns: u64,
    /// When it is over, true ns.
    pub(crate) until_ns: u64,
    pub(crate) fault: Fault,
}
