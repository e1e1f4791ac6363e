//! Each mistake: what it does wrong, how the routers' sources change for it, and where it shows.

mod carrying;
mod lan;
mod session;
mod slots;
mod time;

/// A change of a source. `from` is there exactly once, so a mistake cannot rot unseen.
pub struct Edit {
    /// Below `routers/src`.
    pub file: &'static str,
    /// The source as it is.
    pub from: &'static str,
    /// The same with the mistake, if `broken!` says so.
    pub to: &'static str,
}

const fn edit(file: &'static str, from: &'static str, to: &'static str) -> Edit {
    Edit { file, from, to }
}

/// A mistake.
pub struct Planted {
    /// Its name, as in [`Mistake`](crate::mistakes::Mistake).
    pub name: &'static str,
    /// The core, and what it does wrong.
    pub text: &'static str,
    /// The routers' own test that fails with it.
    pub shows_in: &'static str,
    /// The changes.
    pub edits: &'static [Edit],
}

/// Mistakes that show in networks of one kind.
pub struct Group {
    /// The name of its constant in [`Mistake`](crate::mistakes::Mistake).
    pub name: &'static str,
    /// What they have in common.
    pub text: &'static str,
    /// All of them.
    pub mistakes: &'static [Planted],
}

/// All mistakes.
pub const GROUPS: &[Group] = &[
    carrying::CARRYING,
    lan::ADMISSION,
    lan::CROWDED,
    lan::FORGED,
    lan::LAN,
    session::SESSION,
    slots::IN_SLOT,
    slots::SLOTS,
    slots::JOINING,
    slots::UNPROVEN,
    slots::UNSTEADY,
    slots::TABLES,
    time::TIME,
    time::FOLLOWER,
];
