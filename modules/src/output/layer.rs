//! From `tracing` events to lines.

use super::print::Print;
use super::said::Said;
use super::way::Lane;
use super::{TEXT_MAX, errno_of, trace, way};
use crate::common::OutputLevel;
use std::backtrace::{Backtrace, BacktraceStatus};
use std::error::Error;
use std::fmt::{self, Write};
use tracing::field::{Field, Visit};
use tracing::level_filters::LevelFilter;
use tracing::subscriber::Interest;
use tracing::{Event, Metadata, Subscriber};
use tracing_subscriber::layer::{Context, Layer, SubscriberExt};

/// Makes this process's events lines.
pub(super) fn listen() {
    let subscriber = tracing_subscriber::registry().with(OutputLayer);
    // Fails only if the program set one of its own; then that one has the lines.
    let _ = tracing::subscriber::set_global_default(subscriber);
}

/// Makes its panics lines, and prints where they came from, if RUST_BACKTRACE asks for that.
pub(super) fn listen_for_panics(how: Print) {
    std::panic::set_hook(Box::new(move |panic| {
        // Its own words are: panicked at FILE:LINE:COLUMN, and below them the reason.
        let text = match std::thread::current().name() {
            None | Some("main") => panic.to_string(),
            Some(thread) => format!("thread `{thread}` {panic}"),
        };
        match way::installed() {
            Some(output) => output.panicked(cut(text)),
            None => super::print(&text),
        }
        let trace = Backtrace::capture();
        if trace.status() == BacktraceStatus::Captured {
            let all = std::env::var("RUST_BACKTRACE").is_ok_and(|wanted| wanted == "full");
            trace::lines(&trace.to_string(), all).into_iter().for_each(|line| how.traced(line));
        }
    }));
}

/// A field of this name is the number of the kernel's error that an event tells of.
const ERRNO: &str = "errno";

struct OutputLayer;

impl<S: Subscriber> Layer<S> for OutputLayer {
    fn register_callsite(&self, metadata: &'static Metadata<'static>) -> Interest {
        // Asked again for all of them when the level changes: an event that nobody hears costs its loop next to
        // nothing.
        if is_heard(metadata) { Interest::always() } else { Interest::never() }
    }

    fn enabled(&self, metadata: &Metadata<'_>, _: Context<'_, S>) -> bool {
        is_heard(metadata)
    }

    fn max_level_hint(&self) -> Option<LevelFilter> {
        Some(match way::installed()?.level() {
            OutputLevel::Error => LevelFilter::ERROR,
            OutputLevel::Warn => LevelFilter::WARN,
            OutputLevel::Info => LevelFilter::INFO,
            OutputLevel::Debug => LevelFilter::DEBUG,
            OutputLevel::Trace => LevelFilter::TRACE,
        })
    }

    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let Some(output) = way::installed() else { return };
        let level = level_of_event(event.metadata().level());
        // Asked before the text is written, which is what a line costs most.
        if output.allows(Lane::of(level)) {
            let mut words = EventWords::default();
            event.record(&mut words);
            let EventWords { text, errno } = words;
            output.say(level, output.now_ns(), Said { text: cut(text), errno });
        }
    }
}

/// What events are heard has changed.
pub(super) fn level_changed() {
    tracing::callsite::rebuild_interest_cache();
}

fn is_heard(metadata: &Metadata<'_>) -> bool {
    way::installed().is_some_and(|output| level_of_event(metadata.level()) <= output.level())
}

fn level_of_event(level: &tracing::Level) -> OutputLevel {
    match *level {
        tracing::Level::ERROR => OutputLevel::Error,
        tracing::Level::WARN => OutputLevel::Warn,
        tracing::Level::INFO => OutputLevel::Info,
        tracing::Level::DEBUG => OutputLevel::Debug,
        tracing::Level::TRACE => OutputLevel::Trace,
    }
}

/// What is too long ends with a `…`, never inside a character.
pub fn cut(mut text: String) -> String {
    if text.len() > TEXT_MAX {
        let end = (0..=TEXT_MAX - 4).rev().find(|at| text.is_char_boundary(*at)).unwrap_or(0);
        text.truncate(end);
        text.push('…');
    }
    text
}

/// An event's message, then its other fields; but for its number of an error.
#[derive(Default)]
struct EventWords {
    text: String,
    errno: Option<u16>,
}

impl EventWords {
    /// A number of an error has a place of its own in a line.
    fn number(&mut self, field: &Field, number: Option<u16>, value: &dyn fmt::Debug) {
        match number.filter(|_| field.name() == ERRNO) {
            Some(number) => self.errno = Some(number),
            None => self.record_debug(field, value),
        }
    }
}

impl Visit for EventWords {
    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        let space = if self.text.is_empty() { "" } else { " " };
        // Writing to a string does not fail.
        let _ = match field.name() {
            "message" => write!(self.text, "{space}{value:?}"),
            name => write!(self.text, "{space}{name}={value:?}"),
        };
    }

    fn record_u64(&mut self, field: &Field, value: u64) {
        self.number(field, u16::try_from(value).ok(), &value);
    }

    fn record_i64(&mut self, field: &Field, value: i64) {
        self.number(field, u16::try_from(value).ok(), &value);
    }

    fn record_error(&mut self, field: &Field, value: &(dyn Error + 'static)) {
        self.errno = self.errno.or_else(|| errno_of(value));
        self.record_debug(field, &format_args!("{value}"));
    }
}
