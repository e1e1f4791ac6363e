//! A look at a node as it travels from that node's launch to a tool elsewhere: postcard of these structs.
//!
//! They are the types of `rohrpost-mailbox`, which know no serialization, field by field. What arrives is a claim of another
//! process: whatever the bytes are, reading them gives a look or an error.

mod detail;
#[cfg(test)]
mod tests;
mod traffic;

use super::{MailboxSnapshot, ModuleSurvey, Survey, Usage, Working};
use crate::launcher::ChildState;
use detail::{DetailForm, detail, detail_form};
use rohrpost_mailbox::sys::Scheduling;
use rohrpost_mailbox::{Loss, MailboxInfo, ModuleState, Name, OverflowPolicy, ParticipantInfo, Shape};
use rohrpost_schema::Schema;
use serde::{Deserialize, Serialize};
use std::time::Duration;
use traffic::{ClassForm, FlowForm, LatencyForm, class, class_form, flow, flow_form, latency, latency_form, ns};

/// What one look shows.
#[derive(Clone, Debug)]
pub enum Snapshot {
    /// A node.
    Survey(Box<Survey>),
    /// One of its mailboxes; none when it has none of this name.
    Mailbox(Option<Box<MailboxSnapshot>>),
}

impl Snapshot {
    /// As it travels.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let form = match self {
            Self::Survey(survey) => SeenForm::Survey(survey_form(survey)),
            Self::Mailbox(look) => SeenForm::Mailbox(look.as_ref().map(|look| detail_form(look))),
        };
        // Writing to a growing vector does not fail; what is empty is refused by whoever reads it.
        postcard::to_stdvec(&form).unwrap_or_default()
    }

    /// Reads what [`Snapshot::to_bytes`] wrote.
    ///
    /// # Errors
    /// When the bytes are of another kind.
    pub(crate) fn from_bytes(bytes: &[u8]) -> Result<Self, postcard::Error> {
        Ok(match postcard::from_bytes(bytes)? {
            SeenForm::Survey(form) => Self::Survey(Box::new(survey(form))),
            SeenForm::Mailbox(form) => Self::Mailbox(form.map(|form| Box::new(detail(form)))),
        })
    }

    /// Tells the forms of different versions of this program apart: computed from the types below.
    pub(crate) fn format() -> u32 {
        SeenForm::schema().hash()
    }
}

#[derive(Serialize, Deserialize, Schema)]
enum SeenForm {
    Survey(SurveyForm),
    Mailbox(Option<DetailForm>),
}

#[derive(Serialize, Deserialize, Schema)]
struct SurveyForm {
    node: String,
    at_ns: u64,
    modules: Vec<ModuleForm>,
    mailboxes: Vec<MailboxForm>,
    classes: Vec<ClassForm>,
    flows: Vec<FlowForm>,
}

#[derive(Serialize, Deserialize, Schema)]
struct ModuleForm {
    node: String,
    at_ns: Option<u64>,
    name: u32,
    aliases: Vec<u32>,
    process: Option<ProcessForm>,
    usage: Option<UsageForm>,
    scheduling: Option<SchedulingForm>,
    received: u64,
    bytes_in: u64,
    lost: u64,
    losses: [u64; Loss::ALL.len()],
    waited: LatencyForm,
    sent: u64,
    bytes_out: u64,
    depth: u32,
    working: Option<WorkingForm>,
    child: Option<ChildState>,
}

#[derive(Serialize, Deserialize, Schema)]
struct WorkingForm {
    part: String,
    lasts_ms: u64,
}

#[derive(Serialize, Deserialize, Schema)]
struct ProcessForm {
    module: u32,
    pid: u32,
    incarnation: u32,
    state: Option<StateForm>,
    restarts: u32,
    joined_ns: u64,
}

#[derive(Serialize, Deserialize, Schema)]
enum StateForm {
    Starting,
    Off,
    On,
    Error,
    Stopping,
}

#[derive(Serialize, Deserialize, Schema)]
struct UsageForm {
    cpu_ms: u64,
    memory_bytes: u64,
}

#[derive(Serialize, Deserialize, Schema)]
enum SchedulingForm {
    Fifo(u8),
    Normal(i8),
}

#[derive(Serialize, Deserialize, Schema)]
struct MailboxForm {
    name: u32,
    slots: u16,
    body_bytes_max: u16,
    full: FullForm,
    max_age_ns: Option<u64>,
    claims: u8,
    owner: Option<u32>,
    adoptions: u32,
    depth: u32,
    depth_max: u32,
    sent: u64,
    classes: Vec<ClassForm>,
}

#[derive(Serialize, Deserialize, Schema)]
enum FullForm {
    Displace,
    Latest,
    Reject,
}

fn survey_form(survey: &Survey) -> SurveyForm {
    SurveyForm {
        node: survey.node.clone(),
        at_ns: survey.at_ns,
        modules: survey.modules.iter().map(module_form).collect(),
        mailboxes: survey.mailboxes.iter().map(mailbox_form).collect(),
        classes: survey.classes.iter().map(class_form).collect(),
        flows: survey.flows.iter().map(flow_form).collect(),
    }
}

fn survey(form: SurveyForm) -> Survey {
    Survey {
        node: form.node,
        at_ns: form.at_ns,
        modules: form.modules.into_iter().map(module).collect(),
        mailboxes: form.mailboxes.into_iter().map(mailbox).collect(),
        classes: form.classes.into_iter().map(class).collect(),
        flows: form.flows.into_iter().map(flow).collect(),
    }
}

