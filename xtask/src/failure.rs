//! How commands fail.

/// A failure for the user: the error, and what to do.
pub(crate) type Failure = String;
