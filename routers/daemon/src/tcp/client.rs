//! A node's client of the TCP router, as a module.

use super::ends::{PERIOD, ReplicaReport, called, certificates, classes, configured, levels, line_parts};
use crate::router::{faults::Encoded, impairment};
use rohrpost_config::Reach;
use rohrpost_mailbox::{ERROR_UNKNOWN_NS, Name, TimeRecord, monotonic_ns, realtime_ns};
use rohrpost_modules::interfaces::{BeyondLink, BeyondOutage, BeyondState, BeyondTime, Tcp, TcpInterface};
use rohrpost_modules::runtime::Context;
use rohrpost_modules::{Module, ModuleError, NoSettings};
use rohrpost_routers::admission::Admission;
use rohrpost_routers::impair;
use rohrpost_routers::session::client::ClientSettings;
use rohrpost_routers::tcp::{ClientParts, ClientSeal, ClientShell, Holder, LinkState};
use std::net::SocketAddr;
use std::sync::Arc;

/// A client.
pub(crate) struct ClientModule {
    shell: ClientShell,
    node: String,
    replicas: ReplicaReport,
    server: SocketAddr,
}

impl Tcp for ClientModule {}

impl Module for ClientModule {
    type Settings = NoSettings;
    type Interfaces = TcpInterface;

    fn new(_: NoSettings, context: &mut Context) -> Result<Self, ModuleError> {
        let installation = context.installation();
        let tcp = configured(installation)?;
        let node_name = installation.node_of(context.me()).unwrap_or_default().to_owned();
        let holder = Holder::Node { node: node_name.clone(), system: installation.system.id };
        let seal = certificates(installation, tcp).map(|folder| ClientSeal::load(&folder, &holder)).transpose()?;
        let digest = installation.digest();
        let is_beyond = installation.node(&node_name).is_some_and(|node| node.reach == Reach::Tcp);
        let settings = ClientSettings {
            name: called(&node_name, installation),
            system: installation.system.id,
            reaches_own: !is_beyond,
            common: digest.common,
            system_digest: digest.system,
            incarnation: realtime_ns().max(1),
            quota_bytes: tcp.quota_bytes,
            levels: levels(tcp),
            admission: Admission::new(installation, &node_name),
        };
        let server = tcp.address;
        let others = installation.nodes.iter().filter(|other| !is_beyond && other.name != node_name);
        let mut others: Vec<_> = others.flat_map(|other| installation.names_registered(&other.name)).collect();
        if !is_beyond {
            let whole = |name: Name| (name.with_local(0), name.with_local(u8::MAX));
            others.extend(installation.moving_names().into_iter().map(whole));
        }
        // Between nodes on the LAN, the faults apply to the LAN.
        let impair = if is_beyond { impairment()? } else { None };
        if let Some(impair) = impair {
            tracing::warn!(
                "adds faults to the connection with the TCP router, as {} requests: {impair}",
                impair::ENVIRONMENT
            );
        }
        let node = context.link().borrow().participant().node().clone();
        let replicas = ReplicaReport::new(installation, &node_name);
        let shell = ClientShell::start(ClientParts {
            node: &node,
            name: context.me(),
            server,
            settings,
            hosts: installation.names_reached(&node_name),
            registers: installation.names_registered(&node_name),
            others,
            beyond: installation.names_beyond(&node_name),
            faults: Arc::new(Encoded::of(installation)),
            seal,
            keeps_time: is_beyond,
            impair,
            team: installation.team_router_of(&node_name),
            // The TCP router itself has those of its node.
            replicas: if is_beyond { line_parts(installation, &node_name) } else { None },
        })?;
        context.use_computer_clock();
        context.set_period(PERIOD);
        Ok(Self { shell, node: node_name, replicas, server })
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        // It cannot work without its thread; launch restarts it.
        assert!(self.shell.is_well(), "the thread of the client of the TCP router has ended");
        let link = self.shell.link();
        let (now_ns, system) = (monotonic_ns(), context.now());
        let told = |ns: u64| system.ns.saturating_sub(now_ns.saturating_sub(ns));
        context.publish_now(
            TcpInterface::LINK,
            &BeyondLink {
                node: self.node.clone(),
                server: self.server.to_string(),
                state: match link.state {
                    LinkState::Away => BeyondState::Away,
                    LinkState::Joining => BeyondState::Joining,
                    LinkState::Up => BeyondState::Up,
                },
                why: link.why,
                reconnects: link.connections.saturating_sub(1),
                round_trip_ns: link.round_trip_ns,
                time_error_ns: link.time_error_ns,
                time: link.time.map(|record| time(&record, now_ns)),
                outages: link.outage.count,
                outage: link.outage.last.map(|(began_ns, ended_ns)| BeyondOutage {
                    began_ns: told(began_ns),
                    ended_ns: ended_ns.map(told),
                }),
                waiting_bytes: link.waiting_bytes,
                unknown_parts: self.shell.replicas().unknown.get(),
                sent: classes(&link.out),
                received: classes(&link.inn),
            },
        )?;
        if let Some(states) = self.replicas.states(context.installation(), self.shell.replicas()) {
            context.publish_now(TcpInterface::REPLICAS, &states)?;
        }
        Ok(())
    }
}

fn time(record: &TimeRecord, now_ns: u64) -> BeyondTime {
    let there = record.at(now_ns);
    let error_ns = u64::try_from(there.error.as_nanos()).ok().filter(|error_ns| *error_ns < ERROR_UNKNOWN_NS);
    BeyondTime { epoch: there.epoch, now_ns: there.ns, error_ns }
}
