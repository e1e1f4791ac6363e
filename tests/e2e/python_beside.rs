//! A program in Python beside the robot: the book's five lines to the letter, and what they cannot do.

use crate::harness::{OUTPUT, Place, Robot, python, simulated};
use crate::process::Running;
use crate::python_node::package;
use std::path::Path;

const PAGE: &str = include_str!("../../docs/src/python.md");
const USES: &str = r#"
import os, threading, rohrpost

with rohrpost.connect() as robot:
    assert "odometry.0" in robot.modules, robot.modules
    assert robot.status("motor.0").state is rohrpost.State.On
    with robot.subscribe("odometry.0", "odometry", period_s=0.05) as following:
        first, second = following.next(20.0), following.next(20.0)
    assert first.time_ns < second.time_ns and second.value["pose"]["x_m"] is not None
    with robot.stream("laser.0", "scan", expected=rohrpost.LaserScan) as scans:
        newest = scans.newest(20.0)
        assert scans.next(20.0).sequence > 0 and len(newest.value.ranges_m) > 10
    found = []
    thread = threading.Thread(target=lambda: found.append(robot.get("odometry.0", "odometry")))
    thread.start()
    thread.join()
    assert found[0][0] > 0
    for wrong in (
        lambda: robot.call("nobody.0", "drive"),
        lambda: robot.call("motor.0", "fly"),
        lambda: robot.stream("laser.0", "smell"),
        lambda: robot.call("motor.0", "drive", float("nan"), 0.0),
    ):
        try:
            wrong()
        except rohrpost.RohrpostError as error:
            print(error)
        else:
            raise AssertionError("it went well")
    child = os.fork()
    if child == 0:
        try:
            robot.status("motor.0")
        except rohrpost.Misuse:
            os._exit(7)
        os._exit(1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
    assert robot.status("motor.0").state is rohrpost.State.On, "the parent goes on"
try:
    robot.status("motor.0")
except rohrpost.Misuse as error:
    print(error)
"#;

fn run(place: &Place, package: &Path, code: &str) -> Running {
    let file = place.write("beside.py", code);
    let mut command = python(place, &[file.to_str().unwrap()]);
    command.env("PYTHONPATH", package);
    Running::start(command)
}

fn scene() -> (Place, Running, Robot) {
    let (place, mut launch, robot) = Place::running(&[&simulated(), OUTPUT]);
    robot.wait_on(&mut launch);
    (place, launch, robot)
}

#[test]
fn the_first_lines_of_the_book_read_and_call() {
    let (place, mut launch, _robot) = scene();
    let package = package(&place);
    let code = PAGE.split("```python beside.py\n").nth(1).unwrap().split("```").next().unwrap();
    assert!(code.lines().filter(|line| !line.is_empty()).count() <= 5, "{code}");
    let told = run(&place, &package, code).said().ok();
    assert_eq!(told.matches(", ").count(), 19, "{told}");
    assert!(
        place.say(&["list", "--mailboxes"]).ok().lines().all(|line| !line.contains("tool.1.")),
        "it gave back its place"
    );
    place.end(&mut launch);
}

#[test]
fn it_follows_reads_and_is_told_its_mistakes() {
    let (place, mut launch, _robot) = scene();
    let package = package(&place);
    let told = run(&place, &package, USES).said().ok();
    let lines: Vec<&str> = told.lines().collect();
    assert_eq!(lines.len(), 5, "{told}");
    for (line, words) in
        lines.iter().zip(["nobody", "has no function `fly`", "no stream `smell`", "NotFinite", "closed"])
    {
        assert!(line.contains(words), "{words}: {told}");
    }
    place.end(&mut launch);
    let none = run(&place, &package, "import rohrpost\nrohrpost.connect()\n").said();
    assert!(none.err.contains("NoConnection: no node runs here; launch one"), "{none:?}");
}
