//! The terminal in raw mode: opened, read, and restored.

use crate::terminal::Failure;
use ratatui::DefaultTerminal;
use ratatui::backend::CrosstermBackend;
use ratatui::crossterm::event::{self, Event};
use ratatui::crossterm::terminal::{EnterAlternateScreen, LeaveAlternateScreen, disable_raw_mode, enable_raw_mode};
use ratatui::crossterm::{cursor, execute};
use std::sync::mpsc::Receiver;

/// The terminal in raw mode; restored however the program ends.
pub(crate) struct RawTerminal(pub(crate) DefaultTerminal);

impl RawTerminal {
    pub(crate) fn new() -> Result<Self, Failure> {
        let hook = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            // First, so that the panic's message is visible.
            give_back();
            hook(panic);
        }));
        Self::draw().map_err(|error| {
            give_back();
            format!("cannot draw on this terminal: {error}").into()
        })
    }

    fn draw() -> std::io::Result<Self> {
        enable_raw_mode()?;
        execute!(std::io::stdout(), EnterAlternateScreen)?;
        ratatui::Terminal::new(CrosstermBackend::new(std::io::stdout())).map(Self)
    }
}

impl Drop for RawTerminal {
    fn drop(&mut self) {
        give_back();
    }
}

/// A terminal that is gone cannot be restored; that is no error.
fn give_back() {
    let _ = disable_raw_mode();
    let _ = execute!(std::io::stdout(), LeaveAlternateScreen, cursor::Show);
}

/// Terminal events from a separate thread: reading from a closed terminal never returns (crossterm takes
/// its end for an interruption), and must not keep the program from ending.
pub(crate) fn keyboard() -> Result<Receiver<Event>, Failure> {
    let (sender, receiver) = std::sync::mpsc::channel();
    let read = move || {
        while let Ok(event) = event::read() {
            if sender.send(event).is_err() {
                break;
            }
        }
    };
    std::thread::Builder::new().name("keyboard".into()).spawn(read)?;
    Ok(receiver)
}
