//! What crosses a network, as Wireshark reads it: without security all of it, with security the heads of datagrams and
//! TLS, and nothing else.

use crate::ground::wait;
use crate::lan::Side;
use crate::network::{ADDRESSES, CLIENTS, Joined, PORT, lab};
use crate::sealed::Authority;
use rohrpost_mailbox::{Label, Name, Node, Priority, Shape, Type};
use rohrpost_routers::lab::{Capture, Lab};
use rohrpost_testbed::report::skipped;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::process::Command;

const UDP_PORT: u16 = 21_117;
/// So many packages cross in each way.
const PACKAGES: usize = 100;
/// In each body, by datagrams and by TCP, between bytes that recur.
const WORDS: [&str; 2] = ["the safe is behind the picture", "its combination is 4711"];
const RECURRING: [u8; 24] = [0xd7; 24];
/// pcap's own head: microseconds, version 2.4, the longest frame, Ethernet.
const PCAP_HEAD: [u32; 6] = [0xa1b2_c3d4, 2 | 4 << 16, 0, 0, 1 << 18, 1];

/// Whether it is here.
fn has_tshark() -> bool {
    let is_here = Command::new("tshark").arg("--version").output().is_ok_and(|said| said.status.success());
    if !is_here {
        skipped("what Wireshark reads on the wire (no `tshark` here: apt-get install --no-install-recommends tshark)");
    }
    is_here
}

/// A file that others read, of all frames that cross a bridge.
struct Recorded {
    capture: Capture,
    file: BufWriter<File>,
}

impl Recorded {
    fn new(lab: &Lab, path: &Path) -> Self {
        let mut file = BufWriter::new(File::create(path).unwrap());
        PCAP_HEAD.iter().for_each(|word| file.write_all(&word.to_le_bytes()).unwrap());
        Self { capture: lab.capture().unwrap(), file }
    }

    /// What has crossed since. When each did, nobody asks here.
    fn drain(&mut self) {
        let file = &mut self.file;
        self.capture.drain_frames(|frame| {
            let bytes = frame.len() as u32;
            [0, 0, bytes, bytes].iter().for_each(|word| file.write_all(&word.to_le_bytes()).unwrap());
            file.write_all(frame).unwrap();
        });
    }
}

/// A recording, and what Wireshark finds in it.
struct Read {
    folder: tempfile::TempDir,
}

impl Read {
    /// How many frames a display filter finds. Nobody's preferences count.
    fn frames(&self, filter: &str) -> usize {
        self.fields(filter, "frame.number").len()
    }

    /// A field of each frame that a filter finds.
    fn fields(&self, filter: &str, field: &str) -> Vec<String> {
        let tls = format!("tcp.port=={PORT},tls");
        let said = Command::new("tshark")
            .env("HOME", self.folder.path())
            .env("XDG_CONFIG_HOME", self.folder.path())
            .args(["-n", "-r"])
            .arg(self.folder.path().join("wire.pcap"))
            .args(["-d", &tls, "-Y", filter, "-T", "fields", "-e", field])
            .output()
            .unwrap();
        assert!(said.status.success(), "{filter}: {}", String::from_utf8_lossy(&said.stderr));
        String::from_utf8(said.stdout).unwrap().lines().map(str::to_owned).collect()
    }
}

fn body() -> Vec<u8> {
    [WORDS[0].as_bytes(), &RECURRING, WORDS[1].as_bytes()].concat()
}

/// Two nodes with routers that exchange datagrams, and the TCP router on one of them with a client on each. None where
/// namespaces cannot be made.
fn recorded(authority: Option<&Authority>) -> Option<Read> {
    let lab = lab()?;
    let read = Read { folder: tempfile::tempdir().unwrap() };
    let mut recorded = Recorded::new(&lab, &read.folder.path().join("wire.pcap"));
    cross_lan(&lab, authority.is_some(), &mut recorded);
    cross_tcp(&lab, authority, &mut recorded);
    recorded.file.flush().unwrap();
    Some(read)
}

fn label(from: Name) -> Label {
    Label { from, kind: Type::data(1), priority: Priority(100), ..Label::default() }
}

