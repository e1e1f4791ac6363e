//! Which node has each name that moves, as launch of this node writes it, for routers.

use nix::sys::inotify::{AddWatchFlags, InitFlags, Inotify, InotifyEvent};
use rohrpost_config::HOLDERS_FILE;
use rohrpost_mailbox::Interest;
use rohrpost_modules::ModuleError;
use rohrpost_modules::runtime::Context;
use rohrpost_routers::moving::MovingNames;
use std::io;
use std::sync::Arc;

/// Keeps a router's names that move as launch says that they are.
pub(crate) struct Moving {
    names: Arc<MovingNames>,
    /// Tells that launch has written where these names are, if there are any.
    written: Option<Inotify>,
}

impl Moving {
    /// Has the kernel tell when launch has written where these names are.
    pub(crate) fn watch(names: Arc<MovingNames>, context: &mut Context) -> Result<Self, ModuleError> {
        if names.is_empty() {
            return Ok(Self { names, written: None });
        }
        let written = Inotify::init(InitFlags::IN_CLOEXEC | InitFlags::IN_NONBLOCK).map_err(io::Error::from)?;
        let node = context.link().borrow().participant().node().clone();
        written.add_watch(node.path(), AddWatchFlags::IN_MOVED_TO).map_err(io::Error::from)?;
        context.watch(&written, Interest::Read)?;
        Ok(Self { names, written: Some(written) })
    }

    /// Looks which nodes hold what. To be called now and then, too: the kernel may have had no room to tell.
    pub(crate) fn look(&self, context: &Context) {
        if self.written.is_none() {
            return;
        }
        // What cannot be read says nothing: nobody is known to hold anything until the next look.
        let text = context.link().borrow().participant().node().read_file(HOLDERS_FILE);
        self.names.read(&String::from_utf8_lossy(&text.ok().flatten().unwrap_or_default()));
    }

    /// Looks if the kernel tells that launch has written.
    pub(crate) fn ready(&self, context: &Context) {
        // What cannot be read now is seen at the next look.
        let told = self.written.as_ref().and_then(|written| written.read_events().ok()).unwrap_or_default();
        let is_told = |event: &InotifyEvent| event.name.as_ref().is_some_and(|name| name == HOLDERS_FILE);
        if told.iter().any(is_told) {
            self.look(context);
        }
    }
}
