//! The ways out of a node: the LAN, the TCP router, and to other systems without a server.

use super::Page;
use crate::module::Module;
use crate::team::Team;
use crate::units::{count_text, size_text};

impl Page<'_> {
    pub(super) fn network(&mut self) {
        let Some(network) = self.installation.network else { return };
        let sends = match &self.installation.tdma {
            None => format!("at most {} a second", size_text(network.rate_bytes_s)),
            Some(_) => "in its time slots only".into(),
        };
        let (port, time_port) = (network.port, network.time_port());
        let ports = match (self.installation.rest_port(), self.installation.replica_port()) {
            (Some(rest), Some(replicas)) => format!(
                "{port} (packages), {time_port} (time), {rest} (packages that are not real time) and {replicas} \
                 (replicas)"
            ),
            (Some(rest), None) => {
                format!("{port} (packages), {time_port} (time) and {rest} (packages that are not real time)")
            }
            (None, Some(replicas)) => format!("{port} (packages), {time_port} (time) and {replicas} (replicas)"),
            (None, None) => format!("{port} (packages) and {time_port} (time)"),
        };
        self.entry(
            "network",
            &format!(
                "UDP ports {ports}; IP packets of at most {} B, so datagrams of {} B; each router sends {}, and keeps \
                 {} of each sender waiting",
                network.mtu,
                network.datagram_bytes_max,
                sends,
                size_text(network.quota_bytes as u64)
            ),
        );
        if let Some(security) = self.installation.security_text() {
            self.entry("security", &security);
        }
    }

    pub(super) fn tcp(&mut self) {
        let Some(tcp) = &self.installation.tcp else { return };
        let runs = match &tcp.server {
            Some(node) => {
                format!("it runs on node {node}, takes {}", count_text(tcp.clients.into(), "client"))
            }
            None => "another installation runs it".into(),
        };
        let words = format!(
            "TCP router at {}: what neither a node nor its LAN has goes there; {runs}; {} wait for a connection at \
             most",
            tcp.address,
            size_text(tcp.quota_bytes as u64)
        );
        self.entry("beyond", &words);
        self.entry("security", &tcp.security_text());
    }

    pub(super) fn team(&mut self) {
        for (label, words) in self.installation.team.iter().flat_map(Team::explained) {
            self.entry(label, &words);
        }
    }

    /// What is not checked of the calls of a module to other systems.
    pub(super) fn elsewhere(&mut self, module: &Module) {
        for to in module.calls.iter().filter(|to| to.system() != self.installation.system.id) {
            let words = format!(
                "whether {} runs, may be called and takes this much, the file of system {} says: not checked here",
                self.name(*to),
                to.system()
            );
            self.entry("elsewhere", &words);
        }
    }
}
