//! `sheetsplat schema`: it says what the reader of scenes does, and the guide's table is made of it.

use std::ops::Bound;

use sheetsplat::Scene;
use sheetsplat::scene::SceneError;
use sheetsplat::settings::Allowed;

use crate::*;

fn schema() -> Value {
    serde_json::from_str(&sheetsplat::scene::schema()).unwrap()
}

/// Whether a value is one of a schema's; of JSON Schema it knows what this schema needs.
fn is_valid(schema: &Value, value: &Value) -> bool {
    let number = |name: &str| schema[name].as_f64();
    schema.as_object().unwrap().iter().all(|(key, rule)| match key.as_str() {
        "$schema" | "title" | "description" | "default" | "exclusiveMinimum" | "exclusiveMaximum" => true,
        "type" => match rule.as_str().unwrap() {
            "object" => value.is_object(),
            "array" => value.is_array(),
            "boolean" => value.is_boolean(),
            "string" => value.is_string(),
            "number" => value.is_number(),
            "integer" => value.is_i64() || value.is_u64(),
            other => panic!("{other}"),
        },
        "enum" => rule.as_array().unwrap().contains(value),
        "minimum" => value.as_f64().is_none_or(|found| {
            found > number(key).unwrap() || schema["exclusiveMinimum"] != true && Some(found) == number(key)
        }),
        "maximum" => value.as_f64().is_none_or(|found| {
            found < number(key).unwrap() || schema["exclusiveMaximum"] != true && Some(found) == number(key)
        }),
        "minItems" => value.as_array().is_none_or(|items| items.len() as u64 >= rule.as_u64().unwrap()),
        "maxItems" => value.as_array().is_none_or(|items| items.len() as u64 <= rule.as_u64().unwrap()),
        "items" => value.as_array().is_none_or(|items| match rule.as_array() {
            Some(rules) => items.iter().zip(rules).all(|(item, rule)| is_valid(rule, item)),
            None => items.iter().all(|item| is_valid(rule, item)),
        }),
        "properties" => value.as_object().is_none_or(|table| {
            table.iter().all(|(key, value)| rule.get(key).is_none_or(|rule| is_valid(rule, value)))
        }),
        "additionalProperties" => {
            assert_eq!(rule, false);
            value.as_object().is_none_or(|table| table.keys().all(|key| schema["properties"].get(key).is_some()))
        }
        "anyOf" => rule.as_array().unwrap().iter().any(|rule| is_valid(rule, value)),
        "pattern" => {
            assert_eq!(rule, "^[0-9]+$");
            value.as_str().is_none_or(|text| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit()))
        }
        other => panic!("{other}"),
    })
}

/// Scene files as JSON.
fn parsed(text: &str) -> Value {
    serde_json::to_value(text.parse::<toml::Table>().unwrap()).unwrap()
}

/// The keys of the tables that a scene of one channel has, by their full names, with their schemas.
fn keys(schema: &Value) -> Vec<(String, Value)> {
    fn collect(path: &str, schema: &Value, found: &mut Vec<(String, Value)>) {
        for (key, schema) in schema["properties"].as_object().unwrap() {
            let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
            match schema.get("properties") {
                Some(_) => collect(&path, schema, found),
                None => found.push((path, schema.clone())),
            }
        }
    }
    let mut found = Vec::new();
    collect("", schema, &mut found);
    found.retain(|(key, _)| key != "channel");
    found
}

fn read(set: &str) -> Result<Scene, SceneError> {
    Scene::parse("volume.builtin = \"head\"", "scene.toml", Path::new(""), &[set.to_owned()])
}

/// The values that the reader names as allowed where it refuses a setting.
fn allowed(set: &str) -> Allowed {
    match read(set) {
        Err(SceneError::Invalid { key, allowed, .. }) => {
            assert!(key.starts_with(set.split('=').next().unwrap()), "{set}: {key}");
            allowed
        }
        other => panic!("{set}: {other:?}"),
    }
}

#[test]
fn the_program_prints_it() {
    let run = Folder::new().run("schema");
    assert_eq!((run.code, run.stdout), (Some(0), sheetsplat::scene::schema()), "{}", run.stderr);
}

#[test]
fn scene_files_are_valid() {
    let schema = schema();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut texts: Vec<(String, String)> = Vec::new();
    for folder in ["assets", "assets/paper", "assets/channels"] {
        for entry in fs::read_dir(root.join(folder)).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|extension| extension == "toml") {
                texts.push((path.display().to_string(), fs::read_to_string(&path).unwrap()));
            }
        }
    }
    assert!(texts.len() > 10, "{texts:?}");
    let guide = fs::read_to_string(root.join("docs/guide/scene-files.md")).unwrap();
    let blocks = guide.split("```toml\n").skip(1).map(|rest| rest.split("```").next().unwrap().to_owned());
    texts.extend(blocks.map(|block| ("docs/guide/scene-files.md".to_owned(), block)));
    for (name, text) in texts {
        assert!(is_valid(&schema, &parsed(&text)), "{name}:\n{text}");
    }
}

