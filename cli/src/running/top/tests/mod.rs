//! The screen as a user sees it, word for word, and the effects of keys.
//!
//! `UPDATE_GOLDEN=1 cargo test --bin rohrpost top` rewrites the expected screens; read the diff before you commit.

mod robot;

use super::app::{App, Prompt, Screen, ScreenAction};
use super::columns::Column;
use super::text;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use robot::Robot;
use rohrpost::common::OutputLevel;
use std::path::Path;

/// Compares a screen with its golden file, or writes it.
#[track_caller]
fn check(name: &str, screen: &str) {
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/running/top/golden").join(format!("{name}.txt"));
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::write(&golden, screen).unwrap();
        return;
    }
    let expected = std::fs::read_to_string(&golden).unwrap_or_default();
    assert!(screen == expected, "{}\n--- expected\n{expected}--- drawn\n{screen}", golden.display());
}

/// Types keys, one a letter; `\n` is Enter, `\x1b` Esc, `\x08` Backspace, `v` and `^` the arrows.
fn press(app: &mut App, robot: &Robot, keys: &str) -> Option<ScreenAction> {
    let code = |letter| match letter {
        '\n' => KeyCode::Enter,
        '\x1b' => KeyCode::Esc,
        '\x08' => KeyCode::Backspace,
        'v' => KeyCode::Down,
        '^' => KeyCode::Up,
        letter => KeyCode::Char(letter),
    };
    keys.chars().fold(None, |_, letter| app.key(KeyEvent::from(code(letter)), &robot.model))
}

fn order(app: &App, robot: &Robot) -> Vec<String> {
    app.rows(&robot.model).iter().map(|row| row.line.module.clone()).collect()
}

#[test]
fn screens_match_their_golden_files() {
    let robot = Robot::new();
    let mut app = App::new();
    press(&mut app, &robot, "v");
    check("table-80x24", &robot.screen(&mut app, 80, 24));
    check("table-160x50", &robot.screen(&mut app, 160, 50));
    check("table-40x12", &robot.screen(&mut app, 40, 12));
    press(&mut app, &robot, "\n");
    check("details-80x50", &robot.screen(&mut app, 80, 50));
    press(&mut app, &robot, "?");
    check("help-80x50", &robot.screen(&mut app, 80, 50));
    check("once", &text::table(&robot.model));
}

#[test]
fn json_has_the_content_of_the_screen() {
    let robot = Robot::new();
    let json = serde_json::to_value(&robot.model).unwrap();
    assert_eq!(
        (&json["installation"], &json["node"], &json["interval_s"]),
        (&"demo".into(), &"main".into(), &1.0.into())
    );
    assert_eq!(json["states"], serde_json::json!({ "on": 2, "off": 1, "error": 1, "stopped": 1 }));
    assert_eq!((&json["received_per_s"], &json["lost"], &json["lost_per_s"]), (&86.0.into(), &9.into(), &7.0.into()));
    let mapper = &json["modules"][2];
    assert_eq!(mapper["module"], "mapper.0");
    assert_eq!((&mapper["state"], &mapper["error"]), (&"error".into(), &"no scan has come for 5 s".into()));
    assert_eq!((&mapper["sent_per_s"], &mapper["cpu_percent"]), (&1.0.into(), &40.0.into()));
    let motor = &json["modules"][1];
    let nobodys = (&motor["lost"], &motor["lost_by_cause"], &motor["replaced"], &motor["lost_per_s"]);
    assert_eq!(nobodys, (&0.into(), &serde_json::json!({}), &12.into(), &0.0.into()), "replaced is not lost");
    assert_eq!(json["replaced"], 12);
    assert_eq!((&mapper["lost"], &mapper["lost_by_cause"]), (&9.into(), &serde_json::json!({ "refused": 9 })));
    let gui = &json["modules"][4];
    for key in ["pid", "sent_per_s", "cpu_percent", "memory_bytes", "waited_p99_s", "uptime_s"] {
        assert!(gui[key].is_null(), "{key} of a module that does not run: {gui}");
    }
    assert_eq!(json["modules"][3]["sends_to"][0]["packages_per_s"], 12.0);
    assert_eq!(json["modules"][1]["receives_from"][0]["module"], "pilot.0");
    assert_eq!(json["mailboxes"].as_array().unwrap().len(), 4);
}

#[test]
fn the_first_observation_has_no_rates() {
    let robot = Robot::new();
    let model = super::Model::new(&robot.installation, "main", &["main"], &robot.earlier, None);
    assert_eq!((model.interval_s, model.received_per_s), (None, None));
    assert!(model.modules.iter().all(|row| row.sent_per_s.is_none() && row.cpu_percent.is_none()));
    assert!(model.modules.iter().all(|row| row.waited_p99_s.is_none() && row.lost_per_s.is_none()));
}

#[test]
fn no_terminal_is_too_small_or_too_large() {
    let robot = Robot::new();
    for keys in ["", "\n", "?", "/x", "r", "/nobody\n"] {
        let mut app = App::new();
        press(&mut app, &robot, "v");
        press(&mut app, &robot, keys);
        for columns in [1, 2, 3, 5, 12, 21, 40, 300] {
            for rows in [1, 2, 3, 4, 5, 7, 8, 9, 12, 25, 100] {
                robot.screen(&mut app, columns, rows);
            }
        }
    }
}

