//! Which promise each mistake breaks, and in which network.

use crate::sim::plan::Plan;
use crate::sim::promise::Promise;
use rohrpost_mistaken::mistakes::Mistake;

/// Kinds of networks.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(crate) enum Network {
    Free,
    Rough,
    Crowded,
    Forged,
    /// What is for another port comes to that of packages.
    Strayed,
    /// Sealed, with a program that writes what it likes in its heads, and a router that lets it.
    Intruded,
    Unsteady,
    Slotted,
    SealedSlotted,
    UnsteadySlotted,
    /// Slots of which the flows are declared.
    Declared,
    /// Slots beside nodes of other tables.
    Edited,
    /// With replicas of streams.
    Replicated,
    /// The same with slots.
    SlottedReplicated,
    /// With a module that several nodes may run.
    Leased,
}

impl Network {
    /// The network of a seed.
    pub(crate) fn plan(self, seed: u64) -> Plan {
        match self {
            Self::Free => Plan::new(seed),
            Self::Rough => Plan::rough(seed),
            Self::Crowded => Plan::crowded(seed),
            Self::Forged => Plan::forged(seed),
            Self::Strayed => Plan::strayed(seed),
            Self::Intruded => Plan::new(4 * seed + 2).sealed(),
            Self::Unsteady => Plan::unsteady(seed),
            Self::Slotted => Plan::slotted(seed),
            Self::SealedSlotted => Plan::slotted(seed).sealed(),
            Self::UnsteadySlotted => Plan::unsteady_slotted(seed),
            Self::Declared => Plan::declared(seed),
            Self::Edited => Plan::edited(seed),
            Self::Replicated => Plan::new(seed).replicated(),
            Self::SlottedReplicated => Plan::small_slotted(seed).replicated(),
            Self::Leased => Plan::leased(seed),
        }
    }
}

/// A mistake, and a network that shows it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Caught {
    pub(crate) mistake: Mistake,
    /// What the network breaks first with it.
    pub(crate) promise: Promise,
    pub(crate) network: Network,
    pub(crate) seed: u64,
}

const fn caught(mistake: Mistake, promise: Promise, network: Network, seed: u64) -> Caught {
    Caught { mistake, promise, network, seed }
}

