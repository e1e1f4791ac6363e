//! A TCP router and connections that send any frames at any time: accounts balance, memory and places are bounded, a
//! name has one host at most, and the digests decide which connections are accepted.

use crate::sessions::{BEGIN_NS, Deaf, MS, server};
use crate::split::Bytes;
use rohrpost_mailbox::{Head, Name, Priority, Type};
use rohrpost_routers::session::ClientIndex;
use rohrpost_routers::session::frame::{Carried, Range, Ranges, SessionHello, SessionMessage};
use rohrpost_routers::session::server::{MemberState, Server, ServerStep};

const STEPS_MAX: usize = 300;
/// Places of members and of accepted connections.
const PLACES: usize = 5;
/// Waiting packages, a batch, the largest frame on each side as vectors grow, waiting ranges, and the rest.
const BYTES_MAX: usize = (64 + 16 + 2 * 2 * 66 + 32 + 16) << 10;

struct World {
    server: Server,
    now_ns: u64,
    /// By the order in which they came.
    connections: Vec<ClientIndex>,
}

pub(crate) fn run(data: &[u8]) {
    let mut bytes = Bytes(data);
    let mut world = World { server: server(), now_ns: BEGIN_NS, connections: Vec::new() };
    for _ in 0..STEPS_MAX {
        if bytes.is_empty() {
            break;
        }
        world.step(&mut bytes);
        world.check();
    }
    // At the end all leave, and no package waits any more.
    while let Some(client) = world.connections.pop() {
        world.server.closed(world.now_ns, client, &mut Deaf);
    }
    for (priority, class) in world.server.counts().classes() {
        assert_eq!(class.packages.get(), class.settled(), "class {}", priority.0);
    }
    assert!(world.server.table().is_empty(), "a program that has left hosts nothing");
}

impl World {
    fn step(&mut self, bytes: &mut Bytes<'_>) {
        let (what, which) = (bytes.byte(), usize::from(bytes.byte()));
        let client = self.connections.get(which % self.connections.len().max(1)).copied();
        match (what % 9, client) {
            (0, _) | (_, None) => {
                let from = ([10, 0, 0, which as u8 % 3], 1).into();
                let accepted = self.server.accept(self.now_ns, from, &mut Deaf);
                self.connections.extend(accepted);
            }
            (1, Some(client)) => self.say(client, &hello(bytes)),
            (2, Some(client)) => {
                let ranges: Vec<Range> = (0..bytes.byte() % 8).map(|_| range(bytes)).collect();
                let mut laid_out = Vec::new();
                self.say(client, &SessionMessage::Register(Ranges::new(bytes.word(), &ranges, &mut laid_out)));
            }
            (3, Some(client)) => {
                let body = vec![7; usize::from(bytes.half()) % 3000];
                let head = Head {
                    to: name(bytes),
                    from: name(bytes),
                    len: body.len() as u16,
                    kind: Type::command(1 + bytes.half() % 100),
                    priority: Priority(bytes.byte()),
                    ..Head::default()
                };
                let carried =
                    Carried { hops: bytes.byte() % 12, published_ns: bytes.long() % (2 * BEGIN_NS), head, body: &body };
                self.say(client, &SessionMessage::Package(carried));
            }
            (4, Some(client)) => self.say(client, &SessionMessage::Ask(bytes.long())),
            (5, Some(client)) => {
                let count = usize::from(bytes.byte());
                self.server.received(self.now_ns, client, bytes.take(count), &mut Deaf);
            }
            (6, _) => self.now_ns += u64::from(bytes.half()) * MS,
            (7, Some(client)) => self.server.writable(client),
            (_, Some(client)) => {
                self.server.closed(self.now_ns, client, &mut Deaf);
                self.connections.retain(|known| *known != client);
            }
        }
        self.poll(bytes);
    }

    fn say(&mut self, client: ClientIndex, message: &SessionMessage<'_>) {
        let mut stream = Vec::new();
        message.write(&mut stream);
        self.server.received(self.now_ns, client, &stream, &mut Deaf);
    }

    /// Streams accept as many bytes as the input says.
    fn poll(&mut self, bytes: &mut Bytes<'_>) {
        loop {
            match self.server.poll(self.now_ns, &mut Deaf) {
                ServerStep::Write(client) => {
                    let ready = self.server.ready(client).len();
                    let taken = if bytes.byte().is_multiple_of(4) { ready / 2 } else { ready };
                    self.server.took(self.now_ns, client, taken);
                }
                ServerStep::Close(client) => self.connections.retain(|known| *known != client),
                ServerStep::Look => return,
                ServerStep::Wait { until_ns } => return assert!(until_ns > self.now_ns),
            }
        }
    }

    fn check(&self) {
        assert!(self.server.clients().count() <= PLACES);
        let (table, mut hosted) = (self.server.table(), 0);
        let members = || self.server.snapshots(self.now_ns).filter(|(_, member)| member.is_member);
        assert!(members().count() <= 3);
        for (client, member) in members() {
            let ranges = table.ranges_of(client);
            for range in ranges {
                assert!(range.first.system() == member.system && range.last.system() == member.system);
                assert_eq!([range.first, range.last].map(|name| table.client_of(name)), [Some(client); 2]);
            }
            assert_eq!(ranges.len() as u64, member.ranges);
            hosted += ranges.len();
        }
        assert_eq!(table.len(), hosted, "nobody else hosts anything");
        for (client, _, state) in self.server.clients() {
            let bytes = self.server.bytes_of(client);
            assert!(bytes <= BYTES_MAX, "{bytes} B for one connection");
            assert!(table.ranges_of(client).is_empty() || state == MemberState::Member, "only members host names");
        }
        let (mut packages, mut known) = (0, self.server.waiting() as u64);
        for (priority, class) in self.server.counts().classes() {
            assert!(class.packages.get() >= class.settled(), "class {}", priority.0);
            packages += class.packages.get();
            known += class.settled();
        }
        assert_eq!(packages, known, "what came has passed, is lost, or waits");
    }
}

fn hello(bytes: &mut Bytes<'_>) -> SessionMessage<'static> {
    let odd = bytes.byte();
    SessionMessage::Hello(SessionHello {
        system: 1 + odd % 3,
        reaches_own: odd & 4 != 0,
        common: if odd & 0x18 == 0x18 { 8 } else { 7 },
        system_digest: if odd & 0x60 == 0x60 { 9 } else { 1 },
        incarnation: 1 + u64::from(bytes.byte() % 6),
        attempt: 1 + u64::from(bytes.byte() % 6),
        asked_ns: bytes.long(),
        name: "client",
    })
}

fn name(bytes: &mut Bytes<'_>) -> Name {
    let [system, class, instance, local] = bytes.array();
    let system = if system > 250 { 255 } else { 1 + system % 3 };
    Name::new(system, 1 + class % 6, instance % 4, local % 4)
}

fn range(bytes: &mut Bytes<'_>) -> Range {
    let (first, last) = (name(bytes), name(bytes));
    if bytes.byte().is_multiple_of(8) { Range { first, last } } else { Range::module(first) }
}
