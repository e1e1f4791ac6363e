//! Impairments as people type them: an accepted text is printed in a form that reads back as the same.

use rohrpost_routers::impair::{Impairment, ImpairmentSettings, ImpairmentStep};

pub(crate) fn run(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let settings = match text.parse::<ImpairmentSettings>() {
        Ok(settings) => settings,
        Err(error) => return assert!(!error.to_string().is_empty()),
    };
    let printed = settings.to_string();
    assert_eq!(printed.parse(), Ok(settings), "{printed}");
    let mut impairment = Impairment::new(settings, 1);
    impairment.push(0, (), data);
    while let ImpairmentStep::Send { datagram, .. } = impairment.poll(u64::MAX) {
        assert_eq!(datagram.len(), data.len());
    }
}
