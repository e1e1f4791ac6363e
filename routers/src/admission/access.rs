//! Which classes may command which: the receiving node sees to it.

use rohrpost_config as config;
use rohrpost_mailbox::{Class, Head, Kind, local};

/// Rules, one for each class that not all may command.
#[derive(Clone, Debug, Default)]
pub struct Access {
    rules: Box<[Rule]>,
}

#[derive(Clone, Debug)]
struct Rule {
    class: Class,
    /// One bit for each class that may.
    callers: [u64; 4],
    line: usize,
}

impl Access {
    /// Rules as in the configuration.
    pub fn new(rules: &[config::Access]) -> Self {
        let rule = |access: &config::Access| {
            let mut callers = [0; 4];
            access.callers.iter().for_each(|Class(caller)| callers[usize::from(caller / 64)] |= 1 << (caller % 64));
            Rule { class: access.class, callers, line: access.line }
        };
        Self { rules: rules.iter().map(rule).collect() }
    }

    /// Whether a package may go to its mailbox: all may but commands, and what else takes up room in a mailbox for
    /// commands.
    pub fn allows(&self, head: &Head) -> bool {
        let is_command = matches!(head.kind.kind(), Kind::Command(_)) || head.to.local() == local::COMMANDS;
        let Class(from) = head.from.class();
        let may = |rule: &Rule| rule.callers[usize::from(from / 64)] & 1 << (from % 64) != 0;
        !is_command || self.rule(head.to.class()).is_none_or(may)
    }

    /// Line of the rule for a class, if there is one.
    pub fn line(&self, class: Class) -> Option<usize> {
        self.rule(class).map(|rule| rule.line)
    }

    fn rule(&self, class: Class) -> Option<&Rule> {
        self.rules.iter().find(|rule| rule.class == class)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::harness::{head, module};
    use rohrpost_mailbox::Type;

    #[test]
    fn only_classes_that_are_listed_may_command_a_class_that_has_a_list() {
        let rule = config::Access { class: Class(200), callers: vec![Class(64), Class(255)], line: 7 };
        let access = Access::new(&[rule]);
        let command = |to, from| Head { kind: Type::command(16), ..head(module(to, 0), module(from, 1), 0) };
        for (to, from, may) in [(200, 64, true), (200, 255, true), (200, 63, false), (200, 200, false), (199, 63, true)]
        {
            assert_eq!(access.allows(&command(to, from)), may, "{from} commands {to}");
            let data = head(module(to, 0), module(from, 1), 0);
            assert_eq!(access.allows(&data), may, "data of {from} in the mailbox for commands of {to}");
            assert!(access.allows(&Head { to: data.to.with_local(local::DATA), ..data }), "else data go to all");
        }
        assert_eq!((access.line(Class(200)), access.line(Class(1))), (Some(7), None));
    }
}
