//! A router's counters, as it publishes them.

use rohrpost_mailbox::{Class, Latency, Priority, monotonic_ns};
use rohrpost_modules::interfaces::{
    Age, Carried, CarriedLoss, ClassCarried, LevelWaiting, LinkCounters, LinkState, Links, PeerLink, Rejected,
    SocketFailure,
};
use rohrpost_network::LEVELS;
use rohrpost_routers::counts::{Cause, ClassCounts, Count, PeerReceived, PeerSent};
use rohrpost_routers::frame::NodeIndex;
use rohrpost_routers::link::PeerLinkState;
use rohrpost_routers::security::{Port, Rejection};
use rohrpost_routers::shell::{Failure, Shell, difference};
use rohrpost_routers::stats::{PeerStats, Stats};
use std::collections::BTreeMap;
use std::time::Duration;

/// The present state.
pub(super) fn of(shell: &Shell) -> Links {
    let (settings, stats, now_ns) = (shell.settings(), shell.stats(), monotonic_ns());
    let in_all = |of: fn(&Stats) -> u64| lanes(shell).map(of).sum();
    let waiting = (0..LEVELS).map(|level| (level, lanes(shell).map(|stats| stats.waiting[level].get()).sum()));
    Links {
        node: settings.nodes[usize::from(settings.own)].name.clone(),
        digest: settings.digest,
        uptime_ms: now_ns.saturating_sub(stats.started_ns) / 1_000_000,
        peers: settings.peers().map(|peer| link(shell, peer, now_ns)).collect(),
        waiting: waiting
            .filter(|(_, packages)| *packages > 0)
            .map(|(level, packages)| LevelWaiting { level: level as u8, packages })
            .collect(),
        waiting_bytes: in_all(|stats| stats.waiting_bytes.get()),
        classes: classes(shell),
        foreign: in_all(|stats| stats.foreign.get() + stats.dropped.get()),
        failures: failures(shell),
        rejections: rejections(shell),
    }
}

/// Datagram counters: for real time, and for the rest and for replicas where these have ports of their own.
fn lanes(shell: &Shell) -> impl Iterator<Item = &Stats> {
    [Some(shell.stats()), shell.rest_stats(), shell.replica_stats()].into_iter().flatten().map(|stats| &**stats)
}

fn rejections(shell: &Shell) -> Vec<Rejected> {
    let settings = shell.settings();
    let sources = settings.peers().map(Some).chain([None]);
    let all = sources.flat_map(|peer| Rejection::ALL.map(|why| (peer, why)));
    let told = all.map(|(peer, why)| Rejected {
        node: peer.map_or_else(String::new, |peer| settings.nodes[usize::from(peer)].name.clone()),
        cause: why.word().into(),
        datagrams: Port::ALL.into_iter().filter_map(|port| Some(shell.rejections(port)?.of(peer, why))).sum(),
    });
    told.filter(|rejected| rejected.datagrams > 0).collect()
}

fn failures(shell: &Shell) -> Vec<SocketFailure> {
    let all = Failure::ALL.into_iter().map(|failure| (failure.word(), shell.failures().of(failure)));
    all.filter(|(_, times)| *times > 0).map(|(cause, times)| SocketFailure { cause: cause.into(), times }).collect()
}

fn link(shell: &Shell, peer: NodeIndex, now_ns: u64) -> PeerLink {
    let (settings, stats) = (shell.settings(), shell.stats());
    let (node, counts, state) = (&settings.nodes[usize::from(peer)], stats.peer(peer), stats.state(peer, now_ns));
    let sent = |of: fn(&PeerSent) -> &Count| lanes(shell).map(|stats| of(&stats.peer(peer).sent).get()).sum();
    let received =
        |of: fn(&PeerReceived) -> &Count| lanes(shell).map(|stats| of(&stats.peer(peer).received).get()).sum();
    let of_peer = |of: fn(&PeerStats) -> u64| lanes(shell).map(|stats| of(stats.peer(peer))).sum();
    let heard_ns = Some(counts.link.heard_ns.get()).filter(|at_ns| *at_ns > 0);
    PeerLink {
        node: node.name.clone(),
        address: node.address.to_string(),
        state: match state {
            PeerLinkState::Unknown => LinkState::Unknown,
            PeerLinkState::Alive => LinkState::Alive,
            PeerLinkState::Silent => LinkState::Silent,
            PeerLinkState::Unheard => LinkState::Unheard,
            PeerLinkState::Refused(_) => LinkState::Refused,
        },
        why: match state {
            PeerLinkState::Refused(mismatch) => difference(&mismatch, settings.digest),
            _ => String::new(),
        },
        heard_ms: heard_ns.map(|at_ns| now_ns.saturating_sub(at_ns) / 1_000_000),
        sent: Carried {
            packages: sent(|sent| &sent.packages),
            datagrams: sent(|sent| &sent.datagrams),
            bytes: sent(|sent| &sent.bytes),
            fragments: sent(|sent| &sent.fragments),
        },
        received: Carried {
            packages: received(|received| &received.packages),
            datagrams: received(|received| &received.datagrams),
            bytes: received(|received| &received.bytes),
            fragments: received(|received| &received.fragments),
        },
        counters: LinkCounters {
            lost: of_peer(|peer| peer.received.missing()),
            missed: of_peer(|peer| peer.link.missed_by_it.get()),
            duplicates: received(|received| &received.duplicates),
            reordered: received(|received| &received.reordered),
            damaged: received(|received| &received.damaged),
            refused: of_peer(|peer| peer.received.refused.get() + peer.received.old.get()),
            unsent: sent(|sent| &sent.unsent),
            restarts: counts.received.restarts.get(),
        },
    }
}

/// Both directions of each active class, the most urgent first.
fn classes(shell: &Shell) -> Vec<ClassCarried> {
    let stats = shell.stats();
    let mut classes: BTreeMap<u8, ClassCarried> = BTreeMap::new();
    let mut both = |Priority(class), of: fn(&mut ClassCarried) -> [&mut u64; 2], counts: &ClassCounts| {
        let entry = classes.entry(class).or_insert_with(|| empty(class));
        let [all, passed] = of(entry);
        (*all, *passed) = (counts.packages.get(), counts.passed.get());
        let lost = Cause::ALL.into_iter().map(|cause| (cause.word(), counts.lost(cause))).filter(|(_, n)| *n > 0);
        entry.lost.extend(lost.map(|(cause, packages)| CarriedLoss { cause: cause.into(), packages }));
    };
    stats.out.classes().for_each(|(class, counts)| both(class, |c| [&mut c.taken, &mut c.sent], counts));
    stats.inn.classes().for_each(|(class, counts)| both(class, |c| [&mut c.came, &mut c.delivered], counts));
    for entry in classes.values_mut() {
        entry.age = age(&shell.ages().of(Class(entry.class)));
    }
    classes.into_values().rev().collect()
}

fn age(ages: &Latency) -> Option<Age> {
    let ns = |time: Duration| u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
    let (p50_ns, p99_ns) = (ns(ages.quantile(0.5)?), ns(ages.quantile(0.99)?));
    Some(Age { packages: ages.count(), p50_ns, p99_ns, max_ns: ns(ages.max) })
}

fn empty(class: u8) -> ClassCarried {
    ClassCarried { class, taken: 0, sent: 0, came: 0, delivered: 0, lost: Vec::new(), age: None }
}
