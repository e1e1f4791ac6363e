//! The demo's robot as two observations, a second apart, with simple numbers.

use super::super::details;
use super::super::draw::{OutputText, Palette, ScreenModel};
use super::super::model::{Model, Sample, TimeNow};
use super::super::{app::App, output};
use crate::look::summary::{ModuleLine, module_lines};
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use rohrpost::Name;
use rohrpost::common::OutputLevel;
use rohrpost::interface::Interface;
use rohrpost::interfaces::MotorInterface;
use rohrpost::output::OutputLine;
use rohrpost_config::Installation;
use rohrpost_launch::survey::{ModuleSurvey, StreamSurvey, Survey, Usage, sum};
use rohrpost_mailbox::sys::Scheduling;
use rohrpost_mailbox::{
    Class, ClassTraffic, FlowInfo, Latency, Loss, MailboxInfo, ModuleState, OverflowPolicy, ParticipantInfo, Shape,
    StreamId, StreamInfo, Type, local,
};
use std::path::Path;
use std::time::Duration;

pub(super) struct Robot {
    pub(super) installation: Installation,
    pub(super) earlier: Sample,
    pub(super) now: Sample,
    pub(super) model: Model,
}

/// When the newer observation was taken, on the node's clock.
const AT_NS: u64 = 3_725_000_000_000;

/// The module that keeps only the newest package in its mailbox.
const LATEST: &str = "motor.0";

/// A module's counters at a moment: received, lost, sent, and processor time, ms.
struct Counts {
    module: &'static str,
    state: Option<ModuleState>,
    received: u64,
    refused: u64,
    sent: u64,
    cpu_ms: u64,
    waiting: u32,
}

const fn counts(module: &'static str, state: Option<ModuleState>, counts: [u64; 4], waiting: u32) -> Counts {
    let [received, refused, sent, cpu_ms] = counts;
    Counts { module, state, received, refused, sent, cpu_ms, waiting }
}

impl Robot {
    pub(super) fn new() -> Self {
        use ModuleState::{Error, Off, On};
        let text = include_str!("../../../../../config/demo.toml");
        let installation = Installation::parse(text, Path::new("config/demo.toml")).unwrap();
        let earlier = sample(
            &installation,
            AT_NS - 1_000_000_000,
            &[
                counts("output.0", Some(On), [17, 0, 0, 10], 0),
                counts("motor.0", Some(On), [100, 0, 600, 500], 0),
                counts("mapper.0", Some(On), [300, 2, 9, 1000], 0),
                counts("pilot.0", Some(On), [200, 0, 100, 200], 0),
                counts("gui.0", None, [0; 4], 0),
            ],
        );
        let now = sample(
            &installation,
            AT_NS,
            &[
                counts("output.0", Some(On), [18, 0, 0, 10], 0),
                counts("motor.0", Some(Off), [125, 0, 660, 515], 1),
                counts("mapper.0", Some(Error), [330, 9, 10, 1400], 31),
                counts("pilot.0", Some(On), [230, 0, 112, 205], 0),
                counts("gui.0", None, [0; 4], 0),
            ],
        );
        let model = Model::new(&installation, "main", &["main"], &now, Some(&earlier));
        Self { installation, earlier, now, model }
    }

    pub(super) fn name(&self, module: &str) -> Name {
        name(&self.installation, module)
    }

    /// The screen of a terminal of this size, without colours.
    pub(super) fn screen(&self, app: &mut App, columns: u16, rows: u16) -> String {
        let mut terminal = Terminal::new(TestBackend::new(columns, rows)).unwrap();
        app.columns = super::super::draw::columns(&self.model, columns).iter().map(|(column, _)| *column).collect();
        let noted = |name| (name == self.name("motor.0")).then(MotorInterface::description);
        let details = match app.screen {
            super::super::app::Screen::Details(name) => {
                details::page(&self.installation, &self.now, &self.model, name, (None, noted))
            }
            _ => Vec::new(),
        };
        let view = ScreenModel {
            model: &self.model,
            app,
            output: &self.output(app),
            silence: None,
            details: &details,
            map: Err("no map"),
            palette: Palette { colours: false },
        };
        terminal.draw(|frame| view.draw(frame.area(), frame.buffer_mut())).unwrap();
        let lines = terminal.backend().buffer().content.chunks(columns.into());
        let text = lines.map(|line| line.iter().map(|cell| cell.symbol()).collect::<String>());
        text.map(|line| format!("{}\n", line.trim_end())).collect()
    }

    fn output(&self, app: &App) -> Vec<OutputText> {
        let line = |seconds: u64, module: &str, level, text: &str| OutputLine {
            time_ns: (1_795_257_600 + seconds) * 1_000_000_000,
            module: self.name(module).raw(),
            level,
            lost: 0,
            suppressed: 0,
            errno: None,
            text: text.into(),
        };
        let mut page = output::Output::new(&self.installation);
        page.take(Ok(rohrpost::interfaces::Page { life: 1, first: u64::MAX, next: 4, lines: Vec::new() }));
        page.take(Ok(rohrpost::interfaces::Page {
            life: 1,
            first: 0,
            next: 4,
            lines: vec![
                line(1, "output.0", OutputLevel::Info, "is on"),
                line(
                    2,
                    "pilot.0",
                    OutputLevel::Warn,
                    "runs without fifo 6: Operation not permitted; allow it with a limit `rtprio` for this user",
                ),
                line(3, "mapper.0", OutputLevel::Error, "is in error: no scan has come for 5 s"),
                line(4, "motor.0", OutputLevel::Debug, "the last command is too old"),
            ],
        }));
        page.shown(&self.installation, app.lines)
    }
}

