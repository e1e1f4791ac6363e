//! The existing certificates and their remaining validity, as text.

use super::{AUTHORITY, DAY, HolderState, files, folder, holders, is_pair, state};
use crate::terminal::units::counted;
use rcgen::date_time_ymd;
use rohrpost_config::Installation;
use rohrpost_mailbox::realtime_ns;
use rohrpost_routers::tcp::{Authority, Holder, holds_until_s};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A certificate that is valid for less should be renewed.
const SOON_DAYS: u64 = 30;
const MAKES: &str = "`rohrpost keys new` makes it";

/// The files of each holder, and of the authority.
pub(in crate::nodes::keys) fn show(installation: &Installation) -> Vec<String> {
    let Some(folder) = folder(installation) else { return Vec::new() };
    let [certificate, secret] = files(&folder, AUTHORITY);
    let known = Authority::load(&certificate);
    let mut lines = vec![match &known {
        Err(_) if !certificate.exists() => format!("{}: is missing; {MAKES}", certificate.display()),
        Err(error) => error.to_string(),
        Ok(_) => format!("{}: is there{}", certificate.display(), lasts(&certificate, "keys rotate --authority")),
    }];
    lines.push(match &known {
        _ if !secret.exists() => format!("{}: is not here; it is needed to make certificates", secret.display()),
        Ok(_) if !is_pair(&certificate, &secret) => {
            format!("{}: is not the key of {}", secret.display(), certificate.display())
        }
        _ => format!("{}: is there", secret.display()),
    });
    for holder in holders(installation) {
        let state = state(&folder, known.as_ref().ok(), &holder);
        lines.extend(files(&folder, &holder.file_name()).map(|file| line(&file, state)));
    }
    lines
}

/// The files that a node lacks for sessions with the TCP router; empty if all exist and are valid.
pub(crate) fn lacking(installation: &Installation, node: &str) -> Vec<String> {
    let Some(folder) = folder(installation) else { return Vec::new() };
    let [certificate, _] = files(&folder, AUTHORITY);
    let known = Authority::load(&certificate);
    let mut lines: Vec<String> = known.as_ref().err().map(ToString::to_string).into_iter().collect();
    let server = installation.tcp.as_ref().and_then(|tcp| tcp.server.as_deref());
    let is_its = |holder: &Holder| match holder {
        Holder::Node { node: name, .. } => name == node,
        Holder::Router => server == Some(node),
    };
    for holder in holders(installation).filter(is_its) {
        let state = state(&folder, known.as_ref().ok(), &holder);
        // Without the authority the signature cannot be checked.
        if state == HolderState::Holds || (state == HolderState::Unsigned && known.is_err()) {
            continue;
        }
        let [certificate, secret] = files(&folder, &holder.file_name());
        let is_at_fault = |file: &PathBuf| state != HolderState::Missing || !file.exists();
        lines.extend([certificate, secret].into_iter().filter(is_at_fault).take(1).map(|file| line(&file, state)));
    }
    lines
}

/// One of a holder's two files.
fn line(file: &Path, state: HolderState) -> String {
    match state {
        HolderState::Holds => format!("{}: is there{}", file.display(), lasts(file, "keys rotate")),
        HolderState::Missing if file.exists() => {
            format!("{}: is there without the other file; {MAKES}", file.display())
        }
        HolderState::Missing => format!("{}: is missing; {MAKES}", file.display()),
        HolderState::NoPair => format!("{}: certificate and key do not match; {MAKES} anew", file.display()),
        HolderState::Unsigned => {
            format!("{}: has expired, or `{AUTHORITY}.pem` has not signed it; {MAKES} anew", file.display())
        }
    }
}

/// The remaining validity of a valid certificate, and the command that renews it; none if the text is no certificate.
fn lasts(file: &Path, renews: &str) -> String {
    let now_s = realtime_ns() / 1_000_000_000;
    holds_until_s(file)
        .map_or_else(String::new, |until_s| text(until_s, until_s.saturating_sub(now_s) / DAY.as_secs(), renews))
}

fn text(until_s: u64, days: u64, renews: &str) -> String {
    let until = date_time_ymd(1970, 1, 1) + Duration::from_secs(until_s);
    let left = counted(days, "day");
    let warning = format!("; renew it soon: `rohrpost {renews}` makes new ones");
    let warning = if days < SOON_DAYS { warning } else { String::new() };
    format!(", valid for {left}, until {}{warning}", until.date())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn expiry_within_thirty_days_gives_a_warning() {
        const UNTIL_S: u64 = 1_795_252_380;
        assert_eq!(text(UNTIL_S, 30, "keys rotate"), ", valid for 30 days, until 2026-11-21");
        assert_eq!(
            text(UNTIL_S, 1, "keys rotate"),
            ", valid for 1 day, until 2026-11-21; renew it soon: `rohrpost keys rotate` makes new ones"
        );
    }
}