fn cross_lan(lab: &Lab, sealed: bool, recorded: &mut Recorded) {
    let folder = tempfile::tempdir().unwrap();
    let sides = ["base", "far"].map(|name| {
        let _inside = lab.enter(name).unwrap();
        let own = u8::from(name == "far");
        let node = Node::create(&folder.path().join(name), 0o700).unwrap();
        let mut side = Side::new(own, node, ADDRESSES, None);
        if sealed {
            side.seal()
        } else {
            side.start()
        }
        side
    });
    let to = crate::lan::module(1);
    let mut heard = sides[1].receiver(to, Shape { slots: 64, ..Shape::default() });
    let (mut sender, mut came) = (sides[0].sender(to), 0);
    wait("packages cross the LAN", || {
        // Until both know each other, some wait, and too many are refused.
        let _ = sender.send(&label(crate::lan::module(0)), &[&body()]);
        came += usize::from(heard.try_receive().is_some_and(|package| package.body() == body()));
        recorded.drain();
        (came >= PACKAGES).then_some(())
    });
}

fn cross_tcp(lab: &Lab, authority: Option<&Authority>, recorded: &mut Recorded) {
    let mut joined = Joined::new(lab, authority);
    let (near, far) = (&mut joined.near, &joined.far);
    let (mut sender, mut came) = (far.sender(2), 0);
    wait("packages cross by TCP", || {
        let _ = sender.send(&label(crate::ground::module(1)), &[&body()]);
        came += usize::from(near.hear_bytes().is_some_and(|bytes| bytes == body()));
        recorded.drain();
        (came >= PACKAGES).then_some(())
    });
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect::<Vec<_>>().join(":")
}

/// All that nobody may read, each as a filter finds it.
fn secrets() -> Vec<String> {
    let words = WORDS.iter().chain(&CLIENTS).map(|word| format!("frame contains \"{word}\""));
    // A third of what recurs, so that no edge of a frame or block hides it.
    let recurring = format!("frame contains {}", hex(&RECURRING[..8]));
    // To and from, as heads of packages begin, of datagrams and of sessions.
    let [lan, tcp] =
        [[crate::lan::module(1), crate::lan::module(0)], [crate::ground::module(2), crate::ground::module(1)]];
    let names = [lan, tcp].map(|names| names.map(|name| name.raw().to_le_bytes()).concat());
    let names = names.map(|names| format!("frame contains {}", hex(&names)));
    words.chain([recurring]).chain(names).collect()
}

#[test]
fn wireshark_reads_all_without_security_and_of_what_is_sealed_nothing() {
    if !has_tshark() {
        return;
    }
    let Some(open) = recorded(None) else { return };
    // The far client's name alone crosses the network.
    let crosses = |secret: &String| !secret.contains(CLIENTS[0]);
    for secret in secrets().iter().filter(|secret| crosses(secret)) {
        assert!(open.frames(secret) > 0, "without security nothing is found by {secret}");
    }
    let lan = |filter: &str| format!("udp.port == {UDP_PORT} && {filter}");
    let in_datagrams = open.frames(&lan(&format!("data contains \"{}\"", WORDS[0])));
    assert!(in_datagrams > PACKAGES / 20, "{in_datagrams} datagrams with the words");
    assert_eq!(open.frames("tls.record"), 0, "nothing is sealed");

    let sealed = recorded(Some(&Authority::new())).unwrap();
    for secret in secrets() {
        assert_eq!(sealed.frames(&secret), 0, "with security {secret} finds frames");
    }
    // All datagrams are data of nothing that Wireshark knows, and all that a session sends is TLS 1.3; its handshake
    // shows no certificate.
    let (datagrams, data) = (sealed.frames(&lan("udp.length > 8")), sealed.frames(&lan("data")));
    assert!(datagrams > PACKAGES / 20 && datagrams == data, "{data} of {datagrams} datagrams are data");
    let versions = sealed.fields("tls.handshake.type == 2", "tls.handshake.extensions.supported_version");
    assert!(!versions.is_empty() && versions.iter().all(|version| version == "0x0304"), "{versions:?}");
    let carried = sealed.frames("tls.record.opaque_type == 23 || tls.record.content_type == 23");
    assert!(carried > PACKAGES / 20, "{carried} segments with application data");
    assert_eq!(sealed.frames("tls.handshake.certificate"), 0);
    // What the kernel has sent again Wireshark does not look into; the words were looked for there as well.
    let again = "tcp.analysis.retransmission || tcp.analysis.spurious_retransmission || tcp.analysis.out_of_order";
    let bare = format!("tcp.port == {PORT} && tcp.len > 0 && !tls && !({again})");
    assert_eq!(sealed.fields(&bare, "tcp.payload"), [""; 0], "all that a session sends is TLS");
}
