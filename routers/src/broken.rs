//! Mistakes that can be switched on, one at a time and for one thread: tests and the simulation must notice each of
//! them.
//!
//! In a build without the feature `broken-variants` nothing of this is there.

#[cfg(any(test, feature = "broken-variants"))]
pub use variants::{Broken, with};

/// Whether a mistake is switched on.
#[cfg(any(test, feature = "broken-variants"))]
macro_rules! broken {
    ($variant:ident) => {
        $crate::broken::is($crate::broken::Broken::$variant)
    };
}

/// No mistake is switched on.
#[cfg(not(any(test, feature = "broken-variants")))]
macro_rules! broken {
    ($variant:ident) => {
        false
    };
}

pub(crate) use broken;

#[cfg(any(test, feature = "broken-variants"))]
pub(crate) use variants::is;

#[cfg(any(test, feature = "broken-variants"))]
mod variants {
    use std::cell::Cell;

    thread_local! {
        static BROKEN: Cell<Broken> = const { Cell::new(Broken::Nothing) };
    }

    /// What a core does wrong.
    #[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
    pub enum Broken {
        /// Nothing.
        #[default]
        Nothing,
        /// Frame: the check is not looked at.
        SkipsCheck,
        /// Queue: what has waited longest goes first, whatever its level.
        IgnoresLevels,
        /// Queue: of one level the newest goes first.
        TakesNewest,
        /// Queue: a sender may use up the memory of all.
        SharesQuota,
        /// Queue: the oldest gives way in place of the newest.
        DisplacesOldest,
        /// Queue: what gave way is not told.
        ForgetsDisplaced,
        /// Outbound: no limit to the bytes a second.
        Unpaced,
        /// Outbound: what is more important than what left last waits for the pace as well.
        NeverInAdvance,
        /// Outbound: while the way to one peer has no room, nothing goes to the others.
        WaitsForOne,
        /// Outbound: a package may hurry more than its sender, or than who asked for it.
        Hurries,
        /// Outbound: what waited too long leaves nevertheless.
        SendsStale,
        /// Outbound: in a slot what fits goes before what is more important and does not.
        OvertakesInSlot,
        /// Outbound: more leaves than the slot has room for.
        OverrunsSlot,
        /// Outbound: in a slot a datagram has company that is less important than what waits for others.
        AnyCompany,
        /// Outbound: in a slot a datagram has company that is less important than what waits in the mailbox.
        ForgetsMailbox,
        /// Link: nobody is ever silent.
        NeverSilent,
        /// Link: nobody is ever unheard.
        NeverUnheard,
        /// Inbound: copies are taken.
        TakesCopies,
        /// Inbound: what is missing is not counted.
        CountsNoGaps,
        /// Inbound: what is older than what was delivered is delivered.
        TakesLate,
        /// Inbound: a flow that has no place in the table is not ordered.
        ForgetsFloor,
        /// Inbound: a package that came in parts is judged by what is known of its flow when the last part has come.
        ForgetsBegun,
        /// Inbound: a new incarnation of a peer is believed at its first datagram.
        BelievesIncarnations,
        /// Inbound: so is a sequence that is far ahead.
        BelievesJumps,
        /// Inbound: one refusal parts from a peer that has just said that it hears us.
        BelievesRefusals,
        /// Inbound: datagrams of incarnations that are over are taken.
        TakesOldIncarnations,
        /// Inbound: other configurations are not refused.
        TakesOtherDigests,
        /// Inbound: what waited in the socket for too long is delivered.
        TakesStale,
        /// Admission: what comes keeps the priority that its sender wrote.
        AdmitsHurry,
        /// Admission: whoever sends may take any name.
        AdmitsForeignNames,
        /// Admission: what is for a router's own mailboxes gets there.
        AdmitsRoutersOwn,
        /// Admission: any body is an IP packet of the node that it comes from.
        AdmitsPackets,
        /// Fragment: parts of different packages of one flow are put together.
        MixesPackages,
        /// Fragment: a part that comes twice is counted twice.
        CountsPartsTwice,
        /// Fragment: nothing is ever given up for its age.
        KeepsParts,
        /// Fragment: as many packages are put together at a time as have begun.
        Unbounded,
        /// Session: what came of a frame before it was split is forgotten.
        ForgetsPieces,
        /// Session: what another client hosts is given away.
        TakesTwice,
        /// Session: a narrower range inside another client's is given away.
        TakesInside,
        /// Session: what the file gives the nodes of the own system is given to whoever asks.
        GivesAwayOwn,
        /// Session: to register goes through the ranges of all clients.
        GoesThroughAll,
        /// Session: a principal may have as many ranges as there is room for.
        FillsTable,
        /// Session: of too many connections those of whoever has most do not give way.
        CrowdsOut,
        /// Session: what one principal has waiting gives way to what is more important of another.
        SharesQueue,
        /// Session: what is most important goes first however much of it one principal sends.
        IgnoresShares,
        /// Session: what was made ready for a connection that broke goes by the next one.
        SendsCutAgain,
        /// Session: what was under way too long is delivered.
        DeliversOld,
        /// Session: half of the way is no part of a time's bound.
        TrustsTheWay,
        /// Session: a package that is handed on is no further than before.
        KeepsHops,
        /// Session: a client may send in the names of others.
        TakesForeignNames,
        /// Session: what a client cannot deliver comes back to it.
        HandsBack,
        /// Session: who reaches its own system gets what it sends to all back.
        ToOwnTwice,
        /// Session: a client that has gone still hosts its names.
        KeepsNames,
        /// Session: what waited for a client that has gone is not counted.
        ForgetsGone,
        /// Session: who does not say hello is waited for.
        GreetsForEver,
        /// Session: who says nothing is waited for.
        WaitsForSilent,
        /// Session: another digest of what must be equal everywhere is taken.
        TakesOtherCommon,
        /// Session: another digest of what must be equal inside a system is taken.
        TakesOtherSystems,
        /// Session: a client that was connected again does not say what it hosts.
        RegistersOnce,
        /// Session: a client tries again at once, however often it fails.
        NeverBacksOff,
        /// Session: every registration is looked at, however many one client sends.
        RegistersAtOnce,
        /// Session: of data of which only the newest counts all wait.
        NeverReplaces,
        /// Session: of all data only the newest counts.
        ReplacesAllData,
        /// Session: what is replaced by a newer one is not counted.
        ForgetsReplaced,
        /// Session: what replaces an older one waits behind all others.
        LosesItsPlace,
        /// Session: what waits behind something fresh is not looked at.
        LooksAtFirst,
        /// Session: a question for the time waits behind packages that have not begun to leave.
        AsksLast,
        /// Security: what was opened before is opened again.
        OpensTwice,
        /// Security: whoever says hello is held to live.
        BeginsUnproven,
        /// Security: what cannot be opened is believed to come from a peer that is heard.
        BelievesUnopened,
        /// Time slots: a wake-up that comes too late is none too late.
        NoLateGate,
        /// Time slots: a node sends however far off its clock may be.
        SendsWhenUnsure,
        /// Time slots: a window ends where its guard does.
        IgnoresGuard,
        /// Time slots: calls are made earlier than frames need to reach the wire.
        LeadTooLong,
        /// Time slots: what was handed over does not count for what still fits.
        ForgetsHandedOver,
        /// Time slots: a Sync of another in the master's place is taken for the master's.
        ReplacementCalibrates,
        /// Time slots: a backup master sends also when the master's Sync came.
        ReplacesHeard,
        /// Time slots: a master sends Syncs in its slots.
        SyncInForeignWindow,
        /// Time slots: whoever yields to another master goes on by its own time.
        KeepsOwnTime,
        /// Time slots: whoever starts begins a time at once, and does not listen first.
        BeginsAtOnce,
        /// Time slots: whoever begins a time says nothing else for ever.
        BeginsForEver,
        /// Time slots: what a node knows of the time is never off.
        TrustsItself,
        /// Time slots: who goes by what it has heard only asks before its slot begins.
        AsksTooSoon,
        /// Time slots, sealed: a node begins a time whatever it hears of those who have not shown that they live.
        IgnoresUnproven,
        /// Time slots, sealed: it never does as long as it hears any.
        WaitsForEver,
        /// Time slots, sealed: what comes of who has not shown that it lives is taken as if it had.
        TakesUnproven,
        /// Time slots, sealed: by the time of such more than hellos leave.
        TellsUnproven,
        /// Time slots, sealed: by the time of such hellos leave in each slot.
        AsksWithoutPause,
        /// Time: a master does not care who is too far off to follow it.
        NeverBeginsEpoch,
        /// Time by the TCP router: of what cannot all be true that counts which is said to be off least.
        TakesSmallest,
        /// Time: that the computer slept goes unnoticed.
        SleepsUnnoticed,
        /// Time: that somebody slews the clock goes unnoticed.
        SlewsUnnoticed,
        /// Time slots: what comes of nodes that go by another configuration says nothing.
        DeafToOtherTables,
        /// Time slots: whoever has the lesser claim goes on.
        NeverYieldsToOthers,
    }

