//! Links of nodes to the TCP router. Their clients report them; they are drawn beside the modules, so outages are
//! visible.
//!
//! ```text
//!   modules/TCP router, from NODE                a lane: on, or unreachable while packages cannot go there
//!   network/latency/TCP router, from NODE        half of the way there and back, µs
//!   network/counters/…/NODE, of the TCP router   what its client counts
//!   network/clock/NODE                           error bound of a node that has its time from there, µs
//! ```
//!
//! While such a link is down, it brings nothing new. What tells how things are right now, scans and speeds, is cleared
//! from then on until the next comes, so that nobody takes the last of it for the present. Maps, poses and ways stay:
//! they are what was.

use crate::blueprint::Tab;
use crate::error::DrawError;
use crate::scene::{Scene, entity};
use crate::states::Level;
use crate::view::{Datum, View, is};
use rerun::Clear;
use rohrpost::interfaces::{BeyondLink, BeyondState};
use rohrpost::schema::{DataItem, Description, counters};
use rohrpost_launch::survey::Standing;
use std::collections::HashMap;

/// Entities above what is true at its moment only.
const PRESENT: [&[&str]; 2] = [&["world", "scan"], &["motion"]];

/// The unit of what goes up and down beside the counters.
const MEMORY: &str = "bytes";

/// Ways to the TCP router, as all clients see theirs.
#[derive(Default)]
pub(crate) struct TcpLinks {
    /// By node.
    drawn: HashMap<String, Drawn>,
    /// When what is of its moment was cleared last, system time, ns. Several clients tell of one outage, one after the
    /// other.
    cleared_ns: u64,
}

/// What is drawn of a way.
#[derive(Clone, Copy)]
struct Drawn {
    /// Outages so far.
    outages: u64,
    is_up: bool,
}

impl View for TcpLinks {
    fn wants(&self, _: &Description, item: &DataItem) -> bool {
        is::<BeyondLink>(item)
    }

    fn draw(&mut self, scene: &mut Scene, datum: &Datum<'_>) -> Result<(), DrawError> {
        let link: BeyondLink = datum.read()?;
        let from = format!("TCP router, from {}", link.node);
        if let Some(way_ns) = link.round_trip_ns {
            scene.curve(&["network", "latency", &from], way_ns as f64 / 2e3);
        }
        if let Some(error_ns) = link.time.as_ref().and_then(|time| time.error_ns) {
            scene.curve(&["network", "clock", &link.node], error_ns as f64 / 1e3);
        }
        let name = format!("{}, of the TCP router", link.node);
        for (counter, count) in counters(&link).into_iter().filter(|(counter, _)| counter.unit != MEMORY) {
            scene.curve(&["network", "counters", &counter.name, &name], count as f64);
        }
        let now = Drawn { outages: link.outages, is_up: link.state == BeyondState::Up };
        let Some(mut before) = self.drawn.insert(link.node, now) else {
            // What was before this drawing began is not in it.
            scene.lane(&from, standing(now.is_up));
            return Ok(());
        };
        if let Some(outage) = link.outage.filter(|_| before.outages != now.outages) {
            scene.set_time(outage.began_ns);
            scene.lane(&from, standing(false));
            if outage.began_ns > self.cleared_ns {
                self.cleared_ns = outage.began_ns;
                PRESENT.iter().for_each(|parts| scene.log_event(entity(parts), &Clear::recursive()));
            }
            before.is_up = false;
        }
        if now.is_up && !before.is_up {
            // The first time it was away without ever having been there.
            if let Some((outage, ended_ns)) = link.outage.and_then(|outage| Some((outage, outage.ended_ns?))) {
                scene.set_time(ended_ns);
                let took_s = outage.duration(ended_ns).as_secs_f64();
                scene.output_line(&from, Level::Warning, &format!("there again; it was away for {took_s:.3} s"));
            }
            scene.lane(&from, standing(true));
        }
        Ok(())
    }

    fn tabs(&self) -> Vec<Tab> {
        vec![crate::network::tab()]
    }
}

fn standing(is_up: bool) -> Standing {
    if is_up { Standing::On } else { Standing::Unreachable }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::TestScene;
    use rohrpost::interface::Interface;
    use rohrpost::interfaces::{BeyondOutage, TcpInterface};
    use rohrpost::wire::append;
    use rohrpost_config::Installation;
    use std::path::Path;

    const S: u64 = 1_000_000_000;

    fn link(outages: u64, outage: Option<(u64, Option<u64>)>) -> BeyondLink {
        let outage = outage.map(|(began_ns, ended_ns)| BeyondOutage { began_ns, ended_ns });
        let away = outage.is_some_and(|outage| outage.ended_ns.is_none());
        BeyondLink {
            node: "desk".into(),
            server: "192.168.7.1:21119".into(),
            state: if away { BeyondState::Away } else { BeyondState::Up },
            why: String::new(),
            reconnects: outages,
            round_trip_ns: None,
            time_error_ns: None,
            time: None,
            outages,
            outage,
            waiting_bytes: 0,
            unknown_parts: 0,
            sent: Vec::new(),
            received: Vec::new(),
        }
    }

    /// Draws what the client of the desk tells.
    fn draw(drawing: &mut TestScene, view: &mut TcpLinks, told: &BeyondLink) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/demo-tcp.toml");
        let installation = Installation::load(&path).unwrap();
        let (mut bytes, description) = (Vec::new(), TcpInterface::description());
        append(&mut bytes, told).unwrap();
        let item = description.data_item("link").unwrap();
        assert!(view.wants(&description, item));
        let from = installation.tcp_client_of("desk").unwrap();
        let datum = Datum { from, module: "tcp.2", item, installation: &installation, bytes: &bytes };
        view.draw(&mut drawing.scene, &datum).unwrap();
    }

    #[test]
    fn an_outage_is_drawn_once_from_its_beginning_to_its_end_and_clears_what_is_of_the_moment() {
        let lane = "/modules/TCP\\ router\\,\\ from\\ desk";
        for (told, lanes, clears, why) in [
            (vec![link(0, None), link(0, None)], 1, 0, "nothing happens"),
            (vec![link(0, None), link(1, Some((2 * S, Some(3 * S))))], 3, 1, "a short one is told when it is over"),
            (
                vec![link(0, None), link(1, Some((2 * S, None))), link(1, Some((2 * S, Some(3 * S))))],
                3,
                1,
                "a long one",
            ),
            (vec![link(1, Some((S, Some(2 * S)))), link(1, Some((S, Some(2 * S))))], 1, 0, "it was before"),
        ] {
            let (mut drawing, mut view) = (TestScene::new(), TcpLinks::default());
            drawing.rows();
            for link in &told {
                draw(&mut drawing, &mut view, link);
            }
            let rows = drawing.rows();
            let of = |entity: &str| rows.get(entity).copied().unwrap_or(0);
            // The colours of the lane are one row more.
            assert_eq!((of(lane), of("/world/scan"), of("/motion")), (lanes + 1, clears, clears), "{why}: {rows:?}");
        }
    }
}
