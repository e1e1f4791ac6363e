//! Records of streams that the nodes of the demo have of each other, and whether each that was sent is accounted for.

use crate::terminal::table::table;
use crate::terminal::units::fine;
use rohrpost::interfaces::{ReplicaCause, ReplicaState, ReplicaStates};
use std::fmt;

/// The cause by which the receiver counts records; by all others it counts parts, of which nobody knows the record.
const INCOMPLETE: &str = "incomplete";
/// The cause by which the sender counts records that newer ones overwrote, some of them when a part had left.
const PASSED: &str = "passed";

/// What became of the records of all replicas, once nothing is under way.
#[derive(Debug, Default, PartialEq)]
pub(super) struct RecordBalance {
    ways: Vec<RecordWay>,
    /// Datagrams that were lost on the wire.
    datagrams: u64,
}

/// The records of a replica from one node to another, where both routers lived throughout.
#[derive(Debug, PartialEq)]
struct RecordWay {
    sent: ReplicaState,
    received: ReplicaState,
}

impl RecordBalance {
    /// Of both ends of each replica, but for nodes with a router that died: its counters are lost.
    pub(super) fn of(states: &[ReplicaStates], datagrams: u64, died: &[&str]) -> Self {
        let survived = |node: &str| !died.contains(&node);
        let mut ways = Vec::new();
        for (from, sent) in states.iter().flat_map(|from| from.sent.iter().map(move |sent| (from, sent))) {
            let there = states.iter().find(|to| to.node == sent.node && survived(&to.node) && survived(&from.node));
            let mut received = there.iter().flat_map(|to| &to.received);
            let received = received.find(|known| known.stream == sent.stream && known.node == from.node);
            ways.extend(received.map(|received| RecordWay { sent: sent.clone(), received: received.clone() }));
        }
        Self { ways, datagrams }
    }

    /// Whether each record that was sent came, or has a cause.
    pub(super) fn holds(&self) -> bool {
        let is_ahead = |way: &RecordWay| {
            let (sent, came) = (way.sent.records, way.received.records);
            came > sent || came + way.lost() > sent + way.passed()
        };
        !self.ways.iter().any(is_ahead) && (self.datagrams > 0 || self.unknown() == 0)
    }

    /// Whether no record is under way for sure: none is missing, or both ends tell what they told `before`.
    pub(super) fn is_settled(&self, before: Option<&Self>) -> bool {
        let is_whole = |way: &RecordWay| way.received.records + way.lost() == way.sent.records;
        self.ways.iter().all(is_whole) || before == Some(self)
    }

    /// Records that were sent and of which the receiver knows nothing: of the first and the last of a stream nobody
    /// tells it.
    fn unknown(&self) -> u64 {
        self.ways.iter().map(RecordWay::unknown).sum()
    }

    /// A row for each way; empty without replicas.
    pub(super) fn table(&self) -> String {
        if self.ways.is_empty() {
            return String::new();
        }
        let rows = self.ways.iter().map(|RecordWay { sent, received }| {
            [
                sent.stream.clone(),
                format!("{} → {}", received.node, sent.node),
                sent.records.to_string(),
                received.records.to_string(),
                received.delay_p99_ns.map_or("-".into(), |ns| fine(ns as f64 * 1e-9)),
                causes(&sent.lost),
                causes(&received.lost),
            ]
        });
        table(["replica", "way", ">sent", ">came", ">delay p99", "not sent", "lost"], rows)
    }
}

impl RecordWay {
    fn lost(&self) -> u64 {
        times(&self.received.lost, INCOMPLETE)
    }

    fn passed(&self) -> u64 {
        times(&self.sent.lost, PASSED)
    }

    fn unknown(&self) -> u64 {
        let has_cause = self.received.lost.iter().any(|lost| lost.cause != INCOMPLETE && lost.times > 0);
        let missing = self.sent.records.saturating_sub(self.received.records + self.lost());
        if has_cause { 0 } else { missing }
    }
}

fn times(lost: &[ReplicaCause], cause: &str) -> u64 {
    lost.iter().filter(|lost| lost.cause == cause).map(|lost| lost.times).sum()
}

