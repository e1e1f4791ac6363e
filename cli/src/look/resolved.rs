//! A resolved configuration for programs: `check --json`, and `node.json` beside the mailboxes of a running node.
//!
//! Durations are in milliseconds, sizes in bytes, names both as text and as the number in package heads.

use rohrpost::Name;
use rohrpost_config::{
    Commanded, Downwards, Installation, Level, MailboxSpec, Module, Program, Reach, RecordedItems, Recording,
    RestartPolicy, Sampling, Scheduling, Start, StreamSpec, TimeSource, bounds,
};
use rohrpost_mailbox::LAYOUT_VERSION;
use rohrpost_network::{Bound, FlowBound, Network, Tdma};
use serde_json::{Value, json};
use std::time::Duration;

/// Raised when an entry of `node.json` that programs may read disappears or changes its meaning.
const FORMAT: u32 = 1;

/// Everything needed to take part in a node without reading TOML: `node.json`, one JSON object.
pub(crate) fn of_node(installation: &Installation, node: &str) -> Vec<u8> {
    let launch = installation.node(node).map(|node| installation.launch_of(node));
    let nodes = installation.lan_nodes();
    let routes = installation.routes_from(node).into_iter().map(|route| {
        let to = nodes.get(usize::from(route.node)).map(|node| &node.name);
        json!({ "first": route.first.raw(), "last": route.last.raw(), "node": to })
    });
    let resolved = json!({
        "format": FORMAT,
        "layout": LAYOUT_VERSION,
        "common_functions": rohrpost::common::HASH,
        "node": node,
        "launch": launch.map(|name| json!({ "name": installation.classes.format(name), "number": name.raw() })),
        "routes": routes.collect::<Vec<_>>(),
        "file": installation.path.display().to_string(),
        "installation": of(installation, None),
    });
    format!("{resolved:#}\n").into_bytes()
}

/// Everything in the file, with defaults filled in; only for this node, if one is named.
pub(crate) fn of(installation: &Installation, only: Option<&str>) -> Value {
    let Installation { name, system, classes, output, .. } = installation;
    let text = |name: Name| classes.format(name);
    let class_entries = classes.iter().map(|entry| {
        let scheduling = scheduling(installation.scheduling(entry.class));
        json!({ "id": entry.class.0, "name": entry.name, "text": entry.text, "scheduling": scheduling })
    });
    let nodes = installation.nodes.iter().filter(|node| only.is_none_or(|name| name == node.name)).map(|node| {
        let modules: Vec<Value> = installation.modules_on(&node.name).map(|it| module(installation, it)).collect();
        let network = match node.reach {
            Reach::Lan => "lan",
            Reach::Tcp => "tcp",
        };
        json!({
            "name": node.name, "network": network, "address": node.address, "mode": format!("{:04o}", node.mode),
            "tools": [node.tools.start(), node.tools.end()], "modules": modules,
        })
    });
    let levels = output.levels.iter().map(|(module, level)| (text(*module), level.as_str().into()));
    let show = installation.gui.show.iter();
    let show = show.map(|show| json!({ "from": text(show.from), "data": show.data, "rate_hz": show.rate }));
    let bounds = bounds(installation);
    let flows = installation.flows.iter().enumerate().map(|(index, flow)| {
        let bound = bounds.iter().find(|bound| bound.flow == index);
        json!({
            "from": text(flow.from), "to": text(flow.to), "carries": flow.carries.map(|carries| carries.to_string()),
            "size": flow.size, "period_ms": ms(flow.period), "deadline_ms": ms(flow.deadline),
            "at_worst": bound.map(at_worst),
        })
    });
    let replicas = installation.replicas.iter().map(|replica| {
        json!({
            "from": text(replica.from), "stream": replica.item, "to": replica.to,
            "sampling": replica.sampling.to_string(), "changed": replica.changed,
        })
    });
    let access = installation.access.rules().iter().map(|rule| {
        let (class, module) = match rule.commanded {
            Commanded::Class(class) => (classes.name(class), None),
            Commanded::Module(name) => (None, Some(text(name))),
        };
        let callers = classes.iter().filter(|entry| rule.callers.has(entry.class)).map(|entry| &entry.name);
        json!({ "class": class, "module": module, "callers": callers.collect::<Vec<_>>() })
    });
    json!({
        "name": name,
        "system": { "id": system.id, "name": system.name },
        "time": time(installation),
        "network": installation.network.map(|it| network(installation, it)),
        "tdma": installation.tdma.as_ref().map(|tdma| self::tdma(installation, tdma)),
        "digest": installation.digest().to_string(),
        "parameters": installation.parameters,
        "classes": class_entries.collect::<Vec<_>>(),
        "nodes": nodes.collect::<Vec<_>>(),
        "output": {
            "level": output.level.as_str(), "levels": levels.collect::<serde_json::Map<_, _>>(),
            "ring": output.ring, "file": output.file,
        },
        "gui": show.collect::<Vec<_>>(),
        "record": installation.record.as_ref().map(|it| record(installation, it)),
        "flows": flows.collect::<Vec<_>>(),
        "replicas": replicas.collect::<Vec<_>>(),
        "access": access.collect::<Vec<_>>(),
    })
}

