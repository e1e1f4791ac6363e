//! One name under which a module's process is reached: its command mailbox, and its interface.

use super::server::CommandServer;
use super::stream::{StreamItem, is_new};
use crate::call::Fault;
use crate::interface::{ServeFunction, Served};
use rohrpost_config::Principal;
use rohrpost_mailbox::{Name, Receiver};
use rohrpost_schema::{DataKind, Description};

/// What a module has under a name.
pub(crate) enum Offered<M> {
    /// An interface with its types.
    Types(Served<M>),
    /// The description of a module that it stands in for.
    Description(Description),
    /// Only the common functions.
    Nothing,
}

/// One endpoint. A module without further endpoints has this one.
pub(crate) struct Endpoint<M> {
    pub(crate) name: Name,
    pub(crate) command_server: CommandServer,
    pub(crate) offer: Offer<M>,
}

/// What an endpoint offers.
pub(crate) struct Offer<M> {
    /// Numbers of functions that may be run twice.
    pub(crate) idempotent: Vec<u16>,
    /// Numbers of its data and streams.
    pub(crate) data: Vec<u16>,
    /// Its streams.
    pub(crate) streams: Vec<StreamItem>,
    /// The interface is another than the one that was served under this name before, as far as is known.
    pub(crate) is_new: bool,
    /// None: the module serves no interface of its own under this name.
    pub(crate) serve: Option<ServeFunction<M>>,
    /// Numbers and names of the data that the module publishes here without their types.
    pub(crate) stands_in: Option<Vec<(u16, String)>>,
    pub(crate) hash: u32,
    /// Numbers of its functions, and what they are called.
    pub(crate) functions: Vec<(u16, String)>,
    /// Postcard of the description.
    pub(crate) description: Vec<u8>,
}

impl<M> Endpoint<M> {
    /// `named`: callers that always find a place.
    pub(crate) fn new(name: Name, class: &str, commands: Receiver, named: &[Principal], served: Offered<M>) -> Self {
        let (serve, description, stands_in) = match served {
            Offered::Types(Served { description, serve, .. }) => (Some(serve), description, None),
            Offered::Description(description) => {
                let data = description.data.iter().filter(|item| item.kind == DataKind::Data);
                let data = data.map(|item| (item.number, item.field.name.clone())).collect();
                (None, description, Some(data))
            }
            Offered::Nothing => (None, bare(class), None),
        };
        let hash = description.hash();
        let idempotent = description.functions.iter().filter(|f| f.idempotent).map(|f| f.number).collect();
        let functions = description.functions.iter().map(|f| (f.number, f.name.clone())).collect();
        let data = description.data.iter().map(|item| item.number).collect();
        let streams = StreamItem::all_of(&description);
        let is_new = is_new(commands.participant(), name, hash);
        // Writing to a growing vector does not fail.
        let description = description.to_bytes();
        // For tools that must not ask: a question would be one more package.
        if let Err(error) = commands.set_about(&description) {
            // On a full /dev/shm, say: a module that could take its mailboxes over goes on all the same.
            tracing::warn!("{name}: tools cannot describe it: {error}");
        }
        let offer = Offer { idempotent, data, streams, is_new, serve, stands_in, hash, functions, description };
        Self { name, command_server: CommandServer::new(commands, named), offer }
    }
}

impl<M> Offer<M> {
    pub(crate) fn require_data(&self, number: u16) -> Result<(), Fault> {
        if self.data.contains(&number) { Ok(()) } else { Err(Fault::Unknown(number)) }
    }
}

/// The description of a module without interface.
fn bare(class: &str) -> Description {
    Description {
        name: String::new(),
        class: class.into(),
        text: "A module without functions or data of its own.".into(),
        functions: Vec::new(),
        data: Vec::new(),
    }
}
