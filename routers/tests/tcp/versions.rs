//! Ends of two versions, and of two installations: each says so for itself.

use crate::ground::{COMMON, PATIENCE, Router, System, wait};
use rohrpost_routers::session::frame::{HEAD_BYTES, SessionMessage, SessionRefusal, SessionRefusalReason, VERSION};
use rohrpost_routers::tcp::LinkState;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};

/// Where a hello and a refusal have their version: behind the frame's head and the magic word.
const VERSION_AT: usize = HEAD_BYTES + 4;
const OTHER: u8 = VERSION + 1;

#[test]
fn a_tcp_router_says_which_version_a_client_speaks_and_tells_it_its_own() {
    let server = Router::start();
    let mut hello = SessionMessage::Hello(crate::sessions::hello(3, COMMON)).to_bytes();
    assert_eq!(hello[VERSION_AT], VERSION);
    hello[VERSION_AT] = OTHER;
    let mut client = TcpStream::connect(server.address).unwrap();
    client.set_read_timeout(Some(PATIENCE)).unwrap();
    client.write_all(&hello).unwrap();
    let mut told = Vec::new();
    client.read_to_end(&mut told).unwrap();
    assert_eq!(
        told[VERSION_AT..VERSION_AT + 2],
        [VERSION, SessionRefusalReason::Version as u8],
        "so the client knows what to say"
    );
    let words = format!("session format {OTHER}, ours is {VERSION}; run the same version of Rohrpost at both ends");
    wait("the TCP router says why", || server.members().refusal.contains(&words).then_some(()));
    assert!(server.members().members.iter().all(|member| !member.is_member));
}

#[test]
fn a_client_says_what_a_tcp_router_of_another_version_or_installation_objects_to() {
    for (version, reason, words) in [
        (
            OTHER,
            SessionRefusalReason::Version,
            format!("the TCP router speaks session format {OTHER}, this end {VERSION}; run the same version"),
        ),
        (
            VERSION,
            SessionRefusalReason::Common,
            "the common digest here is 00000000000000c0, that of north 00000000000000c1".into(),
        ),
    ] {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let refusal = SessionRefusal { version, reason, yours: COMMON, ours: COMMON + 1, text: "north" };
        let refusal = SessionMessage::Refusal(refusal).to_bytes();
        let client = System::new(1, "one", listener.local_addr().unwrap());
        listener.set_nonblocking(true).unwrap();
        let (mut server, _) = wait("the client connects", || listener.accept().ok());
        server.set_nonblocking(false).unwrap();
        server.set_read_timeout(Some(PATIENCE)).unwrap();
        // It reads what the client says, refuses it, and closes.
        let mut hello = [0; VERSION_AT + 1];
        server.read_exact(&mut hello).unwrap();
        assert_eq!(hello[VERSION_AT], VERSION);
        server.write_all(&refusal).unwrap();
        wait(&words, || client.client.link().why.contains(&words).then_some(()));
        assert_ne!(client.client.link().state, LinkState::Up);
    }
}

#[test]
fn of_two_installations_both_ends_name_the_digests_that_differ() {
    let server = Router::start();
    let mut client = TcpStream::connect(server.address).unwrap();
    client.set_read_timeout(Some(PATIENCE)).unwrap();
    client.write_all(&SessionMessage::Hello(crate::sessions::hello(3, COMMON + 1)).to_bytes()).unwrap();
    let mut told = Vec::new();
    client.read_to_end(&mut told).unwrap();
    assert_eq!(told[VERSION_AT + 1], SessionRefusalReason::Common as u8);
    let digests = ["00000000000000c1", "00000000000000c0"];
    wait("the TCP router says why", || {
        let said = server.members().refusal;
        digests.iter().all(|digest| said.contains(digest)).then_some(())
    });
}
