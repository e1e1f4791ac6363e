//! The terminal while it is ours: opened, read, and given back as it was.

use crate::terminal::Failure;
use ratatui::DefaultTerminal;
use ratatui::backend::CrosstermBackend;
use ratatui::crossterm::event::{self, Event};
use ratatui::crossterm::terminal::{EnterAlternateScreen, LeaveAlternateScreen, disable_raw_mode, enable_raw_mode};
use ratatui::crossterm::{cursor, execute};
use std::sync::mpsc::Receiver;

/// The terminal while it is ours; given back as it was, whatever ends us.
pub(super) struct Opened(pub(super) DefaultTerminal);

impl Opened {
    pub(super) fn new() -> Result<Self, Failure> {
        let hook = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            // First, so that what it says is to be read.
            give_back();
            hook(panic);
        }));
        Self::draw().map_err(|error| {
            give_back();
            format!("this terminal cannot be drawn on: {error}; say `top --once`").into()
        })
    }

    fn draw() -> std::io::Result<Self> {
        enable_raw_mode()?;
        execute!(std::io::stdout(), EnterAlternateScreen)?;
        ratatui::Terminal::new(CrosstermBackend::new(std::io::stdout())).map(Self)
    }
}

impl Drop for Opened {
    fn drop(&mut self) {
        give_back();
    }
}

/// A terminal that is gone cannot be given back, and that is no error.
fn give_back() {
    let _ = disable_raw_mode();
    let _ = execute!(std::io::stdout(), LeaveAlternateScreen, cursor::Show);
}

/// What the terminal says, from a thread of its own: reading from a terminal that was closed never returns (crossterm takes
/// its end for an interruption), and must not keep us from ending.
pub(super) fn keyboard() -> Result<Receiver<Event>, Failure> {
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
