//! Names, packages and mailboxes in shared memory: the lowest layer of Rohrpost.

mod name;
mod package;

pub use name::{ALL_SYSTEMS, Class, Name, NameError, Priority, local};
pub use package::{BODY_BYTES_MAX, HEAD_BYTES, Head, Kind, Options, Short, Type};
