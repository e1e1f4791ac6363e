//! The TCP router, as a module.

use super::ends::{
    PERIOD, ReplicaReport, called, certificates, classes, configured, levels, line_parts, short, streams,
};
use crate::moving::Moving;
use crate::router::faults::Encoded;
use rohrpost_config::Node;
use rohrpost_mailbox::{Name, Ready, monotonic_ns, realtime_ns};
use rohrpost_modules::interfaces::{
    BeyondClient, BeyondClients, BeyondCrowded, BeyondHost, BeyondHosts, BeyondStreams, Tcp, TcpInterface,
};
use rohrpost_modules::runtime::Context;
use rohrpost_modules::{Module, ModuleError, NoSettings};
use rohrpost_routers::moving::MovingNames;
use rohrpost_routers::session::frame::Range;
use rohrpost_routers::session::server::{MemberSnapshot, MovingHosts, Names, OwnNode, OwnNodes, ServerSettings};
use rohrpost_routers::tcp::{ServerParts, ServerSeal, ServerShell};
use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::sync::Arc;

/// The server.
pub(crate) struct ServerModule {
    shell: ServerShell,
    replicas: ReplicaReport,
    streams: BeyondStreams,
    address: SocketAddr,
    moving: Moving,
    began_ns: u64,
}

impl Tcp for ServerModule {}

impl Module for ServerModule {
    type Settings = NoSettings;
    type Interfaces = TcpInterface;

    fn new(_: NoSettings, context: &mut Context) -> Result<Self, ModuleError> {
        let installation = context.installation();
        let tcp = configured(installation)?;
        let seal = certificates(installation, tcp).map(|folder| ServerSeal::load(&folder)).transpose()?;
        let digest = installation.digest();
        let names_of = |ranges: Vec<(Name, Name)>| -> Names {
            ranges.into_iter().map(|(first, last)| Range { first, last }).collect()
        };
        let registered = |node: &Node| (node.name.clone(), names_of(installation.names_registered(&node.name)));
        let names: BTreeMap<String, Names> = installation.nodes.iter().map(registered).collect();
        let own = |node: &Node| {
            let names = names.get(&node.name).cloned().unwrap_or_default();
            let all = names_of(installation.names_on(&node.name));
            OwnNode { name: called(&node.name, installation), names, all, address: node.address }
        };
        let lan = installation.lan_nodes();
        let moving = MovingHosts {
            names: Arc::new(MovingNames::new(installation.moving_names(), lan.len())),
            clients: lan.iter().filter_map(|node| installation.tcp_client_of(&node.name)).collect(),
        };
        let moving_names = moving.names.clone();
        let settings = ServerSettings {
            name: short(&format!("the TCP router of {}", installation.system.name)),
            common: digest.common,
            system: Some((installation.system.id, digest.system)),
            own_nodes: OwnNodes::new(installation.nodes.iter().map(own)),
            moving,
            incarnation: realtime_ns().max(1),
            clients_max: tcp.clients,
            handshakes_max: tcp.clients.max(HANDSHAKES_MIN),
            quota_bytes: tcp.quota_bytes,
            levels: levels(tcp),
        };
        let address = tcp.address;
        let faults = Arc::new(Encoded::of(installation));
        let node = context.link().borrow().participant().node().clone();
        let own = installation.node_of(context.me()).unwrap_or_default().to_owned();
        let (replicas, report) = (line_parts(installation, &own), ReplicaReport::new(installation, &own));
        let shell = ServerShell::start(ServerParts { address, settings, faults, seal, names, node: &node, replicas })?;
        context.use_computer_clock();
        context.set_period(PERIOD);
        let moving = Moving::watch(moving_names, context)?;
        let streams = streams(context.installation(), &own);
        Ok(Self { shell, replicas: report, streams, address, moving, began_ns: monotonic_ns() })
    }

    fn on(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        self.moving.look(context);
        Ok(())
    }

