//! Settings that are taken out of a scene's text, so that their defaults count.

use toml::{Table, Value};

/// A scene's text without the settings, or the tables, of these keys, which are named as in overrides: `transfer.colormap`, `channel[1].transfer`.
pub(crate) fn without(text: &str, keys: &[String]) -> String {
    // The reader tells what is wrong with a text that is no TOML.
    let Ok(mut root) = text.parse::<Table>() else { return text.to_owned() };
    let mut is_changed = false;
    for key in keys {
        is_changed |= take(&mut root, key);
    }
    if is_changed { written(root) } else { text.to_owned() }
}

/// A table as TOML, one entry a line. Values write themselves; tables would need a serializer of their own.
fn written(root: Table) -> String {
    root.into_iter().map(|(key, value)| format!("{} = {value}\n", Value::String(key))).collect()
}

/// Takes a key, and the tables that it leaves empty, out of a table. Returns whether it was there.
fn take(parent: &mut Table, key: &str) -> bool {
    let Some((name, rest)) = key.split_once('.') else { return parent.remove(key).is_some() };
    let Some(table) = table_of(parent, name) else { return false };
    let is_taken = take(table, rest);
    // A scene that has a table for the transfer function, even an empty one, is classified otherwise than one without.
    if is_taken && table.is_empty() && parent.get(name).is_some_and(Value::is_table) {
        parent.remove(name);
    }
    is_taken
}

/// A table by its name in its parent. A scene without channels has the tables of the first one itself.
fn table_of<'a>(parent: &'a mut Table, name: &str) -> Option<&'a mut Table> {
    let number = name.strip_prefix("channel[").and_then(|rest| rest.strip_suffix(']'));
    let Some(number) = number.and_then(|number| number.parse::<usize>().ok()) else {
        return parent.get_mut(name)?.as_table_mut();
    };
    if !parent.contains_key("channel") {
        return (number == 0).then_some(parent);
    }
    parent.get_mut("channel").and_then(Value::as_array_mut)?.get_mut(number)?.as_table_mut()
}
