//! What happened in a simulated network, line by line, when one seed is looked at.

/// Lines with their times; nothing, and at no cost, unless it was asked for.
#[derive(Debug, Default)]
pub(crate) struct Trace {
    on: bool,
    pub(crate) lines: Vec<String>,
}

impl Trace {
    /// One that keeps lines, or none.
    pub(crate) fn new(on: bool) -> Self {
        Self { on, lines: Vec::new() }
    }

    /// Adds a line; `text` is only made when it is wanted.
    pub(crate) fn line(&mut self, true_ns: u64, text: impl FnOnce() -> String) {
        if self.on {
            self.lines.push(format!("{:>12.6} ms  {}", true_ns as f64 / 1e6, text()));
        }
    }
}