    impl Broken {
        /// All mistakes of carrying packages.
        pub const ALL: [Self; 23] = [
            Self::SkipsCheck,
            Self::IgnoresLevels,
            Self::TakesNewest,
            Self::SharesQuota,
            Self::DisplacesOldest,
            Self::ForgetsDisplaced,
            Self::Unpaced,
            Self::NeverInAdvance,
            Self::Hurries,
            Self::SendsStale,
            Self::NeverSilent,
            Self::NeverUnheard,
            Self::TakesCopies,
            Self::CountsNoGaps,
            Self::TakesLate,
            Self::ForgetsFloor,
            Self::TakesOldIncarnations,
            Self::TakesOtherDigests,
            Self::TakesStale,
            Self::MixesPackages,
            Self::CountsPartsTwice,
            Self::KeepsParts,
            Self::Unbounded,
        ];

        /// All mistakes of admission.
        pub const ADMISSION: [Self; 4] =
            [Self::AdmitsHurry, Self::AdmitsForeignNames, Self::AdmitsRoutersOwn, Self::AdmitsPackets];

        /// Those that show where many flows are under way and nothing is reordered.
        pub const CROWDED: [Self; 1] = [Self::ForgetsBegun];

        /// Those that show where somebody sends what a router could have sent.
        pub const FORGED: [Self; 3] = [Self::BelievesIncarnations, Self::BelievesJumps, Self::BelievesRefusals];

