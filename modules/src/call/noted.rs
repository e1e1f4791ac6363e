//! Errors of calls as a journal has them: names are numbers.

use rohrpost_mailbox::{Name, SendError};
use serde::{Deserialize, Serialize};

/// How a [`SendError`] is written and read; `rohrpost-mailbox` knows no serialization.
#[derive(Serialize, Deserialize)]
#[serde(remote = "SendError")]
pub(super) enum NotedSendError {
    NoMailbox(#[serde(with = "name")] Name),
    NoRouter {
        #[serde(with = "name")]
        name: Name,
        #[serde(with = "name")]
        router: Name,
    },
    Full(#[serde(with = "name")] Name),
    TooLarge {
        #[serde(with = "name")]
        name: Name,
        len: usize,
        max: usize,
    },
    InUse(#[serde(with = "name")] Name),
    Reclaimed(#[serde(with = "name")] Name),
    Bad(#[serde(with = "name")] Name, String),
}

/// A name as its number.
pub(super) mod name {
    use super::Name;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(in crate::call) fn serialize<S: Serializer>(name: &Name, serializer: S) -> Result<S::Ok, S::Error> {
        name.raw().serialize(serializer)
    }

    pub(in crate::call) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Name, D::Error> {
        u32::deserialize(deserializer).map(Name::from_raw)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::call::{CallError, Fault};
    use std::time::Duration;

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
            let bytes = postcard::to_stdvec::<CallError>(&error).unwrap();
            let read: CallError = postcard::from_bytes(&bytes).unwrap();
            assert_eq!(format!("{read:?}"), text);
        }
    }
}
