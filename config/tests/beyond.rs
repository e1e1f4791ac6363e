//! Meaning of a node that is reached through the TCP router alone.

use rohrpost_config::{Installation, Reach, TimeSource, bounds};
use rohrpost_mailbox::Name;
use std::path::Path;

fn parse(text: &str) -> Installation {
    Installation::parse(text, Path::new("beyond.toml")).unwrap_or_else(|errors| panic!("{errors}"))
}

fn field() -> Installation {
    parse(include_str!("beyond.toml"))
}

#[test]
fn it_comes_behind_those_of_the_lan_and_is_none_of_them() {
    let field = field();
    let nodes: Vec<_> = field.nodes.iter().map(|node| (node.name.as_str(), node.reach)).collect();
    assert_eq!(nodes, [("base", Reach::Lan), ("brain", Reach::Lan), ("laptop", Reach::Tcp)], "the file names it first");
    assert_eq!(field.lan_nodes().len(), 2);
    assert_eq!(
        (field.node_index("laptop"), field.lan_index("laptop"), field.lan_index("brain")),
        (Some(2), None, Some(1))
    );
    assert_eq!(field.router_of("laptop"), None);
    assert!(field.router_of("base").is_some() && field.tcp_client_of("laptop").is_some());
    let modules: Vec<String> = field.modules_on("laptop").map(|module| field.classes.format(module.name)).collect();
    assert_eq!(modules, ["tcp.2", "gui.0"]);
    let TimeSource::Master { masters, .. } = &field.time else { panic!("{:?}", field.time) };
    assert_eq!(masters, &[0, 1], "it is never the master of time");
}

#[test]
fn packages_to_it_and_from_it_go_beyond() {
    let field = field();
    let name = |text: &str| field.classes.parse_name(text).unwrap();
    let is_in =
        |ranges: &[(Name, Name)], name: Name| ranges.iter().any(|(first, last)| (*first..=*last).contains(&name));
    for (text, node) in [("gui.0", "laptop"), ("tool.100", "laptop"), ("motor.0", "base"), ("pilot.0.2", "brain")] {
        let name = name(text);
        assert!(is_in(&field.names_on(node), name), "{text} is hosted on {node}");
        for other in ["base", "brain", "laptop"].into_iter().filter(|other| *other != node) {
            let routes = field.routes_from(other);
            let by_lan = routes.iter().any(|route| (route.first..=route.last).contains(&name));
            assert_eq!(by_lan, node != "laptop", "{text} from {other}, by the LAN");
            assert!(is_in(&field.names_beyond(other), name), "{text} from {other}, if the LAN does not have it");
        }
    }
    assert_eq!(bounds(&field), [], "nobody can say how late TCP is");
}

#[test]
fn one_computer_and_a_laptop_need_neither_a_network_nor_a_master_of_time() {
    let text = include_str!("beyond.toml");
    let brain = "[nodes.brain]\naddress = \"10.77.0.2\"\ntools = [32, 63]\n\n";
    let text = text.replace(brain, "").replace("node = \"brain\"", "node = \"base\"");
    let text = text.replace("[network]\nsecurity = \"none\"\n\n[time]\nsource = \"master\"\n\n", "");
    let text = text.replace("address = \"10.77.0.1\"\n", "");
    let alone = parse(&text);
    assert_eq!((alone.network, alone.router_of("base"), alone.time.clone()), (None, None, TimeSource::Local));
    assert_ne!(alone.digest().system, field().digest().system);
}
