//! One configuration added to another: what is added counts; modules of one name are one.

use toml::{Table, Value};

/// Adds sections and modules.
pub(super) fn merge(to: &mut Table, added: Table) {
    for (key, value) in added {
        match (to.get_mut(&key), value) {
            (Some(Value::Table(known)), Value::Table(value)) => merge(known, value),
            (Some(Value::Array(known)), Value::Array(modules)) if key == "module" => {
                modules.into_iter().for_each(|module| add(known, module));
            }
            (_, value) => drop(to.insert(key, value)),
        }
    }
}

fn add(modules: &mut Vec<Value>, module: Value) {
    let known = modules.iter_mut().find(|known| known.get("name") == module.get("name"));
    match (known, module) {
        (Some(Value::Table(known)), Value::Table(module)) => merge(known, module),
        (_, module) => modules.push(module),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modules_of_one_name_are_one_and_what_is_added_counts() {
        let mut made: Table = "a = 1\n[team]\nport = 2\n[[module]]\nname = \"x\"\nsettings = { p = 1, q = [1] }\n\
                               [[module]]\nname = \"y\"\n"
            .parse()
            .unwrap();
        let added = "a = 3\n[team]\nkeys = \"k\"\n[[module]]\nname = \"x\"\nsettings = { q = [2] }\n[[module]]\nname = \
                     \"z\"\n";
        merge(&mut made, added.parse().unwrap());
        let expected: Table =
            "a = 3\n[team]\nport = 2\nkeys = \"k\"\n[[module]]\nname = \"x\"\nsettings = { p = 1, q = \
                               [2] }\n[[module]]\nname = \"y\"\n[[module]]\nname = \"z\"\n"
                .parse()
                .unwrap();
        assert_eq!(made, expected);
    }
}
