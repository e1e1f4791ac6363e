//! What stations ask of mobiles, and what these answer (seed 000, 4.5.3): what stands behind the head of an event.
//! Layout: docs/src/wire.md.

use rohrpost_team::{RobotId, Run};

/// Characters of a report at most.
pub const REPORT_CHARS_MAX: usize = 1000;
/// Bytes before the robots of a request, and before the text of a report.
const HEAD_BYTES: usize = 10;
/// Bytes of a robot in a request.
const RUN_BYTES: usize = 5;
/// In the place of a station: a report that answers nobody.
const NOBODY: [u8; 9] = [0; 9];

/// What is asked.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum RequestKind {
    /// A mobile is to send its view as a text.
    Info,
    /// A mobile is to end.
    Quit,
}

/// Name of a request, the same for all its repetitions.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct RequestId {
    /// The station that asks.
    pub station: Run,
    /// Number of the request in this run.
    pub number: u32,
}

/// What a station asks of some mobiles.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Request {
    /// Name of the request.
    pub id: RequestId,
    /// What is asked.
    pub kind: RequestKind,
    /// Runs of robots that have not answered yet, by ascending robot: one that was restarted is not meant.
    pub to: Vec<Run>,
}

/// How a mobile answers.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Answer {
    /// The mobile does what is asked.
    Done,
    /// The mobile does not obey this station.
    Refused,
    /// Another station, which nothing is asked of.
    Station,
}

/// What a mobile tells stations.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Report {
    /// The request that is answered, and how; `None`: the mobile speaks of its own accord.
    pub answers: Option<(RequestId, Answer)>,
    /// What a person reads; longer than [`REPORT_CHARS_MAX`] it is cut.
    pub text: String,
}

impl Request {
    pub(crate) fn encode(&self) -> Vec<u8> {
        let kind = match self.kind {
            RequestKind::Info => 1,
            RequestKind::Quit => 2,
        };
        let mut bytes = vec![kind, self.to.len() as u8];
        bytes.extend(self.id.station.incarnation.to_le_bytes());
        bytes.extend(self.id.number.to_le_bytes());
        for Run { robot, incarnation } in &self.to {
            bytes.push(robot.get());
            bytes.extend(incarnation.to_le_bytes());
        }
        bytes
    }

    /// Reads a request of robot `from`; `None` if it is none.
    pub(crate) fn decode(from: RobotId, bytes: &[u8]) -> Option<Self> {
        let kind = match bytes.first()? {
            1 => RequestKind::Info,
            2 => RequestKind::Quit,
            _ => return None,
        };
        let (incarnation, number) = (u32_at(bytes, 2)?, u32_at(bytes, 6)?);
        let (runs, rest) = bytes.get(HEAD_BYTES..)?.as_chunks::<RUN_BYTES>();
        let run = |run: &[u8; RUN_BYTES]| Some(Run { robot: RobotId::new(run[0])?, incarnation: u32_at(run, 1)? });
        let to: Vec<Run> = runs.iter().map(run).collect::<Option<_>>()?;
        let is_right = rest.is_empty() && to.len() == usize::from(bytes[1]) && !to.is_empty();
        let rises = to.windows(2).all(|pair| pair[0].robot < pair[1].robot);
        let id = RequestId { station: Run { robot: from, incarnation }, number };
        (is_right && rises).then_some(Self { id, kind, to })
    }
}

impl Report {
    pub(crate) fn encode(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        match self.answers {
            None => {
                bytes.push(0);
                bytes.extend(NOBODY);
            }
            Some((RequestId { station, number }, answer)) => {
                let answer = match answer {
                    Answer::Done => 1,
                    Answer::Refused => 2,
                    Answer::Station => 3,
                };
                bytes.extend([answer, station.robot.get()]);
                bytes.extend(station.incarnation.to_le_bytes());
                bytes.extend(number.to_le_bytes());
            }
        }
        bytes.extend(self.text.chars().take(REPORT_CHARS_MAX).collect::<String>().into_bytes());
        bytes
    }

