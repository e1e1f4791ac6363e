//! The user's selections, and how keys change them. Pure: a key's further effect is returned as a
//! [`ScreenAction`].

use super::columns::Column;
use super::model::{Model, Row};
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use rohrpost::Name;
use rohrpost::common::OutputLevel;
use rohrpost::output::OutputLine;

/// Lines that a page key moves by.
const PAGE: usize = 10;

/// The selections: what is shown, and how.
pub(super) struct App {
    pub(super) screen: Screen,
    pub(super) prompt: Prompt,
    /// None: in the order of the configuration.
    pub(super) sort: Option<Column>,
    pub(super) columns: Vec<Column>,
    pub(super) reversed: bool,
    /// Only modules with this text in their name.
    pub(super) filter: String,
    pub(super) selected: Option<Name>,
    /// First visible line of a text longer than the screen: details, help.
    pub(super) scroll: usize,
    pub(super) paused: bool,
    pub(super) lines: LineFilter,
    /// The result of the last key.
    pub(super) message: Option<String>,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Screen {
    Table,
    Details(Name),
    Map,
    Help,
}

/// The question in the last line.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) enum Prompt {
    None,
    /// The filter is being typed; this was the previous one.
    Filter(String),
    /// Restart it?
    Restart(Name),
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct LineFilter {
    pub(super) level: OutputLevel,
    /// Only lines of this module.
    pub(super) module: Option<Name>,
}

/// A key's effect outside the screen.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum ScreenAction {
    Quit,
    Switch(Name, bool),
    Restart(Name),
}

impl App {
    pub(super) fn new() -> Self {
        Self {
            screen: Screen::Table,
            prompt: Prompt::None,
            sort: None,
            columns: vec![Column::Module],
            reversed: false,
            filter: String::new(),
            selected: None,
            scroll: 0,
            paused: false,
            lines: LineFilter { level: OutputLevel::Info, module: None },
            message: None,
        }
    }

