//! The screen: the model is drawn into a buffer of any size. Colour is never the only mark.
//!
//! ```text
//! demo.main  2026-11-21 10:40:12 UTC simulation              head
//! 6 modules: 1 stopped, 5 on   168 packages/s   0 lost
//! > module  state  in/s …                                    table, or details, or help
//!   motor.0 on     25
//! ── output: info and above, all modules ──────────          output, whatever room is left
//! 10:40:11.907 info  motor.0: is on
//! Enter details  o on  f off …                               keys, a question, or what came of the last key
//! ```

use super::app::{App, Prompt, Screen};
use super::columns::{Column, fit};
use super::map::MapPage;
use super::model::{Model, Row};
use super::text::{head, help};
use crate::terminal::wrap;
use ratatui::buffer::Buffer;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use rohrpost::common::OutputLevel;
use rohrpost::output::plain;
use rohrpost_launch::survey::Standing;

/// Room before a name for the mark of the selected module.
const MARK: u16 = 2;
/// Lines for output, including its title, before the table gets more than one module.
const OUTPUT_MIN: u16 = 4;
/// A lower terminal shows no output below details and help.
const SPLIT_MIN: u16 = 20;

pub(super) struct ScreenModel<'a> {
    pub(super) model: &'a Model,
    pub(super) app: &'a App,
    /// Output lines that pass the filter, oldest first.
    pub(super) output: &'a [OutputText],
    /// The message in place of output that is not available.
    pub(super) silence: Option<&'a str>,
    /// Lines of the details, if they are shown; headings begin without a blank.
    pub(super) details: &'a [String],
    /// The map, or why there is none.
    pub(super) map: Result<&'a MapPage, &'a str>,
    pub(super) palette: Palette,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct OutputText {
    pub(super) level: rohrpost::common::OutputLevel,
    pub(super) text: String,
}