#[test]
#[ignore = "needs the shared data: SHEETSPLAT_SHARED=FOLDER"]
fn shared_scene_files_are_valid() {
    let schema = schema();
    for entry in fs::read_dir(shared("scenes")).unwrap() {
        let path = entry.unwrap().path();
        assert!(is_valid(&schema, &parsed(&fs::read_to_string(&path).unwrap())), "{}", path.display());
    }
}

#[test]
fn wrong_scene_files_are_invalid() {
    let schema = schema();
    for text in [
        "colour = 1",
        "preset = \"ct\"",
        "volume.path = 1",
        "volume.spacing = [1, 1]",
        "volume.spacing = [1, 1, 0]",
        "volume.level = \"finest\"",
        "volume.dims = [1, 2.5, 3]",
        "volume.type = \"int128\"",
        "camera.direction = [0, 1]",
        "camera.fov_y = 180",
        "camera.height = 0",
        "image.width = 0",
        "image.width = 1.5",
        "image.background = [0, 0, 0, 1.5]",
        "clip.planes = [[1, 0, 0]]",
        "clip.crop = [[0, 0, 0]]",
        "transfer.color = []",
        "transfer.color = [[0, [0, 0]]]",
        "transfer.opacity = [[0, 1.5]]",
        "transfer.iso_ranges = [[1]]",
        "transfer.label = [{ label = -1 }]",
        "transfer.label = [{ label = \"one\" }]",
        "shading.light = \"left\"",
        "shading.enabled = 1",
        "shading.ambient = -0.1",
        "shading.shininess = 0",
        "splatting.radius = 4.5",
        "splatting.order = \"front\"",
        "splatting.experimental.beta = 0",
        "splatting.beta = 1.0",
        "channel = [{ colour = 1 }]",
        "channel = [{ transfer = { opacity = 1 } }]",
    ] {
        let scene = format!("{text}\n");
        assert!(!is_valid(&schema, &parsed(&scene)), "{text}");
        let scene = if text.starts_with("volume") || text.starts_with("channel") {
            scene
        } else {
            format!("volume.builtin = \"head\"\n{scene}")
        };
        assert!(Scene::parse(&scene, "scene.toml", Path::new(""), &[]).is_err(), "{text}");
    }
}

#[test]
fn defaults_are_read_and_what_lies_outside_is_refused_alike() {
    let schema = schema();
    let keys = keys(&schema);
    assert!(keys.len() > 60, "{}", keys.len());
    let mut intervals = 0;
    for (key, form) in &keys {
        if let Some(default) = form.get("default") {
            assert!(is_valid(form, default), "{key} = {default}");
            read(&format!("{key}={default}")).unwrap_or_else(|error| panic!("{error}"));
        }
        if form["type"] == "number" {
            intervals += 1;
            let Allowed::Interval(interval) = allowed(&format!("{key}=nan")) else { panic!("{key}") };
            let bound = |bound: &str, excludes: &str| match (form[bound].as_f64(), form[excludes] == true) {
                (Some(bound), true) => Bound::Excluded(bound),
                (Some(bound), false) => Bound::Included(bound),
                (None, _) => Bound::Unbounded,
            };
            assert_eq!(interval.min, bound("minimum", "exclusiveMinimum"), "{key}");
            assert_eq!(interval.max, bound("maximum", "exclusiveMaximum"), "{key}");
        }
        if let Some(names) = form["enum"].as_array() {
            let names: Vec<String> = names.iter().map(Value::to_string).collect();
            assert_eq!(allowed(&format!("{key}=\"no such\"")).to_string(), names.join(" or "), "{key}");
        }
        for wrong in ["true", "\"no such\"", "-1", "1.5", "[]", "[1]", "[[[]]]", "{a=1}"] {
            if !is_valid(form, &parsed(&format!("value = {wrong}"))["value"]) {
                allowed(&format!("{key}={wrong}"));
            }
        }
    }
    assert!(intervals > 15, "{intervals}");
}

#[test]
fn every_table_has_the_keys_that_the_reader_knows() {
    let schema = schema();
    let tables = ["volume", "camera", "image", "clip", "transfer", "shading", "splatting", "splatting.experimental"];
    let of_table = |table: &str| {
        let schema = table.split('.').fold(&schema, |schema, name| &schema["properties"][name]);
        (format!("{table}.no_such=1"), schema.clone())
    };
    let label = schema["properties"]["transfer"]["properties"]["label"]["items"].clone();
    let channel = schema["properties"]["channel"]["items"].clone();
    let others = [
        ("no_such=1".to_owned(), schema.clone()),
        ("transfer.label=[{ no_such = 1 }]".to_owned(), label),
        ("channel=[{ volume.builtin = \"head\", no_such = 1 }]".to_owned(), channel),
    ];
    for (set, schema) in tables.into_iter().map(of_table).chain(others) {
        let source = sheetsplat::scene::VolumeSource::Builtin("head".to_owned());
        let error = Scene::from_volume(source, std::slice::from_ref(&set)).unwrap_err().to_string();
        let (_, known) = error.split_once("an unknown key, allowed: ").unwrap_or_else(|| panic!("{error}"));
        let known: BTreeSet<&str> = known.split(", ").collect();
        let found: BTreeSet<&str> = schema["properties"].as_object().unwrap().keys().map(String::as_str).collect();
        assert_eq!(found, known, "{set}");
    }
}

