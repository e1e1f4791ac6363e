//! `record info`: what is in files.

use crate::measure::stream::stamp_text;
use crate::terminal::table::table;
use crate::terminal::units::size;
use crate::terminal::{Failure, complain, say};
use rohrpost::output::plain::ForeignText;
use rohrpost::schema::describe_type;
use rohrpost_recording::format::PROFILE;
use rohrpost_recording::{AttachmentInfo, ChannelInfo, Damage, Info, LossCause, Losses, Shown};
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::process::ExitCode;

/// Some messages at once have no rate.
const SHORTEST_NS: u64 = 1_000_000_000;

#[derive(clap::Args)]
pub(super) struct RecordingInfoArguments {
    /// Recordings.
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// One JSON object a file.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &RecordingInfoArguments) -> Result<ExitCode, Failure> {
    let mut code = ExitCode::SUCCESS;
    for (number, file) in arguments.files.iter().enumerate() {
        match rohrpost_recording::info(file) {
            Ok(info) if arguments.json => drop(say(as_json(&info))),
            Ok(info) => drop(say(format_args!("{}{}", if number == 0 { "" } else { "\n" }, text(&info).trim_end()))),
            Err(error) => {
                complain(error);
                code = ExitCode::FAILURE;
            }
        }
    }
    Ok(code)
}

fn text(info: &Info) -> String {
    let closed = match (info.is_closed, &info.closed_because) {
        (true, Some(why)) => format!("closed ({why})"),
        (true, None) => "closed".into(),
        (false, _) => "not closed: if nothing writes it any more, `rohrpost record recover` makes a whole file".into(),
    };
    let (path, bytes, chunks) = (Shown(info.path.clone()), size(info.bytes), info.chunks);
    let messages = messages_text(info);
    let mut lines = vec![format!("{path}: {messages}, {bytes} in {chunks} chunks, {closed}")];
    if info.lost > 0 {
        let why = if info.losses.all() > 0 { info.losses.text() } else { "the file does not tell why".into() };
        lines.push(format!("{} messages are lost: {why}", info.lost));
    }
    if info.repeated > 0 {
        let topics = info.channels.iter().filter(|channel| channel.repeated > 0).map(|channel| &channel.topic);
        lines.push(format!("it begins with the newest of earlier, which is not counted, of {}", listed(topics)));
    }
    if let (Some(first), Some(last)) = (info.first_ns, info.last_ns) {
        let seconds = last.saturating_sub(first) as f64 / 1e9;
        lines.push(format!("from {} to {}, {seconds:.3} s", stamp_text(first), stamp_text(last)));
    }
    if info.epochs.len() > 1 {
        let epochs = info.epochs.iter().map(|its| format!("{} ({} messages)", its.epoch, its.messages));
        lines.push(format!("system time stepped; epochs: {}", epochs.collect::<Vec<_>>().join(", ")));
    }
    if info.profile != PROFILE {
        let profile = if info.profile.is_empty() { "no profile".into() } else { info.profile.to_string() };
        lines.push(format!("not one of ours: {profile}, written by {}", info.library));
    }
    let session = info.session.iter().map(|(key, text)| format!("{key} {text}"));
    if !info.session.is_empty() {
        lines.push(session.collect::<Vec<_>>().join(", "));
    }
    lines.extend(info.attachments.iter().map(|its| {
        let AttachmentInfo { name, media_type, bytes } = its;
        format!("attachment {name}: {media_type}, {}", size(*bytes))
    }));
    lines.extend(info.marks.iter().map(|mark| format!("mark at {}: {}", stamp_text(mark.time_ns), mark.text)));
    if !info.described.is_empty() {
        let names: BTreeSet<&ForeignText> = info.described.iter().map(|module| &module.name).collect();
        lines.push(format!("described for replay: {}", listed(names)));
    }
    for (name, texts) in &info.others {
        let texts: Vec<String> = texts.iter().map(|(key, text)| format!("{key} {text}")).collect();
        lines.push(format!("{name}: {}", texts.join(", ")));
    }
    lines.extend(info.damages.iter().map(|(at, damage)| format!("at byte {at}: {damage}")));
    lines.extend(more_damages(info.damage_count, &info.damages));
    let rows = info.channels.iter().map(|channel| {
        let rate = rate(channel).map_or(String::new(), |rate| format!("{rate:.1}"));
        [channel.topic.to_string(), channel.messages.to_string(), rate, channel.lost.to_string(), type_text(channel)]
    });
    format!("{}\n\n{}", lines.join("\n"), table(["topic", ">messages", ">per s", ">lost", "type"], rows))
}

