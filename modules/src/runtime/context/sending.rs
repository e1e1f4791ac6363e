//! What a module sends to those that did not ask for it.

use super::Context;
use crate::common::DataHead;
use rohrpost_mailbox::{Label, Name, Options, Type, local};
use std::io;

impl Context {
    /// Sends data to a mailbox that takes them from all ([`Context::open_mailbox_to_all`]): of a module, or with system
    /// 255 of that module's namesakes in all other systems that are reached. Nobody says whether they arrive.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::Context;
    /// # use rohrpost_mailbox::{ALL_SYSTEMS, Name};
    /// const REPORTS: u8 = 3;
    ///
    /// fn tell_all(context: &Context, voltage: &[u8]) -> std::io::Result<()> {
    ///     let me = context.me();
    ///     context.send_data(Name::new(ALL_SYSTEMS, me.class().0, me.instance(), REPORTS), 1, voltage)
    /// }
    /// ```
    ///
    /// # Errors
    /// When no way leads there, or the way is full. In an exact replay the error of then.
    pub fn send_data(&self, to: Name, number: u16, value: &[u8]) -> io::Result<()> {
        let label = Label {
            from: self.me.with_local(local::COMMANDS),
            kind: Type::data(number),
            id: 0,
            priority: self.me.class().priority(),
            options: Options::default(),
        };
        let head = DataHead { stamp_ns: 0, sequence: 0, missed: 0, incarnation: 0 }.to_bytes();
        let send = |value: &[u8]| {
            let sent = self.link.unseen().borrow_mut().send(to, &label, &[&head, value]);
            sent.map(|()| value.len()).map_err(io::Error::other)
        };
        self.give_out(value, send).map(drop)
    }
}
