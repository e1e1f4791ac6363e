//! What the router says of its slots in words.

use crate::tdma::Silent;

/// Says that it does not send any more, and that it does.
pub(super) fn tell_change(before: Option<Silent>, now: Option<Silent>) {
    if kind(now) == kind(before) {
        return;
    }
    match now {
        None => tracing::info!("sends in its time slots"),
        Some(why @ Silent::BoundTooLarge { .. }) => {
            tracing::warn!(
                "sends nothing, lest it disturbs others: {why}; is a master of time running, and does the network reach it?"
            );
        }
        Some(why) => tracing::info!("sends nothing yet: {why}"),
    }
}

fn kind(silent: Option<Silent>) -> Option<std::mem::Discriminant<Silent>> {
    silent.as_ref().map(std::mem::discriminant)
}
