//! The cases over a network, run small: every contender delivers what it should, and nothing is left behind.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod support;

use rohrpost_testbed::report::has_two_processors;
use serde_json::{Map, Value};
use std::collections::BTreeSet;
use support::{begin, interrupt, left_behind, rows, run};

const CBWARE: &str = "CBWare, its table";

const HOP: &[&str] = &["chain", "chain of mailboxes", "udp"];

/// The cases: a size, and the contenders besides ours.
const CASES: [(&str, u64, &[&str]); 30] = [
    ("hop", 64, HOP),
    ("hop", 1024, HOP),
    ("hop", 16_384, HOP),
    ("hop", 62_000, HOP),
    ("hop, paced", 64, HOP),
    ("hop, in fragments", 16_384, HOP),
    ("hop, sealed", 64, &["not sealed"]),
    ("hop, sealed", 1024, &["not sealed"]),
    ("rate", 64, &["udp"]),
    ("rate", 2112, &["udp", CBWARE]),
    ("rate", 5860, &["udp", CBWARE]),
    ("rate", 15_236, &["udp", CBWARE]),
    ("rate", 36_084, &["udp", CBWARE]),
    ("rate", 62_000, &["udp"]),
    ("packing", 64, &["udp"]),
    ("urgent", 64, &["no flood"]),
    ("urgent-saturated", 64, &["no flood"]),
    ("urgent, replica", 64, &["no flood"]),
    ("urgent-saturated, replica", 64, &["no flood"]),
    ("replica, rate", 2112, &["udp", CBWARE]),
    ("replica, rate", 5860, &["udp", CBWARE]),
    ("replica, rate", 15_236, &["udp", CBWARE]),
    ("replica, rate", 36_084, &["udp", CBWARE]),
    ("replica, rate", 62_000, &["udp"]),
    ("replica, rate", 4 << 20, &["udp"]),
    ("replica, hop", 64, &["a package", "udp"]),
    ("replica, hop, default scheduler", 64, &["a package", "udp"]),
    ("replica, ten readers", 62_000, &["one reader", "its bytes"]),
    ("junk", 64, &["no junk", "udp, junk on unread ports", "udp"]),
    ("junk of a peer", 64, &["no junk", "udp, junk on unread ports", "udp"]),
];

/// Network devices of this computer, and named namespaces.
fn network() -> BTreeSet<String> {
    let names = |path| std::fs::read_dir(path).into_iter().flatten().flatten();
    let names = names("/sys/class/net").chain(names("/run/netns"));
    names.filter_map(|entry| entry.file_name().into_string().ok()).collect()
}

#[test]
fn every_contender_delivers_over_the_network_and_every_line_is_complete() {
    if !has_two_processors() {
        return;
    }
    let before = network();
    let (output, prefix) = run("lan", &["--quick", "--json"]);
    let rows = rows(&output);
    for (case, bytes, others) in CASES {
        let rows: Vec<&Map<String, Value>> =
            rows.iter().filter(|row| row["case"] == case && row["bytes"] == bytes).collect();
        for other in others {
            assert_eq!(rows.iter().filter(|row| row["contender"] == *other).count(), 1, "{case} {bytes} {other}");
            assert_eq!(rows.iter().filter(|row| row["vs"] == *other).count(), 1, "{case} {bytes} beside {other}");
        }
    }
    let clock: Vec<&Map<String, Value>> = rows.iter().filter(|row| row["case"] == "clock").collect();
    assert_eq!(
        clock.iter().filter(|row| row["contender"] == "rohrpost" && row["vs"].is_string()).count(),
        3,
        "{clock:?}"
    );
    // A network between two nodes of an idle computer loses nothing; the kernel's buffers may lose unpaced
    // datagrams.
    for row in rows.iter().filter(|row| row["unit"] == "%" && row["contender"] != "udp") {
        assert_eq!(row["p50"], 0.0, "{row:?}");
    }
    assert_eq!(left_behind(&prefix), [""; 0]);
    assert_eq!(network(), before);
}

#[test]
fn an_interrupt_leaves_no_process_and_no_network() {
    let before = network();
    let (child, pids) = begin("lan", "hop", |_, processes| processes > 2);
    interrupt(child, &pids);
    assert_eq!(network(), before);
}
