//! A TCP router in a process of its own, and attackers: others are served all the while, and its memory stays what it
//! was.

use crate::ground::{COMMON, Router, System, address, two, wait};
use crate::sealed::{Authority, seal};
use rohrpost_mailbox::{Head, Priority, Type};
use rohrpost_routers::session::frame::{Carried, Range, Ranges, SessionHello, SessionMessage};
use rohrpost_routers::tcp::{ClientSeal, LinkState, Moved, ServerSeal, Stream};
use rohrpost_testbed::sim::chance::Chance;
use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

const SERVER: &str = "ROHRPOST_TEST_SERVER";
/// What the process runs.
const PROCESS: &str = "hostile::in_a_process_of_its_own";
/// What `ground` lets take part and be let in at a time.
const PLACES: u64 = 32;
/// More than an allocator keeps of what was freed, and far less than frames that were believed would take.
const GROWTH_BYTES_MAX: u64 = 48 << 20;

/// Attacks of each kind: for a long run, `ROHRPOST_ATTACKS=1000000 cargo test --release -p rohrpost-routers --test tcp
/// hostile`.
fn attacks() -> u64 {
    std::env::var("ROHRPOST_ATTACKS").ok().map_or(300, |attacks| attacks.parse().unwrap())
}

/// Says a few times a second how many connections it has, what they take up, and how many it refused.
#[test]
fn in_a_process_of_its_own() {
    let Ok(order) = std::env::var(SERVER) else { return };
    let (address, folder) = order.split_once(' ').unwrap();
    let seal = (!folder.is_empty()).then(|| ServerSeal::load(Path::new(folder)).unwrap());
    let server = Router::at(address.parse().unwrap(), seal);
    // Until the test that has the other end of this pipe ends.
    loop {
        let members = server.members();
        let bytes: u64 = members.members.iter().map(|member| member.bytes).sum();
        if writeln!(std::io::stderr(), "seen {} {bytes} {}", members.members.len(), members.refused).is_err() {
            return;
        }
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// The server's process.
pub(crate) struct Target {
    child: Child,
    pub(crate) address: SocketAddr,
    /// A client with whole handshakes, and a certificate that another authority has signed.
    stranger: Option<ClientSeal>,
    /// Connections, their bytes, and how many were refused, at most so far.
    most: Arc<Mutex<[u64; 3]>>,
}

impl Target {
    pub(crate) fn start(authority: Option<&Authority>) -> Self {
        let address = address();
        let folder = authority.map_or_else(String::new, |authority| authority.path().display().to_string());
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(["--exact", PROCESS, "--nocapture"]).env(SERVER, format!("{address} {folder}"));
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let (said, most) = (BufReader::new(child.stderr.take().unwrap()), Arc::new(Mutex::new([0; 3])));
        let kept = most.clone();
        std::thread::spawn(move || {
            for line in said.lines().map_while(Result::ok) {
                let Some(numbers) = line.strip_prefix("seen ") else { continue };
                let numbers = numbers.split(' ').map(|number| number.parse::<u64>().unwrap());
                kept.lock().unwrap().iter_mut().zip(numbers).for_each(|(most, number)| *most = number.max(*most));
            }
        });
        Self { child, address, stranger: authority.map(|authority| authority.forged(9)), most }
    }

    fn connect(&self) -> Option<TcpStream> {
        let stream = TcpStream::connect_timeout(&self.address, Duration::from_secs(5)).ok()?;
        stream.set_read_timeout(Some(Duration::from_millis(1))).unwrap();
        stream.set_write_timeout(Some(Duration::from_millis(200))).unwrap();
        Some(stream)
    }

    fn resident_bytes(&self) -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.child.id())).unwrap();
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
        line.trim().trim_end_matches(" kB").parse::<u64>().unwrap() << 10
    }
}

impl Drop for Target {
    fn drop(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }
}

fn below(chance: &mut Chance, limit: usize) -> usize {
    chance.below(limit as u64) as usize
}

