//! What it costs the server when all clients come at once, as after its restart.

use super::ground::Notes;
use super::plan::{client_settings, server_settings};
use super::world::MS;
use crate::session::ClientIndex;
use crate::session::client::{Client, ClientSettings};
use crate::session::frame::{Range, Ranges, SessionMessage};
use crate::session::server::{Server, ServerSettings, ServerStep};
use nix::time::{ClockId, clock_gettime};
use rohrpost_mailbox::Name;
use std::time::Duration;

/// Ranges that each has.
const RANGES: usize = 16;

/// The processor's time of this thread: what others do beside it is not in it.
fn worked() -> Duration {
    clock_gettime(ClockId::CLOCK_THREAD_CPUTIME_ID).unwrap().into()
}

fn says(client: usize) -> Vec<u8> {
    let module = |index: usize| {
        Name::new(2 + (client >> 11) as u8, (client >> 3) as u8, ((client & 7) * RANGES + index) as u8, 0)
    };
    let ranges: Vec<Range> = (0..RANGES).map(|index| Range::module(module(index))).collect();
    let (system, incarnation) = (module(0).system(), 1 + client as u64);
    let settings = ClientSettings { system, system_digest: 1, ..client_settings(0, incarnation) };
    let mut says = Client::new(settings, Vec::new(), 0);
    says.connected(1);
    let register = SessionMessage::Register(Ranges::new(1, &ranges, &mut Vec::new())).to_bytes();
    [says.ready(), &register].concat()
}

/// What the server's thread works until so many clients, each with its own address, are connected and host their names.
fn coming_at_once(clients: usize) -> Duration {
    let (clients_max, handshakes_max) = (clients as u16, clients as u16);
    let mut server = Server::new(ServerSettings { clients_max, handshakes_max, ..server_settings(5) });
    let (mut host, mut now_ns, mut work) = (Notes::default(), 100_000 * MS, Duration::ZERO);
    for client in 0..clients {
        let ([high, low], bytes) = ((client as u16).to_be_bytes(), says(client));
        let began = worked();
        let place = server.accept(now_ns, ([10, 0, high, low], 1).into(), &mut host).unwrap();
        server.received(now_ns, place, &bytes, &mut host);
        work += worked() - began;
    }
    let mut looks = 0;
    while server.table().len() < clients * RANGES {
        assert!(looks < 100, "{} ranges of {clients} clients", server.table().len());
        (now_ns, looks) = (now_ns + 100 * MS, looks + 1);
        let began = worked();
        while let ServerStep::Write(client) = server.poll(now_ns, &mut host) {
            let bytes = server.ready(client).len();
            server.took(now_ns, client, bytes);
        }
        work += worked() - began;
    }
    assert_eq!(server.table().client_of(Name::new(2, 0, 3, 9)), Some(ClientIndex(0)));
    work
}

#[test]
fn when_eight_times_as_many_clients_come_at_once_the_server_works_about_eight_times_as_long() {
    let clients = 512;
    let least = |clients| (0..3).map(|_| coming_at_once(clients)).min().unwrap();
    let (few, many) = (least(clients), least(8 * clients));
    let text = format!("{clients} clients of {RANGES} ranges: {few:?}, {}: {many:?}", 8 * clients);
    eprintln!("{text}");
    assert!(many < few * 8 * 3, "{text}; each with each would take 64 times as long");
}
