//! Lines of output.

/// How important a line is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SayLevel {
    /// The module cannot do its work.
    Error,
    /// Something is not as it should be.
    Warn,
    /// What a user wants to know.
    Info,
    /// What an author wants to know.
    Debug,
    /// Everything.
    Trace,
}

/// Says a line, from any thread; before the module runs, nobody hears it.
pub fn say(level: SayLevel, text: &str) {
    match level {
        SayLevel::Error => tracing::error!("{text}"),
        SayLevel::Warn => tracing::warn!("{text}"),
        SayLevel::Info => tracing::info!("{text}"),
        SayLevel::Debug => tracing::debug!("{text}"),
        SayLevel::Trace => tracing::trace!("{text}"),
    }
}
