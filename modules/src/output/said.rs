//! What is to become a line.

/// What is said: its text, and the number of the kernel's error that it tells of.
pub(super) struct Said {
    pub(super) text: String,
    pub(super) errno: Option<u16>,
}

impl From<String> for Said {
    fn from(text: String) -> Self {
        Self { text, errno: None }
    }
}
