//! Numbers of the kernel's errors, found in errors that have them.

use nix::errno::Errno;
use std::error::Error;
use std::io;
use std::sync::Arc;

/// The number of the kernel's error behind an error: of the first that has one, of itself and its sources. If none
/// has, a text of theirs may end as those of the kernel's errors do, `(os error 2)`: errors that others stand for
/// (`#[error(transparent)]`) are no sources.
///
/// ```
/// use rohrpost_modules::output::errno_of;
///
/// let error = std::fs::read("/no/such/file").unwrap_err();
/// assert_eq!(errno_of(&error), Some(2));
/// assert_eq!(errno_of(&"x".parse::<u8>().unwrap_err()), None);
/// ```
pub fn errno_of(error: &(dyn Error + 'static)) -> Option<u16> {
    let all = || std::iter::successors(Some(error), |error| behind(*error));
    match all().find_map(own_number) {
        Some(number) => u16::try_from(number).ok(),
        None => all().find_map(told_number),
    }
}

fn behind<'a>(error: &'a (dyn Error + 'static)) -> Option<&'a (dyn Error + 'static)> {
    // What an `io::Error` was made of is not its source: it stands for it.
    match io_error(error).and_then(io::Error::get_ref) {
        Some(inner) => Some(inner),
        None => error.source(),
    }
}

/// At the end of its text.
fn told_number(error: &(dyn Error + 'static)) -> Option<u16> {
    let text = error.to_string();
    let (_, number) = text.strip_suffix(')')?.rsplit_once("(os error ")?;
    number.parse().ok()
}

fn own_number(error: &(dyn Error + 'static)) -> Option<i32> {
    let number = io_error(error).and_then(io::Error::raw_os_error);
    number.or_else(|| error.downcast_ref::<Errno>().map(|errno| *errno as i32))
}

fn io_error<'a>(error: &'a (dyn Error + 'static)) -> Option<&'a io::Error> {
    let shared = || error.downcast_ref::<Arc<io::Error>>().map(|error| &**error);
    error.downcast_ref::<io::Error>().or_else(shared)
}

/// What the kernel's error of a number says: `No such file or directory`.
pub fn errno_text(number: u16) -> String {
    let text = io::Error::from_raw_os_error(number.into()).to_string();
    text.strip_suffix(&format!(" (os error {number})")).unwrap_or(&text).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, thiserror::Error)]
    enum Failed {
        #[error("the disk is full")]
        Full(#[source] Arc<io::Error>),
        #[error("cannot ask")]
        Ask(#[from] Errno),
        #[error("no number")]
        Nothing,
        #[error("deeper")]
        Deeper(#[source] Box<Failed>),
        #[error(transparent)]
        Same(io::Error),
        #[error("mailbox: {0}")]
        Told(String),
    }

    #[test]
    fn the_first_number_of_an_error_and_its_sources_is_found() {
        let full = || Failed::Full(Arc::new(io::Error::from_raw_os_error(28)));
        for (error, wanted) in [
            (full(), Some(28)),
            (Failed::from(Errno::EACCES), Some(13)),
            (Failed::Nothing, None),
            (Failed::Same(io::Error::from_raw_os_error(2)), Some(2)),
            (Failed::Deeper(Box::new(Failed::Same(io::Error::from_raw_os_error(2)))), Some(2)),
            (Failed::Told(io::Error::from_raw_os_error(12).to_string()), Some(12)),
            (Failed::Told("(os error x)".into()), None),
            (Failed::Deeper(Box::new(Failed::Deeper(Box::new(full())))), Some(28)),
            (Failed::Full(Arc::new(io::Error::other(full()))), Some(28)),
            (Failed::Full(Arc::new(io::Error::other("words"))), None),
            (Failed::Full(Arc::new(io::Error::from(io::ErrorKind::NotFound))), None),
            (Failed::Full(Arc::new(io::Error::from_raw_os_error(-1))), None),
        ] {
            assert_eq!(errno_of(&error), wanted, "{error:?}");
        }
        assert_eq!(
            [28, 5, 60_000].map(errno_text),
            ["No space left on device", "Input/output error", "Unknown error 60000"]
        );
    }
}