        /// All mistakes of sessions.
        pub const SESSION: [Self; 31] = [
            Self::ForgetsPieces,
            Self::TakesTwice,
            Self::TakesInside,
            Self::GivesAwayOwn,
            Self::GoesThroughAll,
            Self::FillsTable,
            Self::CrowdsOut,
            Self::SharesQueue,
            Self::IgnoresShares,
            Self::SendsCutAgain,
            Self::DeliversOld,
            Self::TrustsTheWay,
            Self::KeepsHops,
            Self::TakesForeignNames,
            Self::HandsBack,
            Self::ToOwnTwice,
            Self::KeepsNames,
            Self::ForgetsGone,
            Self::GreetsForEver,
            Self::WaitsForSilent,
            Self::TakesOtherCommon,
            Self::TakesOtherSystems,
            Self::RegistersOnce,
            Self::NeverBacksOff,
            Self::RegistersAtOnce,
            Self::NeverReplaces,
            Self::ReplacesAllData,
            Self::ForgetsReplaced,
            Self::LosesItsPlace,
            Self::LooksAtFirst,
            Self::AsksLast,
        ];

        /// All mistakes of what leaves in a slot. Where packages leave as they come they do not show.
        pub const IN_SLOT: [Self; 4] =
            [Self::OvertakesInSlot, Self::OverrunsSlot, Self::AnyCompany, Self::ForgetsMailbox];

        /// All mistakes of time slots.
        pub const SLOTS: [Self; 9] = [
            Self::NoLateGate,
            Self::SendsWhenUnsure,
            Self::IgnoresGuard,
            Self::LeadTooLong,
            Self::ForgetsHandedOver,
            Self::ReplacementCalibrates,
            Self::ReplacesHeard,
            Self::SyncInForeignWindow,
            Self::KeepsOwnTime,
        ];
    }

    impl Broken {
        /// All mistakes of who joins a network with time slots where datagrams are sealed.
        pub const UNPROVEN: [Self; 5] = [
            Self::IgnoresUnproven,
            Self::WaitsForEver,
            Self::TakesUnproven,
            Self::TellsUnproven,
            Self::AsksWithoutPause,
        ];
    }

    impl Broken {
        /// All mistakes of a clock that is not steady.
        pub const UNSTEADY: [Self; 2] = [Self::SleepsUnnoticed, Self::SlewsUnnoticed];

        /// All mistakes of time slots beside other tables.
        pub const TABLES: [Self; 2] = [Self::DeafToOtherTables, Self::NeverYieldsToOthers];
    }

    /// Runs something on this thread with a mistake.
    pub fn with<R>(broken: Broken, run: impl FnOnce() -> R) -> R {
        // Also when what runs panics, as it should.
        struct Back(Broken);
        impl Drop for Back {
            fn drop(&mut self) {
                BROKEN.set(self.0);
            }
        }
        let _back = Back(BROKEN.replace(broken));
        run()
    }

    pub(crate) fn is(broken: Broken) -> bool {
        BROKEN.get() == broken
    }
}
