//! How a picture was made, as JSON in its file.

use std::fmt::{self, Display, Formatter, Write};
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::names::is_kept;
use crate::image::ImageError;
use crate::image::open::content;

/// The version of the text.
const FORMAT: u32 = 1;

/// How a picture was made: its scene, what drew it, and the files behind it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    pub(super) format: u32,
    /// The version of the program that drew it.
    pub(super) version: String,
    /// `gpu`, `cpu` or `reference`.
    pub(super) backend: String,
    /// The GPU, if one drew it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) adapter: Option<String>,
    /// The words beside the picture.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) annotate: Vec<String>,
    /// Whether the volume was read while it was drawn.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(super) streamed: bool,
    /// The files that were read.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) files: Vec<SourceFile>,
    /// The hashes of the values of each channel, unless all come from files whose hashes are known, or are procedural.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) values: Vec<String>,
    /// The scene file.
    pub(super) scene: String,
    /// Bits per channel of a PNG.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) depth: Option<u8>,
    /// The hash of the pixels in the file.
    pub(super) pixels: String,
    /// The hash of all fields above.
    pub(super) check: String,
}

/// A file, or a store, that was read for a picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SourceFile {
    /// Its path in the picture's folder, or its name.
    pub(super) path: String,
    /// The hash of its bytes, if it was read whole.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) blake3: Option<String>,
}

impl Provenance {
    /// A text of the current format, without the fields that follow.
    pub(super) fn new(version: String, backend: String, scene: String) -> Self {
        Self {
            format: FORMAT,
            version,
            backend,
            scene,
            adapter: None,
            annotate: Vec::new(),
            streamed: false,
            files: Vec::new(),
            values: Vec::new(),
            depth: None,
            pixels: String::new(),
            check: String::new(),
        }
    }

    /// The version of the program that drew the picture.
    pub fn version(&self) -> &str {
        &self.version
    }

    /// The backend that drew it: `gpu`, `cpu` or `reference`.
    pub fn backend(&self) -> &str {
        &self.backend
    }

    /// The name of the GPU that drew it, if one did.
    pub fn adapter(&self) -> Option<&str> {
        self.adapter.as_deref()
    }

    /// The names of the annotations beside it.
    pub fn annotations(&self) -> &[String] {
        &self.annotate
    }

    /// The scene as a scene file.
    pub fn scene_text(&self) -> &str {
        &self.scene
    }

    /// The hash of all fields but the last.
    pub(super) fn checked(&self) -> serde_json::Result<String> {
        let text = serde_json::to_string(&Self { check: String::new(), ..self.clone() })?;
        Ok(blake3::hash(text.as_bytes()).to_hex().to_string())
    }

    /// The text, of ASCII alone, as EXR files need it.
    ///
    /// # Errors
    /// Never, as all fields are texts and numbers.
    pub fn to_json(&self) -> serde_json::Result<String> {
        let text = serde_json::to_string(self)?;
        let mut ascii = String::with_capacity(text.len());
        for character in text.chars() {
            if character.is_ascii() && !character.is_ascii_control() {
                ascii.push(character);
            } else {
                // Only strings have such characters.
                for unit in character.encode_utf16(&mut [0; 2]) {
                    _ = write!(ascii, "\\u{unit:04x}");
                }
            }
        }
        Ok(ascii)
    }

    /// Reads the text of a picture.
    pub(super) fn from_json(path: &Path, text: &str) -> Result<Self, ImageError> {
        let invalid = |key: String, found: String, allowed: &str| content(path, &key, found, allowed.to_owned());
        let read: Self = serde_json::from_str(text).map_err(|error| {
            invalid("picture".to_owned(), error.to_string(), "the text that sheetsplat render writes into a picture")
        })?;
        if read.format != FORMAT {
            return Err(invalid("picture.format".to_owned(), read.format.to_string(), &FORMAT.to_string()));
        }
        if !["gpu", "cpu", "reference"].contains(&read.backend.as_str()) {
            return Err(invalid("picture.backend".to_owned(), read.backend, "gpu, cpu, reference"));
        }
        if let Some(depth) = read.depth.filter(|depth| ![8, 16].contains(depth)) {
            return Err(invalid("picture.depth".to_owned(), depth.to_string(), "8, 16"));
        }
        for (at, file) in read.files.iter().enumerate() {
            if !is_kept(&file.path) {
                let allowed = "a name, or a path in the picture's folder";
                return Err(invalid(format!("picture.files[{at}].path"), file.path.clone(), allowed));
            }
        }
        let hashes = [("pixels".to_owned(), &read.pixels), ("check".to_owned(), &read.check)];
        let of_files = (0..)
            .zip(&read.files)
            .filter_map(|(at, file): (usize, _)| Some((format!("files[{at}].blake3"), file.blake3.as_ref()?)));
        let of_values = (0..).zip(&read.values).map(|(at, hash): (usize, _)| (format!("values[{at}]"), hash));
        let is_hash = |hash: &str| hash.len() == 64 && hash.bytes().all(|byte| byte.is_ascii_hexdigit());
        let mut all = hashes.into_iter().chain(of_files).chain(of_values);
        if let Some((key, found)) = all.find(|(_, hash)| !is_hash(hash)) {
            return Err(invalid(format!("picture.{key}"), found.clone(), "64 hexadecimal digits"));
        }
        drop(all);
        Ok(read)
    }
}

