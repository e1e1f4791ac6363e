//! What must be seen in simulated networks, so that what they do not show is not taken for kept.

/// What must have been seen so often in each hundred networks.
pub(crate) const SEEN_IN_A_HUNDRED: [(&str, u64); 25] = [
    ("intruder", 1000),
    ("routers-own", 100),
    ("bad-packet", 50),
    ("delivered", 100_000),
    ("answered", 10_000),
    ("run before", 200),
    ("interrupted", 200),
    ("told that it was not run", 300),
    ("quota", 20_000),
    ("silent", 3000),
    ("unheard", 10),
    ("refused", 50),
    ("late", 100),
    ("incomplete", 200),
    ("stale", 500),
    ("no-mailbox", 300),
    ("mailbox-full", 300),
    ("socket", 200),
    ("dropped as a copy", 200),
    ("dropped as wrong or old", 300),
    ("lost on the wire", 5000),
    ("frozen", 40),
    ("router killed", 50),
    ("split", 15),
    ("time: taken", 300_000),
];
/// The same where datagrams are sealed.
pub(crate) const SEEN_IN_A_HUNDRED_SEALED: [(&str, u64); 8] = [
    ("intruder", 1000),
    ("foreign-name", 50),
    ("delivered", 100_000),
    ("answered", 10_000),
    ("asked", 1000),
    ("rejected", 400),
    ("router killed", 50),
    ("time: taken", 300_000),
];
/// The same with time slots.
pub(crate) const SEEN_IN_A_HUNDRED_SLOTTED: [(&str, u64); 9] = [
    ("delivered", 20_000),
    ("time: taken", 500_000),
    ("window used", 200_000),
    ("router killed", 20),
    ("frozen", 20),
    ("split", 8),
    ("missed its slot, held", 100),
    ("held for too long", 15),
    ("slot left out", 50000),
];
/// The same with sealed datagrams.
pub(crate) const SEEN_IN_A_HUNDRED_SEALED_SLOTTED: [(&str, u64); 11] = [
    ("delivered", 20_000),
    ("time: taken", 400_000),
    ("time: overheard", 2_000),
    ("asked by what was overheard", 200),
    ("asked by an echo", 10),
    ("rejected", 100),
    ("router killed", 20),
    ("split", 8),
    ("missed its slot, held", 80),
    ("held for too long", 15),
    ("slot left out", 50000),
];
/// The same where all goes wrong.
pub(crate) const SEEN_IN_A_HUNDRED_ROUGH_SLOTTED: [(&str, u64); 10] = [
    ("delivered", 5_000),
    ("window late", 5_000),
    ("router killed", 200),
    ("frozen", 400),
    ("cut", 200),
    ("lost on the wire", 2_000),
    ("missed its slot, held", 400),
    ("missed its slot, lost", 40),
    ("held for too long", 60),
    ("slot left out", 100000),
];
/// The same with edited files.
pub(crate) const SEEN_IN_A_HUNDRED_EDITED: [(&str, u64); 4] =
    [("edited", 150), ("time: of another configuration", 5_000), ("refused", 200), ("window used", 200_000)];
/// The same of unsteady clocks.
pub(crate) const SEEN_IN_A_HUNDRED_UNSTEADY: [(&str, u64); 4] =
    [("asleep", 30), ("slewed", 30), ("time: unsteady", 60), ("delivered", 20_000)];
/// The same of replicas.
pub(crate) const SEEN_IN_A_HUNDRED_REPLICATED: [(&str, u64); 9] = replicated(50_000);
/// The same of replicas in time slots.
pub(crate) const SEEN_IN_A_HUNDRED_REPLICATED_SLOTTED: [(&str, u64); 9] = replicated(5_000);

/// With so many packages beside.
const fn replicated(delivered: u64) -> [(&'static str, u64); 9] {
    [
        ("delivered", delivered),
        ("a record written", 10_000),
        ("a record read", 10_000),
        ("a reader is told of lost records", 1_000),
        ("a part of a record", 20_000),
        ("a part of a record again", 20),
        ("a request for parts", 20),
        ("a writer restarts", 40),
        ("hostile parts", 4),
    ]
}
