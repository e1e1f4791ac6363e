//! End to end: real processes in shared memory of their own, watched as a user watches them.
//!
//! `harness` gives each test a place of its own, `process` watches what runs there, `probe` is the module that
//! misbehaves as a test asks it to; each other file is a theme. Nothing here sleeps for luck: tests wait for what they
//! need to see, with deadlines that a busy computer keeps.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod access;
mod all_nodes;
mod bench;
mod beyond;
mod beyond_strangers;
mod boot;
mod c_modules;
mod check;
mod completions;
mod conforming;
mod consent;
mod control;
mod crash;
mod demo;
mod demo_recorded;
mod doctor;
mod exact;
mod exact_records;
mod far;
mod faults;
mod graph;
mod harness;
mod hostile;
mod hostile_texts;
mod interface;
mod lan;
mod lan_tools;
mod languages;
mod languages_killed;
mod launch;
mod left_out;
mod lines;
mod load;
mod log_file;
mod log_time;
mod looks;
mod mailbox;
mod mailboxes;
mod measure;
mod measure_gone;
mod moved;
mod new;
mod nodes;
mod once;
mod once_wrap;
mod other_users;
mod output;
mod output_log;
mod param;
mod ping_send;
mod printed;
mod probe;
mod process;
mod python_node;
mod readme;
mod record;
mod recorded;
mod recorded_busy;
mod recorded_control;
mod recorded_killed;
mod recorded_nodes;
mod replayed;
mod replayed_answers;
mod replayed_others;
mod replicas;
mod replicas_lossy;
mod replicas_sealed;
mod replicas_tcp;
mod restart;
mod screen;
mod seer;
#[path = "../../mailbox/tests/common/small_memory.rs"]
mod small_memory;
mod start;
mod strangers;
mod streams;
mod streams_described;
mod streams_killed;
mod stuck;
mod subscribe;
mod systems;
mod takeover;
mod terminal;
mod tools;
mod tools_data;
mod top;
mod tuned;
mod versions;
mod wifi;
mod wrapped;
