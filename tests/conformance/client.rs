//! A client in Rust: answers the questions of the line protocol with the crates.

use crate::cases::{hex, unhex};
use rohrpost_mailbox::{HEAD_BYTES, Head, Kind, Name};
use rohrpost_modules::call::{CallEnvelope, Fault, ReplyEnvelope};
use rohrpost_modules::common::DataHead;
use rohrpost_schema::{Description, Type, Value, decode, encode};
use serde_json::{Value as Json, json};
use std::io::{BufRead, Write};

/// Until its input ends.
pub(crate) fn answer_all() {
    for line in std::io::stdin().lock().lines() {
        let answer = match serde_json::from_str(&line.unwrap()).map_err(|error| error.to_string()).and_then(|ask| {
            let ask: Json = ask;
            answer(&ask)
        }) {
            Ok(ok) => json!({"ok": ok}),
            Err(error) => json!({"error": error}),
        };
        // The harness may have begun a line.
        println!("\n{answer}");
        std::io::stdout().flush().unwrap();
    }
}

fn answer(ask: &Json) -> Result<Json, String> {
    let text = |key: &str| ask[key].as_str().ok_or_else(|| format!("no `{key}`"));
    let bytes = |key: &str| unhex(text(key)?).ok_or_else(|| format!("`{key}` is no hexadecimal"));
    let ty = || Type::from_bytes(&bytes("type")?).map_err(|error| error.to_string());
    match text("do")? {
        "name" => text("text")?.parse::<Name>().map(|name| json!(name.raw())).map_err(|error| error.to_string()),
        "head" => head(&bytes("bytes")?).map(|head| fields(&head, &bytes("bytes").unwrap_or_default())),
        "decode" => {
            let value = decode(&ty()?, &bytes("bytes")?).map_err(|error| error.to_string())?;
            serde_json::to_value(value).map_err(|error| error.to_string())
        }
        "encode" => {
            let value: Value = serde_json::from_value(ask["value"].clone()).map_err(|error| error.to_string())?;
            encode(&ty()?, &value).map(|bytes| json!(hex(&bytes))).map_err(|error| error.to_string())
        }
        "interface" => {
            let its = Description::from_bytes(&bytes("bytes")?).map_err(|error| error.to_string())?;
            Ok(json!({"name": its.name, "class": its.class, "hash": its.hash(), "again": hex(&its.to_bytes())}))
        }
        "type" => {
            let ty = Type::from_bytes(&bytes("bytes")?).map_err(|error| error.to_string())?;
            Ok(json!({"hash": ty.hash(), "again": hex(&ty.to_bytes())}))
        }
        "package" => package(&bytes("bytes")?),
        "fault" => {
            let (bytes, number) = (bytes("bytes")?, |bytes: &[u8]| bytes.first().copied());
            let fault: Fault = postcard::from_bytes(&bytes).map_err(|error| error.to_string())?;
            Ok(json!({"number": number(&bytes), "one_try": fault.is_of_this_try(), "words": fault.to_string()}))
        }
        other => Err(format!("`{other}` is nothing that this client does")),
    }
}

fn head(bytes: &[u8]) -> Result<Head, String> {
    Head::from_bytes(bytes).map_err(|error| error.to_string())
}

fn fields(head: &Head, bytes: &[u8]) -> Json {
    json!({
        "to": head.to.raw(), "from": head.from.raw(), "len": head.len, "type": head.kind.0, "id": head.id,
        "priority": head.priority.0,
        // As they came: a head that was read has the byte order of this computer.
        "options": bytes[HEAD_BYTES - 1],
    })
}

/// A package's head, and what its body begins with.
pub(crate) fn package(bytes: &[u8]) -> Result<Json, String> {
    let (front, body) = bytes.split_at_checked(HEAD_BYTES).ok_or("no whole head")?;
    let head = head(front)?;
    let short = "a short body";
    let (envelope, rest) = match head.kind.kind() {
        Kind::Command(_) => {
            let (its, rest) = CallEnvelope::split(body).map_err(|_| short)?;
            let CallEnvelope { interface, incarnation, sequence, valid_for_us, age_us } = its;
            (json!([interface, incarnation, sequence, valid_for_us, age_us]), rest)
        }
        Kind::Reply(_) => {
            let (its, rest) = ReplyEnvelope::split(body).map_err(|_| short)?;
            (json!([its.incarnation, its.sequence]), rest)
        }
        Kind::Data(_) => {
            let (its, rest) = DataHead::split(body).ok_or(short)?;
            (json!([its.stamp_ns, its.sequence, its.missed, its.incarnation]), rest)
        }
        Kind::None => return Err("a package of no kind".into()),
    };
    Ok(json!({"head": fields(&head, front), "envelope": envelope, "rest": hex(rest)}))
}