impl ScreenModel<'_> {
    pub(super) fn draw(&self, area: Rect, to: &mut Buffer) {
        let head = if area.height >= 8 { 2 } else { u16::from(area.height >= 4) };
        let [top, middle, foot] =
            Layout::vertical([Constraint::Length(head), Constraint::Min(0), Constraint::Length(1)]).areas(area);
        self.head(top, to);
        match self.app.screen {
            Screen::Table => {
                let rows = self.app.rows(self.model);
                let least = OUTPUT_MIN.min(middle.height / 3);
                let wanted = rows.len().max(1) as u16 + 1;
                let [table, output] =
                    Layout::vertical([Constraint::Length(wanted.min(middle.height - least)), Constraint::Min(0)])
                        .areas(middle);
                self.table(&rows, table, to);
                self.output(output, to);
            }
            Screen::Map => self.map(middle, to),
            Screen::Details(_) | Screen::Help => {
                let least = if middle.height >= SPLIT_MIN { OUTPUT_MIN } else { 0 };
                let [text, output] = Layout::vertical([Constraint::Min(0), Constraint::Length(least)]).areas(middle);
                if self.app.screen == Screen::Help {
                    self.text(&help(), text, to)
                } else {
                    self.text(self.details, text, to)
                }
                self.output(output, to);
            }
        }
        self.foot(foot, to);
    }

    fn map(&self, area: Rect, to: &mut Buffer) {
        let [title, body] = Layout::vertical([Constraint::Length(1), Constraint::Min(0)]).areas(area);
        match self.map {
            Ok(page) => {
                put(to, title, &page.title(), self.palette.rule());
                page.draw(body, to, self.palette.colours);
            }
            Err(why) => put(to, title, why, self.palette.message()),
        }
    }

    fn head(&self, area: Rect, to: &mut Buffer) {
        let [mut first, mut second] = head(self.model);
        if self.app.paused {
            first.push_str("   PAUSED");
        }
        if !self.app.filter.is_empty() {
            second.push_str(&format!("   only `{}`", self.app.filter));
        }
        for (place, text) in area.rows().zip([first, second]) {
            put(to, place, &text, self.palette.head());
        }
    }

    fn table(&self, rows: &[&Row], area: Rect, to: &mut Buffer) {
        let [head, body] = Layout::vertical([Constraint::Length(1), Constraint::Min(0)]).areas(area);
        let columns = columns(self.model, area.width);
        let cells = columns.iter().map(|(column, width)| {
            let sorted = self.app.sort == Some(*column);
            let mark = if sorted { if self.app.reversed { "^" } else { "v" } } else { "" };
            (pad(&format!("{}{mark}", column.head()), *width, column.is_number()), self.palette.column(sorted))
        });
        line(to, head, "", cells);
        if rows.is_empty() {
            put(to, body, "  no module matches; Esc shows all", Style::new());
        }
        let selected = self.app.selected_at(rows);
        let first = (selected + 1).saturating_sub(body.height.into());
        for (place, (at, row)) in body.rows().zip(rows.iter().enumerate().skip(first)) {
            let cells = columns.iter().map(|(column, width)| {
                let text = if *column == Column::Module { name(row, *width) } else { column.cell(row) };
                (pad(&text, *width, column.is_number()), self.palette.cell(*column, row))
            });
            line(to, place, if at == selected { "> " } else { "" }, cells);
            if at == selected {
                to.set_style(place, self.palette.selected());
            }
        }
    }

    fn output(&self, area: Rect, to: &mut Buffer) {
        let [title, body] = Layout::vertical([Constraint::Length(1), Constraint::Min(0)]).areas(area);
        let filter = self.app.lines;
        let source = filter.module.map_or("all modules".into(), |module| {
            self.model.row(module).map_or(module.to_string(), |row| row.line.module.clone())
        });
        let text = match self.silence {
            None => format!("── output: {} and above, {source} ", filter.level.name()),
            Some(why) => format!("── no output: {why} "),
        };
        let rest = usize::from(title.width).saturating_sub(text.chars().count());
        put(to, title, &format!("{text}{}", "─".repeat(rest)), self.palette.rule());
        let wrapped = self.output.iter().rev().flat_map(|line| {
            let lines = wrap(&line.text, body.width.into());
            lines.into_iter().rev().map(|text| (line.level, text))
        });
        let mut newest: Vec<_> = wrapped.take(body.height.into()).collect();
        newest.reverse();
        for (place, (level, text)) in body.rows().zip(newest) {
            put(to, place, &text, self.palette.level(level));
        }
    }

    /// Lines that may exceed the screen.
    fn text(&self, lines: &[String], area: Rect, to: &mut Buffer) {
        let wrapped: Vec<(bool, String)> = lines
            .iter()
            .flat_map(|line| {
                let heading = !line.starts_with(' ');
                wrap(line, area.width.into()).into_iter().map(move |part| (heading, part))
            })
            .collect();
        let first = self.app.scroll.min(wrapped.len().saturating_sub(area.height.into()));
        for (place, (heading, text)) in area.rows().zip(wrapped.into_iter().skip(first)) {
            let style = if heading { self.palette.head() } else { Style::new() };
            put(to, place, &text, style);
        }
    }

    fn foot(&self, area: Rect, to: &mut Buffer) {
        let keys = match self.app.screen {
            Screen::Table => {
                "? help  q quit  o on  f off  Enter details  r restart  s sort  / filter  l lines  p pause"
            }
            Screen::Details(_) => "? help  q quit  Esc back  o on  f off  r restart  arrows scroll  l lines  p pause",
            Screen::Map => "m, Esc back  q quit  ? help  p pause",
            Screen::Help => "Esc back  q quit  arrows scroll",
        };
        let (text, style) = match (&self.app.prompt, &self.app.message) {
            (Prompt::Filter(_), _) => {
                (format!("/{}_   Enter keeps it, Esc restores the old one", self.app.filter), Style::new())
            }
            (Prompt::Restart(name), _) => {
                let text = self.model.row(*name).map_or(name.to_string(), |row| row.line.module.clone());
                (format!("restart {text}? y/n"), self.palette.message())
            }
            (Prompt::None, Some(message)) => (message.clone(), self.palette.message()),
            (Prompt::None, None) => (keys.into(), self.palette.rule()),
        };
        put(to, area, &text, style);
    }
}