/// All that the simulation shows.
pub(crate) const CAUGHT: &[Caught] = &[
    // Packages and datagrams.
    caught(Mistake::SkipsCheck, Promise::Unchanged, Network::Rough, 0),
    caught(Mistake::IgnoresLevels, Promise::Urgency, Network::Rough, 0),
    caught(Mistake::TakesNewest, Promise::Order, Network::Rough, 1),
    caught(Mistake::SharesQuota, Promise::Bounded, Network::Rough, 0),
    caught(Mistake::DisplacesOldest, Promise::Displacing, Network::Rough, 0),
    caught(Mistake::ForgetsDisplaced, Promise::Bounded, Network::Rough, 0),
    caught(Mistake::Unpaced, Promise::Pace, Network::Rough, 0),
    caught(Mistake::AlwaysAlone, Promise::Pace, Network::Rough, 0),
    caught(Mistake::NeverStops, Promise::Bounded, Network::Rough, 0),
    caught(Mistake::Hurries, Promise::Fresh, Network::Rough, 0),
    caught(Mistake::SendsStale, Promise::Fresh, Network::Rough, 0),
    caught(Mistake::NeverSilent, Promise::Links, Network::Rough, 0),
    caught(Mistake::ReportsDelivered, Promise::AtMostOnce, Network::Rough, 0),
    caught(Mistake::TakesCopies, Promise::NoCopies, Network::Rough, 0),
    caught(Mistake::CountsNoGaps, Promise::Links, Network::Rough, 0),
    caught(Mistake::TakesLate, Promise::Order, Network::Rough, 0),
    caught(Mistake::ForgetsFloor, Promise::Order, Network::Rough, 24),
    caught(Mistake::TakesOldIncarnations, Promise::NoCopies, Network::Rough, 0),
    caught(Mistake::TakesOtherDigests, Promise::Unchanged, Network::Edited, 0),
    caught(Mistake::TakesStale, Promise::Fresh, Network::Rough, 0),
    caught(Mistake::KeepsParts, Promise::Accounts, Network::Rough, 0),
    caught(Mistake::Unbounded, Promise::Bounded, Network::Rough, 0),
    caught(Mistake::ForgetsBegun, Promise::Order, Network::Crowded, 0),
    // What others send.
    caught(Mistake::BelievesIncarnations, Promise::Recovery, Network::Forged, 0),
    caught(Mistake::BelievesJumps, Promise::Recovery, Network::Forged, 0),
    caught(Mistake::BelievesRefusals, Promise::Recovery, Network::Forged, 0),
    caught(Mistake::TakesOtherPorts, Promise::Recovery, Network::Strayed, 1),
    caught(Mistake::AdmitsHurry, Promise::Admission, Network::Intruded, 0),
    caught(Mistake::AdmitsForeignNames, Promise::Admission, Network::Intruded, 0),
    caught(Mistake::AdmitsRoutersOwn, Promise::Admission, Network::Intruded, 0),
    caught(Mistake::AdmitsPackets, Promise::Admission, Network::Intruded, 0),
    caught(Mistake::TakesFormerHolders, Promise::Leases, Network::Leased, 23),
    // What is rejected though nothing is wrong with it.
    caught(Mistake::RejectsAsDamaged, Promise::Rejection, Network::Free, 0),
    caught(Mistake::RejectsAsForeign, Promise::Rejection, Network::Free, 0),
    caught(Mistake::RejectsAsOld, Promise::Rejection, Network::Free, 1),
    caught(Mistake::RejectsAsDuplicate, Promise::Rejection, Network::Free, 0),
    caught(Mistake::RejectsAsLate, Promise::Rejection, Network::Free, 0),
    caught(Mistake::RejectsAsOtherIncarnation, Promise::Rejection, Network::Intruded, 0),
    caught(Mistake::RejectsAsReplay, Promise::Rejection, Network::Intruded, 0),
    caught(Mistake::RejectsAsForged, Promise::Rejection, Network::Intruded, 4),
    caught(Mistake::IgnoresSyncs, Promise::Rejection, Network::Free, 0),
    caught(Mistake::RejectsAddress, Promise::Rejection, Network::Free, 0),
    // Clocks.
    caught(Mistake::AnyReply, Promise::TimeBound, Network::Rough, 0),
    caught(Mistake::NoDrift, Promise::TimeBound, Network::Rough, 7),
    caught(Mistake::NoMasterError, Promise::TimeBound, Network::Rough, 0),
    caught(Mistake::Steps, Promise::TimeForward, Network::Rough, 0),
    caught(Mistake::HalfBound, Promise::TimeBound, Network::Rough, 0),
    caught(Mistake::OldSamples, Promise::TimeBound, Network::Free, 71),
    caught(Mistake::Stubborn, Promise::OneMaster, Network::Rough, 0),
    caught(Mistake::SharesTerms, Promise::OneMaster, Network::Free, 3),
    caught(Mistake::TakesAnyAddress, Promise::Admission, Network::Rough, 0),
    caught(Mistake::SleepsUnnoticed, Promise::TimeBound, Network::Unsteady, 3),
    caught(Mistake::SleepsUnnoticed, Promise::SilentWhenUnsure, Network::UnsteadySlotted, 6),
    caught(Mistake::SlewsUnnoticed, Promise::TimeBound, Network::Unsteady, 0),
    caught(Mistake::SlewsUnnoticed, Promise::SilentWhenUnsure, Network::UnsteadySlotted, 1),
    // What leaves in a slot.
    caught(Mistake::OvertakesInSlot, Promise::Urgency, Network::Declared, 0),
    caught(Mistake::OverrunsSlot, Promise::Recovery, Network::Slotted, 2),
    caught(Mistake::AnyCompany, Promise::Urgency, Network::Slotted, 0),
    caught(Mistake::ForgetsMailbox, Promise::Urgency, Network::Declared, 0),
    caught(Mistake::OverrunsWithPart, Promise::InWindow, Network::Declared, 1),
    // Time slots.
    caught(Mistake::NoLateGate, Promise::InWindow, Network::Slotted, 1),
    caught(Mistake::SendsWhenUnsure, Promise::SilentWhenUnsure, Network::Slotted, 1),
    caught(Mistake::IgnoresGuard, Promise::InWindow, Network::Slotted, 1),
    caught(Mistake::LeadTooLong, Promise::InWindow, Network::Slotted, 1),
    caught(Mistake::ForgetsHandedOver, Promise::InWindow, Network::Slotted, 1),
    caught(Mistake::ReplacementCalibrates, Promise::OneMaster, Network::Slotted, 1),
    caught(Mistake::ReplacesHeard, Promise::OneMaster, Network::Slotted, 1),
    caught(Mistake::SyncInForeignWindow, Promise::SilentWhenUnsure, Network::Slotted, 2),
    // Nodes that begin or join a time.
    caught(Mistake::BeginsAtOnce, Promise::Exclusive, Network::Slotted, 5),
    caught(Mistake::Stubborn, Promise::Exclusive, Network::Slotted, 21),
    caught(Mistake::BeginsForEver, Promise::Recovery, Network::Slotted, 0),
    caught(Mistake::TrustsItself, Promise::SilentWhenUnsure, Network::Slotted, 1),
    caught(Mistake::AsksTooSoon, Promise::InWindow, Network::Slotted, 1),
    caught(Mistake::IgnoresUnproven, Promise::Exclusive, Network::SealedSlotted, 1),
    caught(Mistake::TakesUnproven, Promise::OneMaster, Network::SealedSlotted, 1),
    caught(Mistake::TellsUnproven, Promise::SilentWhenUnsure, Network::SealedSlotted, 1),
    caught(Mistake::AsksWithoutPause, Promise::SilentWhenUnsure, Network::SealedSlotted, 1),
    caught(Mistake::DeafToOtherTables, Promise::Exclusive, Network::Edited, 2),
    caught(Mistake::NeverYieldsToOthers, Promise::Exclusive, Network::Edited, 10),
    caught(Mistake::NeverBeginsEpoch, Promise::Recovery, Network::Slotted, 19),
    // Replicas.
    caught(Mistake::SkipsCheck, Promise::Records, Network::Replicated, 37),
    caught(Mistake::PublishesIncomplete, Promise::Records, Network::Replicated, 1),
    caught(Mistake::MixesRecords, Promise::Records, Network::Replicated, 6),
    caught(Mistake::SaysOtherIncarnation, Promise::Records, Network::Replicated, 0),
    caught(Mistake::CutsElsewhere, Promise::Records, Network::SlottedReplicated, 1),
    caught(Mistake::TakesRecordsBack, Promise::RecordOrder, Network::Replicated, 8),
    caught(Mistake::CountsOneThatCame, Promise::RecordAccounts, Network::Replicated, 0),
    caught(Mistake::SaysSampled, Promise::RecordAccounts, Network::Replicated, 1),
    caught(Mistake::CountsRecordsTwice, Promise::RecordAccounts, Network::Replicated, 1),
    caught(Mistake::ForgetsOverwritten, Promise::RecordAccounts, Network::Replicated, 26),
    caught(Mistake::AsksForEver, Promise::RecordBounds, Network::Replicated, 34),
    caught(Mistake::RepeatsForEver, Promise::RecordBounds, Network::Replicated, 1),
    caught(Mistake::PartsUnpaced, Promise::RecordBounds, Network::Replicated, 1),
    caught(Mistake::OverrunsWithPart, Promise::InWindow, Network::SlottedReplicated, 1),
    caught(Mistake::DescribesOnce, Promise::Recovery, Network::Replicated, 58),
];

