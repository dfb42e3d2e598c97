//! Names in metadata (of data types, grids, key encodings, codecs), each with a configuration.

use serde_json::Value;

use super::super::VolumeError;
use super::json::Json;

/// Something that may be of a kind which only some programs know.
pub(super) struct Extension<'a> {
    pub(super) name: Json<'a>,
    pub(super) configuration: Json<'a>,
    /// Whether a program that does not know it may leave it out.
    pub(super) is_optional: bool,
}

impl<'a> Extension<'a> {
    /// A name, or an object with one.
    pub(super) fn read(json: &Json<'a>) -> Result<Self, VolumeError> {
        let name = if json.text().is_some() { json.clone() } else { json.get("name") };
        if name.text().is_none() {
            return Err(json.invalid("a name, or an object with a name"));
        }
        json.only(&["name", "configuration", "must_understand"])?;
        let (configuration, must_understand) = (json.get("configuration"), json.get("must_understand"));
        if configuration.value().is_some_and(|value| !value.is_object()) {
            return Err(configuration.invalid("an object"));
        }
        match must_understand.value() {
            None | Some(Value::Bool(_)) => {}
            Some(_) => return Err(must_understand.invalid("true or false")),
        }
        Ok(Self { name, configuration, is_optional: must_understand.value() == Some(&Value::Bool(false)) })
    }
}
