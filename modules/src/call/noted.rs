//! Errors of calls as a journal has them.

use super::{CallError, Fault};
use rohrpost_mailbox::{Name, SendError};
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// A [`CallError`] of a function without an error of its own; names are numbers.
#[derive(Serialize, Deserialize)]
pub(super) enum NotedCallError {
    Timeout(u32, Duration),
    NotSent(NotedSendError),
    TooMany(u32),
    Fault(u32, Fault),
    BadReply(u32, String),
    BadArguments(String),
}

/// A [`SendError`].
#[derive(Serialize, Deserialize)]
pub(super) enum NotedSendError {
    NoMailbox(u32),
    NoRouter { name: u32, router: u32 },
    Full(u32),
    TooLarge { name: u32, len: usize, max: usize },
    InUse(u32),
    Reclaimed(u32),
    Bad(u32, String),
}

impl From<CallError> for NotedCallError {
    fn from(error: CallError) -> Self {
        match error {
            CallError::Timeout(to, timeout) => Self::Timeout(to.raw(), timeout),
            CallError::NotSent(error) => Self::NotSent(error.into()),
            CallError::TooMany(to) => Self::TooMany(to.raw()),
            CallError::Fault(to, fault) => Self::Fault(to.raw(), fault),
            CallError::BadReply(to, text) => Self::BadReply(to.raw(), text),
            CallError::BadArguments(text) => Self::BadArguments(text),
            CallError::Module(_, never) => match never {},
        }
    }
}

impl From<NotedCallError> for CallError {
    fn from(error: NotedCallError) -> Self {
        let name = Name::from_raw;
        match error {
            NotedCallError::Timeout(to, timeout) => Self::Timeout(name(to), timeout),
            NotedCallError::NotSent(error) => Self::NotSent(error.into()),
            NotedCallError::TooMany(to) => Self::TooMany(name(to)),
            NotedCallError::Fault(to, fault) => Self::Fault(name(to), fault),
            NotedCallError::BadReply(to, text) => Self::BadReply(name(to), text),
            NotedCallError::BadArguments(text) => Self::BadArguments(text),
        }
    }
}

impl From<SendError> for NotedSendError {
    fn from(error: SendError) -> Self {
        match error {
            SendError::NoMailbox(name) => Self::NoMailbox(name.raw()),
            SendError::NoRouter { name, router } => Self::NoRouter { name: name.raw(), router: router.raw() },
            SendError::Full(name) => Self::Full(name.raw()),
            SendError::TooLarge { name, len, max } => Self::TooLarge { name: name.raw(), len, max },
            SendError::InUse(name) => Self::InUse(name.raw()),
            SendError::Reclaimed(name) => Self::Reclaimed(name.raw()),
            SendError::Bad(name, text) => Self::Bad(name.raw(), text),
        }
    }
}

impl From<NotedSendError> for SendError {
    fn from(error: NotedSendError) -> Self {
        let of = Name::from_raw;
        match error {
            NotedSendError::NoMailbox(name) => Self::NoMailbox(of(name)),
            NotedSendError::NoRouter { name, router } => Self::NoRouter { name: of(name), router: of(router) },
            NotedSendError::Full(name) => Self::Full(of(name)),
            NotedSendError::TooLarge { name, len, max } => Self::TooLarge { name: of(name), len, max },
            NotedSendError::InUse(name) => Self::InUse(of(name)),
            NotedSendError::Reclaimed(name) => Self::Reclaimed(of(name)),
            NotedSendError::Bad(name, text) => Self::Bad(of(name), text),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_error_comes_back_as_it_was() {
        let [to, router] = [Name::new(1, 200, 0, 0), Name::new(1, 250, 0, 0)];
        for error in [
            CallError::Timeout(to, Duration::from_millis(200)),
            CallError::TooMany(to),
            CallError::Fault(to, Fault::ModuleError("stuck".into())),
            CallError::BadReply(to, "short".into()),
            CallError::BadArguments("long".into()),
            SendError::NoMailbox(to).into(),
            SendError::NoRouter { name: to, router }.into(),
            SendError::Full(to).into(),
            SendError::TooLarge { name: to, len: 9, max: 8 }.into(),
            SendError::InUse(to).into(),
            SendError::Reclaimed(to).into(),
            SendError::Bad(to, "odd".into()).into(),
        ] {
            let text = format!("{error:?}");
            let bytes = postcard::to_stdvec(&NotedCallError::from(error)).unwrap();
            let read: NotedCallError = postcard::from_bytes(&bytes).unwrap();
            assert_eq!(format!("{:?}", CallError::from(read)), text);
        }
    }
}
