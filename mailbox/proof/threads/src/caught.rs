//! Mistakes of the models' table that ThreadSanitizer must see, each with the run that shows it: those by which two
//! threads touch one body with nothing between them that orders it.

/// Names of the variant and of the run.
pub(crate) const CAUGHT: &[(&str, &str)] = &[
    ("publish_without_release", "displacing"),
    ("release_without_release", "handing_over"),
    ("claim_without_acquire", "handing_over"),
    ("take_without_compare", "displacing"),
    ("displace_without_compare", "displacing"),
    ("replace_without_compare", "replacing"),
    ("reuse_without_compare", "reusing"),
    ("reclaims_the_living", "reclaiming"),
];

/// The same for streams: those by which a record is read while its frame is written. A hold without Release is for the
/// models: to ThreadSanitizer the release before it still stands.
pub(crate) const STREAM_CAUGHT: &[(&str, &str)] = &[
    ("stream_publish_without_release_a", "holding"),
    ("stream_look_without_acquire_b", "holding"),
    ("stream_hold_says_nothing", "holding"),
    ("stream_hold_looks_once", "holding"),
    ("stream_release_without_release_h", "holding"),
    ("stream_claim_without_acquire_i", "holding"),
    ("stream_claim_takes_what_is_held", "succeeding"),
];
