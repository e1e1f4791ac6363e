//! Rust under the live cases of the conformance suite: a module, and a client that calls as a tool does, on a node.
//! What they exchange with the suite goes through the node's client of the TCP router.
//!
//! Both are this test program itself, as the probe is.

use crate::harness::{NoSettings, run_if_launched};
use rohrpost::common::{DataHead, HASH, SUBSCRIBE, Subscribe, UNSUBSCRIBE, Unsubscribe};
use rohrpost::schema::Description;
use rohrpost::wire::{append, from_bytes};
use rohrpost::{CallError, Context, Fault, Module, ModuleError, Name, ToolLink};
use rohrpost_config::Installation;
use rohrpost_mailbox::{Kind, Node, local, node_directory};
use serde_json::{Value as Json, json};
use std::io::{BufRead, Write};
use std::time::{Duration, Instant};

/// Not a test: what launch starts. Run as a test it ends at once.
#[test]
fn module() {
    run_if_launched::<Conforming>();
}

/// Not a test: what the suite starts, with the configuration's file. Run as a test it ends at once.
#[test]
fn client() {
    if let Some(config) = std::env::var_os("ROHRPOST_CONFORMING") {
        let installation = Installation::load(std::path::Path::new(&config)).unwrap();
        Client { installation, tool: None, begun: Vec::new() }.answer_all();
    }
}

/// What each client under the suite hosts.
#[rohrpost::interface(class = "probe")]
pub(crate) trait Probing {
    /// Twice the number.
    #[command(16)]
    fn double(&mut self, number: u32) -> u64;

    /// How often it was run.
    #[command(17)]
    fn count(&mut self) -> u64;

    /// Refuses.
    #[command(18)]
    fn refuse(&mut self, why: String) -> Result<u32, String>;

    /// How often it was run; may be run twice.
    #[command(19, idempotent)]
    fn again(&mut self) -> u64;

    /// Counts.
    #[data(1)]
    fn beat() -> u64;
}

struct Conforming {
    counted: u64,
    again: u64,
    beats: u64,
}

impl Module for Conforming {
    type Settings = NoSettings;
    type Interfaces = ProbingInterface;

    fn new(_: NoSettings, context: &mut Context) -> Result<Self, ModuleError> {
        context.set_period(Duration::from_millis(50));
        Ok(Self { counted: 0, again: 0, beats: 0 })
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        self.beats += 1;
        Ok(context.publish_now(ProbingInterface::BEAT, &self.beats)?)
    }
}

impl Probing for Conforming {
    fn double(&mut self, number: u32) -> u64 {
        2 * u64::from(number)
    }

    fn count(&mut self) -> u64 {
        self.counted += 1;
        self.counted
    }

    fn refuse(&mut self, why: String) -> Result<u32, String> {
        Err(why)
    }

    fn again(&mut self) -> u64 {
        self.again += 1;
        self.again
    }
}

struct Client {
    installation: Installation,
    tool: Option<ToolLink>,
    begun: Vec<u32>,
}

pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

pub(crate) fn unhex(text: &str) -> Vec<u8> {
    (0..text.len()).step_by(2).map(|at| u8::from_str_radix(&text[at..at + 2], 16).unwrap()).collect()
}

fn name(ask: &Json) -> Name {
    ask["to"].as_str().unwrap().parse().unwrap()
}

impl Client {
    fn answer_all(mut self) {
        for line in std::io::stdin().lock().lines() {
            let ask: Json = serde_json::from_str(&line.unwrap()).unwrap();
            if let Some(ok) = self.answer(&ask) {
                // The harness may have begun a line.
                println!("\n{}", json!({"ok": ok}));
                std::io::stdout().flush().unwrap();
            }
        }
    }

    fn tool(&mut self) -> &mut ToolLink {
        self.tool.as_mut().expect("connect comes first")
    }

