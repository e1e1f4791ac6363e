//! Mailboxes that were looked for and not found. A sender to a module that does not run asks again and again; while the
//! registry's epoch stays the same, the answer is known without a system call.

use rohrpost_mailbox::Name;

/// Names that are remembered; those beyond are looked for each time.
const NAMES_MAX: usize = 64;

/// What was not there in one epoch of the registry.
#[derive(Default)]
pub(super) struct Absent {
    epoch: u32,
    names: Vec<Name>,
}

impl Absent {
    /// Whether it was not there, and nothing has come or gone since.
    pub(super) fn has(&self, name: Name, epoch: u32) -> bool {
        epoch == self.epoch && self.names.contains(&name)
    }

    /// It was not there. `epoch` is the one from before it was looked for: what came in between has raised it since.
    pub(super) fn note(&mut self, name: Name, epoch: u32) {
        if epoch != self.epoch {
            self.names.clear();
            self.epoch = epoch;
        }
        if self.names.len() < NAMES_MAX && !self.names.contains(&name) {
            self.names.push(name);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_not_there_is_known_until_something_changes() {
        let name = |instance| Name::new(1, 9, instance, 0);
        let mut absent = Absent::default();
        assert!(!absent.has(name(0), 0), "never looked for");
        absent.note(name(0), 5);
        absent.note(name(1), 5);
        assert!(absent.has(name(0), 5) && absent.has(name(1), 5) && !absent.has(name(2), 5));
        assert!(!absent.has(name(0), 6), "something came or went");
        absent.note(name(1), 6);
        assert!(!absent.has(name(0), 6) && absent.has(name(1), 6), "the other was not looked for again");
        (0..=NAMES_MAX as u8).for_each(|instance| absent.note(name(instance), 7));
        assert!(!absent.has(name(NAMES_MAX as u8), 7), "bounded");
    }
}
