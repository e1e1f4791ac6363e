//! Flows: regular traffic between two modules, and its deadlines. Routers plan their time slots by them.

use crate::contents::{Contents, ContentsError};
use crate::directory::{Directory, Unknown};
use crate::reader::Section;
use crate::units::duration_text;
use rohrpost_mailbox::{BODY_BYTES_MAX, Name};
use std::time::Duration;

/// One `[[flow]]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Flow {
    /// Module that sends.
    pub from: Name,
    /// Module that receives.
    pub to: Name,
    /// Contents, if the file states them: they distinguish flows between the same modules.
    pub carries: Option<Contents>,
    /// Bytes of a body, at most.
    pub size: u32,
    /// Time from one package to the next.
    pub period: Duration,
    /// Time within which a package arrives; the period, unless the file says less.
    pub deadline: Duration,
    /// Line in the file.
    pub line: usize,
}

impl Flow {
    pub(crate) fn read(section: Section<'_>, directory: &Directory<'_>) -> Option<Self> {
        let end = |key: &'static str, example: &str| {
            section.required(key, &format!("{key} = \"{example}\"")).and_then(|item| {
                let text = item.text(example)?;
                let missing = |unknown: &Unknown| {
                    item.report(format!("`{key}`: `{text}` is no [[module]]; {}", unknown.or("drop the flow")));
                };
                directory.find(text).inspect_err(missing).ok()
            })
        };
        let (from, to) = (end("from", "laser.0"), end("to", "mapper.0"));
        let mut carries = Some(None);
        if let Some(item) = section.get("carries") {
            let wrong = |error: &ContentsError| item.report(format!("`carries`: {error}"));
            carries = item.text("data 1").and_then(|text| text.parse().inspect_err(wrong).ok()).map(Some);
        }
        let size = section.required("size", "size = \"2 KiB\"");
        let size = size.and_then(|item| item.size(1..=BODY_BYTES_MAX as u64, "2 KiB"));
        let period = section.required("period", "period = \"100 ms\"");
        let period = period.and_then(|item| item.duration_above_zero("100 ms"));
        let mut deadline = period;
        if let Some(item) = section.get("deadline") {
            deadline = item.duration_above_zero("50 ms");
            if let (Some(deadline), Some(period)) = (deadline, period)
                && deadline > period
            {
                item.report(format!(
                    "`deadline` {} is later than the next package; write at most the period, {}",
                    duration_text(deadline),
                    duration_text(period)
                ));
            }
        }
        let line = section.line;
        section.finish();
        let (from, to, carries) = (from?, to?, carries?);
        Some(Self { from, to, carries, size: size? as u32, period: period?, deadline: deadline?, line })
    }
}