    fn answer(&mut self, ask: &Json) -> Option<Json> {
        Some(match ask["do"].as_str().unwrap() {
            "interface" => {
                let its = Description::from_bytes(&unhex(ask["bytes"].as_str().unwrap())).unwrap();
                json!({"name": its.name, "class": its.class, "hash": its.hash()})
            }
            "connect" => {
                let node = Node::open(&node_directory(&self.installation.name, "base")).unwrap();
                let joined = ToolLink::join(&self.installation, &node, "base", Duration::from_secs(20));
                self.tool = Some(joined.unwrap());
                json!({"hosts": "1.96.0.0"})
            }
            "call" => {
                let sequence = self.begin(ask);
                self.wait(sequence)
            }
            "begin" => {
                let sequence = self.begin(ask);
                self.begun.push(sequence);
                return None;
            }
            "wait" => {
                let sequence = self.begun.remove(0);
                self.wait(sequence)
            }
            "follow" => self.follow(ask),
            "time" => {
                let now = self.tool().clock.now();
                json!({"ns": now.ns, "error_ns": now.error.as_nanos() as u64, "epoch": now.epoch})
            }
            "close" => {
                self.tool.take().unwrap().close();
                json!(true)
            }
            other => panic!("`{other}` is no question"),
        })
    }

    fn begin(&mut self, ask: &Json) -> u32 {
        let number = |key: &str| ask[key].as_u64().unwrap();
        let arguments = unhex(ask["arguments"].as_str().unwrap());
        let timeout = Duration::from_millis(number("timeout_ms"));
        let (function, interface) = (number("function") as u16, number("interface") as u32);
        let write = |body: &mut Vec<u8>| {
            body.extend_from_slice(&arguments);
            Ok(())
        };
        self.tool().link.begin(name(ask), function, interface, timeout, write).unwrap()
    }

    fn wait(&mut self, sequence: u32) -> Json {
        match self.tool().link.wait(sequence, |bytes| Ok(hex(bytes))) {
            Ok(result) => json!({"result": result}),
            Err(CallError::Timeout(..)) => json!({"timeout": true}),
            Err(CallError::Fault(_, fault)) => json!({"fault": number_of(&fault)}),
            Err(error) => panic!("{error}"),
        }
    }

    fn follow(&mut self, ask: &Json) -> Json {
        let (to, count) = (name(ask), ask["count"].as_u64().unwrap() as usize);
        let tool = self.tool();
        let description = tool.describe(to).unwrap();
        let number = description.data_item(ask["data"].as_str().unwrap()).unwrap().number;
        let wish = Subscribe { number, id: 1, period_us: 0, lease_ms: 3000, mailbox: local::DATA };
        tool.data().unwrap();
        let (mut renew_at, mut found) = (Instant::now(), Vec::new());
        while found.len() < count {
            if Instant::now() >= renew_at {
                tool.call(to, SUBSCRIBE, description.hash(), |body| append(body, &wish), |_| Ok(())).unwrap();
                renew_at = Instant::now() + Duration::from_secs(1);
            }
            let incarnation = tool.link.incarnation();
            let Some(package) = tool.data().unwrap().receive_timeout(Duration::from_millis(50)) else { continue };
            let Some((head, value)) = DataHead::split(package.body()) else { continue };
            let is_data = matches!(package.head().kind.kind(), Kind::Data(other) if other == number);
            if is_data && (package.head().id, head.incarnation) == (wish.id, incarnation) {
                found.push(json!([head.sequence, hex(value)]));
            }
        }
        // The suite answers it when it has read what was found.
        let ended = Unsubscribe { id: wish.id, mailbox: wish.mailbox };
        let call = tool.begin(to, UNSUBSCRIBE, HASH, |body| append(body, &ended)).unwrap();
        tool.link.forget(call);
        json!(found)
    }
}

/// Its number on the wire.
fn number_of(fault: &Fault) -> u8 {
    let mut bytes = Vec::new();
    append(&mut bytes, fault).unwrap();
    from_bytes::<(u8,)>(&bytes[..1]).unwrap().0
}
