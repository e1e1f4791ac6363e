//! `alone = true` in `calls`: nobody else commands that module. Rules of access follow from it.

use crate::access::{Access, AccessRule, Commanded};
use crate::classes::{ClassTable, GUI, TOOL};
use crate::gui::Gui;
use crate::module::{Lines, Module};
use crate::reader::Reader;
use rohrpost_mailbox::Name;

impl Access {
    /// Access by these rules, and by those that follow from `alone = true`:
    ///
    /// - the name is commanded by its caller's class,
    /// - each other name of that process without a rule by those that call it, by the caller, by tools, and by the GUI
    ///   if that shows it: what may command a name of a process may switch the process off.
    pub(crate) fn with_alone(
        self,
        modules: &[Module],
        lines: &[Lines],
        gui: &Gui,
        classes: &ClassTable,
        reader: &Reader<'_>,
    ) -> Self {
        let each = modules.iter().zip(lines);
        let alone = each.flat_map(|(caller, lines)| lines.alone.iter().map(move |(to, line)| (caller, *to, *line)));
        let alone: Vec<(&Module, Name, usize)> = alone.collect();
        let rule = |name, callers, line| AccessRule { commanded: Commanded::Module(name), callers, line };
        let mut derived = Vec::new();
        for (caller, to, line) in &alone {
            if !self.is_refused((caller, *to, *line), modules, classes, reader) {
                derived.push(rule(*to, [caller.name.class()].into_iter().collect(), *line));
            }
        }
        for host in modules {
            let guards: Vec<_> = alone.iter().filter(|(_, to, _)| host.names().any(|name| name == *to)).collect();
            let Some((.., line)) = guards.first() else { continue };
            let is_guarded = |name: &Name| guards.iter().any(|(_, to, _)| to == name) || self.of(*name).is_some();
            for name in host.names().filter(|name| !is_guarded(name)) {
                let callers = modules.iter().filter(|module| module.calls.contains(&name));
                let callers = callers.chain(guards.iter().map(|(guard, ..)| *guard)).map(|module| module.name.class());
                let is_shown = gui.show.iter().any(|show| show.from == name);
                let people = [Some(TOOL), is_shown.then_some(GUI)].into_iter().flatten();
                let people = people.filter_map(|class| classes.id(class));
                derived.push(rule(name, callers.chain(people).collect(), *line));
            }
        }
        if derived.is_empty() { self } else { Self::new(self.rules().iter().copied().chain(derived).collect()) }
    }

    /// Reports what contradicts `alone`.
    fn is_refused(
        &self,
        (caller, to, line): (&Module, Name, usize),
        modules: &[Module],
        classes: &ClassTable,
        reader: &Reader<'_>,
    ) -> bool {
        let (by, name) = (classes.format(caller.name), classes.format(to));
        let told = |why: String| reader.report(line, format!("module `{by}` calls `{name}` alone, {why}"));
        let rule = self.of(to).filter(|rule| rule.commanded == Commanded::Module(to));
        if let Some(rule) = rule {
            told(format!("and [access] in line {} says which classes may command it; drop one of them", rule.line));
        }
        let mut others = modules.iter().filter(|other| other.name != caller.name && other.calls.contains(&to));
        let other = others.next();
        if let Some(other) = other {
            let other = classes.format(other.name);
            told(format!("and `{other}` calls it, too; drop it from the `calls` of `{other}`, or drop `alone`"));
        }
        rule.is_some() || other.is_some()
    }
}

#[cfg(test)]
mod tests {
    use crate::Installation;
    use rohrpost_mailbox::Name;

    const FILE: &str = "installation = \"alone\"\n[system]\nname = \"robot\"\nid = 1\n[classes]\nmotor = { id = 220 }\n\
                        wormhole = { id = 210 }\nlaser = { id = 150 }\nodometry = { id = 148 }\n\
                        camera = { id = 146 }\ngui = { id = 40 }\npilot = { id = 140 }\n\
                        tool = { id = 16 }\n[nodes.main]\n[access]\nodometry = [\"tool\"]\n\
                        [[module]]\nname = \"motor.1\"\n\
                        aliases = [\"laser.0\", \"odometry.0\", \"camera.0\"]\nprogram = \"sim\"\n\
                        [[module]]\nname = \"wormhole.0\"\naliases = [\"motor.0\"]\nprogram = \"wormhole\"\n\
                        calls = [{ to = \"motor.1\", alone = true }]\n\
                        [[module]]\nname = \"pilot.0\"\nprogram = \"pilot\"\ncalls = [\"laser.0\", \"motor.0\"]\n\
                        [gui]\nshow = [{ from = \"camera.0\" }]\n";

    fn read(changes: &[(&str, &str)]) -> Result<Installation, String> {
        let text = changes.iter().fold(FILE.to_owned(), |text, (old, new)| text.replacen(old, new, 1));
        Installation::parse(&text, "alone.toml".as_ref()).map_err(|errors| errors.to_string())
    }

    #[test]
    fn one_module_commands_the_name_and_the_others_of_its_process_stay_with_those_that_call_them() {
        let installation = read(&[]).unwrap();
        let [motor, driven] = [1, 0].map(|instance| Name::new(1, 220, instance, 0));
        let [laser, odometry, camera] = [150, 148, 146].map(|class| Name::new(1, class, 0, 0));
        let [wormhole, pilot, tool, gui] = [210, 140, 16, 40].map(|class| Name::new(1, class, 1, 1));
        for (from, to, may, why) in [
            (wormhole, motor, true, "it is the one"),
            (pilot, motor, false, "nobody else"),
            (tool, motor, false, "nor a person past it"),
            (pilot, driven, true, "another process of the class has no rule"),
            (pilot, laser, true, "its file says that it calls it"),
            (tool, laser, true, "people ask the scanner"),
            (wormhole, laser, true, "the one may switch the process off by any name"),
            (Name::new(1, 220, 0, 1), laser, false, "what does not call it has no business there"),
            (gui, camera, true, "the GUI shows it"),
            (gui, laser, false, "and not this"),
            (wormhole, odometry, false, "a line of [access] stands"),
        ] {
            assert_eq!(installation.access_against(from, to).is_none(), may, "{why}");
        }
    }

    #[test]
    fn what_contradicts_it_is_a_mistake_and_says_so_once() {
        for (old, new, words) in [
            (
                "odometry = [\"tool\"]",
                "odometry = []\n\"motor.1\" = [\"wormhole\"]",
                "[access] in line 17 says which classes may",
            ),
            ("[\"laser.0\", \"motor.0\"]", "[\"motor.1\"]", "and `pilot.0` calls it, too; drop it from the `calls`"),
            ("alone = true", "alone = true, subscribes = true", "`alone` is of no use beside `subscribes = true`"),
        ] {
            let told = read(&[(old, new)]).unwrap_err();
            assert!(told.contains(words) && told.lines().count() == 1, "{words}: {told}");
        }
    }
}