fn bytes(chance: &mut Chance, count: usize) -> Vec<u8> {
    (0..count).map(|_| chance.bits() as u8).collect()
}

fn hello(incarnation: u64) -> Vec<u8> {
    let (system, system_digest) = (9, 9);
    let (reaches_own, attempt, asked_ns, name) = (false, 1, 0, "hostile");
    let hello =
        SessionHello { system, reaches_own, common: COMMON, system_digest, incarnation, attempt, asked_ns, name };
    SessionMessage::Hello(hello).to_bytes()
}

/// What a client may say, or nearly.
fn frames(chance: &mut Chance) -> Vec<u8> {
    let range = |chance: &mut Chance| {
        let first = u32::from_be_bytes([9, below(chance, 256) as u8, below(chance, 256) as u8, 0]);
        Range { first: rohrpost_mailbox::Name::from_raw(first), last: rohrpost_mailbox::Name::from_raw(first | 255) }
    };
    let frame = |chance: &mut Chance| match below(chance, 4) {
        0 => SessionMessage::Ask(chance.below(1 << 30)).to_bytes(),
        1 => {
            let ranges: Vec<_> = (0..below(chance, 300)).map(|_| range(chance)).collect();
            let number = below(chance, 9) as u32;
            SessionMessage::Register(Ranges::new(number, &ranges, &mut Vec::new())).to_bytes()
        }
        2 => {
            let body = vec![7; below(chance, 65_000)];
            let [to, from] = [(); 2].map(|()| range(chance).first);
            let (kind, priority) = (Type::command(1 + below(chance, 99) as u16), Priority(chance.bits() as u8));
            let head = Head { to, from, len: body.len() as u16, kind, priority, ..Head::default() };
            SessionMessage::Package(Carried { hops: 0, published_ns: 0, head, body: &body }).to_bytes()
        }
        _ => bytes(chance, 30),
    };
    (0..1 + below(chance, 20)).flat_map(|_| frame(chance)).collect()
}

/// One attack; what it leaves open.
fn attack(target: &Target, chance: &mut Chance, number: u64) -> Option<TcpStream> {
    let mut stream = target.connect()?;
    let mut write = |bytes: &[u8]| stream.write_all(bytes).is_ok();
    let stays = match number % 8 {
        // Nothing of ours.
        0 => {
            let count = 1 + below(chance, 3000);
            write(&bytes(chance, count));
            false
        }
        // A head that promises much.
        1 => write(&[0xff, 0xff, 0xff, 0xff, 1, 0, 0, 0]),
        // Let in, and then a frame of the largest size that never ends.
        2 => write(&hello(1000 + number)) && write(&[7, 0, 1, 0, 6, 0, 0, 0, 1, 2, 3]),
        // A hello that never ends.
        3 => write(&hello(7)[..below(chance, 40)]),
        // A handshake that costs the server all it can.
        4 if let Some(stranger) = target.stranger.as_ref().filter(|_| below(chance, 2) == 0) => {
            shake_hands(target.address, stranger);
            false
        }
        // A handshake of TLS that never ends.
        4 => write(&[0x16, 3, 1, 2, 0, 1, 0, 1, 0xfc, 3, 3]),
        // All that a client may say, cut and damaged.
        5 | 6 => {
            write(&hello(1000 + number));
            let mut bytes = frames(chance);
            for _ in 0..below(chance, 3) {
                let at = below(chance, bytes.len());
                bytes[at] ^= 1 << below(chance, 8);
            }
            let cut = below(chance, bytes.len());
            write(&bytes[..cut]);
            // Sometimes it reads what it is told.
            let _ = stream.read(&mut [0; 512]);
            false
        }
        // It says nothing.
        _ => true,
    };
    stays.then_some(stream)
}