fn module_form(module: &ModuleSurvey) -> ModuleForm {
    ModuleForm {
        node: module.node.clone(),
        at_ns: module.at_ns,
        name: module.name.raw(),
        aliases: module.aliases.iter().map(|alias| alias.raw()).collect(),
        process: module.process.as_ref().map(process_form),
        usage: module.usage.map(|usage| UsageForm {
            cpu_ms: u64::try_from(usage.cpu.as_millis()).unwrap_or(u64::MAX),
            memory_bytes: usage.memory_bytes,
        }),
        scheduling: module.scheduling.map(|scheduling| match scheduling {
            Scheduling::Fifo(priority) => SchedulingForm::Fifo(priority),
            Scheduling::Normal(nice) => SchedulingForm::Normal(nice),
        }),
        received: module.received,
        bytes_in: module.bytes_in,
        lost: module.lost,
        losses: module.losses,
        waited: latency_form(&module.waited),
        sent: module.sent,
        bytes_out: module.bytes_out,
        depth: module.depth,
        working: module.working.as_ref().map(|working| WorkingForm {
            part: working.part.clone(),
            lasts_ms: u64::try_from(working.lasts.as_millis()).unwrap_or(u64::MAX),
        }),
        child: module.child.clone(),
    }
}

fn module(form: ModuleForm) -> ModuleSurvey {
    ModuleSurvey {
        node: form.node,
        at_ns: form.at_ns,
        name: Name::from_raw(form.name),
        aliases: form.aliases.into_iter().map(Name::from_raw).collect(),
        process: form.process.map(process),
        usage: form
            .usage
            .map(|usage| Usage { cpu: Duration::from_millis(usage.cpu_ms), memory_bytes: usage.memory_bytes }),
        scheduling: form.scheduling.map(|scheduling| match scheduling {
            SchedulingForm::Fifo(priority) => Scheduling::Fifo(priority),
            SchedulingForm::Normal(nice) => Scheduling::Normal(nice),
        }),
        received: form.received,
        bytes_in: form.bytes_in,
        lost: form.lost,
        losses: form.losses,
        waited: latency(form.waited),
        sent: form.sent,
        bytes_out: form.bytes_out,
        depth: form.depth,
        working: form
            .working
            .map(|working| Working { part: working.part, lasts: Duration::from_millis(working.lasts_ms) }),
        child: form.child,
        error: None,
    }
}

fn process_form(process: &ParticipantInfo) -> ProcessForm {
    ProcessForm {
        module: process.module.raw(),
        pid: process.pid,
        incarnation: process.incarnation,
        state: process.state.map(|state| match state {
            ModuleState::Starting => StateForm::Starting,
            ModuleState::Off => StateForm::Off,
            ModuleState::On => StateForm::On,
            ModuleState::Error => StateForm::Error,
            ModuleState::Stopping => StateForm::Stopping,
        }),
        restarts: process.restarts,
        joined_ns: process.joined_ns,
    }
}

fn process(form: ProcessForm) -> ParticipantInfo {
    ParticipantInfo {
        module: Name::from_raw(form.module),
        pid: form.pid,
        incarnation: form.incarnation,
        state: form.state.map(|state| match state {
            StateForm::Starting => ModuleState::Starting,
            StateForm::Off => ModuleState::Off,
            StateForm::On => ModuleState::On,
            StateForm::Error => ModuleState::Error,
            StateForm::Stopping => ModuleState::Stopping,
        }),
        restarts: form.restarts,
        joined_ns: form.joined_ns,
        // What lasts long is in the module's own form, with the names of functions.
        in_hand: None,
    }
}

fn mailbox_form(mailbox: &MailboxInfo) -> MailboxForm {
    MailboxForm {
        name: mailbox.name.raw(),
        slots: mailbox.shape.slots,
        body_bytes_max: mailbox.shape.body_bytes_max,
        full: match mailbox.shape.full {
            OverflowPolicy::Displace => FullForm::Displace,
            OverflowPolicy::Latest => FullForm::Latest,
            OverflowPolicy::Reject => FullForm::Reject,
        },
        max_age_ns: mailbox.shape.max_age.map(ns),
        claims: mailbox.shape.claims,
        owner: mailbox.owner,
        adoptions: mailbox.adoptions,
        depth: mailbox.depth,
        depth_max: mailbox.depth_max,
        sent: mailbox.sent,
        classes: mailbox.classes.iter().map(class_form).collect(),
    }
}

fn mailbox(form: MailboxForm) -> MailboxInfo {
    MailboxInfo {
        name: Name::from_raw(form.name),
        shape: Shape {
            slots: form.slots,
            body_bytes_max: form.body_bytes_max,
            full: match form.full {
                FullForm::Displace => OverflowPolicy::Displace,
                FullForm::Latest => OverflowPolicy::Latest,
                FullForm::Reject => OverflowPolicy::Reject,
            },
            max_age: form.max_age_ns.map(Duration::from_nanos),
            claims: form.claims,
        },
        owner: form.owner,
        adoptions: form.adoptions,
        depth: form.depth,
        depth_max: form.depth_max,
        sent: form.sent,
        classes: form.classes.into_iter().map(class).collect(),
    }
}
