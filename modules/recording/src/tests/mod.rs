//! What is written is read again; of what is cut or damaged, what is there; and a failing disk loses nothing uncounted.

mod beginning;
mod conformance;
mod costly;
mod cutting;
mod damaged;
mod disks;
mod dying;
mod failing;
mod features;
mod flipped;
mod foreign;
mod large;
mod listed;
mod merging;
mod moved;
mod ordered;
mod playing;
mod sought;
mod support;
mod telling;
mod written;
