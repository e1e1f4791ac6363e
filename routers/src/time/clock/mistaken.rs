//! A clock with a planted mistake.

use super::Clock;
use crate::time::broken::Broken;

impl Clock {
    /// Makes this mistake from now on.
    #[cfg(any(test, feature = "broken-variants"))]
    pub fn break_it(&mut self, broken: Broken) {
        self.broken = Some(broken);
    }

    #[cfg(any(test, feature = "broken-variants"))]
    pub(in crate::time) fn is(&self, broken: Broken) -> bool {
        self.broken == Some(broken)
    }

    #[cfg(not(any(test, feature = "broken-variants")))]
    #[allow(clippy::unused_self, reason = "the same as with mistakes")]
    pub(in crate::time) const fn is(&self, _: Broken) -> bool {
        false
    }
}