#[test]
fn arrows_and_letters_select() {
    let robot = Robot::new();
    let mut app = App::new();
    for (keys, selected) in [
        ("v", "motor.0"),
        ("j", "mapper.0"),
        ("k", "motor.0"),
        ("^^^", "output.0"),
        ("G", "gui.0"),
        ("vv", "gui.0"),
        ("g", "output.0"),
    ] {
        assert_eq!(press(&mut app, &robot, keys), None);
        let rows = app.rows(&robot.model);
        assert_eq!(rows[app.selected_at(&rows)].line.module, selected, "{keys:?}");
    }
}

#[test]
fn sorting_puts_problems_first_and_keeps_the_selection() {
    let robot = Robot::new();
    let mut app = App::new();
    app.columns = Column::ALL.to_vec();
    let configured = ["output.0", "motor.0", "mapper.0", "pilot.0", "gui.0"];
    press(&mut app, &robot, "v");
    for (column, first) in [
        (Column::Module, "gui.0"),
        (Column::Node, "output.0"),
        (Column::State, "mapper.0"),
        (Column::Class, "gui.0"),
        (Column::Priority, "motor.0"),
        (Column::Scheduling, "gui.0"),
        (Column::In, "mapper.0"),
        (Column::Out, "motor.0"),
        (Column::Waiting, "mapper.0"),
        (Column::Lost, "mapper.0"),
        (Column::P50, "motor.0"),
        (Column::P99, "motor.0"),
        (Column::Restarts, "pilot.0"),
        (Column::Cpu, "mapper.0"),
    ] {
        press(&mut app, &robot, "s");
        assert_eq!((app.sort, order(&app, &robot)[0].as_str()), (Some(column), first));
        let rows = app.rows(&robot.model);
        assert_eq!(rows[app.selected_at(&rows)].line.module, "motor.0");
    }
    press(&mut app, &robot, "S");
    assert_eq!(order(&app, &robot).last().unwrap(), "mapper.0");
    press(&mut app, &robot, "ssss");
    assert_eq!((app.sort, order(&app, &robot)), (None, configured.map(String::from).to_vec()));
}

#[test]
fn a_filter_is_typed_kept_restored_and_cleared() {
    let robot = Robot::new();
    let mut app = App::new();
    press(&mut app, &robot, "/odom");
    assert_eq!(order(&app, &robot), ["motor.0"], "an alias counts");
    press(&mut app, &robot, "x\x08\n");
    assert_eq!((app.filter.as_str(), &app.prompt), ("odom", &Prompt::None));
    assert_eq!(
        press(&mut app, &robot, "f"),
        Some(ScreenAction::Switch(robot.name("motor.0"), false)),
        "of those shown"
    );
    press(&mut app, &robot, "/q\x1b");
    assert_eq!((app.filter.as_str(), order(&app, &robot).len()), ("odom", 1), "Esc takes back what was typed");
    press(&mut app, &robot, "/q\n");
    assert_eq!(press(&mut app, &robot, "o"), None, "no module is shown, so none is meant");
    press(&mut app, &robot, "\x1b");
    assert_eq!(order(&app, &robot).len(), 5);
}

#[test]
fn keys_request_their_actions() {
    let robot = Robot::new();
    let (motor, pilot) = (robot.name("motor.0"), robot.name("pilot.0"));
    let mut app = App::new();
    press(&mut app, &robot, "v");
    assert_eq!(press(&mut app, &robot, "o"), Some(ScreenAction::Switch(motor, true)));
    assert_eq!(press(&mut app, &robot, "f"), Some(ScreenAction::Switch(motor, false)));
    press(&mut app, &robot, "\n");
    assert_eq!(app.screen, Screen::Details(motor));
    assert_eq!(press(&mut app, &robot, "f"), Some(ScreenAction::Switch(motor, false)), "also among the details");
    press(&mut app, &robot, "\x1bjj");
    assert_eq!(press(&mut app, &robot, "r"), None, "it asks first");
    assert_eq!(press(&mut app, &robot, "n"), None);
    assert_eq!(press(&mut app, &robot, "r\x1b"), None);
    assert_eq!(press(&mut app, &robot, "ry"), Some(ScreenAction::Restart(pilot)));
    for keys in ["q", "?q", "\nq"] {
        assert_eq!(press(&mut App::new(), &robot, keys), Some(ScreenAction::Quit), "{keys:?}");
    }
    let control_c = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
    for keys in ["", "/x", "r", "?"] {
        let mut app = App::new();
        press(&mut app, &robot, keys);
        assert_eq!(app.key(control_c, &robot.model), Some(ScreenAction::Quit), "{keys:?}");
    }
    let control_o = KeyEvent::new(KeyCode::Char('o'), KeyModifiers::CONTROL);
    assert_eq!(App::new().key(control_o, &robot.model), None);
}

#[test]
fn output_is_filtered_by_module_and_level() {
    let robot = Robot::new();
    let mut app = App::new();
    assert!(!robot.screen(&mut app, 80, 24).contains("too old"), "debug is not shown at first");
    press(&mut app, &robot, "L");
    assert_eq!(app.lines.level, OutputLevel::Debug);
    assert!(robot.screen(&mut app, 80, 24).contains("too old"));
    press(&mut app, &robot, "vvl");
    let screen = robot.screen(&mut app, 80, 24);
    assert!(screen.contains("debug and above, mapper.0") && !screen.contains("too old"), "{screen}");
    assert!(screen.contains("mapper.0: is in error: no scan"), "{screen}");
    press(&mut app, &robot, "l");
    assert!(robot.screen(&mut app, 80, 24).contains("too old"));
    press(&mut app, &robot, "LL");
    assert_eq!(app.lines.level, OutputLevel::Error);
    assert!(!robot.screen(&mut app, 80, 24).contains("pilot.0: runs without"), "a warning is no error");
}