fn name(installation: &Installation, module: &str) -> Name {
    installation.classes.parse_name(module).unwrap().module()
}

fn sample(installation: &Installation, at_ns: u64, counts: &[Counts]) -> Sample {
    let modules: Vec<ModuleSurvey> = counts.iter().map(|counts| module(installation, at_ns, counts)).collect();
    let mailboxes: Vec<MailboxInfo> = modules.iter().filter(|m| m.process.is_some()).map(mailbox).collect();
    let flows = counts.iter().zip(&modules).filter(|(counts, _)| counts.sent > 0);
    let pilot = name(installation, "pilot.0");
    let motor = name(installation, "motor.0");
    let flow = |(counts, module): (&Counts, &ModuleSurvey)| {
        flow(module, if module.name == pilot { motor } else { pilot }, counts.sent)
    };
    let flows = flows.map(flow).collect();
    let streams = vec![stream(at_ns, name(installation, "odometry.0"))];
    let survey = Survey { node: "main".into(), at_ns, classes: sum(&mailboxes), modules, mailboxes, streams, flows };
    let lines = module_lines(installation, &survey, None);
    Sample {
        lines: counts.iter().zip(lines).map(|(counts, seen)| line(counts, seen)).collect(),
        time: TimeNow {
            time_ns: 1_795_257_612_000_000_000,
            time_source: "simulation",
            time_pace: 2.0,
            time_known: true,
            clock_set_by_ns: None,
        },
        launched: true,
        silent: Vec::new(),
        survey,
    }
}

fn module(installation: &Installation, at_ns: u64, counts: &Counts) -> ModuleSurvey {
    let name = name(installation, counts.module);
    let configured = installation.module(name).unwrap();
    let process = counts.state.map(|state| ParticipantInfo {
        module: name,
        pid: 14_700 + u32::from(name.class().0),
        incarnation: 7,
        state: Some(state),
        restarts: u32::from(counts.module == "pilot.0"),
        ..ParticipantInfo::default()
    });
    // Each waited 25 to 33 µs, and one of fifteen some milliseconds.
    let mut waited = Latency { max: Duration::from_millis(6), ..Latency::default() };
    waited.buckets[13] = counts.received as u32;
    waited.buckets[29] = counts.received as u32 / 15;
    let mut losses = [0; Loss::ALL.len()];
    losses[Loss::Refused as usize] = counts.refused;
    // Its mailbox of commands has the policy `latest`: of each ten, a newer one replaced one.
    if counts.module == LATEST {
        losses[Loss::Replaced as usize] = counts.received / 10;
    }
    let usage = Usage { cpu: Duration::from_millis(counts.cpu_ms), memory_bytes: 12_345_678 };
    ModuleSurvey {
        node: "main".into(),
        at_ns: Some(at_ns),
        usage: process.is_some().then_some(usage),
        scheduling: process.is_some().then_some(match counts.module {
            "motor.0" => Scheduling::Fifo(34),
            _ => Scheduling::Normal(0),
        }),
        error: (counts.state == Some(ModuleState::Error)).then(|| "no scan has come for 5 s".to_owned()),
        name,
        aliases: configured.aliases.clone(),
        process,
        received: counts.received,
        bytes_in: counts.received * 100,
        lost: counts.refused,
        losses,
        waited,
        sent: counts.sent,
        bytes_out: counts.sent * 100,
        depth: counts.waiting,
        ..ModuleSurvey::default()
    }
}

fn mailbox(module: &ModuleSurvey) -> MailboxInfo {
    let class = ClassTraffic {
        class: Some(Class(140)),
        received: module.received,
        body_bytes: module.bytes_in,
        losses: module.losses,
        latency: module.waited.clone(),
    };
    let full =
        if module.losses[Loss::Replaced as usize] > 0 { OverflowPolicy::Latest } else { OverflowPolicy::Displace };
    MailboxInfo {
        name: module.name.with_local(local::COMMANDS),
        shape: Shape { full, ..Shape::default() },
        owner: module.process.as_ref().map(|process| process.pid),
        depth: module.depth,
        depth_max: module.depth + 1,
        sent: module.received + u64::from(module.depth),
        classes: vec![class],
        ..MailboxInfo::default()
    }
}

fn stream(at_ns: u64, name: Name) -> StreamSurvey {
    let info = StreamInfo {
        id: StreamId { name, number: 1 },
        written: 220,
        refused: 1,
        readers: 2,
        sleeping: 1,
        ..StreamInfo::default()
    };
    StreamSurvey { node: "main".into(), at_ns, info }
}

fn flow(module: &ModuleSurvey, to: Name, packages: u64) -> FlowInfo {
    FlowInfo {
        pid: 1,
        module: module.name,
        incarnation: 7,
        from: module.name.with_local(local::REPLIES),
        to,
        kind: Type::command(16),
        packages,
        bytes: packages * 100,
        first_ns: 1,
        last_ns: 2,
        ..FlowInfo::default()
    }
}

fn line(counts: &Counts, line: ModuleLine) -> ModuleLine {
    // The other modules' counters a second later.
    ModuleLine { received_per_s: Some(counts.received as f64 / 10.0), ..line }
}
