//! The part of the package `rohrpost` that is Rust: a module in Python on a node, over [`rohrpost_native`].
//!
//! ```text
//! rohrpost.node (Python) ── run ──▶ runtime's loop, without the interpreter's lock
//!        ▲                               │ takes the lock for each call
//!        └── Bridge's methods ◀──────────┘ and lends its context to the thread meanwhile
//! ```
//!
//! The interpreter's lock is given back wherever something is waited for.

mod bridge;
mod calls;
mod fails;
mod in_hand;
mod lent;
mod owned;
mod plan;
mod publishing;
mod records;
mod seat;
mod shared;
mod streams;
mod tool;
mod values;
mod watching;

use pyo3::prelude::*;

/// `rohrpost._node`; its types are in `_node.pyi`. A free-threaded interpreter that loads it turns its lock on.
#[pymodule(gil_used = true)]
mod _node {
    #[pymodule_export]
    use crate::bridge::run;
    #[pymodule_export]
    use crate::calls::{call, forget, get, peer};
    #[pymodule_export]
    use crate::in_hand::InHand;
    #[pymodule_export]
    use crate::lent::forked;
    #[pymodule_export]
    use crate::publishing::{abandon, begin, finish, follow, now, publish, say, set_parameter, set_period};
    #[pymodule_export]
    use crate::records::Record;
    #[pymodule_export]
    use crate::seat::Stream;
    #[pymodule_export]
    use crate::streams::open_stream;
    #[pymodule_export]
    use crate::tool::{CopiedStream, Tool};
    #[pymodule_export]
    use crate::watching::{unwatch, watch};
}
