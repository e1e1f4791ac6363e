//! Descriptors that a module waits for, and how it opens them so that an exact replay needs none.

use super::Context;
use super::opened::OpenedFile;
use super::taking_in::NotedError;
use crate::journal::{AskedInterest, Question, Tag};
use nix::libc;
use rohrpost_mailbox::{Interest, Watch, Watches};
use std::fs::OpenOptions;
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::fs::OpenOptionsExt;

/// Exists everywhere.
const STAND_IN: &str = "/";

impl Context {
    /// Waits for a file descriptor too: a serial port, a socket, a pipe, anything that `poll` knows. When there is
    /// something to do [`crate::Module::ready`] is called, while the module is on; until then it waits in the kernel.
    ///
    /// A duplicate is kept until [`Context::unwatch`]: closing one's own descriptor does not end it. In a module with a
    /// journal it is to be one that [`Context::open_outside`] has opened; at another one its journal ends.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::Context;
    /// # use rohrpost_mailbox::{Interest, Watch};
    /// # use std::net::UdpSocket;
    /// fn listen(context: &mut Context) -> std::io::Result<(UdpSocket, Watch)> {
    ///     let socket = UdpSocket::bind("127.0.0.1:4000")?;
    ///     socket.set_nonblocking(true)?;
    ///     let watch = context.watch(&socket, Interest::Read)?;
    ///     Ok((socket, watch))
    /// }
    /// ```
    ///
    /// # Errors
    /// When [`rohrpost_mailbox::WATCHES_MAX`] are watched, the process has no descriptor left, or the pipe by which
    /// senders wake such a receiver cannot be made in the node's directory.
    pub fn watch(&mut self, descriptor: &impl AsFd, interest: Interest) -> io::Result<Watch> {
        if self.journal.is_none() {
            return self.wait_for(descriptor, interest);
        }
        let question = Question::Watch(match interest {
            Interest::Read => AskedInterest::Read,
            Interest::Write => AskedInterest::Write,
            Interest::Both => AskedInterest::Both,
        });
        if let Some(given) = self.journal.given(Tag::Watched, question) {
            let watched: Result<u32, NotedError> = given.read();
            return Ok(Watch::from_number(watched?));
        }
        let is_outside = OpenedFile::of(descriptor).is_some_and(|file| self.outside.contains(&file));
        if !is_outside {
            self.journal.hole(
                "the module waits for a descriptor (`Context::watch`) that it did not open by `Context::open_outside`",
            );
        }
        let watched = self.wait_for(descriptor, interest).map_err(|error| NotedError::of(&error));
        self.journal.note(Tag::Watched, question, &watched.as_ref().map(|watch| watch.number()));
        Ok(watched?)
    }

    fn wait_for(&mut self, descriptor: &impl AsFd, interest: Interest) -> io::Result<Watch> {
        let watches = match &mut self.watches {
            Some(watches) => watches,
            none => none.insert(Watches::new(self.link.unseen().borrow().participant())?),
        };
        watches.add(descriptor, interest)
    }

    /// Waits for it no longer; false when it was not waited for.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::Context;
    /// fn ready(context: &mut Context, ready: rohrpost_mailbox::Ready, at_end: bool) {
    ///     if at_end {
    ///         context.unwatch(ready.watch);
    ///     }
    /// }
    /// ```
    pub fn unwatch(&mut self, watch: Watch) -> bool {
        let watches = &mut self.watches;
        let remove = || watches.as_mut().is_some_and(|watches| watches.remove(watch));
        self.journal.answer(Tag::Unwatched, Question::Watched(watch.number()), remove)
    }

    /// Opens what the module reads or writes past its interfaces: a serial port, a socket, the next connection of one.
    /// In an exact replay `open` is not called, and the descriptor that comes is of nothing: to read, to write
    /// and calls of sockets fail with `EBADF` or the like; `fstat` and `fcntl` work, and tell of a folder. So set it
    /// up in `open`; read and write by [`Context::take_in_to`] and [`Context::give_out`].
    ///
    /// ```
    /// # use rohrpost_mailbox::Interest;
    /// # use rohrpost_modules::runtime::Context;
    /// # use std::net::UdpSocket;
    /// fn listen(context: &mut Context) -> std::io::Result<UdpSocket> {
    ///     let socket = context.open_outside(|| {
    ///         let socket = UdpSocket::bind("127.0.0.1:4000")?;
    ///         socket.set_nonblocking(true)?;
    ///         Ok(socket)
    ///     })?;
    ///     context.watch(&socket, Interest::Read)?;
    ///     Ok(socket)
    /// }
    /// ```
    ///
    /// # Errors
    /// Those of `open`; in an exact replay those of then.
    pub fn open_outside<D: AsFd + From<OwnedFd>>(&mut self, open: impl FnOnce() -> io::Result<D>) -> io::Result<D> {
        if self.journal.is_none() {
            return open();
        }
        if let Some(given) = self.journal.given(Tag::OpenedOutside, Question::Plain) {
            let opened: Result<(), NotedError> = given.read();
            opened?;
            let nothing = OpenOptions::new().read(true).custom_flags(libc::O_PATH).open(STAND_IN)?;
            return Ok(OwnedFd::from(nothing).into());
        }
        let opened = self.journal.apart(open).map_err(|error| NotedError::of(&error));
        self.journal.note(Tag::OpenedOutside, Question::Plain, &opened.as_ref().map(drop));
        let descriptor = opened?;
        // Numbers of closed descriptors are given anew: to other files.
        if let Some(opened) = OpenedFile::of(&descriptor) {
            self.outside.retain(|other| other.number != opened.number && other.may_be_open());
            self.outside.push(opened);
        }
        Ok(descriptor)
    }
}