    /// The modules that are shown, in their order.
    pub(super) fn rows<'m>(&self, model: &'m Model) -> Vec<&'m Row> {
        let holds = |row: &&Row| {
            let names = std::iter::once(&row.line.module).chain(&row.line.aliases);
            self.filter.is_empty() || names.into_iter().any(|name| name.contains(&self.filter))
        };
        let mut rows: Vec<&Row> = model.modules.iter().filter(holds).collect();
        if let Some(column) = self.sort {
            // A stable sort: equal modules keep the order of the configuration.
            rows.sort_by(|a, b| column.compare(a, b));
        }
        if self.reversed {
            rows.reverse();
        }
        rows
    }

    /// The selected module among these, or else the first.
    pub(super) fn selected_at(&self, rows: &[&Row]) -> usize {
        rows.iter().position(|row| Some(row.name) == self.selected).unwrap_or(0)
    }

    pub(super) fn key(&mut self, key: KeyEvent, model: &Model) -> Option<ScreenAction> {
        if key.modifiers.contains(KeyModifiers::CONTROL) {
            return (key.code == KeyCode::Char('c')).then_some(ScreenAction::Quit);
        }
        match std::mem::replace(&mut self.prompt, Prompt::None) {
            Prompt::Filter(before) => {
                self.type_filter(key.code, before);
                None
            }
            Prompt::Restart(name) => {
                let yes = matches!(key.code, KeyCode::Char('y' | 'Y'));
                self.message = (!yes).then(|| "not restarted".into());
                yes.then_some(ScreenAction::Restart(name))
            }
            Prompt::None => {
                self.message = None;
                self.command(key.code, model)
            }
        }
    }

    fn type_filter(&mut self, key: KeyCode, before: String) {
        match key {
            KeyCode::Enter => return,
            KeyCode::Esc => {
                self.filter = before;
                return;
            }
            KeyCode::Backspace => {
                self.filter.pop();
            }
            KeyCode::Char(letter) => self.filter.push(letter),
            _ => {}
        }
        self.prompt = Prompt::Filter(before);
    }

    fn command(&mut self, key: KeyCode, model: &Model) -> Option<ScreenAction> {
        match (key, self.screen) {
            (KeyCode::Char('q'), _) => return Some(ScreenAction::Quit),
            (KeyCode::Char('?'), screen) => {
                self.show(if screen == Screen::Help { Screen::Table } else { Screen::Help })
            }
            (KeyCode::Char('m'), screen) => self.show(if screen == Screen::Map { Screen::Table } else { Screen::Map }),
            (KeyCode::Esc | KeyCode::Backspace | KeyCode::Left, Screen::Details(_) | Screen::Map | Screen::Help) => {
                self.show(Screen::Table);
            }
            // From the table, Esc leads back to all modules.
            (KeyCode::Esc, Screen::Table) => self.filter.clear(),
            (KeyCode::Char('p'), _) => self.paused = !self.paused,
            (KeyCode::Char('l'), _) => {
                let target = self.target(model);
                self.lines.module = if self.lines.module == target { None } else { target };
            }
            (KeyCode::Char('L'), _) => self.lines.level = next_level(self.lines.level),
            (KeyCode::Char('o'), _) => return self.target(model).map(|name| ScreenAction::Switch(name, true)),
            (KeyCode::Char('f'), _) => return self.target(model).map(|name| ScreenAction::Switch(name, false)),
            (KeyCode::Char('r'), _) => self.prompt = self.target(model).map_or(Prompt::None, Prompt::Restart),
            (KeyCode::Enter | KeyCode::Right, Screen::Table) => {
                let name = self.target(model)?;
                self.show(Screen::Details(name));
            }
            (key, Screen::Table) => self.table_key(key, model),
            (key, Screen::Details(_) | Screen::Map | Screen::Help) => self.scroll_by(key),
        }
        None
    }

    fn table_key(&mut self, key: KeyCode, model: &Model) {
        let rows = self.rows(model);
        let (at, last) = (self.selected_at(&rows), rows.len().saturating_sub(1));
        let to = match key {
            KeyCode::Down | KeyCode::Char('j') => at + 1,
            KeyCode::Up | KeyCode::Char('k') => at.saturating_sub(1),
            KeyCode::PageDown => at + PAGE,
            KeyCode::PageUp => at.saturating_sub(PAGE),
            KeyCode::Home | KeyCode::Char('g') => 0,
            KeyCode::End | KeyCode::Char('G') => last,
            KeyCode::Char('s') => return self.sort_on(),
            KeyCode::Char('S') => {
                self.reversed = !self.reversed;
                return;
            }
            KeyCode::Char('/') => {
                self.prompt = Prompt::Filter(self.filter.clone());
                return;
            }
            _ => return,
        };
        self.selected = rows.get(to.min(last)).map(|row| row.name);
    }

    fn scroll_by(&mut self, key: KeyCode) {
        self.scroll = match key {
            KeyCode::Down | KeyCode::Char('j') => self.scroll + 1,
            KeyCode::Up | KeyCode::Char('k') => self.scroll.saturating_sub(1),
            KeyCode::PageDown | KeyCode::Char(' ') => self.scroll + PAGE,
            KeyCode::PageUp => self.scroll.saturating_sub(PAGE),
            KeyCode::Home | KeyCode::Char('g') => 0,
            _ => self.scroll,
        };
    }

    fn show(&mut self, screen: Screen) {
        (self.screen, self.scroll) = (screen, 0);
    }

    /// Sorts by the next column; after the last one, by the order of the configuration again.
    fn sort_on(&mut self) {
        let at = self.sort.and_then(|column| self.columns.iter().position(|known| *known == column));
        self.sort = self.columns.get(at.map_or(0, |at| at + 1)).copied();
        self.reversed = false;
    }

    /// The module that keys apply to.
    fn target(&self, model: &Model) -> Option<Name> {
        if let Screen::Details(name) = self.screen {
            return Some(name);
        }
        let rows = self.rows(model);
        rows.get(self.selected_at(&rows)).map(|row| row.name)
    }
}

/// Cycles from the usual level to the more verbose ones, then from errors alone back to it.
fn next_level(level: OutputLevel) -> OutputLevel {
    match level {
        OutputLevel::Info => OutputLevel::Debug,
        OutputLevel::Debug => OutputLevel::Trace,
        OutputLevel::Trace => OutputLevel::Error,
        OutputLevel::Error => OutputLevel::Warn,
        OutputLevel::Warn => OutputLevel::Info,
    }
}

impl LineFilter {
    pub(super) fn passes(&self, line: &OutputLine) -> bool {
        line.level <= self.level && self.module.is_none_or(|module| module == line.module())
    }
}
