//! How long a module may take to end, if the file does not say.

use std::time::Duration;

/// See [`Module::stop_within`](crate::Module::stop_within).
pub(crate) const USUAL: Duration = Duration::from_secs(2);
/// A recorder writes what waits in its memory before it ends, on a disk that may be slow.
const OF_RECORDER: Duration = Duration::from_secs(60);

/// That of a recorder, or of another module.
pub(crate) fn usual(is_recorder: bool) -> Duration {
    if is_recorder { OF_RECORDER } else { USUAL }
}
