//! An edit: one change of a source, which a mistake consists of.

/// A change of a source.
#[derive(Clone, Copy)]
pub struct Edit {
    /// Below the sources.
    pub file: &'static str,
    /// The source as it is: there exactly once, so that a mistake cannot rot unseen.
    pub from: &'static str,
    /// What becomes of it.
    pub change: Change,
}

/// What an edit makes of the text that it finds. All but the first ask themselves whether their mistake is made.
#[derive(Clone, Copy)]
pub enum Change {
    /// This text, which asks with `broken!` where it stands in a copy with all mistakes.
    To(&'static str),
    /// A condition that ends there holds less often: ` && !broken!(…)` behind it.
    AndNot,
    /// A condition that ends there holds more often: ` || broken!(…)` behind it.
    Or,
    /// The statement is skipped.
    LeftOut,
    /// This expression takes its place.
    Instead(&'static str),
    /// This happens before it.
    Before(&'static str),
}

/// `from` becomes `to`.
pub const fn edit(file: &'static str, from: &'static str, to: &'static str) -> Edit {
    Edit { file, from, change: Change::To(to) }
}

/// The condition that ends with `from` is false with the mistake.
pub const fn and_not(file: &'static str, from: &'static str) -> Edit {
    Edit { file, from, change: Change::AndNot }
}

/// The condition that ends with `from` is true with the mistake.
pub const fn or(file: &'static str, from: &'static str) -> Edit {
    Edit { file, from, change: Change::Or }
}

/// The statement `from` is skipped with the mistake.
pub const fn left_out(file: &'static str, from: &'static str) -> Edit {
    Edit { file, from, change: Change::LeftOut }
}

/// With the mistake the expression `other` takes the place of `from`.
pub const fn instead(file: &'static str, from: &'static str, other: &'static str) -> Edit {
    Edit { file, from, change: Change::Instead(other) }
}

/// With the mistake `statements` come before `from`.
pub const fn before(file: &'static str, from: &'static str, statements: &'static str) -> Edit {
    Edit { file, from, change: Change::Before(statements) }
}

impl Edit {
    /// What `from` becomes in a copy that has this mistake among others.
    pub fn to(&self, mistake: &str) -> String {
        let Self { from, change, .. } = self;
        let made = format!("broken!({mistake})");
        match change {
            Change::To(to) => (*to).into(),
            Change::AndNot => format!("{from} && !{made}"),
            Change::Or => format!("{from} || {made}"),
            Change::LeftOut => format!("if !{made} {{ {from} }}"),
            Change::Instead(other) => format!("if {made} {{ {other} }} else {{ {from} }}"),
            Change::Before(statements) => format!("if {made} {{ {statements} }}\n{from}"),
        }
    }

    /// The text of its file, changed.
    ///
    /// # Errors
    /// If `from` is not there once.
    pub(crate) fn apply(&self, mistake: &str, text: &str) -> Result<String, String> {
        match text.matches(self.from).count() {
            1 => Ok(text.replacen(self.from, &self.to(mistake), 1)),
            found => Err(format!("{mistake}: {} must have this once, not {found} times:\n{}", self.file, self.from)),
        }
    }
}