/// Mistakes that break no promise here, and why. The routers' own tests show each.
pub(crate) const UNSEEN: &[(Mistake, &str)] = &[
    (Mistake::MixesPackages, "no two heads of this simulation are the same"),
    (Mistake::CountsPartsTwice, "a duplicate of a fragment is dropped as a datagram"),
    (Mistake::NeverInAdvance, "an urgent package that waits for the pace breaks no promise but that of speed"),
    (Mistake::PartsFirst, "packages are later than their bounds, which no promise here is about"),
    (Mistake::WaitsForOne, "no socket is ever without room here"),
    (Mistake::OpensTwice, "120 networks kept all promises: what is opened twice is a duplicate behind it"),
    (Mistake::BeginsUnproven, "120 networks kept all promises"),
    (Mistake::NeverUnheard, "120 networks kept all promises: a link that is cut one way is fixed too soon"),
    (Mistake::KeepsOwnTime, "10 networks kept all promises"),
    (Mistake::WaitsForEver, "10 networks kept all promises"),
    (Mistake::BelievesUnopened, "120 networks kept all promises: a belief changes what callers are told"),
];

/// Groups of mistakes of sessions, which no simulated network has, and of keys and sampling of replicas: the cores' own
/// tests show these.
pub(crate) const UNSEEN_GROUPS: [&str; 4] = ["SESSION", "FOLLOWER", "REPLICAS", "LINE"];
