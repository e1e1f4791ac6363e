//! Where log control listens: `control` and `control-security` of `[record]`.

use crate::reader::Section;
use std::net::SocketAddr;

/// Where log control listens. Beyond this computer only if the file says that it is not protected.
pub(crate) fn read(section: &Section<'_>) -> Option<SocketAddr> {
    const EXAMPLE: &str = "127.0.0.1:21121";
    let item = section.get("control");
    let security = section.get("control-security");
    let is_open = security.as_ref().and_then(|item| item.choice(&[("none", ())])).is_some();
    let Some(item) = item else {
        if let Some(security) = security {
            security.report(format!("`control-security` is of no use without `control = \"{EXAMPLE}\"`; drop it"));
        }
        return None;
    };
    let text = item.text(EXAMPLE)?;
    let address = text.parse::<SocketAddr>().ok().filter(|address| address.port() > 0 && !address.ip().is_multicast());
    let Some(address) = address else {
        return item.wrong(&format!("the address and port to listen at, such as `control = \"{EXAMPLE}\"`"));
    };
    if !is_loopback(address) && !is_open {
        item.report(format!(
            "`control` {address} takes commands from other computers, and log control knows no password; write \
             `control = \"127.0.0.1:{}\"`, or `control-security = \"none\"` beside it if nobody else reaches this \
             address",
            address.port()
        ));
    }
    Some(address)
}

fn is_loopback(address: SocketAddr) -> bool {
    address.ip().to_canonical().is_loopback()
}

/// What there is to say of an address that other computers reach.
pub(crate) fn note(control: SocketAddr) -> Option<String> {
    (!is_loopback(control)).then(|| {
        format!(
            "control-security = \"none\": any computer that reaches {control} may switch the recording off; use a \
             network that nobody else reaches"
        )
    })
}
