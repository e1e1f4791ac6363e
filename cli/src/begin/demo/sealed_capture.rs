//! Decodes sealed time datagrams from the bridge: the demo has the keys, and reads them like a node that has not
//! authenticated its peers.

use crate::terminal::Failure;
use rohrpost_config::Installation;
use rohrpost_router_daemon::keys;
use rohrpost_routers::frame::FrameHead;
use rohrpost_routers::security::{Opening, PeerSessions, Port, RouterIdentity, TAG_BYTES};
use rohrpost_routers::settings::Settings;
use rohrpost_routers::time::TIME_BYTES;
use rohrpost_routers::time::message::TimeMessage;

/// The incarnation of an observer that sends nothing.
const MUTE: u64 = 1;

/// By node: opens what is sealed to it. Empty where nothing is sealed.
#[derive(Default)]
pub(super) struct SealedCapture {
    nodes: Vec<Opening>,
}

impl SealedCapture {
    /// With the LAN keys of an installation, if it has some.
    pub(super) fn of(installation: &Installation) -> Result<Self, Failure> {
        let mut nodes = Vec::new();
        for node in installation.lan_nodes() {
            let Some(keys) = keys::of(installation)? else { break };
            let settings = Settings::new(installation, &node.name, MUTE)?;
            nodes.push(Opening::new(&PeerSessions::new(RouterIdentity::of(&settings), keys), Port::Time));
        }
        Ok(Self { nodes })
    }

    /// Parses a datagram of time, sealed or not.
    pub(super) fn hear(&mut self, datagram: &[u8]) -> Option<(FrameHead, TimeMessage)> {
        if let Ok((head, rest)) = FrameHead::parse(datagram) {
            return Some((head, TimeMessage::parse(head.kind, rest).ok()?));
        }
        let mut sealed = [0; TIME_BYTES + TAG_BYTES];
        sealed.copy_from_slice(datagram.get(..TIME_BYTES + TAG_BYTES).filter(|whole| whole.len() == datagram.len())?);
        let ear = (0..self.nodes.len()).find(|node| self.nodes[*node].is_strange(&sealed))?;
        let (head, rest) = self.nodes[ear].overhear(&mut sealed, |_| true).ok()?;
        Some((head, TimeMessage::parse(head.kind, rest).ok()?))
    }
}