fn module(installation: &Installation, module: &Module) -> Value {
    let text = |name: &Name| installation.classes.format(*name);
    let calls = module.calls.iter().map(|to| {
        let why = module.downwards.why(*to);
        let although = if let Some(Downwards::Although(why)) = why { Some(why) } else { None };
        json!({
            "to": text(to), "although": although, "subscribes": module.downwards.subscribes(*to),
            "within_ms": module.call_limits.of(*to).map(ms),
        })
    });
    let runs = match &module.program {
        Program::Builtin(name) => json!({ "builtin": name }),
        Program::Command(words) => json!({ "program": words }),
    };
    let policy = match module.restart.policy {
        RestartPolicy::Never => "never",
        RestartPolicy::OnFailure => "on-failure",
        RestartPolicy::Always => "always",
    };
    let mailboxes = module.mailboxes.each().into_iter().map(|(key, spec)| (key.into(), mailbox(spec)));
    let streams = module.streams.iter().map(|(name, spec)| (name.clone(), stream(spec)));
    json!({
        "name": text(&module.name),
        "number": module.name.raw(),
        "line": installation.place(module.line).1,
        "priority": module.name.class().0,
        "scheduling": scheduling(installation.scheduling_of(module)),
        "aliases": module.aliases.iter()
            .map(|alias| json!({ "name": text(alias), "number": alias.raw() })).collect::<Vec<_>>(),
        "runs": runs,
        "optional": module.optional,
        "required": module.required,
        "on": module.start == Start::On,
        "calls": calls.collect::<Vec<_>>(),
        "settings": module.settings,
        "restart": {
            "policy": policy, "backoff_ms": ms(module.restart.backoff), "at_most": module.restart.at_most,
            "within_ms": ms(module.restart.within),
        },
        "ready_within_ms": ms(module.ready_within),
        "stop_within_ms": ms(module.stop_within),
        "watchdog": module.watchdog.map(|it| json!({ "limit_ms": ms(it.limit), "grace_ms": ms(it.grace) })),
        "mailboxes": mailboxes.collect::<serde_json::Map<_, _>>(),
        "streams": streams.collect::<serde_json::Map<_, _>>(),
    })
}

fn mailbox(spec: &MailboxSpec) -> Value {
    json!({
        "slots": spec.slots, "size": spec.size, "full": spec.full.name(), "max_age_ms": spec.max_age.map(ms),
        "claims": spec.claims, "memory": spec.memory(),
    })
}

/// `late_ms`: 0 where a record behind the newest is refused.
fn stream(spec: &StreamSpec) -> Value {
    json!({
        "record": spec.record_bytes, "keep": spec.keep, "readers": spec.readers, "late_ms": ms(spec.late),
        "memory": spec.memory(),
    })
}

fn record(installation: &Installation, record: &Recording) -> Value {
    let items = |all: &[RecordedItems]| -> Vec<Value> {
        let item = |items: &RecordedItems| {
            let name = items.text(&installation.classes);
            match items.sampling {
                Sampling::Each => json!({ "name": name }),
                Sampling::Every(every) => json!({ "name": name, "every": every }),
                Sampling::Rate(rate_hz) => json!({ "name": name, "rate_hz": rate_hz }),
            }
        };
        all.iter().map(item).collect()
    };
    json!({
        "directory": record.directory, "streams": items(&record.streams), "data": items(&record.data),
        "output": record.output.map(Level::as_str), "rotate_size": record.rotate_size,
        "rotate_after_ms": ms(record.rotate_after), "leave_free": record.leave_free, "flush_ms": ms(record.flush),
        "sync_ms": ms(record.sync),
    })
}

