//! A station at a terminal: its map, and keys as a person uses them.

use crate::harness::{Place, until};
use crate::network::addresses;
use crate::terminal::Terminal;

const MAP: &str = "\
************
*          *
* ........ *
* .      . *
* ........ *
*          *
************
";

#[test]
fn a_person_sees_the_map_and_makes_up_moves_and_removes_intruders_by_keys() {
    let place = Place::new();
    place.write("lab.map", MAP);
    place.write("hosts", format!("5 {} 5500\n", addresses()[0]));
    place.write("own.toml", "# nothing besides\n");
    let words = ["station", "start", "5", "lab.map", "hosts", "--insecure", "--config", "own.toml", "--quiet"];
    let mut station = place.start(&words);
    until("the station runs", || station.out().contains("runs: ") || station.err().contains("cannot"));
    let config = place.path("own.made-5.toml");
    let watch = ["station", "watch", "--config", config.to_str().unwrap()];
    place.say(&watch).fails_with(["`station watch` draws on a terminal"]);
    let (terminal, mut watched) = Terminal::start(&place, &watch, 24, 90);
    let screen = |what: &str, words: &[&str]| {
        terminal.wait_screen(what, |screen| words.iter().all(|word| screen.contains(word)));
    };
    screen("the map", &["station 6: group 6 of 1 robot", "# ........ #", "f fake", "here"]);
    terminal.keys("f");
    screen("an intruder in the first path", &["6-1.1 set", "# F....... #", "made up", "2.50, 4.50"]);
    terminal.keys("\x1b[C\x1b[Cm");
    screen("it has moved", &["6-1.1 moved", "# ..F..... #", "4.50, 4.50"]);
    terminal.keys("\x1b[B");
    terminal.keys("f");
    screen("no path there", &["on no path of the map"]);
    terminal.keys("\x1b[Ax");
    screen("it is gone", &["6-1.1 removed", "# ........ #"]);
    terminal.keys("i");
    screen("nobody is asked", &["no robot is heard now"]);
    terminal.keys("Qn");
    screen("nobody is told to end", &["arrows move the mark"]);
    terminal.keys("q");
    assert!(watched.end().success(), "{}", terminal.drawn());
    terminal.assert_restored();
    place.end(&mut station);
}
