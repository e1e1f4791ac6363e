//! What runs on a node and what it does, read from shared memory: looking changes nothing.

use rohrpost_config::Installation;
use rohrpost_mailbox::{
    ClassTraffic, FlowInfo, Latency, Loss, MailboxInfo, Name, Node, NodeError, ParticipantInfo, local, saturating_sum,
};
use std::time::Instant;

/// A node at one moment.
pub struct Survey {
    /// When it was made.
    pub at: Instant,
    /// Modules, in the order of the configuration, then those it does not name.
    pub modules: Vec<ModuleSurvey>,
    /// All mailboxes, in order of their names.
    pub mailboxes: Vec<MailboxInfo>,
    /// What all mailboxes together did, most urgent class first.
    pub classes: Vec<ClassTraffic>,
    /// What everybody sends and publishes.
    pub flows: Vec<FlowInfo>,
}

/// A module at one moment.
#[derive(Clone, Debug)]
pub struct ModuleSurvey {
    /// Its name, local id 0.
    pub name: Name,
    /// Further names of its process.
    pub faces: Vec<Name>,
    /// Its process, as the node's table has it; none when it does not run.
    pub process: Option<ParticipantInfo>,
    /// Packages that its mailboxes received so far.
    pub received: u64,
    /// Bytes of their bodies.
    pub bytes_in: u64,
    /// Packages that its mailboxes lost so far, for any cause for which somebody misses them ([`Loss::is_missed`]).
    pub lost: u64,
    /// Packages by cause, in the order of [`Loss::ALL`]: those lost, and those that a newer one replaced.
    pub losses: [u64; Loss::ALL.len()],
    /// How long packages waited in its mailboxes.
    pub waited: Latency,
    /// Packages that its process sent since it began; not those that were refused.
    pub sent: u64,
    /// Bytes of their bodies.
    pub bytes_out: u64,
    /// Packages that wait for it.
    pub depth: u32,
}

impl Survey {
    /// Looks at a node.
    ///
    /// # Errors
    /// When its directory cannot be read.
    pub fn new(node: &Node, installation: &Installation, node_name: &str) -> Result<Self, NodeError> {
        let mailboxes: Vec<MailboxInfo> = node.mailboxes()?.into_iter().filter_map(|name| node.look_at(name)).collect();
        let participants = node.participants();
        let flows = node.traffic();
        let survey = |name, faces| survey(name, faces, &participants, &mailboxes, &flows);
        let mut modules: Vec<ModuleSurvey> =
            installation.modules_on(node_name).map(|module| survey(module.name, module.faces.clone())).collect();
        for participant in participants.iter().filter(|p| p.module != Name::NONE) {
            if modules.iter().all(|module| module.name != participant.module) {
                modules.push(survey(participant.module, Vec::new()));
            }
        }
        let classes = sum(&mailboxes);
        Ok(Self { at: Instant::now(), modules, mailboxes, classes, flows })
    }

    /// The module of this name, or with this face.
    pub fn module(&self, name: Name) -> Option<&ModuleSurvey> {
        let name = name.module();
        self.modules.iter().find(|module| module.name == name || module.faces.contains(&name))
    }

    /// Packages a second that a module received since `earlier`.
    pub fn received_per_s(&self, earlier: &Self, name: Name) -> f64 {
        let (Some(now), Some(before)) = (self.module(name), earlier.module(name)) else { return 0.0 };
        let seconds = self.at.duration_since(earlier.at).as_secs_f64();
        if seconds > 0.0 { now.received.saturating_sub(before.received) as f64 / seconds } else { 0.0 }
    }
}

fn survey(
    name: Name,
    faces: Vec<Name>,
    participants: &[ParticipantInfo],
    mailboxes: &[MailboxInfo],
    flows: &[FlowInfo],
) -> ModuleSurvey {
    let own = |mailbox: &&MailboxInfo| mailbox.name.module() == name || faces.contains(&mailbox.name.module());
    let own: Vec<&MailboxInfo> = mailboxes.iter().filter(own).collect();
    let classes = || own.iter().flat_map(|mailbox| &mailbox.classes);
    let process = participants.iter().find(|participant| participant.module == name).cloned();
    let incarnation = process.as_ref().map(|process| process.incarnation);
    let sends = |flow: &&FlowInfo| Some(flow.incarnation) == incarnation && !flow.is_publication();
    let mut waited = Latency::default();
    classes().for_each(|class| waited.add(&class.latency));
    ModuleSurvey {
        name,
        faces,
        process,
        received: saturating_sum(classes().map(|class| class.received)),
        bytes_in: saturating_sum(classes().map(|class| class.body_bytes)),
        lost: saturating_sum(classes().map(ClassTraffic::lost_in_all)),
        losses: Loss::ALL.map(|cause| saturating_sum(classes().map(|class| class.lost(cause)))),
        waited,
        sent: saturating_sum(flows.iter().filter(sends).map(|flow| flow.packages)),
        bytes_out: saturating_sum(flows.iter().filter(sends).map(|flow| flow.bytes)),
        depth: own.iter().fold(0, |depth, mailbox| depth.saturating_add(mailbox.depth)),
    }
}

/// Adds up all mailboxes, class by class.
pub fn sum(mailboxes: &[MailboxInfo]) -> Vec<ClassTraffic> {
    let mut classes: Vec<ClassTraffic> = Vec::new();
    for class in mailboxes.iter().flat_map(|mailbox| &mailbox.classes) {
        match classes.iter_mut().find(|known| known.class == class.class) {
            Some(known) => known.add(class),
            None => classes.push(class.clone()),
        }
    }
    classes.sort_by_key(|class| std::cmp::Reverse(class.class));
    classes
}

/// What a mailbox is for, by its local id.
pub fn purpose(local: u8) -> &'static str {
    match local {
        local::COMMANDS => "commands",
        local::REPLIES => "replies",
        local::DATA => "data",
        _ => "own",
    }
}
