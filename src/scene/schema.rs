//! The JSON Schema of scene files, by which editors complete and check them: draft 4, which editors of TOML know.

use std::ops::Bound;

use serde_json::{Map, Value, json};

use super::keys::{LabelTable, Root, VolumeTable};
use super::overrides::MAX_CHANNELS;
use super::slots::value;
use super::{Channel, ImageSettings, TransferSettings};
use crate::error::setting::Interval;
use crate::settings::camera_table::CameraTable;
use crate::settings::clip::{Clip, MAX_PLANES};
use crate::settings::economies::Economies;
use crate::settings::key::{Choice, Keyed, Slot};
use crate::settings::shading::Shading;
use crate::settings::splatting::Splatting;

/// The schema as text.
pub fn schema() -> String {
    let (mut channel, mut splatting, mut root) = (table::<Channel>(), table::<Splatting>(), table::<Root>());
    let [volume, transfer] = [table::<VolumeTable>(), table::<TransferSettings>()];
    channel["properties"]["volume"] = volume.clone();
    channel["properties"]["transfer"] = transfer.clone();
    splatting["properties"]["experimental"] = table::<Economies>();
    for (name, table) in [
        ("volume", volume),
        ("camera", table::<CameraTable>()),
        ("image", table::<ImageSettings>()),
        ("clip", table::<Clip>()),
        ("transfer", transfer),
        ("shading", table::<Shading>()),
        ("splatting", splatting),
        ("channel", json!({"type": "array", "items": channel, "maxItems": MAX_CHANNELS})),
    ] {
        root["properties"][name] = table;
    }
    root["$schema"] = "http://json-schema.org/draft-04/schema#".into();
    root["title"] = "A scene file of sheetsplat".into();
    format!("{root:#}\n")
}

/// A table, with its keys.
fn table<T: Keyed>() -> Value {
    let mut settings = T::default();
    let properties = T::KEYS.iter().map(|key| {
        let slot = (key.slot)(&mut settings);
        let mut property = form(&slot);
        property["description"] = key.sentence.into();
        if let Some(default) = value(&slot) {
            property["default"] = json!(default);
        }
        (key.name.to_owned(), property)
    });
    json!({"type": "object", "properties": properties.collect::<Map<_, _>>(), "additionalProperties": false})
}

/// The schema of a key's value.
fn form(slot: &Slot) -> Value {
    let (share, finite) = (&Interval::SHARE, &Interval::FINITE);
    let whole = |least: u32| json!({"type": "integer", "minimum": least, "maximum": u32::MAX});
    let text = json!({"type": "string"});
    match slot {
        Slot::Switch(_) => json!({"type": "boolean"}),
        Slot::Number(range, _) | Slot::Given(range, _) => number(range),
        Slot::Choice(Choice { names, .. }) => json!({"enum": names}),
        Slot::Direction(_) => numbers(3, finite),
        Slot::Vector(range, _) => numbers(3, range),
        Slot::Light(_) => json!({"anyOf": [{"enum": ["headlight", "upper-left"]}, numbers(3, finite)]}),
        Slot::Pixels(_) => whole(1),
        Slot::Background(_) => json!({"anyOf": [text, numbers(4, share)]}),
        Slot::Planes(_) => json!({"type": "array", "items": numbers(4, finite), "maxItems": MAX_PLANES}),
        Slot::Crop(_) => array(2, &numbers(3, finite)),
        Slot::Colors(_) => points(&json!({"anyOf": [text, numbers(3, share)]})),
        Slot::Shares(..) => points(&number(share)),
        Slot::Ranges(_) => json!({"type": "array", "items": numbers(2, finite), "minItems": 1}),
        Slot::Labels(_) => json!({"type": "array", "items": table::<LabelTable>()}),
        Slot::Label(_) => {
            json!({"anyOf": [{"type": "integer", "minimum": 0}, {"type": "string", "pattern": "^[0-9]+$"}]})
        }
        Slot::Text(..) => text,
        Slot::Number32(_) => whole(0),
        Slot::Level(_) => json!({"anyOf": [{"enum": ["auto"]}, whole(0)]}),
        Slot::Series(_) => json!({"anyOf": [text, whole(0)]}),
        Slot::Dims(_) => array(3, &whole(1)),
        Slot::Bytes(_) => json!({"type": "integer", "minimum": 0}),
    }
}

fn number(range: &Interval) -> Value {
    let mut number = json!({"type": "number"});
    for (bound, name, excludes) in
        [(range.min, "minimum", "exclusiveMinimum"), (range.max, "maximum", "exclusiveMaximum")]
    {
        if let Bound::Included(bound) | Bound::Excluded(bound) = bound {
            number[name] = bound.into();
        }
        if matches!(bound, Bound::Excluded(_)) {
            number[excludes] = true.into();
        }
    }
    number
}

fn array(count: usize, items: &Value) -> Value {
    json!({"type": "array", "items": items, "minItems": count, "maxItems": count})
}

fn numbers(count: usize, range: &Interval) -> Value {
    array(count, &number(range))
}

/// Control points.
fn points(value: &Value) -> Value {
    let point = json!([number(&Interval::FINITE), value]);
    json!({"type": "array", "items": array(2, &point), "minItems": 1})
}