/// What is said behind the damages that are listed, if there are more.
pub(super) fn more_damages(count: u64, listed: &[(u64, Damage)]) -> Option<String> {
    let more = count - listed.len() as u64;
    (more > 0).then(|| format!("and {more} more, {count} in all"))
}

fn listed<'a>(texts: impl IntoIterator<Item = &'a ForeignText>) -> String {
    texts.into_iter().map(ForeignText::to_string).collect::<Vec<_>>().join(", ")
}

/// All messages; and how many are drawn of others, if they stand beside those.
fn messages_text(info: &Info) -> String {
    let of = |channel: &ChannelInfo| channel.drawn_of.as_ref().map(|_| channel.messages);
    match (info.messages, info.channels.iter().filter_map(of).fold(0, u64::saturating_add)) {
        (all, 0) => format!("{all} messages"),
        (all, drawn) if drawn >= all => format!("{all} messages"),
        (all, drawn) => format!("{all} messages ({drawn} of them drawn)"),
    }
}

/// Messages a second, over the time in which they came, if that is a second or more.
fn rate(channel: &ChannelInfo) -> Option<f64> {
    let ns = channel.last_ns?.checked_sub(channel.first_ns?).filter(|ns| *ns >= SHORTEST_NS)?;
    Some(channel.messages.saturating_sub(1) as f64 * 1e9 / ns as f64)
}

/// Of others the name, and how values and types are written.
fn type_text(channel: &ChannelInfo) -> String {
    let ChannelInfo { ty, type_name, message_encoding, schema_encoding, drawn_of, is_reduced, .. } = channel;
    match ty {
        Some(ty) => describe_type(ty),
        None => {
            let mut words = vec![type_name, message_encoding, schema_encoding];
            words.retain(|word| !word.is_empty());
            words.dedup();
            let words: Vec<String> = words.into_iter().map(ForeignText::to_string).collect();
            let drawn = drawn_of.as_ref().map_or(String::new(), |topic| format!(", drawn of {topic}"));
            let reduced = if *is_reduced { ", reduced to 64 KiB" } else { "" };
            format!("{}{drawn}{reduced}", words.join(" "))
        }
    }
}

fn lost_by(losses: &Losses) -> Value {
    LossCause::ALL.iter().map(|cause| (cause.name().to_owned(), losses[*cause].into())).collect::<Map<_, _>>().into()
}

fn as_json(info: &Info) -> Value {
    let channels = info.channels.iter().map(|channel| {
        json!({
            "topic": channel.topic, "name": channel.name, "item": channel.item, "type_name": channel.type_name,
            "type": channel.ty.as_deref().map(describe_type), "message_encoding": channel.message_encoding,
            "schema_encoding": channel.schema_encoding, "drawn_of": channel.drawn_of, "reduced": channel.is_reduced,
            "messages": channel.messages, "repeated": channel.repeated, "lost": channel.lost,
            "lost_by": lost_by(&channel.losses),
            "first_ns": channel.first_ns, "last_ns": channel.last_ns,
        })
    });
    let epochs = info.epochs.iter().map(
        |its| json!({"epoch": its.epoch, "messages": its.messages, "first_ns": its.first_ns, "last_ns": its.last_ns}),
    );
    let damages = info.damages.iter().map(|(at, what)| json!({"at": at, "what": what.to_string()}));
    let marks = info.marks.iter().map(|its| json!({"time_ns": its.time_ns, "epoch": its.epoch, "text": its.text}));
    let attachments =
        info.attachments.iter().map(|its| json!({"name": its.name, "media_type": its.media_type, "bytes": its.bytes}));
    let described = info.described.iter().map(|module| {
        let description = &module.description;
        json!({"name": module.name, "class": description.class, "interface": format!("{:08x}", description.hash())})
    });
    let others = info.others.iter().map(|(name, texts)| json!({"name": name, "texts": texts}));
    json!({
        "path": info.path, "bytes": info.bytes, "is_closed": info.is_closed, "closed_because": info.closed_because,
        "library": info.library, "profile": info.profile, "chunks": info.chunks, "messages": info.messages,
        "repeated": info.repeated, "lost": info.lost, "lost_by": lost_by(&info.losses),
        "first_ns": info.first_ns, "last_ns": info.last_ns, "channels": channels.collect::<Vec<_>>(),
        "epochs": epochs.collect::<Vec<_>>(), "session": info.session, "configuration": info.configuration,
        "earlier_configuration": info.earlier_configuration,
        "attachments": attachments.collect::<Vec<_>>(), "marks": marks.collect::<Vec<_>>(),
        "described": described.collect::<Vec<_>>(),
        "others": others.collect::<Vec<_>>(), "damages": damages.collect::<Vec<_>>(),
        "damage_count": info.damage_count,
    })
}
