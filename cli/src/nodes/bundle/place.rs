//! Where a node's folder is: on this computer, or on another by ssh.

use crate::terminal::{Failure, say};
use rohrpost_bundle::{Bundle, NodeReport, SendError, send};
use std::fmt;
use std::io::{BufRead, BufReader, Read};
use std::path::PathBuf;
use std::process::{Child, ChildStdout, Command, ExitCode, Stdio};
use std::str::FromStr;

/// Bytes that a node may answer.
const ANSWER_BYTES_MAX: u64 = 16 << 20;
/// What ssh and shells end with if the command is not on the node's PATH.
const NOT_FOUND: i32 = 127;

/// Where a node's folder is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum NodePlace {
    /// On this computer.
    Folder(PathBuf),
    /// On another one.
    Host(Host),
}

/// A node's folder on another computer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Host {
    /// As ssh knows it.
    host: String,
    /// The folder there.
    folder: String,
}

impl FromStr for NodePlace {
    type Err = String;

    /// As rsync and scp read it: a colon before the first slash ends a host.
    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            Some((host, folder)) if !host.contains('/') => {
                if host.is_empty() || host.starts_with('-') || folder.is_empty() {
                    return Err("write HOST:FOLDER, such as base:/var/lib/rohrpost".into());
                }
                Ok(Self::Host(Host { host: host.into(), folder: folder.into() }))
            }
            _ if text.is_empty() => Err("write the folder of a node, such as /var/lib/rohrpost".into()),
            _ => Ok(Self::Folder(text.into())),
        }
    }
}

impl fmt::Display for NodePlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Folder(folder) => folder.display().fmt(f),
            Self::Host(host) => host.fmt(f),
        }
    }
}

impl fmt::Display for Host {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.host, self.folder)
    }
}

impl Host {
    /// The command that runs a step of `rohrpost bundle` there.
    fn command(&self, step: &str) -> Command {
        // The shell of the node reads it once more.
        let folder = format!("'{}'", self.folder.replace('\'', "'\\''"));
        let mut command = Command::new("ssh");
        command.args(["--", &self.host]).arg(format!("rohrpost bundle {step} -- {folder}"));
        command
    }

    /// Runs a step; what it says goes to the terminal.
    pub(super) fn run(&self, step: &str) -> Result<ExitCode, Failure> {
        let mut child = self.start(self.command(step).stdin(Stdio::null()))?;
        pass_on(child.stdout.take().map(bounded));
        self.end(child)?;
        Ok(ExitCode::SUCCESS)
    }

    /// Sends a bundle to `rohrpost bundle receive` there.
    pub(super) fn send(&self, bundle: &Bundle) -> Result<(), Failure> {
        let mut child = self.start(self.command("receive").stdin(Stdio::piped()))?;
        let (to, from) = (child.stdin.take(), child.stdout.take().map(bounded));
        let (Some(mut to), Some(mut from)) = (to, from) else { return Err("ssh was started without pipes".into()) };
        let sent = send(bundle, &mut to, &mut from);
        drop(to);
        pass_on(Some(from));
        // A node that refuses ends first; why, it has said itself.
        match (sent, self.end(child)) {
            (Err(SendError::Node(_)), Err(refused)) => Err(refused),
            (Err(error), _) => Err(format!("{self}: {error}").into()),
            (Ok(_), ended) => ended,
        }
    }

    /// Asks what a node has.
    pub(super) fn report(&self) -> Result<NodeReport, Failure> {
        let mut child = self.start(self.command("check --json").stdin(Stdio::null()))?;
        let mut lines = child.stdout.take().map(bounded).into_iter().flat_map(BufRead::lines);
        // A shell of the node may print lines before it.
        let report = lines.by_ref().find_map(|line| serde_json::from_str::<[NodeAnswer; 1]>(&line.ok()?).ok());
        lines.for_each(drop);
        let ended = self.end(child);
        let [answer] = report.ok_or_else(|| ended.err().unwrap_or_else(|| format!("{self}: no answer").into()))?;
        answer.report.ok_or_else(|| answer.error.unwrap_or_default().into())
    }

    fn start(&self, command: &mut Command) -> Result<Child, Failure> {
        let refused = "install it, or copy the bundle to the node and push it there";
        command.stdout(Stdio::piped()).spawn().map_err(|error| format!("{self}: ssh: {error}; {refused}").into())
    }

    fn end(&self, mut child: Child) -> Result<(), Failure> {
        let ended = child.wait()?;
        match ended.code() {
            Some(0) => Ok(()),
            Some(NOT_FOUND) => Err(format!("{self}: `rohrpost` is not on the PATH of commands by ssh there").into()),
            Some(255) => Err(format!("{self}: ssh has failed; what it says is above").into()),
            _ => Err(format!("{self}: refused ({ended}); the reason is above").into()),
        }
    }
}

/// What `rohrpost bundle check --json` prints for each place.
#[derive(serde::Serialize, serde::Deserialize)]
pub(super) struct NodeAnswer {
    /// The place, as it was named.
    pub(super) place: String,
    /// None if the node has no bundle that can be read.
    pub(super) report: Option<NodeReport>,
    /// Why there is no report.
    pub(super) error: Option<String>,
}

fn bounded(stdout: ChildStdout) -> impl BufRead {
    BufReader::new(stdout.take(ANSWER_BYTES_MAX))
}

fn pass_on(lines: Option<impl BufRead>) {
    for line in lines.into_iter().flat_map(BufRead::lines).map_while(Result::ok) {
        say(line);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hosts_and_folders_are_told_apart_as_scp_does() {
        let host = |host: &str, folder: &str| Ok(NodePlace::Host(Host { host: host.into(), folder: folder.into() }));
        let folder = |folder: &str| Ok(NodePlace::Folder(folder.into()));
        for (text, place) in [
            ("/var/lib/rohrpost", folder("/var/lib/rohrpost")),
            ("node", folder("node")),
            ("./a:b", folder("./a:b")),
            ("base:/var/lib", host("base", "/var/lib")),
            ("robot@10.0.0.2:x", host("robot@10.0.0.2", "x")),
        ] {
            assert_eq!(text.parse::<NodePlace>(), place, "{text}");
        }
        for text in ["", ":/x", "base:", "-oProxyCommand=x:/y"] {
            assert!(text.parse::<NodePlace>().is_err(), "{text}");
        }
        let there = Host { host: "base".into(), folder: "/a b'c".into() };
        let command = there.command("back");
        let words: Vec<_> = command.get_args().map(|word| word.to_str().unwrap()).collect();
        assert_eq!(words, ["--", "base", "rohrpost bundle back -- '/a b'\\''c'"]);
    }
}