    /// Reads a report; `None` if it is none.
    pub(crate) fn decode(bytes: &[u8]) -> Option<Self> {
        let (head, text) = bytes.split_at_checked(HEAD_BYTES)?;
        let answer = match head[0] {
            0 => None,
            1 => Some(Answer::Done),
            2 => Some(Answer::Refused),
            3 => Some(Answer::Station),
            _ => return None,
        };
        let answers = match answer {
            None if head[1..] != NOBODY => return None,
            None => None,
            Some(answer) => {
                let station = Run { robot: RobotId::new(head[1])?, incarnation: u32_at(head, 2)? };
                Some((RequestId { station, number: u32_at(head, 6)? }, answer))
            }
        };
        let text = str::from_utf8(text).ok().filter(|text| text.chars().count() <= REPORT_CHARS_MAX)?;
        Some(Self { answers, text: text.into() })
    }
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().map(|bytes| u32::from_le_bytes(*bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str = include_str!("../../../docs/src/wire.md");

    /// The bytes of a block: each line begins with digits, two a byte, then two spaces and words.
    fn block(name: &str) -> Vec<u8> {
        let text = PAGE.split(&format!("\n```hex {name}\n")).nth(1).unwrap().split("\n```").next().unwrap();
        let pairs = text.lines().flat_map(|line| line.split("  ").next().unwrap().as_bytes().chunks(2));
        pairs.map(|pair| u8::from_str_radix(str::from_utf8(pair).unwrap(), 16).unwrap()).collect()
    }

    fn run(robot: u8, incarnation: u32) -> Run {
        Run { robot: RobotId::new(robot).unwrap(), incarnation }
    }

    #[test]
    fn requests_and_reports_have_the_documented_bytes() {
        let id = RequestId { station: run(6, 2), number: 7 };
        let request = Request { id, kind: RequestKind::Quit, to: vec![run(1, 5), run(4, 258)] };
        assert_eq!(request.encode(), block("team-request"));
        assert_eq!(Request::decode(id.station.robot, &block("team-request")), Some(request));
        let report = Report { answers: Some((id, Answer::Done)), text: "ends".into() };
        assert_eq!(report.encode(), block("team-report"));
        assert_eq!(Report::decode(&block("team-report")), Some(report));
        let text = Report { answers: None, text: "ü".repeat(2000) };
        let cut = Report { answers: None, text: "ü".repeat(REPORT_CHARS_MAX) };
        assert_eq!(Report::decode(&text.encode()), Some(cut));
    }

    #[test]
    fn what_is_no_request_and_no_report_is_refused_whole() {
        let from = run(6, 2).robot;
        let right = block("team-request");
        let changed = |at: usize, byte: u8| {
            let mut bytes = right.clone();
            bytes[at] = byte;
            bytes
        };
        for (bytes, why) in [
            (changed(0, 3), "kind"),
            (changed(1, 1), "more robots than it says"),
            (changed(10, 0), "no robot"),
            (changed(10, 4), "not ascending"),
            (right[..right.len() - 1].to_vec(), "cut"),
            (right[..10].to_vec(), "nobody"),
            (Vec::new(), "empty"),
        ] {
            assert_eq!(Request::decode(from, &bytes), None, "{why}");
        }
        for (bytes, why) in [
            (&[4, 0, 0, 0, 0, 0, 0, 0, 0, 0][..], "kind"),
            (&[0, 1, 0, 0, 0, 0, 0, 0, 0, 0], "answers nobody, and names a station"),
            (&[1, 0, 0, 0, 0, 0, 0, 0, 0, 0], "answers no station"),
            (&[0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xff], "no text"),
            (&[1, 2], "cut"),
        ] {
            assert_eq!(Report::decode(bytes), None, "{why}");
        }
    }
}
