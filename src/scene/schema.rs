//! The JSON Schema (draft 7) of scene files, by which editors complete and check them.

use std::ops::Bound;

use serde_json::{Map, Value, json};

use super::keys::{LabelTable, Root, VolumeTable};
use super::overrides::MAX_CHANNELS;
use super::writer::value;
use super::{Channel, ImageSettings, TransferSettings};
use crate::error::setting::Interval;
use crate::settings::camera_table::CameraTable;
use crate::settings::clip::{Clip, MAX_PLANES};
use crate::settings::economies::Economies;
use crate::settings::key::{Choice, Keyed, Slot};
use crate::settings::shading::Shading;
use crate::settings::splatting::Splatting;
use crate::settings::transfer_function::{MAX_COLORS, MAX_POINTS};

/// The schema as text.
pub fn schema() -> String {
    let volume = with(table::<VolumeTable>(), "not", json!({"required": ["path", "builtin"]}));
    let transfer = with(table::<TransferSettings>(), "not", json!({"required": ["color", "colormap"]}));
    let channel = nested(nested(table::<Channel>(), "volume", &volume), "transfer", &transfer);
    let root = [
        ("$schema", "http://json-schema.org/draft-07/schema#".into()),
        ("title", "A scene file of sheetsplat".into()),
        ("not", json!({"required": ["channel"], "anyOf": [{"required": ["volume"]}, {"required": ["transfer"]}]})),
    ];
    let tables = [
        ("volume", volume),
        ("camera", table::<CameraTable>()),
        ("image", table::<ImageSettings>()),
        ("clip", table::<Clip>()),
        ("transfer", transfer),
        ("shading", table::<Shading>()),
        ("splatting", nested(table::<Splatting>(), "experimental", &table::<Economies>())),
        ("channel", array(&channel, 0, MAX_CHANNELS)),
    ];
    let schema = tables.iter().fold(table::<Root>(), |schema, (name, table)| nested(schema, name, table));
    format!("{:#}\n", root.into_iter().fold(schema, |schema, (key, value)| with(schema, key, value)))
}

/// The schema of a table.
fn table<T: Keyed>() -> Value {
    let mut default = T::default();
    let properties: Map<String, Value> = T::KEYS
        .iter()
        .map(|key| {
            let slot = (key.slot)(&mut default);
            let form = with(form(&slot), "description", key.sentence.into());
            let default = value(&slot).and_then(|value| serde_json::to_value(value).ok());
            (key.name.to_owned(), default.map_or(form.clone(), |default| with(form, "default", default)))
        })
        .collect();
    json!({"type": "object", "properties": properties, "additionalProperties": false})
}

/// A schema with another key.
fn with(mut schema: Value, key: &str, value: Value) -> Value {
    schema[key] = value;
    schema
}

/// A table's schema with a table in it.
fn nested(mut schema: Value, name: &str, table: &Value) -> Value {
    schema["properties"][name] = table.clone();
    schema
}

/// What a key's value may be.
fn form(slot: &Slot) -> Value {
    let count = json!({"type": "integer", "minimum": 0, "maximum": u32::MAX});
    let text = json!({"type": "string"});
    match slot {
        Slot::Switch(_) => json!({"type": "boolean"}),
        Slot::Number(range, _) | Slot::Given(range, _) => number(range),
        Slot::Choice(Choice { names, .. }) => json!({"enum": names}),
        Slot::Direction(_) => numbers(3, &Interval::FINITE),
        Slot::Vector(range, _) => numbers(3, range),
        Slot::Light(_) => json!({"anyOf": [{"enum": ["headlight", "upper-left"]}, numbers(3, &Interval::FINITE)]}),
        Slot::Pixels(_) => with(count, "minimum", 1.into()),
        Slot::Background(_) => json!({"anyOf": [text, numbers(4, &Interval::SHARE)]}),
        Slot::Planes(_) => array(&numbers(4, &Interval::FINITE), 0, MAX_PLANES),
        Slot::Crop(_) => array(&numbers(3, &Interval::FINITE), 2, 2),
        Slot::Colors(_) => points(&json!({"anyOf": [text, numbers(3, &Interval::SHARE)]}), MAX_COLORS),
        Slot::Shares(..) => points(&number(&Interval::SHARE), MAX_POINTS),
        Slot::Ranges(_) => array(&numbers(2, &Interval::FINITE), 1, MAX_POINTS),
        Slot::Labels(_) => array(&with(table::<LabelTable>(), "required", json!(["label"])), 0, usize::MAX),
        Slot::Label(_) => {
            json!({"anyOf": [{"type": "integer", "minimum": 0}, {"type": "string", "pattern": "^[0-9]+$"}]})
        }
        Slot::Text(..) => text,
        Slot::Number32(_) => count,
        Slot::Level(_) => json!({"anyOf": [{"enum": ["auto"]}, count]}),
        Slot::Series(_) => json!({"anyOf": [text, count]}),
        Slot::Dims(_) => array(&with(count, "minimum", 1.into()), 3, 3),
        Slot::Bytes(_) => json!({"type": "integer", "minimum": 0}),
    }
}

fn number(range: &Interval) -> Value {
    let bounds = [(range.min, ["minimum", "exclusiveMinimum"]), (range.max, ["maximum", "exclusiveMaximum"])];
    bounds.into_iter().fold(json!({"type": "number"}), |schema, (bound, [included, excluded])| match bound {
        Bound::Included(bound) => with(schema, included, bound.into()),
        Bound::Excluded(bound) => with(schema, excluded, bound.into()),
        Bound::Unbounded => schema,
    })
}

fn array(items: &Value, least: usize, most: usize) -> Value {
    json!({"type": "array", "items": items, "minItems": least, "maxItems": most})
}

fn numbers(count: usize, range: &Interval) -> Value {
    array(&number(range), count, count)
}

/// Control points.
fn points(value: &Value, most: usize) -> Value {
    let point = json!({"type": "array", "items": [number(&Interval::FINITE), value], "minItems": 2, "maxItems": 2});
    array(&point, 1, most)
}
