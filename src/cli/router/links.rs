//! A router's counters, as it publishes them.

use rohrpost::interfaces::{
    Age, Carried, CarriedLoss, ClassCarried, LevelWaiting, LinkState, Links, PeerLink, Rejected, SocketFailure,
};
use rohrpost::mailbox::{Class, Latency, Priority, monotonic_ns};
use rohrpost_routers::frame::NodeIndex;
use rohrpost_routers::link::State;
use rohrpost_routers::security::{Port, Rejection};
use rohrpost_routers::shell::{Failure, Shell, difference};
use rohrpost_routers::stats::{Cause, ClassCounts};
use std::collections::BTreeMap;
use std::time::Duration;

/// How it stands now.
pub(super) fn of(shell: &Shell) -> Links {
    let (settings, stats, now_ns) = (shell.settings(), shell.stats(), monotonic_ns());
    let waiting = stats.waiting.iter().zip(0..).filter(|(count, _)| count.get() > 0);
    Links {
        node: settings.nodes[usize::from(settings.own)].name.clone(),
        digest: settings.digest,
        uptime_ms: now_ns.saturating_sub(stats.started_ns) / 1_000_000,
        peers: settings.peers().map(|peer| link(shell, peer, now_ns)).collect(),
        waiting: waiting.map(|(count, level)| LevelWaiting { level, packages: count.get() }).collect(),
        waiting_bytes: stats.waiting_bytes.get(),
        classes: classes(shell),
        foreign: stats.foreign.get(),
        failures: failures(shell),
        rejections: rejections(shell),
    }
}

fn rejections(shell: &Shell) -> Vec<Rejected> {
    let settings = shell.settings();
    let sources = settings.peers().map(Some).chain([None]);
    let all = sources.flat_map(|peer| Rejection::ALL.map(|why| (peer, why)));
    let told = all.map(|(peer, why)| Rejected {
        node: peer.map_or_else(String::new, |peer| settings.nodes[usize::from(peer)].name.clone()),
        cause: why.word().into(),
        datagrams: [Port::Packages, Port::Time]
            .into_iter()
            .filter_map(|port| Some(shell.rejections(port)?.of(peer, why)))
            .sum(),
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
    let (sent, received) = (&counts.sent, &counts.received);
    let heard_ns = Some(counts.link.heard_ns.get()).filter(|at_ns| *at_ns > 0);
    PeerLink {
        node: node.name.clone(),
        address: node.address.to_string(),
        state: match state {
            State::Unknown => LinkState::Unknown,
            State::Alive => LinkState::Alive,
            State::Silent => LinkState::Silent,
            State::Unheard => LinkState::Unheard,
            State::Refused(_) => LinkState::Refused,
        },
        why: match state {
            State::Refused(mismatch) => difference(&mismatch, settings.digest),
            _ => String::new(),
        },
        heard_ms: heard_ns.map(|at_ns| now_ns.saturating_sub(at_ns) / 1_000_000),
        sent: Carried {
            packages: sent.packages.get(),
            datagrams: sent.datagrams.get(),
            bytes: sent.bytes.get(),
            parts: sent.fragments.get(),
        },
        received: Carried {
            packages: received.packages.get(),
            datagrams: received.datagrams.get(),
            bytes: received.bytes.get(),
            parts: received.fragments.get(),
        },
        unsent: sent.unsent.get(),
        lost: received.missing(),
        missed: counts.link.missed_by_it.get(),
        copies: received.copies.get(),
        damaged: received.damaged.get(),
        overtaken: received.overtaken.get(),
        refused: received.refused.get() + received.old.get(),
        restarts: received.restarts.get(),
    }
}

/// Both directions of each class that did something, the most urgent first.
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
