//! The slot tables, and their configuration.

use super::stage::{NODES, Place};
use crate::lan::records::{self, RECORDS};
use crate::lan::router::{ROUTER, SYSTEM};
use rohrpost_bench_local::{Failure, OrFail};
use rohrpost_config::Installation;
use rohrpost_mailbox::{Class, Name, StreamShape};
use rohrpost_routers::settings::Settings;
use rohrpost_routers::tdma::SlotTable;
use std::path::Path;

/// Name of the installation.
pub const INSTALLATION: &str = "bench-tdma";
/// Where routers take packages; datagrams of time go to the next one.
pub const PORT: u16 = 21_117;
/// Class of modules that always have packages for others.
const FLOOD: Class = Class(100);
/// Class of the receivers of declared flows.
const EAR: Class = Class(210);

/// When nodes send. Their slots follow each other, behind the windows of the masters.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// From the beginning of one cycle to that of the next.
    pub cycle_us: u64,
    /// Window of each master.
    pub synchronisation_us: u64,
    /// End of each slot in which nobody sends.
    pub guard_us: u64,
    /// From the beginning of one slot to that of the next.
    pub pitch_us: u64,
    /// What each link carries, as configurations have it.
    pub link: &'static str,
    /// The first so many nodes may be master.
    pub masters: u8,
    /// What each node has declared to send.
    pub flows: &'static [Declared],
    /// The stream that each node writes and the next one has as a replica; none: there are no streams.
    pub records: Option<StreamShape>,
}

/// The node that has the replica of a node's stream.
pub fn replica_of(node: u8) -> u8 {
    (node + 1) % NODES
}

/// A flow that each node has to another.
#[derive(Clone, Copy, Debug)]
pub struct Declared {
    /// Class of its sender, and its name.
    pub class: (Class, &'static str),
    /// It goes to the node so many places further on.
    pub hop: u8,
    /// Of each body.
    pub bytes: u32,
    /// From one package to the next, at least.
    pub period_us: u64,
}

impl Declared {
    /// The module of a node that sends it.
    pub fn sender(&self, node: u8) -> Name {
        Name::new(SYSTEM, self.class.0.0, node, 0)
    }

    /// Where that sends it.
    pub fn receiver(&self, node: u8) -> Name {
        ear((node + self.hop) % NODES)
    }
}

/// The mailbox of the flooding module of a node, which also takes the flood from others.
pub fn flood(node: u8) -> Name {
    Name::new(SYSTEM, FLOOD.0, node, 0)
}

/// The mailbox for declared flows to a node.
pub fn ear(node: u8) -> Name {
    Name::new(SYSTEM, EAR.0, node, 0)
}

impl Plan {
    /// As routers read it.
    ///
    /// # Errors
    /// What is wrong with the plan, as `rohrpost check` says it.
    pub fn installation(&self) -> Result<Installation, Failure> {
        Installation::parse(&self.text(), Path::new("bench-tdma.toml")).or_fail("configuration")
    }

    /// The slots, as a node reads them.
    ///
    /// # Errors
    /// As [`Self::installation`].
    pub fn table(&self, own: u8) -> Result<SlotTable, Failure> {
        let installation = self.installation()?;
        let settings = Settings::new(&installation, &Place::Node(own).name(), 1).or_fail("configuration")?;
        let tdma = installation.tdma.as_ref().ok_or_else(|| Failure::Failed("a plan without slots".into()))?;
        Ok(SlotTable::new(tdma, installation.time.masters(), own, NODES, settings.overhead_bytes()))
    }

    /// The slots, as each node reads them.
    ///
    /// # Errors
    /// As [`Self::installation`].
    pub fn tables(&self) -> Result<Vec<SlotTable>, Failure> {
        (0..NODES).map(|own| self.table(own)).collect()
    }

    /// The configuration.
    pub fn text(&self) -> String {
        let Self { cycle_us, synchronisation_us, guard_us, pitch_us, link, masters, .. } = self;
        let masters: Vec<String> = (0..*masters).map(|index| format!("\"{}\"", Place::Node(index).name())).collect();
        let slots_us = synchronisation_us * masters.len() as u64;
        let nodes = (0..NODES).map(|index| {
            let (name, address) = (Place::Node(index).name(), Place::Node(index).address());
            let (first_tool, last_tool) = (index * 32, index * 32 + 31);
            let offset_us = slots_us + u64::from(index) * pitch_us;
            format!(
                "[nodes.{name}]\naddress = \"{address}\"\ntools = [{first_tool}, {last_tool}]\n\
                 [[slot]]\nnode = \"{name}\"\noffset = \"{offset_us} us\"\nlength = \"{pitch_us} us\"\n"
            )
        });
        let classes: String = self
            .flows
            .iter()
            .map(|flow| format!("{} = {{ id = {}, text = \"Sends a declared flow\" }}\n", flow.class.1, flow.class.0.0))
            .collect();
        format!(
            r#"installation = "{INSTALLATION}"
[system]
name = "bench"
id = {SYSTEM}
[classes]
router = {{ id = {router}, text = "Carries packages between nodes" }}
ear = {{ id = {ear}, text = "Takes declared flows" }}
flood = {{ id = {flood}, text = "Always has packages for others" }}
records = {{ id = {records}, text = "Writes records" }}
tool = {{ id = 16, text = "Tools" }}
{classes}[network]
security = "none"
mode = "tdma"
port = {PORT}
quota = "1 MiB"
[tdma]
cycle = "{cycle_us} us"
synchronisation = "{synchronisation_us} us"
guard = "{guard_us} us"
link = "{link}"
[time]
source = "master"
masters = [{masters}]
{nodes}{modules}"#,
            router = ROUTER.0,
            ear = EAR.0,
            flood = FLOOD.0,
            records = RECORDS.0,
            masters = masters.join(", "),
            nodes = nodes.collect::<String>(),
            modules = self.modules(),
        )
    }

    /// Never launched: processes of the bench take their place.
    fn modules(&self) -> String {
        let module = |class: &str, node: u8, more: &str| {
            let at = Place::Node(node).name();
            format!(
                "[[module]]\nname = \"{class}.{node}\"\nnode = \"{at}\"\nprogram = \"{class}\"\noptional = true\n{more}"
            )
        };
        let mut text = String::new();
        for node in 0..NODES {
            text += &module("flood", node, "");
            text += &module("ear", node, "[module.mailbox.commands]\nsize = \"8 KiB\"\n");
            for Declared { class: (_, class), hop, bytes, period_us } in self.flows {
                let to = (node + hop) % NODES;
                text += &module(class, node, &format!("calls = [\"ear.{to}\"]\n"));
                text += &format!(
                    "[[flow]]\nfrom = \"{class}.{node}\"\nto = \"ear.{to}\"\nsize = \"{bytes} B\"\n\
                     period = \"{period_us} us\"\n"
                );
            }
            if let Some(shape) = self.records {
                let to = Place::Node(replica_of(node)).name();
                text += &records::entries(node, &Place::Node(node).name(), &[&to], shape);
            }
        }
        text
    }
}