    fn ready(&mut self, context: &mut Context, _: Ready) -> Result<(), ModuleError> {
        self.moving.ready(context);
        Ok(())
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        // It cannot work without its thread; launch restarts it.
        assert!(self.shell.is_well(), "the thread of the TCP router has ended");
        self.moving.look(context);
        let seen = self.shell.members();
        context.publish_now(TcpInterface::HOSTS, &hosts(&seen.members))?;
        context.publish_now(TcpInterface::STREAMS, &self.streams)?;
        context.publish_now(
            TcpInterface::CLIENTS,
            &BeyondClients {
                address: self.address.to_string(),
                uptime_ms: monotonic_ns().saturating_sub(self.began_ns) / 1_000_000,
                clients: seen.members.into_iter().map(client).collect(),
                more: seen.more,
                left: seen.left,
                refused: seen.refused,
                refusal: seen.refusal,
                crowded: BeyondCrowded {
                    greetings: seen.crowded.handshakes,
                    clients: seen.crowded.clients,
                    ranges: seen.crowded.ranges,
                    packages: seen.crowded_packages,
                },
                superseded: seen.superseded,
                held_lines: seen.held,
                unknown_parts: self.shell.replicas().unknown.get(),
                classes: classes(&seen.classes),
            },
        )?;
        if let Some(states) = self.replicas.states(context.installation(), self.shell.replicas()) {
            context.publish_now(TcpInterface::REPLICAS, &states)?;
        }
        Ok(())
    }
}

/// Lower bound of connections that have not completed the handshake.
const HANDSHAKES_MIN: u16 = 64;

/// Ranges per report: with the names of their clients they fit in a package.
const HOSTS_MAX: usize = 512;

fn hosts(members: &[MemberSnapshot]) -> BeyondHosts {
    let all = members.iter().flat_map(|member| member.hosts.iter().map(move |range| (range, member)));
    let host = |((first, last), member): (&(Name, Name), &MemberSnapshot)| BeyondHost {
        first: first.raw(),
        last: last.raw(),
        client: member.name.clone(),
    };
    let hosts: Vec<BeyondHost> = all.take(HOSTS_MAX).map(host).collect();
    let ranges: u64 = members.iter().map(|member| member.ranges).sum();
    BeyondHosts { more: ranges.saturating_sub(hosts.len() as u64), hosts }
}

fn client(member: MemberSnapshot) -> BeyondClient {
    BeyondClient {
        name: member.name,
        address: member.peer,
        system: member.system,
        takes_part: member.is_member,
        ranges: member.ranges,
        age_ms: member.age_ns / 1_000_000,
        heard_ms: member.heard_ns / 1_000_000,
        lost: member.lost,
        bytes: member.bytes,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tcp::ends::NAME_BYTES_MAX;
    use rohrpost_config::REPLICAS_MAX;
    use rohrpost_modules::interfaces::{BeyondNode, BeyondStream, CarriedLoss, ClassPassed};
    use rohrpost_modules::wire::append;
    use rohrpost_network::NODES_MAX;
    use rohrpost_routers::session::Cause;
    use rohrpost_routers::tcp::MEMBERS_MAX;

    /// A report with more entries would not fit, and nothing would be shown.
    #[test]
    fn the_largest_report_of_clients_fits_into_a_package() {
        let most = u64::from(u32::MAX);
        let client = BeyondClient {
            name: "x".repeat(NAME_BYTES_MAX),
            address: "[2001:db8:ffff:ffff:ffff:ffff:ffff:ffff]:65535".into(),
            system: u8::MAX,
            takes_part: true,
            ranges: most,
            age_ms: most,
            heard_ms: most,
            lost: most,
            bytes: most,
        };
        let lost = Cause::ALL.map(|cause| CarriedLoss { cause: cause.word().into(), packages: most });
        let class = ClassPassed { class: u8::MAX, packages: most, passed: most, replaced: most, lost: lost.into() };
        let all = BeyondClients {
            unknown_parts: most,
            address: client.address.clone(),
            uptime_ms: most,
            clients: vec![client; MEMBERS_MAX],
            more: most,
            left: most,
            refused: most,
            refusal: "x".repeat(1000),
            crowded: BeyondCrowded { greetings: most, clients: most, ranges: most, packages: most },
            superseded: most,
            held_lines: most,
            classes: vec![class; 64],
        };
        let mut body = Vec::new();
        append(&mut body, &all).unwrap();
        assert!(body.len() < rohrpost_mailbox::BODY_BYTES_MAX, "{}", body.len());
    }

    #[test]
    fn all_streams_to_all_nodes_fit_into_a_package() {
        let node = BeyondNode { name: "x".repeat(250), client: u32::MAX };
        let to: Vec<u16> = (0..NODES_MAX as u16).collect();
        let stream =
            BeyondStream { place: u16::MAX, source: u32::MAX, item: "x".repeat(250), record_bytes: u32::MAX, to };
        let all = BeyondStreams { nodes: vec![node; NODES_MAX], streams: vec![stream; REPLICAS_MAX] };
        let mut body = Vec::new();
        append(&mut body, &all).unwrap();
        assert!(body.len() < rohrpost_mailbox::BODY_BYTES_MAX, "{}", body.len());
    }
}
