//! The caller's side: one reply mailbox, the ways into other mailboxes, and the calls under way.

mod takeover;

use super::absent::Absent;
use super::envelope::micros;
use super::stand_by::StandBy;
use super::tally::{CallOutcome, Tallies, Tally};
use super::{CallEnvelope, CallError, Fault, REPLIES_KEPT, ReplyEnvelope, VALIDITY_MAX};
use rohrpost_mailbox::{
    ALL_SYSTEMS, Head, Label, Name, Options, Participant, Receiver, SendError, Sender, Type, monotonic_ns,
};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A command without an answer is sent again after this share of its time, or of the time for which a server may run
/// it: three tries in all that can be run.
const REPEATS: u32 = 3;
/// Calls under way at a time, to all servers together.
pub const CALLS_MAX: usize = 64;
/// Envelopes tell no longer time; a longer timeout is cut to it, so that a command's age always is the truth.
const TIMEOUT_MAX: Duration = Duration::from_micros(u32::MAX as u64);
/// Ways into other mailboxes that are kept open; the first goes when there are more. If all of them are on other nodes,
/// they are claims in the mailbox of the router, where one participant may have 255.
const SENDERS_MAX: usize = 240;
/// Answers taken in one go: a flood of them must not keep a waiting caller from its timeout.
const BURST: usize = 64;

/// A module's or tool's way to all others: sends packages, and matches replies to calls.
pub struct Link {
    participant: Arc<Participant>,
    me: Name,
    /// Tells its calls from those of the previous owner of this name.
    incarnation: u32,
    replies: Receiver,
    senders: Vec<Sender>,
    absent: Absent,
    calls: Vec<PendingCall>,
    tallies: Tallies,
    /// Buffers of calls that are over, to be used again.
    spare: Vec<Vec<u8>>,
    next_sequence: u32,
    /// The module stands by.
    stand_by: Option<StandBy>,
}

/// A call under way.
struct PendingCall {
    sequence: u32,
    to: Name,
    /// The whole body of the command, to be sent again; then, when the answer has come, the answer.
    body: Vec<u8>,
    label: Label,
    /// When it began and when it is to be sent again, ns of time that passed: a caller that slept must not say that its
    /// command is young.
    began_ns: u64,
    timeout: Duration,
    repeat_ns: u64,
    repeated: bool,
    answer: Option<Head>,
}

impl PendingCall {
    /// When its time is over, ns.
    fn deadline_ns(&self) -> u64 {
        self.began_ns.saturating_add(ns(self.timeout))
    }
}

fn ns(of: Duration) -> u64 {
    u64::try_from(of.as_nanos()).unwrap_or(u64::MAX)
}

/// Whether the answering module was called: itself, or that name in all systems, of which the first that answers
/// counts.
pub(crate) fn is_to(to: Name, from: Name) -> bool {
    let (to, from) = (to.module(), from.module());
    to == from || to == Name::new(ALL_SYSTEMS, from.class().0, from.instance(), 0)
}

impl Link {
    /// A link of this module (local id 0), with its reply mailbox.
    pub fn new(participant: &Arc<Participant>, me: Name, replies: Receiver) -> Self {
        Self {
            participant: participant.clone(),
            me,
            // Not the participant's: of two that join, the first may have the name after the other, and the server of
            // that other would take these calls for those of an earlier incarnation. The mailbox is ours, so all
            // earlier owners have theirs.
            incarnation: participant.node().next_incarnation(),
            replies,
            senders: Vec::new(),
            absent: Absent::default(),
            calls: Vec::new(),
            tallies: Tallies::default(),
            spare: Vec::new(),
            // Sequence numbers may begin anywhere; from 1 they are easier to read.
            next_sequence: 1,
            stand_by: None,
        }
    }

    /// The module that sends.
    pub fn me(&self) -> Name {
        self.me
    }

    /// Tells this incarnation of the module from others that had or will have its name.
    pub fn incarnation(&self) -> u32 {
        self.incarnation
    }

    /// The participant with the bell that wakes it.
    pub fn participant(&self) -> &Arc<Participant> {
        &self.participant
    }

    /// Its reply mailbox, to wait on.
    pub fn replies(&mut self) -> &mut Receiver {
        &mut self.replies
    }

    /// Removes the reply mailbox.
    pub fn close(self) {
        self.replies.close();
    }

    /// Numbers the next call from here on: for tests of what happens when numbers wrap.
    #[doc(hidden)]
    pub fn set_next_sequence(&mut self, sequence: u32) {
        self.next_sequence = sequence;
    }

    /// Sends a package of these parts; opens the mailbox if this is the first.
    ///
    /// # Errors
    /// When it was not accepted.
    pub fn send(&mut self, to: Name, label: &Label, parts: &[&[u8]]) -> Result<(), SendError> {
        let at = match self.senders.iter().position(|sender| sender.name() == to) {
            Some(at) => at,
            None => self.open(to)?,
        };
        let sent = self.senders[at].send(label, parts);
        if let Err(SendError::NoMailbox(_)) = sent {
            // Gone for good or to come again: either way this map leads nowhere.
            self.senders.retain(|sender| sender.name() != to);
        }
        sent
    }

