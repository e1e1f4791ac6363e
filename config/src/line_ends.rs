//! The lines of a text, for messages about places in it.

/// Where the lines of a text end, found once for all its mistakes.
pub(crate) struct LineEnds {
    /// Places of the line breaks between lines with content.
    ends: Vec<usize>,
}

impl LineEnds {
    pub(crate) fn of(text: &str) -> Self {
        Self { ends: text.trim_end().match_indices('\n').map(|(at, _)| at).collect() }
    }

    /// Line of a byte of the text, counted from 1. A place past the end is the last line with content.
    pub(crate) fn line(&self, offset: usize) -> usize {
        1 + self.ends.partition_point(|end| *end < offset)
    }
}