impl Display for Provenance {
    /// The fields, a line for each, and then the scene file. The text is a file's: terminals get it through an escape.
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let mut line = |name: &str, value: &str| writeln!(f, "{name:<12} {value}");
        line("version", &self.version)?;
        line("backend", &self.backend)?;
        if let Some(adapter) = &self.adapter {
            line("adapter", adapter)?;
        }
        if !self.annotate.is_empty() {
            line("annotate", &self.annotate.join(", "))?;
        }
        if self.streamed {
            line("streamed", "the volume was read while it was drawn")?;
        }
        for SourceFile { path, blake3 } in &self.files {
            line(
                "file",
                &format!(
                    "{path}, {}",
                    blake3.as_deref().map_or("without a hash".to_owned(), |hash| format!("blake3 {hash}"))
                ),
            )?;
        }
        for (number, hash) in self.values.iter().enumerate() {
            line("values", &format!("of channel {number}: {hash}"))?;
        }
        if let Some(depth) = self.depth {
            line("depth", &depth.to_string())?;
        }
        line("pixels", &self.pixels)?;
        write!(f, "\n{}", self.scene)
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;

    fn provenance() -> Provenance {
        let hash = blake3::hash(b"").to_hex().to_string();
        let mut made =
            Provenance::new("1.2.3".to_owned(), "cpu".to_owned(), "[volume]\npath = \"Kopf 頭 🧠.nrrd\"\n".to_owned());
        made.files = vec![SourceFile { path: "Kopf 頭 🧠.nrrd".to_owned(), blake3: Some(hash.clone()) }];
        (made.pixels, made.depth) = (hash, Some(16));
        made.check = made.checked().unwrap();
        made
    }

    #[test]
    fn the_text_is_ascii_and_reads_back() {
        let made = provenance();
        let text = made.to_json().unwrap();
        assert!(text.is_ascii());
        let read = Provenance::from_json(Path::new("a.png"), &text).unwrap();
        assert_eq!((&read, read.checked().unwrap()), (&made, made.check.clone()));
    }

    /// Every field is under the hash.
    #[test]
    fn the_hash_tells_of_any_change() {
        let text = provenance().to_json().unwrap();
        for (from, to) in [("1.2.3", "1.2.4"), ("\"cpu\"", "\"reference\""), (".nrrd\\\"", ".nrrf\\\""), (":16", ":8")]
        {
            assert!(text.contains(from), "{from}");
            let read = Provenance::from_json(Path::new("a.png"), &text.replacen(from, to, 1)).unwrap();
            assert_ne!(read.checked().unwrap(), read.check, "{from}");
        }
    }

    #[test]
    fn errors_name_the_picture_and_the_field() {
        let text = provenance().to_json().unwrap();
        let digit = &provenance().pixels[..8];
        for (from, to, words) in [
            ("\"format\":1", "\"format\":2", "picture.format: found 2"),
            ("\"cpu\"", "\"cuda\"", "picture.backend: found cuda"),
            (":16", ":12", "picture.depth: found 12"),
            ("\"path\":\"", "\"path\":\"/home/", "picture.files[0].path: found /home/"),
            ("\"path\":\"", "\"path\":\"../", "picture.files[0].path: found ../"),
            (digit, "x", "picture.files[0].blake3: found x"),
            ("\"version\"", "\"verse\"", "picture: found unknown field `verse`"),
            ("}]", "", "picture: found "),
        ] {
            assert!(text.contains(from), "{from}");
            let error = Provenance::from_json(Path::new("a.png"), &text.replacen(from, to, 1)).unwrap_err().to_string();
            assert!(error.starts_with("a.png: ") && error.contains(words), "{error}");
        }
    }
}
