//! One mailbox down to its slots, as it travels.

use super::{MailboxForm, mailbox, mailbox_form};
use crate::survey::MailboxSnapshot;
use rohrpost_mailbox::{MailboxDetail, Name, Party, Priority, SlotInfo, VictimInfo, WaitingPackage};
use rohrpost_schema::Schema;
use serde::{Deserialize, Serialize};

#[derive(Serialize, Deserialize, Schema)]
pub(super) struct DetailForm {
    stopped: Vec<u32>,
    info: MailboxForm,
    receiver: Option<PartyForm>,
    is_retired: bool,
    slots: Vec<SlotForm>,
}

#[derive(Serialize, Deserialize, Schema)]
enum SlotForm {
    Free,
    Filling { by: PartyForm, victim: Option<(u8, bool)> },
    Ready(WaitingForm),
    Taken(WaitingForm),
}

#[derive(Serialize, Deserialize, Schema)]
struct WaitingForm {
    priority: u8,
    ticket: u64,
    is_redelivered: bool,
}

#[derive(Serialize, Deserialize, Schema)]
struct PartyForm {
    participant: u16,
    pid: Option<u32>,
    module: u32,
    is_alive: bool,
}

pub(super) fn detail_form(look: &MailboxSnapshot) -> DetailForm {
    let detail = &look.detail;
    DetailForm {
        stopped: look.stopped.clone(),
        info: mailbox_form(&detail.info),
        receiver: detail.receiver.as_ref().map(party_form),
        is_retired: detail.is_retired,
        slots: detail.slots.iter().map(slot_form).collect(),
    }
}

pub(super) fn detail(form: DetailForm) -> MailboxSnapshot {
    let detail = MailboxDetail {
        info: mailbox(form.info),
        receiver: form.receiver.map(party),
        is_retired: form.is_retired,
        slots: form.slots.into_iter().map(slot).collect(),
    };
    MailboxSnapshot { detail, stopped: form.stopped }
}

fn slot_form(slot: &SlotInfo) -> SlotForm {
    let waiting = |package: &WaitingPackage| WaitingForm {
        priority: package.priority.0,
        ticket: package.ticket,
        is_redelivered: package.is_redelivered,
    };
    match slot {
        SlotInfo::Free => SlotForm::Free,
        SlotInfo::Ready(package) => SlotForm::Ready(waiting(package)),
        SlotInfo::Taken(package) => SlotForm::Taken(waiting(package)),
        SlotInfo::Filling { by, victim } => SlotForm::Filling {
            by: party_form(by),
            victim: victim.map(|victim| (victim.priority.0, victim.is_replaced)),
        },
    }
}

fn slot(form: SlotForm) -> SlotInfo {
    let waiting = |form: WaitingForm| WaitingPackage {
        priority: Priority(form.priority),
        ticket: form.ticket,
        is_redelivered: form.is_redelivered,
    };
    match form {
        SlotForm::Free => SlotInfo::Free,
        SlotForm::Ready(form) => SlotInfo::Ready(waiting(form)),
        SlotForm::Taken(form) => SlotInfo::Taken(waiting(form)),
        SlotForm::Filling { by, victim } => SlotInfo::Filling {
            by: party(by),
            victim: victim.map(|(priority, is_replaced)| VictimInfo { priority: Priority(priority), is_replaced }),
        },
    }
}

fn party_form(party: &Party) -> PartyForm {
    PartyForm { participant: party.participant, pid: party.pid, module: party.module.raw(), is_alive: party.is_alive }
}

fn party(form: PartyForm) -> Party {
    Party { participant: form.participant, pid: form.pid, module: Name::from_raw(form.module), is_alive: form.is_alive }
}