fn causes(lost: &[ReplicaCause]) -> String {
    let words: Vec<String> = lost.iter().map(|lost| format!("{} {}", lost.times, lost.cause)).collect();
    if words.is_empty() { "none".into() } else { words.join(", ") }
}

impl fmt::Display for RecordBalance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.ways.is_empty() {
            return Ok(());
        }
        let sum = |of: fn(&RecordWay) -> u64| self.ways.iter().map(of).sum::<u64>();
        let (on_wire, unexplained) = if self.datagrams > 0 { (self.unknown(), 0) } else { (0, self.unknown()) };
        writeln!(
            f,
            "records to other nodes: {}; came whole: {}; incomplete: {}; in datagrams that did not come: {on_wire}; \
             lost without a cause: {unexplained}",
            sum(|way| way.sent.records),
            sum(|way| way.received.records),
            sum(RecordWay::lost),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(node: &str, records: u64, lost: &[(&str, u64)]) -> ReplicaState {
        let cause = |(cause, times): &(&str, u64)| ReplicaCause { cause: (*cause).into(), times: *times };
        ReplicaState {
            stream: "camera.0/image".into(),
            node: node.into(),
            records,
            lost: lost.iter().map(cause).collect(),
            ..ReplicaState::default()
        }
    }

    fn balance(sent: u64, came: u64, lost: &[(&str, u64)], datagrams: u64, died: &[&str]) -> RecordBalance {
        let states = |node: &str, sent, received| ReplicaStates { node: node.into(), sent, received };
        let base = states("base", vec![state("desk", sent, &[("sampled", 7)])], Vec::new());
        RecordBalance::of(&[base, states("desk", Vec::new(), vec![state("base", came, lost)])], datagrams, died)
    }

    #[test]
    fn each_record_that_was_sent_comes_or_has_a_cause() {
        for (sent, came, lost, datagrams, holds, why) in [
            (9, 9, &[][..], 0, true, "all came"),
            (9, 8, &[], 0, false, "nobody knows of it"),
            (9, 8, &[("incomplete", 1)], 0, true, "given up"),
            (9, 7, &[("incomplete", 1)], 0, false, "one of two"),
            (9, 8, &[("undescribed", 3)], 0, true, "its parts were not taken"),
            (9, 8, &[], 2, true, "the last of them may have been in a datagram that was lost"),
            (8, 9, &[], 2, false, "none comes that was not sent"),
        ] {
            assert_eq!(balance(sent, came, lost, datagrams, &[]).holds(), holds, "{why}");
        }
        let [wire, none] = [2, 0].map(|datagrams| balance(9, 8, &[], datagrams, &[]));
        let told = |on_wire, unexplained| {
            format!(
                "records to other nodes: 9; came whole: 8; incomplete: 0; in datagrams that did not come: {on_wire}; \
                 lost without a cause: {unexplained}\n"
            )
        };
        assert_eq!((wire.to_string(), none.to_string()), (told(1, 0), told(0, 1)));
        let row = none.table().lines().nth(1).unwrap().split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(row, "camera.0/image base → desk 9 8 - 7 sampled none");
    }

    /// On a slow computer a large record is overwritten while it leaves.
    #[test]
    fn a_record_that_left_in_part_is_incomplete_there_and_passed_here() {
        let balance = |incomplete| {
            let sent = state("desk", 9, &[("passed", 2)]);
            let received = state("base", 9, &[("incomplete", incomplete)]);
            RecordBalance { ways: vec![RecordWay { sent, received }], datagrams: 2 }
        };
        assert_eq!([0, 2, 3].map(|incomplete| balance(incomplete).holds()), [true, true, false]);
    }

    #[test]
    fn what_is_under_way_is_waited_for() {
        let [under_way, still, further] = [8, 8, 7].map(|came| balance(9, came, &[], 2, &[]));
        assert!(!under_way.is_settled(None) && !under_way.is_settled(Some(&further)));
        assert!(under_way.is_settled(Some(&still)) && balance(9, 9, &[], 0, &[]).is_settled(None));
    }

    #[test]
    fn counters_of_a_router_that_died_are_not_compared() {
        let balance = balance(9, 1, &[], 0, &["desk"]);
        assert_eq!((balance.holds(), balance.to_string(), balance.table()), (true, String::new(), String::new()));
    }
}
