//! How commands fail.

/// A failure as it is told to the user: what went wrong, and what to do.
pub(crate) type Failure = String;
