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