/// Until the server has looked at the certificate, and refused it.
fn shake_hands(address: SocketAddr, seal: &ClientSeal) {
    let Ok(mut stream) = Stream::connect(address, Some(seal.begin().unwrap())) else { return };
    for _ in 0..100 {
        let is_over = match stream.connected() {
            Ok(()) => stream.flush().is_err() || matches!(stream.read(&mut [0; 64]), Moved::Over(_)),
            Err(error) => error.kind() != ErrorKind::NotConnected,
        };
        if is_over {
            return;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Bytes one at a time, in as many connections as it may have, until it ends.
fn slow(target: &Target, ends: &AtomicBool) {
    let hello = hello(5);
    let mut streams: Vec<(TcpStream, usize)> = Vec::new();
    while !ends.load(Ordering::Relaxed) {
        if streams.len() < 40 {
            streams.extend(target.connect().map(|stream| (stream, 0)));
        }
        streams.retain_mut(|(stream, sent)| {
            let byte = [hello[*sent % (hello.len() - 1)]];
            *sent += 1;
            stream.write_all(&byte).is_ok()
        });
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn others_are_served(authority: Option<&Authority>) {
    let target = Target::start(authority);
    let (one, mut two) = two(target.address, authority);
    let mut sender = one.sender(2);
    let mut number = 0;
    let mut known = 2;
    let mut serve = |one: &System, two: &mut System| {
        number += 1;
        one.say(&mut sender, number);
        // Each comes, and in order. A client without time for seconds loses its connection, and what that took along:
        // then it is said again.
        wait("a package beside attacks", || {
            let links = [one.client.link(), two.client.link()];
            let connections = links.iter().map(|link| link.connections).sum::<u64>();
            if connections != known && links.iter().all(|link| link.state == LinkState::Up) {
                known = connections;
                one.say(&mut sender, number);
            }
            let heard = std::iter::from_fn(|| two.hear()).find(|heard| *heard >= number)?;
            assert_eq!(heard, number, "nothing came that was not said");
            Some(())
        });
    };
    // So that what is taken once and for all is taken before.
    let mut chance = Chance::new(1);
    (0..40).for_each(|number| drop(attack(&target, &mut chance, number)));
    (0..100).for_each(|_| serve(&one, &mut two));
    let (before, done, ends) = (target.resident_bytes(), AtomicU64::new(0), AtomicBool::new(false));
    let (mut most, mut served) = (before, 0);
    std::thread::scope(|scope| {
        scope.spawn(|| slow(&target, &ends));
        for seed in 2..4 {
            let (target, done) = (&target, &done);
            scope.spawn(move || {
                let (mut chance, mut open) = (Chance::new(seed), Vec::new());
                while done.fetch_add(1, Ordering::Relaxed) < 8 * attacks() {
                    let number = chance.below(1 << 20);
                    open.extend(attack(target, &mut chance, number));
                    // Half open ones are kept, more than it has places.
                    if open.len() > 2 * PLACES as usize {
                        open.remove(0);
                    }
                }
            });
        }
        while done.load(Ordering::Relaxed) < 8 * attacks() {
            serve(&one, &mut two);
            served += 1;
            most = most.max(target.resident_bytes());
        }
        // A new client is let in, too.
        let three = System::sealed(3, "three", target.address, seal(authority, 3));
        three.wait_up();
        ends.store(true, Ordering::Relaxed);
    });
    let [connections, bytes, refused] = *target.most.lock().unwrap();
    eprintln!(
        "{served} served beside; RSS {before} to {most} B; most: {connections} connections, {bytes} B; \
         {refused} refused"
    );
    assert!(served > 0 && refused > attacks() / 10, "{served} served, {refused} refused");
    assert!(connections <= PLACES, "{connections} connections");
    assert!(bytes <= PLACES * (512 << 10), "{bytes} B by its own count");
    assert!(most < before + GROWTH_BYTES_MAX, "from {before} to {most} B");
    serve(&one, &mut two);
}

#[test]
fn a_well_behaved_client_is_served_while_others_attack() {
    others_are_served(None);
}

#[test]
fn a_client_with_a_certificate_is_served_while_those_without_attack() {
    others_are_served(Some(&Authority::new()));
}
