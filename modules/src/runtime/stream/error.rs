//! Why a value is not written to a stream, and why a stream cannot be read.

use crate::runtime::unreadable::Unreadable;
use rohrpost_config::ClassTable;
use rohrpost_mailbox::{StreamError, StreamId};
use std::time::Duration;

/// Why a value did not become a record. Nothing was written.
///
/// ```
/// use rohrpost_modules::interface::StreamPort;
/// use rohrpost_modules::runtime::{Context, ContextError, RecordError};
///
/// /// Late values are not worth a failure.
/// fn write(context: &mut Context, port: StreamPort<f64>, stamp_ns: u64, mass_kg: f64) -> Result<(), ContextError> {
///     match context.write(port, stamp_ns, &mass_kg) {
///         Err(ContextError::Record(late @ RecordError::Late { .. })) => tracing::debug!("{late}"),
///         written => drop(written?),
///     }
///     Ok(())
/// }
/// ```
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize, thiserror::Error)]
pub enum RecordError {
    /// Larger than the stream's records.
    #[error(
        "a value of stream `{stream}` has {len_bytes} bytes, and its records take {max_bytes}; raise `record` in \
         [module.stream.{stream}] of {module}"
    )]
    TooLarge {
        /// The stream's name.
        stream: String,
        /// The module that writes it.
        module: String,
        /// Bytes of the value.
        len_bytes: usize,
        /// Bytes that fit.
        max_bytes: usize,
    },
    /// The time is too far behind. Counted.
    #[error(
        "a value of stream `{stream}` is of {behind:?} before the newest one, and {late:?} are allowed; write in \
         order, or raise `late` in [module.stream.{stream}] of {module}"
    )]
    Late {
        /// The stream's name.
        stream: String,
        /// The module that writes it.
        module: String,
        /// How far behind.
        behind: Duration,
        /// How far it may be.
        late: Duration,
    },
    /// The time is of an epoch that has ended. Counted.
    #[error(
        "a value of stream `{stream}` of {module} is of epoch {epoch} of system time, and values of epoch {newest} \
         were written already"
    )]
    OldEpoch {
        /// The stream's name.
        stream: String,
        /// The module that writes it.
        module: String,
        /// The value's.
        epoch: u64,
        /// The newest record's.
        newest: u64,
    },
    /// Times start at 1.
    #[error("a value of stream `{stream}` of {module} has the time 0; say when it was true, in ns since 1970")]
    Unstamped {
        /// The stream's name.
        stream: String,
        /// The module that writes it.
        module: String,
    },
    /// A foreign program wrote into the ring.
    #[error("stream `{stream}` of {module} is damaged; end its users, and remove it with `rohrpost clean`")]
    Damaged {
        /// The stream's name.
        stream: String,
        /// The module that writes it.
        module: String,
    },
    /// It cannot be filled in place.
    #[error(
        "a value of stream `{stream}` is not filled in place: its last field must be `Bytes`, and empty in what is \
         given to `fill`"
    )]
    NotEmpty {
        /// The stream's name.
        stream: String,
    },
    /// Begun, and finished without a value.
    #[error("a value of stream `{stream}` is finished and was never put in; use `put` or `fill` before")]
    NothingPut {
        /// The stream's name.
        stream: String,
    },
    /// The value cannot be written as postcard.
    #[error("a value of stream `{stream}` cannot be written: {error}")]
    Encode {
        /// The stream's name.
        stream: String,
        /// What postcard said.
        error: postcard::Error,
    },
}

/// Why a stream of another module cannot be read. Only [`StreamReadError::Ring`] may pass by itself.
///
/// ```
/// use rohrpost_modules::runtime::{Stream, StreamReadError};
///
/// fn has_one(heights: &mut Stream<f64>) -> Result<bool, StreamReadError> {
///     match heights.newest() {
///         Err(StreamReadError::Ring(why)) => { tracing::debug!("{why}"); Ok(false) }
///         newest => Ok(newest?.is_some()),
///     }
/// }
/// ```
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize, thiserror::Error)]
pub enum StreamReadError {
    /// Its ring cannot be used; the text names it as the configuration does.
    #[error("{0}")]
    Ring(String),
    /// The module that writes it has another interface.
    #[error(
        "stream `{stream}` of {module}: interface differs: the module has {theirs:#010x}, this program {ours:#010x}; \
         build both from the same version of the interface and of Rohrpost (`rohrpost version`)"
    )]
    InterfaceDiffers {
        /// The stream's name.
        stream: String,
        /// The module.
        module: String,
        /// Hash of its interface.
        theirs: u32,
        /// Hash of the interface that this program knows.
        ours: u32,
    },
    /// A record is not what the interface says. The module finds that itself, so no journal has it.
    #[error(transparent)]
    #[serde(skip)]
    Unreadable(#[from] Unreadable),
}

/// What the mailbox layer says of a ring, with names as the configuration has them.
pub(super) fn in_words(error: &StreamError, id: StreamId, stream: &str, classes: &ClassTable) -> String {
    let named = format!("`{stream}` of {}", classes.format(id.name));
    let text = error.to_string().replace(&id.to_string(), &named);
    match error {
        StreamError::Owned { module, .. } => text.replace(&module.to_string(), &classes.format(*module)),
        StreamError::Crowded { .. } => format!("{text} in [module.stream.{stream}] of {}", classes.format(id.name)),
        _ => text,
    }
}