    /// Opens a way into a mailbox; where it is in the list.
    fn open(&mut self, to: Name) -> Result<usize, SendError> {
        // Before it is looked for: what comes in between makes this number an old one.
        let epoch = self.participant.node().registry_epoch();
        if self.absent.has(to, epoch) {
            return Err(SendError::NoMailbox(to));
        }
        let sender = self.participant.sender(to).inspect_err(|error| {
            if matches!(error, SendError::NoMailbox(_)) {
                self.absent.note(to, epoch);
            }
        })?;
        if self.senders.len() >= SENDERS_MAX {
            self.senders.remove(0);
        }
        self.senders.push(sender);
        Ok(self.senders.len() - 1)
    }

    /// Sends a command and returns at deduplicator; [`Link::wait`] fetches the answer. `arguments` are postcard.
    ///
    /// # Errors
    /// [`CallError::NotSent`], [`CallError::BadArguments`], or [`CallError::TooMany`] when too many calls are under
    /// way.
    pub fn begin(
        &mut self,
        to: Name,
        function: u16,
        interface: u32,
        timeout: Duration,
        arguments: impl FnOnce(&mut Vec<u8>) -> Result<(), postcard::Error>,
    ) -> Result<u32, CallError> {
        self.begin_with(Options::default(), to, function, interface, timeout, arguments)
    }

    /// The same with options in the command's head.
    pub(crate) fn begin_with(
        &mut self,
        options: Options,
        to: Name,
        function: u16,
        interface: u32,
        timeout: Duration,
        arguments: impl FnOnce(&mut Vec<u8>) -> Result<(), postcard::Error>,
    ) -> Result<u32, CallError> {
        // The number may come from another process's description.
        if !(1..=Type::COMMAND_MAX).contains(&function) {
            return Err(CallError::BadArguments(format!("{function} is no function's number")));
        }
        let taken_over = self.take_over();
        taken_over.map_err(|error| SendError::Bad(to, error.to_string()))?;
        if self.stand_by.is_some() {
            return Err(SendError::NoMailbox(to).into());
        }
        // Counted for each server: one that hangs must not keep us from calling others.
        let there = self.calls.iter().filter(|call| call.to == to).count();
        if there >= REPLIES_KEPT || self.calls.len() >= CALLS_MAX {
            return Err(CallError::TooMany(to));
        }
        let timeout = timeout.min(TIMEOUT_MAX);
        let sequence = self.next_sequence;
        self.next_sequence = self.next_sequence.wrapping_add(1);
        let mut body = self.spare.pop().unwrap_or_default();
        let envelope = CallEnvelope {
            interface,
            incarnation: self.incarnation,
            sequence,
            valid_for_us: micros(timeout),
            age_us: 0,
        };
        body.clear();
        body.extend_from_slice(&envelope.to_bytes());
        if let Err(error) = arguments(&mut body) {
            self.spare.push(body);
            return Err(CallError::BadArguments(error.to_string()));
        }
        let began_ns = monotonic_ns();
        let kind = Type::command(function);
        let repeat_ns = began_ns + ns(repeat_after(timeout));
        let label = self.label(kind, sequence, options);
        let call =
            PendingCall { sequence, to, body, label, began_ns, timeout, repeat_ns, repeated: false, answer: None };
        match self.send(to, &label, &[&call.body]) {
            Ok(()) => {
                self.calls.push(call);
                Ok(sequence)
            }
            Err(error) => {
                self.spare.push(call.body);
                // One with an absent server is none of the calls that should have had an answer.
                if matches!(error, SendError::Full(_)) {
                    self.tallies.ended(sequence, to, CallOutcome::Refused);
                }
                Err(error.into())
            }
        }
    }

    fn label(&self, kind: Type, sequence: u32, options: Options) -> Label {
        Label {
            from: self.me.with_local(rohrpost_mailbox::local::REPLIES),
            kind,
            id: sequence as u16,
            priority: self.me.class().priority(),
            options,
        }
    }

    /// Waits for the answer to a call, at most until its time is over, and hands its bytes to `read`.
    ///
    /// # Errors
    /// [`CallError::Timeout`], or what the server said instead.
    pub fn wait<T>(
        &mut self,
        sequence: u32,
        read: impl FnOnce(&[u8]) -> Result<T, postcard::Error>,
    ) -> Result<T, CallError> {
        loop {
            self.collect();
            let now_ns = monotonic_ns();
            let Some(at) = self.calls.iter().position(|call| call.sequence == sequence) else {
                return Err(CallError::BadReply(self.me, "the call is not under way".into()));
            };
            let call = &self.calls[at];
            let deadline_ns = call.deadline_ns();
            if call.answer.is_some() || now_ns >= deadline_ns {
                return self.finish(at, read);
            }
            if now_ns >= call.repeat_ns {
                self.repeat(at, now_ns);
            }
            let wake = Duration::from_nanos(self.calls[at].repeat_ns.min(deadline_ns) - now_ns);
            rohrpost_mailbox::wait_any(&mut [&mut self.replies], Some(Instant::now() + wake), || false);
        }
    }

