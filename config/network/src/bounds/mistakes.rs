//! Mistakes in the analysis that tests switch on, one at a time and for one thread: the simulation must notice each of
//! them.

/// Whether a mistake is switched on.
#[cfg(test)]
macro_rules! mistake {
    ($which:ident) => {
        $crate::bounds::mistakes::is($crate::bounds::mistakes::Mistake::$which)
    };
}

/// No mistake is switched on.
#[cfg(not(test))]
macro_rules! mistake {
    ($which:ident) => {
        false
    };
}

pub(crate) use mistake;
#[cfg(test)]
pub(crate) use switch::{Mistake, is, with};

#[cfg(test)]
mod switch {
    use std::cell::Cell;

    thread_local! {
        static ON: Cell<Option<Mistake>> = const { Cell::new(None) };
    }

    /// A planted mistake in the analysis.
    #[derive(Clone, Copy, PartialEq, Eq, Debug)]
    pub(crate) enum Mistake {
        /// A package catches the slot in which it is published.
        CatchesTheSlot,
        /// The end of a slot is never left unused.
        WastesNothing,
        /// A package does not wait for those of its own stream.
        ForgetsOwn,
        /// A package does not wait for those of its own level.
        ForgetsEqual,
        /// More important packages come once, however long it takes.
        ComesOnce,
        /// Only the first package after slot v is examined.
        FirstOnly,
        /// Only the first slot of a round is taken for slot v.
        OneSlotFirst,
        /// Routers send no messages of their own, and slots begin on time.
        SaysNothing,
        /// Slot time and the computers' clocks have the same rate.
        ForgetsBend,
        /// What slots leave for parts of replicas is what they carry in all.
        ForgetsFlows,
    }

    impl Mistake {
        pub(crate) const ALL: [Self; 10] = [
            Self::CatchesTheSlot,
            Self::WastesNothing,
            Self::ForgetsOwn,
            Self::ForgetsEqual,
            Self::ComesOnce,
            Self::FirstOnly,
            Self::OneSlotFirst,
            Self::SaysNothing,
            Self::ForgetsBend,
            Self::ForgetsFlows,
        ];
    }

    pub(crate) fn is(mistake: Mistake) -> bool {
        ON.get() == Some(mistake)
    }

    /// Runs something with a mistake switched on.
    pub(crate) fn with<T>(mistake: Option<Mistake>, what: impl FnOnce() -> T) -> T {
        let before = ON.replace(mistake);
        let done = what();
        ON.set(before);
        done
    }
}
