//! What the code that our attributes write refers to. Not for people.

pub use crate::call::append;
pub use crate::call::{CallError, Caller, Fault, Pending};
pub use crate::interface::{DataPort, Interface, Proxy, ProxyCore, Serve, StreamPort};
pub use crate::parameter::{Declared, Parameter, ParameterSet, ParameterType, Refusal, put_parameter};
pub use crate::runtime::{read_arguments, write_result};
pub use postcard::from_bytes;
pub use rohrpost_mailbox::Name;
pub use rohrpost_schema as schema;
pub use serde;
