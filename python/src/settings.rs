//! Keyword arguments as the settings of scene files.

use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple};
use toml::{Table, Value};

use crate::error::{Raised, setting};

/// Settings in the form `table.key=value` that the reader of scenes takes. Nested dictionaries are tables.
pub(crate) fn sets(settings: &Bound<'_, PyDict>) -> Result<Vec<String>, Raised> {
    let mut sets = Vec::new();
    collect("", settings, &mut sets)?;
    Ok(sets)
}

fn collect(path: &str, table: &Bound<'_, PyDict>, sets: &mut Vec<String>) -> Result<(), Raised> {
    for (key, value) in table {
        let key = name(path, &key)?;
        let path = if path.is_empty() { key } else { format!("{path}.{key}") };
        match value.cast::<PyDict>() {
            Ok(table) => collect(&path, table, sets)?,
            Err(_) => sets.push(format!("{path}={}", of(&path, &value)?)),
        }
    }
    Ok(())
}

/// A key, which may itself be a path: `camera.direction`.
fn name(path: &str, key: &Bound<'_, PyAny>) -> Result<String, Raised> {
    let text = key.extract::<String>().ok().filter(|key| !key.contains('=') && !key.trim().is_empty());
    let place = if path.is_empty() { "settings" } else { path };
    text.ok_or_else(|| setting(place, &format!("the key {}", shown(key)), "the names of a scene file's keys"))
}

/// The value under a key.
fn of(key: &str, value: &Bound<'_, PyAny>) -> Result<Value, Raised> {
    // `bool` is a kind of `int` in Python.
    if let Ok(value) = value.cast::<PyBool>() {
        return Ok(value.is_true().into());
    }
    if let Ok(value) = value.cast::<PyInt>() {
        let integer = value.extract::<i64>();
        return integer.map(Value::from).map_err(|_| setting(key, &shown(value), "integers of at most 64 bits"));
    }
    if let Ok(value) = value.cast::<PyFloat>() {
        return Ok(value.value().into());
    }
    if let Ok(value) = value.cast::<PyString>() {
        return Ok(value.to_string().into());
    }
    if value.is_instance_of::<PyList>() || value.is_instance_of::<PyTuple>() {
        let item = |(at, item): (usize, PyResult<Bound<'_, PyAny>>)| of(&format!("{key}[{at}]"), &item?);
        return Ok(Value::Array(value.try_iter()?.enumerate().map(item).collect::<Result<_, _>>()?));
    }
    if let Ok(table) = value.cast::<PyDict>() {
        let item = |(name, value): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
            let name = self::name(key, &name)?;
            let value = of(&format!("{key}.{name}"), &value)?;
            Ok::<_, Raised>((name, value))
        };
        return Ok(Value::Table(table.iter().map(item).collect::<Result<Table, _>>()?));
    }
    // NumPy's arrays and numbers, and paths.
    for method in ["tolist", "__fspath__"] {
        if value.hasattr(method)? {
            return of(key, &value.call_method0(method)?);
        }
    }
    Err(setting(key, &shown(value), "a boolean, a number, a string, a list, a dictionary, an array or a path"))
}

/// A value as Python writes it, shortened.
fn shown(value: &Bound<'_, PyAny>) -> String {
    let text = value.repr().map_or_else(|_| "a value without repr()".to_owned(), |text| text.to_string());
    let short: String = text.chars().take(60).collect();
    if short.len() < text.len() { format!("{short}…") } else { short }
}