fn scheduling(scheduling: Scheduling) -> Value {
    match scheduling {
        Scheduling::Fifo { priority } => json!({ "fifo": priority }),
        Scheduling::Normal { nice } => json!({ "nice": nice }),
    }
}

/// `rest_port`: null where there are time slots; `replica_port`: null without a replica.
fn network(installation: &Installation, network: Network) -> Value {
    json!({
        "security": network.security.as_str(), "port": network.port, "time_port": network.time_port(),
        "rest_port": installation.rest_port(), "replica_port": installation.replica_port(), "mtu": network.mtu,
        "datagram_bytes_max": network.datagram_bytes_max,
        "rate_bytes_s": network.rate_bytes_s, "quota_bytes": network.quota_bytes, "bulk_below": network.bulk_below,
    })
}

fn tdma(installation: &Installation, tdma: &Tdma) -> Value {
    let slots = tdma.slots.iter().map(|slot| {
        json!({
            "node": installation.nodes.get(usize::from(slot.node)).map(|node| &node.name), "offset_ms": ms(slot.offset),
            "length_ms": ms(slot.length), "period": slot.period, "phase": slot.phase,
            "bytes": tdma.budget_bytes(slot.length),
        })
    });
    json!({
        "cycle_ms": ms(tdma.cycle), "synchronisation_ms": ms(tdma.synchronisation), "guard_ms": ms(tdma.guard),
        "link_bytes_s": tdma.link_bytes_s, "cycles": tdma.cycles(),
        "tunnel": tdma.tunnel.map(|tunnel| format!("{}/{}", tunnel.network, tunnel.prefix)),
        "slots": slots.collect::<Vec<_>>(),
    })
}

/// The worst case of a flow between nodes: its latency and the parts of it, or why there is no bound.
fn at_worst(bound: &FlowBound) -> Value {
    match &bound.latency {
        Err(why) => json!({ "level": bound.level, "latency_ms": null, "why": why.to_string() }),
        Ok(Bound { latency, slot, waits, slots, others, own_earlier, said, own, datagrams, forward }) => json!({
            "level": bound.level, "latency_ms": ms(*latency), "slot": slot, "waits_ms": ms(*waits), "slots": slots,
            "others_ms": ms(*others), "own_earlier": own_earlier, "said_ms": ms(*said), "own_ms": ms(*own),
            "datagrams": datagrams, "forward_ms": ms(*forward),
        }),
    }
}

fn time(installation: &Installation) -> Value {
    match &installation.time {
        TimeSource::Local => json!({ "source": "local" }),
        TimeSource::Master { masters, interval } => {
            let nodes = masters.iter().filter_map(|index| installation.nodes.get(usize::from(*index)));
            let masters: Vec<&str> = nodes.map(|node| node.name.as_str()).collect();
            json!({ "source": "master", "masters": masters, "interval_ms": ms(*interval) })
        }
        TimeSource::Simulation { speed } => json!({ "source": "simulation", "speed": speed }),
        TimeSource::Log => json!({ "source": "log" }),
    }
}

fn ms(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1e3
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_name_of_another_node_has_a_route_to_it() {
        let text = include_str!("../../../config/tests/two_nodes.toml");
        let installation = Installation::parse(text, "two_nodes.toml".as_ref()).unwrap();
        let nodes: Vec<&str> = installation.nodes.iter().map(|node| node.name.as_str()).collect();
        for node in &nodes {
            let resolved: Value = serde_json::from_slice(&of_node(&installation, node)).unwrap();
            let number = |route: &Value, end: &str| route[end].as_u64().unwrap();
            for other in resolved["installation"]["nodes"].as_array().unwrap() {
                for module in other["modules"].as_array().unwrap() {
                    let name = module["number"].as_u64().unwrap();
                    let routes = resolved["routes"].as_array().unwrap().iter();
                    let leads = |route: &&Value| number(route, "first") <= name && name <= number(route, "last");
                    let to: Vec<&Value> = routes.filter(leads).map(|route| &route["node"]).collect();
                    let expected = if other["name"] == **node { vec![] } else { vec![&other["name"]] };
                    assert_eq!(to, expected, "{node}: {module}");
                }
            }
        }
        assert_eq!(nodes.len(), 2);
    }
}
