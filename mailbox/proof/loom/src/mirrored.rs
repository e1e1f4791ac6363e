//! What the models write again of the mailbox.

/// Lines of the mailbox that the models write again, in the order in which they must stand there.
pub(crate) struct Mirrored {
    pub(crate) file: &'static str,
    pub(crate) what: &'static str,
    pub(crate) lines: &'static [&'static str],
}

pub(crate) const MIRRORED: &[Mirrored] = &[
    Mirrored {
        file: "wake/waiting",
        what: "models::Receiver::wait does the same, change both",
        lines: &[
            "fn settled<",
            "let seen = entry.bell().seen();",
            ".drowsy());",
            "let idle = !found()",
            "watches.sleep(entry.bell(), seen,",
            "doorbell::sleep(&entry.bell, seen,",
            ".awake());",
        ],
    },
    Mirrored {
        file: "wake/watch",
        what: "models::Receiver::wait does the same, change both",
        // The real one also looks at the bell by itself now and then; here the pipe alone must do.
        lines: &[
            "fn sleep(",
            "let quiet = bell.may_poll(seen);",
            "let mut nap = if quiet {",
            "while self.poll(nap)",
            "bell.polled();",
        ],
    },
    Mirrored {
        file: "receiver",
        what: "models::a_retired_mailbox_keeps_nothing does the same, change both",
        lines: &[
            "pub fn close(",
            "slots.retire();",
            "self.queue.rescan(&slots);",
            "self.queue.take(&slots)",
            "slots.release(taken);",
        ],
    },
    Mirrored {
        file: "receiver",
        what: "models::Receiver::search does the same, change both",
        lines: &["fn search(", "slots.reclaim(", "self.queue.rescan(&slots);", "self.queue.doubt();"],
    },
    Mirrored {
        file: "node/registry",
        what: "models::a_retired_mailbox_keeps_nothing does the same, change both",
        lines: &[
            "fn retire(old: &Segment)",
            "slots.retire();",
            "slots.adopt(",
            "queue.rescan(&slots);",
            "queue.take(&slots)",
            "slots.release(taken);",
        ],
    },
    Mirrored {
        file: "sender",
        what: "models::Sender::send does the same, change both",
        lines: &[
            "fn publish(",
            "self.count_victim(&claim);",
            "self.posts.of(label).is_some_and(|old| slots.replace(&mut claim, old))",
            "self.count_victim(&claim);",
            ".publish(claim, label.priority)",
            "self.posts.remember(label, posted, &slots);",
            "if wake {",
            "self.wake();",
        ],
    },
    Mirrored {
        file: "slots/protocol",
        what: "SeqCst stands for the fence that the models have there (seq_cst_accesses), and no model would see it \
            weakened",
        lines: &[
            "compare_exchange(from.0, to.0, Ordering::SeqCst, Ordering::Relaxed)",
            "self.hot.receiver.0.retired.load(Ordering::SeqCst)",
            "seq_cst_accesses();",
            "receiver.retired.load(Ordering::SeqCst)",
            "receiver.level.load(Ordering::SeqCst)",
            "receiver.sleeping.load(Ordering::SeqCst)",
        ],
    },
    Mirrored {
        file: "slots/hot",
        what: "SeqCst stands for the fence that the models have there (seq_cst_accesses), and no model would see it \
            weakened",
        lines: &[
            "fetch_or(1 << (slot % 64), Ordering::SeqCst)",
            "sleeping.store(sleeping, Ordering::SeqCst)",
            "hints.load(Ordering::SeqCst)",
            "level.store(level.0.into(), Ordering::SeqCst)",
        ],
    },
    Mirrored {
        file: "slots/queue",
        what: "SeqCst stands for the fence that the models have before it (seq_cst_accesses), and no model would see \
            it weakened",
        lines: &["hints.load(Ordering::SeqCst)"],
    },
    Mirrored {
        file: "stream/ring",
        what: "SeqCst stands for the fence that the models have in stream/writing (seq_cst_accesses), and no model \
            would see it weakened",
        lines: &["self.word.store(word(sequence, Some(frame)), Ordering::SeqCst)"],
    },
    Mirrored {
        file: "stream/writing",
        what: "SeqCst stands for the fence that the models have there (seq_cst_accesses), and no model would see it \
            weakened",
        lines: &["seat.hold.load(Ordering::SeqCst)", "seq_cst_accesses();", "seat.sleeper.load(Ordering::SeqCst)"],
    },
    Mirrored {
        file: "wake/doorbell",
        what: "models::Mailbox::ring does the same, change both",
        lines: &["fn ring(", "let polling = bell.ring();", "FUTEX_WAKE", "if polling {", "write_to_pipe("],
    },
];