    /// The outcome of a call without a result, if it is known by now; none while it is under way. Repeats the command
    /// when it is time.
    pub fn poll(&mut self, sequence: u32) -> Option<Result<(), CallError>> {
        self.poll_for(sequence, |_| Ok(()))
    }

    /// The same of a call with a result; `read` takes its bytes.
    pub fn poll_for<T>(
        &mut self,
        sequence: u32,
        read: impl FnOnce(&[u8]) -> Result<T, postcard::Error>,
    ) -> Option<Result<T, CallError>> {
        let at = self.calls.iter().position(|call| call.sequence == sequence)?;
        let (call, now_ns) = (&self.calls[at], monotonic_ns());
        if call.answer.is_some() || now_ns >= call.deadline_ns() {
            return Some(self.finish(at, read));
        }
        if now_ns >= call.repeat_ns {
            self.repeat(at, now_ns);
        }
        None
    }

    fn finish<T>(&mut self, at: usize, read: impl FnOnce(&[u8]) -> Result<T, postcard::Error>) -> Result<T, CallError> {
        let call = self.calls.swap_remove(at);
        let result = match &call.answer {
            None => Err(CallError::Timeout(call.to, call.timeout)),
            Some(head) if head.options.has(Options::ERROR) => match postcard::from_bytes(&call.body) {
                Ok(fault) => Err(CallError::Fault(call.to, fault)),
                Err(error) => Err(CallError::BadReply(call.to, error.to_string())),
            },
            Some(_) => read(&call.body).map_err(|error| CallError::BadReply(call.to, error.to_string())),
        };
        let ending = match &result {
            Err(CallError::Timeout(..)) => CallOutcome::Overdue,
            Err(CallError::Fault(_, fault)) => CallOutcome::by(fault),
            _ => CallOutcome::Answered,
        };
        self.tallies.ended(call.sequence, call.to, ending);
        self.spare.push(call.body);
        result
    }

    /// The modules that it has called, and the outcomes.
    pub fn tallies(&self) -> &[Tally] {
        self.tallies.all()
    }

    /// Gives a call up; its answer, should it come, is dropped.
    pub fn forget(&mut self, sequence: u32) {
        if let Some(at) = self.calls.iter().position(|call| call.sequence == sequence) {
            self.spare.push(self.calls.swap_remove(at).body);
        }
    }

    /// Moves the answers that have come to their calls. Late ones are counted, all others to nobody (to an earlier
    /// incarnation) are dropped.
    pub fn collect(&mut self) {
        for _ in 0..BURST {
            let Some(package) = self.replies.try_receive() else { return };
            let head = package.head();
            let Ok((envelope, result)) = ReplyEnvelope::split(package.body()) else { continue };
            if envelope.incarnation != self.incarnation {
                continue;
            }
            // The sequence number, not the 16-bit id, tells calls apart: ids wrap.
            let its = |call: &&mut PendingCall| {
                call.sequence == envelope.sequence
                    && is_to(call.to, head.from)
                    && head.kind.0 == -call.label.kind.0
                    && call.answer.is_none()
            };
            let of_one_try = head.options.has(Options::ERROR) && is_of_one_try(result);
            match self.calls.iter_mut().find(its) {
                // One try that was refused says nothing of the others that are under way, nor one system of others.
                Some(call) if of_one_try && (call.repeated || call.to.system() == ALL_SYSTEMS) => {}
                Some(call) => {
                    call.answer = Some(*head);
                    call.body.clear();
                    call.body.extend_from_slice(result);
                }
                None if of_one_try => {}
                None => self.tallies.came_late(envelope.sequence, |to| is_to(to, head.from)),
            }
        }
    }

    fn repeat(&mut self, at: usize, now_ns: u64) {
        let call = &mut self.calls[at];
        call.repeat_ns = now_ns + ns(repeat_after(call.timeout));
        call.repeated = true;
        // Age 0 means a first try, so a repeat is at least 1 µs old.
        let age_us = micros(Duration::from_nanos(now_ns - call.began_ns)).max(1);
        call.body[CallEnvelope::BYTES - 4..CallEnvelope::BYTES].copy_from_slice(&age_us.to_le_bytes());
        let (to, label) = (call.to, call.label);
        let body = std::mem::take(&mut call.body);
        // A repeat that cannot be sent is as good as one that was lost: the next one, or the timeout, takes care.
        let _ = self.send(to, &label, &[&body]);
        self.calls[at].body = body;
        self.tallies.repeated(to);
    }
}

fn repeat_after(timeout: Duration) -> Duration {
    timeout.min(VALIDITY_MAX) / REPEATS
}

fn is_of_one_try(fault: &[u8]) -> bool {
    postcard::from_bytes(fault).is_ok_and(|fault: Fault| fault.is_of_this_try())
}
