//! Colours, which only repeat what words say; without them there is bold and reversed text.

use super::columns::Column;
use super::model::Row;
use ratatui::style::{Color, Modifier, Style};
use rohrpost::common::OutputLevel;
use rohrpost_launch::survey::Standing;

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
                Standing::Stopped => Style::new(),
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
