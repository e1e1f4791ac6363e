//! Which mistake is made now.

use rohrpost_planted::MISTAKE_VARIABLE;
use std::cell::Cell;

include!(concat!(env!("OUT_DIR"), "/mistake.rs"));

thread_local! {
    static MADE: Cell<Option<Mistake>> = Cell::new(of_process());
}

fn of_process() -> Option<Mistake> {
    let name = std::env::var(MISTAKE_VARIABLE).ok()?;
    Some(Mistake::named(&name).unwrap_or_else(|| panic!("{MISTAKE_VARIABLE}: there is no mistake {name:?}")))
}

/// Runs something on this thread with a mistake.
pub fn with<R>(mistake: Mistake, run: impl FnOnce() -> R) -> R {
    // Also when what runs panics, as it should.
    struct Back(Option<Mistake>);
    impl Drop for Back {
        fn drop(&mut self) {
            MADE.set(self.0);
        }
    }
    let _back = Back(MADE.replace(Some(mistake)));
    run()
}

pub(crate) fn is(mistake: Mistake) -> bool {
    MADE.get() == Some(mistake)
}
