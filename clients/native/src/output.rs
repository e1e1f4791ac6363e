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

/// Says a line, from any thread; before the module runs, nobody hears it. `errno`: number of the kernel's error that it
/// tells of.
pub fn say(level: SayLevel, text: &str, errno: Option<u16>) {
    match level {
        SayLevel::Error => tracing::error!(errno, "{text}"),
        SayLevel::Warn => tracing::warn!(errno, "{text}"),
        SayLevel::Info => tracing::info!(errno, "{text}"),
        SayLevel::Debug => tracing::debug!(errno, "{text}"),
        SayLevel::Trace => tracing::trace!(errno, "{text}"),
    }
}