/// The values that a schema allows, in words.
fn words(form: &Value) -> String {
    let several = |count: String, item: String| {
        if item.contains(' ') { format!("{count} × ({item})") } else { format!("{count} × {item}") }
    };
    if let Some(forms) = form["anyOf"].as_array() {
        return forms.iter().map(words).collect::<Vec<_>>().join(", or ");
    }
    if let Some(names) = form["enum"].as_array() {
        return names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    }
    match form["type"].as_str().unwrap() {
        "boolean" => "`true`, `false`".to_owned(),
        "array" => match (&form["items"], form["minItems"].as_u64(), form["maxItems"].as_u64()) {
            (Value::Array(items), ..) => format!("[{}]", items.iter().map(words).collect::<Vec<_>>().join(", ")),
            (item, Some(least), Some(most)) if least == most => several(least.to_string(), words(item)),
            (item, Some(least), _) => format!("{least} or more of {}", words(item)),
            (item, None, Some(most)) => several(format!("up to {most}"), words(item)),
            (item, None, None) => words(item),
        },
        "string" => "text".to_owned(),
        "object" => "tables".to_owned(),
        number => {
            let bound = |name: &str| form[name].as_f64().filter(|bound| *bound != f64::from(u32::MAX));
            let is_excluded = |name: &str| form[name] == true;
            let range = match (bound("minimum"), bound("maximum")) {
                (None, _) => return number.to_owned(),
                (Some(least), None) if is_excluded("exclusiveMinimum") => format!("above {least}"),
                (Some(least), None) => format!("at least {least}"),
                (Some(least), Some(most)) if is_excluded("exclusiveMaximum") => format!("above {least}, below {most}"),
                (Some(least), Some(most)) if is_excluded("exclusiveMinimum") => format!("above {least}, to {most}"),
                (Some(least), Some(most)) if most > 1e9 => format!("{least:e} to {most:e}"),
                (Some(least), Some(most)) => format!("{least} to {most}"),
            };
            if number == "integer" { format!("integer, {range}") } else { range }
        }
    }
}

/// The rows of the guide's table: every key, what it allows, its default, and its sentence.
fn rows() -> Vec<String> {
    let schema = schema();
    let label = schema["properties"]["transfer"]["properties"]["label"]["items"]["properties"].as_object().unwrap();
    let channel = schema["properties"]["channel"]["items"]["properties"].as_object().unwrap();
    let of_label = label.iter().map(|(key, form)| (format!("transfer.label[].{key}"), form.clone()));
    let of_channel = channel.iter().filter(|(_, form)| form.get("properties").is_none());
    let of_channel = of_channel.map(|(key, form)| (format!("channel[].{key}"), form.clone()));
    let row = |(key, form): (String, Value)| {
        let default = form.get("default").map_or(String::new(), |default| format!("`{default}`"));
        format!("| `{key}` | {} | {default} | {} |", words(&form), form["description"].as_str().unwrap())
    };
    keys(&schema).into_iter().chain(of_label).chain(of_channel).map(row).collect()
}

#[test]
fn the_guide_has_every_key() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/guide/scene-files.md");
    let text = fs::read_to_string(path).unwrap();
    let found: Vec<&str> = text.lines().skip_while(|line| *line != "| key | allowed | default | |").skip(2).collect();
    let found: Vec<&str> = found.into_iter().take_while(|line| line.starts_with('|')).collect();
    let expected = rows();
    assert!(
        found == expected,
        "docs/guide/scene-files.md: replace the rows of the table of keys by\n{}",
        expected.join("\n")
    );
}

/// Type checkers and editors know the keys and choices of Python's dictionaries by these classes.
#[test]
fn the_tables_of_python_have_every_key() {
    let text =
        fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("python/sheetsplat/_settings.py")).unwrap();
    let schema = schema();
    let mut choices = 0;
    for table in ["camera", "image", "clip", "transfer", "shading", "splatting"] {
        let (_, class) = text.split_once(&format!("\"\"\"The table ``[{table}]``.\"\"\"")).unwrap();
        let fields = class.trim_start().split("\n\n").next().unwrap().lines();
        let fields: Vec<(&str, &str)> = fields.filter_map(|line| line.trim().split_once(": ")).collect();
        let properties = schema["properties"][table]["properties"].as_object().unwrap();
        let names: BTreeSet<&str> = fields.iter().map(|(name, _)| *name).collect();
        assert_eq!(names, properties.keys().map(String::as_str).collect(), "{table}");
        for (name, literals) in fields.iter().filter(|(_, kind)| kind.starts_with("Literal")) {
            let found: BTreeSet<&str> = literals.split('"').skip(1).step_by(2).collect();
            let names = properties[*name]["enum"].as_array().unwrap().iter().map(|name| name.as_str().unwrap());
            assert_eq!(found, names.collect(), "{table}.{name}");
            choices += 1;
        }
    }
    assert!(choices > 10, "{choices}");
}