/// Text in the first line of an area, cut to its width, with control characters escaped. On a small terminal an area
/// may be empty.
fn put(to: &mut Buffer, place: Rect, text: &str, style: Style) {
    if !place.is_empty() {
        to.set_stringn(place.x, place.y, plain::line(text), place.width.into(), style);
    }
}

pub(super) fn columns(model: &Model, width: u16) -> Vec<(Column, u16)> {
    let longest = model.modules.iter().map(|row| full_name(row).chars().count()).max().unwrap_or(0);
    fit(width.saturating_sub(MARK), longest as u16, model.nodes.len() > 1)
}

fn full_name(row: &Row) -> String {
    let aliases: Vec<String> = row.line.aliases.iter().map(|alias| format!(" + {alias}")).collect();
    row.line.module.clone() + &aliases.concat()
}

/// All names of a module if they fit, else its own and the number of the others.
fn name(row: &Row, width: u16) -> String {
    let full = full_name(row);
    match row.line.aliases.len() {
        more if more > 0 && full.chars().count() > width.into() => format!("{} +{more}", row.line.module),
        _ => full,
    }
}

/// Text cut to a width, with a mark where it is cut.
fn pad(text: &str, width: u16, right: bool) -> String {
    let (text, width) = (plain::line(text), usize::from(width));
    let text = match text.chars().count() {
        long if long > width => text.chars().take(width.saturating_sub(1)).chain(['…']).collect(),
        _ => text.into_owned(),
    };
    if right { format!("{text:>width$}") } else { format!("{text:<width$}") }
}

fn line(to: &mut Buffer, place: Rect, mark: &str, cells: impl Iterator<Item = (String, Style)>) {
    put(to, place, mark, Style::new());
    let mut x = place.x + MARK;
    for (text, style) in cells {
        let rest = Rect { x, width: place.right().saturating_sub(x), ..place };
        put(to, rest, &text, style);
        x += text.chars().count() as u16 + 1;
    }
}

/// With or without colours.
#[derive(Clone, Copy)]
pub(super) struct Palette {
    pub(super) colours: bool,
}

impl Palette {
    /// No colours if the user requested that here, or for all programs (<https://no-color.org>).
    pub(super) fn new(no_color: bool) -> Self {
        let asked = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
        Self { colours: !no_color && !asked }
    }

    fn coloured(self, colour: Color) -> Style {
        if self.colours { Style::new().fg(colour) } else { Style::new() }
    }

    pub(super) fn head(self) -> Style {
        Style::new().add_modifier(Modifier::BOLD)
    }

    pub(super) fn rule(self) -> Style {
        self.coloured(Color::Cyan)
    }

    pub(super) fn message(self) -> Style {
        Style::new().add_modifier(Modifier::REVERSED)
    }

    pub(super) fn selected(self) -> Style {
        Style::new().add_modifier(Modifier::REVERSED)
    }

    pub(super) fn column(self, sorted: bool) -> Style {
        let style = self.coloured(Color::Cyan).add_modifier(Modifier::UNDERLINED);
        if sorted { style.add_modifier(Modifier::BOLD) } else { style }
    }

    pub(super) fn cell(self, column: Column, row: &Row) -> Style {
        match column {
            Column::State => match row.line.account.state {
                Standing::On => self.coloured(Color::Green),
                Standing::Failed | Standing::Busy | Standing::Error => {
                    self.coloured(Color::Red).add_modifier(Modifier::BOLD)
                }
                Standing::Stopped | Standing::StandsBy => Style::new(),
                Standing::Starting | Standing::Off | Standing::Restarting { .. } | Standing::Unreachable => {
                    self.coloured(Color::Yellow)
                }
            },
            Column::Lost if row.lost_per_s.is_some_and(|lost| lost > 0.0) => {
                self.coloured(Color::Red).add_modifier(Modifier::BOLD)
            }
            Column::Why if row.line.account.error.is_some() => self.coloured(Color::Red),
            _ => Style::new(),
        }
    }

    pub(super) fn level(self, level: OutputLevel) -> Style {
        match level {
            OutputLevel::Error => self.coloured(Color::Red).add_modifier(Modifier::BOLD),
            OutputLevel::Warn => self.coloured(Color::Yellow),
            _ => Style::new(),
        }
    }
}
