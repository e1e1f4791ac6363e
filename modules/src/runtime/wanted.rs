//! What a program expects of data that it subscribes to, and what is otherwise at the publisher.

use crate::call::{CallError, Fault};
use crate::description::noted;
use crate::output::plain;
use rohrpost_mailbox::{Name, Node};
use rohrpost_schema::{Type, describe_type};

/// What a program knows of the data that it subscribes to.
pub(crate) struct WantedData {
    pub(crate) name: &'static str,
    pub(crate) ty: Type,
}

impl WantedData {
    /// What differs between the data of this number that the module has and those that are wanted, if that is known on
    /// this node: empty, or words that go on behind the error.
    pub(super) fn difference(&self, error: &CallError, node: &Node, (from, number): (Name, u16)) -> String {
        let CallError::Fault(_, Fault::InterfaceDiffers { .. }) = error else { return String::new() };
        let Some(there) = noted(node, from) else { return String::new() };
        let Self { name, ty } = self;
        match there.data.iter().find(|item| item.number == number) {
            None => format!("; it has no data of number {number} any more"),
            Some(item) if item.field.ty != *ty => format!(
                "; there, number {number} is `{}: {}`; this program takes `{name}: {}`",
                plain::line(&item.field.name),
                describe_type(&item.field.ty),
                describe_type(ty)
            ),
            Some(_) => format!("; `{name}` itself is the same in both"),
        }
    }
}
