//! `--set`: values that take precedence over the scene file's.

use toml::{Table, Value};

use super::SceneError;
use super::reader::{OVERRIDE, typed};

/// The maximum number of channels.
pub(super) const MAX_CHANNELS: usize = 64;

/// The keys of `[volume]` that concern a whole file, whichever channels come from it.
const OF_WHOLE_FILE: [&str; 4] = ["time", "level", "series", "spacing"];

/// Applies one `--set` argument, `table.key=value` or `table=value`, and returns its key. In a scene of `[[channel]]` tables, keys of `[volume]` are those
/// of the first channel.
pub(super) fn apply_override(root: &mut Table, argument: &str) -> Result<String, SceneError> {
    let misused = |key: &str, found: &str, allowed: &str| SceneError::Invalid {
        origin: OVERRIDE.to_owned(),
        key: key.to_owned(),
        found: found.to_owned(),
        allowed: allowed.into(),
    };
    let usage = "table.key=value, as in splatting.slab_width=2.0";
    let Some((key, text)) = argument.split_once('=') else { return Err(misused(argument, "no \"=\"", usage)) };
    let (key, text) = (key.trim(), text.trim());
    let value = text.parse().unwrap_or_else(|_| Value::String(text.to_owned()));
    if key.split('.').any(str::is_empty) {
        return Err(misused(argument, "an empty key", usage));
    }
    let of_volume = key.strip_prefix("volume").filter(|rest| rest.is_empty() || rest.starts_with('.'));
    let of_first = match (of_volume, root.get_mut("channel")) {
        (Some(rest), Some(Value::Array(channels))) => {
            adapt_channels(channels, rest, &value);
            Some(format!("channel[0].volume{rest}"))
        }
        _ => None,
    };
    let key = of_first.as_deref().unwrap_or(key);
    let (tables, name) = key.rsplit_once('.').map_or((None, key), |(tables, name)| (Some(tables), name));
    let mut section = root;
    let mut path = String::new();
    for table in tables.into_iter().flat_map(|tables| tables.split('.')) {
        path = if path.is_empty() { table.to_owned() } else { format!("{path}.{table}") };
        let found = match table.strip_prefix("channel[").and_then(|rest| rest.strip_suffix(']')) {
            Some(number) if path == table => {
                let parsed = number.parse().ok().filter(|&number| number < MAX_CHANNELS);
                let refused = || misused(key, number, &format!("a number below {MAX_CHANNELS} in brackets"));
                channel_table(section, parsed.ok_or_else(refused)?)
            }
            _ => section.entry(table).or_insert_with(|| Value::Table(Table::new())),
        };
        section = match found {
            Value::Table(section) => section,
            other => {
                return Err(misused(key, &format!("{path} = {}", typed(other)), &format!("{path} to be a table")));
            }
        };
    }
    // The two keys name the same thing, so the last one wins.
    match key.split_once("].").map_or(key, |(_, of_channel)| of_channel) {
        "volume.path" => _ = section.remove("builtin"),
        "volume.builtin" => {
            section.retain(|name, _| !["path", "dims", "type", "endian", "offset"].contains(&name));
        }
        "transfer.color" => _ = section.remove("colormap"),
        "transfer.colormap" => _ = section.remove("color"),
        _ => {}
    }
    section.insert(name.to_owned(), value);
    Ok(key.to_owned())
}

/// The value of `[[channel]]` with a number. Empty tables are added up to it; the first takes in the tables of a scene of one channel.
fn channel_table(root: &mut Table, number: usize) -> &mut Value {
    if !root.contains_key("channel") {
        let of_one = ["volume", "transfer"].map(|name| root.remove(name).map(|table| (name.to_owned(), table)));
        let first = Value::Table(of_one.into_iter().flatten().collect());
        root.insert("channel".to_owned(), Value::Array(vec![first]));
    }
    match &mut root["channel"] {
        Value::Array(channels) => {
            if channels.len() <= number {
                channels.resize(number + 1, Value::Table(Table::new()));
            }
            &mut channels[number]
        }
        other => other,
    }
}

/// Prepares the tables `[[channel]]` for a key of the first one's volume: what concerns a whole file is set for all channels of that file, and the number
/// of the only channel that is read leaves that channel's table alone, if all tables are about channels of one file.
fn adapt_channels(channels: &mut Vec<Value>, key: &str, value: &Value) {
    let key = key.trim_start_matches('.');
    let Some((first, others)) = channels.split_first_mut() else { return };
    let source = |channel: &Value| {
        let volume = channel.get("volume")?;
        volume.get("path").or_else(|| volume.get("builtin")).cloned()
    };
    if OF_WHOLE_FILE.contains(&key) {
        let of_first = source(first);
        for channel in others.iter_mut().filter(|channel| of_first.is_some() && source(channel) == of_first) {
            if let Some(Value::Table(volume)) = channel.get_mut("volume") {
                volume.insert(key.to_owned(), value.clone());
            }
        }
    }
    let number = value.as_integer().and_then(|number| usize::try_from(number).ok());
    if key == "index"
        && let Some(number) = number.filter(|_| others.iter().all(|channel| source(channel).is_none()))
        && let Some(volume) = first.get("volume").cloned()
    {
        let only = channels.get(number).and_then(Value::as_table).cloned();
        let mut only = only.unwrap_or_default();
        only.remove("visible");
        only.insert("volume".to_owned(), volume);
        *channels = vec![Value::Table(only)];
    }
}
