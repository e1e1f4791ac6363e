//! Frames of sessions: a stream from anybody, to a TCP router and to a client. Frames are written again as they were
//! read, byte for byte, however the stream is split, and announced bytes take no memory before they arrive.

use rohrpost_routers::admission::Admission;
use rohrpost_routers::report::NotDelivered;
use rohrpost_routers::session::client::{self, Client, ClientSettings};
use rohrpost_routers::session::frame::{Carried, HEAD_BYTES, LENGTH_MAX, SessionFrameHead, SessionMessage};
use rohrpost_routers::session::server::{self, MovingHosts, OwnNodes, Server, ServerSettings, ServerStep};
use rohrpost_routers::session::{Cause, EndHost};

pub(crate) const MS: u64 = 1_000_000;
pub(crate) const BEGIN_NS: u64 = 1000 * MS;
/// Memory of a connection that has sent so many bytes: twice as many, as vectors grow, and the rest.
const BESIDE_BYTES: usize = 16 * 1024;

pub(crate) fn run(data: &[u8]) {
    let (split, stream) = data.split_first().map_or((0, data), |(split, stream)| (usize::from(*split), stream));
    frames(stream);
    to_a_server(stream, split);
    to_a_client(stream, split);
}

fn frames(mut stream: &[u8]) {
    while let Some((bytes, rest)) = stream.split_first_chunk::<HEAD_BYTES>() {
        let head = match SessionFrameHead::parse(bytes, LENGTH_MAX) {
            Ok(head) => head,
            Err(bad) => return assert!(!bad.to_string().is_empty()),
        };
        let Some((frame, behind)) = rest.split_at_checked(head.length) else { return };
        match SessionMessage::parse(head, frame) {
            Ok(SessionMessage::Package(carried)) => assert_eq!(usize::from(carried.head.len), carried.body.len()),
            Ok(message) => assert_eq!(message.to_bytes(), stream[..HEAD_BYTES + head.length]),
            Err(bad) => return assert!(!bad.to_string().is_empty()),
        }
        stream = behind;
    }
}

/// Ignores all events.
pub(crate) struct Deaf;

impl EndHost for Deaf {
    fn answer(&mut self, _: &[u8], why: Cause, _: Option<&str>, answer: &mut Vec<u8>) -> bool {
        answer.extend(why.word().bytes());
        true
    }
}

impl server::ServerHost for Deaf {
    fn event(&mut self, _: server::ServerEvent<'_>) {}
}

impl client::ClientHost for Deaf {
    fn deliver(&mut self, carried: &Carried<'_>) -> Result<(), NotDelivered> {
        assert_eq!(usize::from(carried.head.len), carried.body.len());
        if carried.head.id.is_multiple_of(3) { Err(NotDelivered::MailboxFull) } else { Ok(()) }
    }

    fn event(&mut self, _: client::ClientEvent<'_>) {}
}

pub(crate) fn server() -> Server {
    Server::new(ServerSettings {
        name: "the server".into(),
        common: 7,
        system: None,
        own_nodes: OwnNodes::default(),
        moving: MovingHosts::default(),
        incarnation: 5,
        clients_max: 3,
        handshakes_max: 2,
        quota_bytes: 64 << 10,
        levels: std::array::from_fn(|priority| priority as u8 >> 3),
    })
}

fn pieces(stream: &[u8], split: usize) -> impl Iterator<Item = &[u8]> {
    stream.chunks(if split == 0 { usize::MAX } else { split })
}

fn to_a_server(stream: &[u8], split: usize) {
    let mut server = server();
    let Some(client) = server.accept(BEGIN_NS, ([10, 0, 0, 1], 1).into(), &mut Deaf) else { return };
    for (at, piece) in pieces(stream, split).enumerate() {
        let now_ns = BEGIN_NS + at as u64 * MS;
        server.received(now_ns, client, piece, &mut Deaf);
        while let ServerStep::Write(index) = server.poll(now_ns, &mut Deaf) {
            let ready = server.ready(index).len();
            server.took(now_ns, index, ready);
        }
        assert!(server.bytes_of(client) <= 2 * stream.len() + BESIDE_BYTES, "{} B", server.bytes_of(client));
    }
}

fn to_a_client(stream: &[u8], split: usize) {
    let settings = ClientSettings {
        name: "client".into(),
        system: 1,
        reaches_own: false,
        common: 7,
        system_digest: 1,
        incarnation: 3,
        quota_bytes: 64 << 10,
        levels: [0; 256],
        admission: Admission::default(),
    };
    let mut client = Client::new(settings, Vec::new(), BEGIN_NS);
    client.poll(BEGIN_NS, &mut Deaf);
    client.connected(BEGIN_NS);
    for (at, piece) in pieces(stream, split).enumerate() {
        let now_ns = BEGIN_NS + at as u64 * MS;
        client.received(now_ns, piece, &mut Deaf);
        while client.poll(now_ns, &mut Deaf) == client::ClientStep::Write {
            client.took(now_ns, client.ready().len());
        }
    }
    let balanced = |counts: &rohrpost_routers::session::SessionCounts| {
        counts.classes().all(|(_, class)| class.packages.get() >= class.settled())
    };
    assert!(balanced(client.inn()) && balanced(client.out()));
}
