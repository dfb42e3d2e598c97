//! Files of light: NPZ archives of an array of both stacks' sheets (planes × rows × columns), occlusion's first, and of the description. Like any input, a
//! file is trusted only as far as its bytes can hold what it claims.

use std::path::Path;
use std::sync::Arc;

use super::description::{from_json, to_json};
use super::stored::StoredLight;
use crate::image::open::{content, of_volume};
use crate::image::{ImageError, output};
use crate::light::LightSheets;
use crate::part::{archive, hash_of};
use crate::volume::{Access, ReadOptions, SampleType, npy, npz};

/// The members.
const SHEETS: &str = "sheets.npy";
const DESCRIPTION: &str = "light.json";

/// The maximum length of a description in bytes.
const MAX_DESCRIPTION: u64 = 1 << 16;

/// The most light that a pixel may have: rounding leaves a little more than all.
const MOST_LIGHT: f32 = 1.001;

impl StoredLight {
    /// Checks that [`StoredLight::save`] knows the extension of a file.
    ///
    /// # Errors
    /// If it is not `.npz`.
    pub fn check_format(path: &Path) -> Result<(), ImageError> {
        let extension = path.extension().and_then(|extension| extension.to_str());
        if extension.is_some_and(|extension| extension.eq_ignore_ascii_case("npz")) {
            return Ok(());
        }
        let found = extension.map_or("none".to_owned(), |extension| format!("\".{extension}\""));
        Err(content(path, "extension", found, ".npz for light".to_owned()))
    }

    /// Opens light that [`StoredLight::save`] or `sheetsplat light` wrote.
    ///
    /// # Errors
    /// If the file cannot be read, holds no light, or needs more memory than [`ReadOptions::memory`] allows by default.
    pub fn open(path: &Path) -> Result<Self, ImageError> {
        Self::open_with(path, &ReadOptions::default())
    }

    /// Like [`StoredLight::open`], with a folder that files must lie in and a memory limit.
    ///
    /// # Errors
    /// As for [`StoredLight::open`], and if the options do not allow it.
    pub fn open_with(path: &Path, options: &ReadOptions) -> Result<Self, ImageError> {
        Self::check_format(path)?;
        let access = Access::new(options).map_err(of_volume)?;
        let read = npz::text_and_array(path, (DESCRIPTION, MAX_DESCRIPTION), SHEETS, &access);
        let (json, array) = read.map_err(of_volume)?;
        let (matter, stacks, hash) = from_json(path, &json)?;
        let [width, height, planes] = array.dims.to_array();
        let count: usize = stacks.iter().flatten().map(|stack| stack.planes).sum();
        if width != height || planes as usize != count {
            let allowed = format!("({count}, n, n), as the description says");
            return Err(content(path, "shape", format!("({planes}, {height}, {width})"), allowed));
        }
        if array.kind != SampleType::F32 {
            return Err(content(path, "descr", array.kind.to_string(), "float32".to_owned()));
        }
        let values = array.values.as_slice();
        access.reserve(path, "shape", format_args!("{count} sheets"), values.len() as u64 * 4).map_err(of_volume)?;
        let mut sheets = Vec::new();
        for stack in stacks.iter().flatten() {
            let pixels = width as usize * height as usize;
            let from = sheets.iter().map(Vec::len).sum::<usize>();
            sheets.push(values.iter().skip(from).take(stack.planes * pixels).collect::<Vec<f32>>());
        }
        if hash != hash_of(&sheets) {
            return Err(content(path, "light.sheets", "other sheets".to_owned(), format!("those of hash {hash}")));
        }
        if let Some(light) = sheets.iter().flatten().find(|light| !(0.0..=MOST_LIGHT).contains(*light)) {
            return Err(content(path, "sheets", light.to_string(), "numbers in [0, 1]".to_owned()));
        }
        let mut sheets = sheets.into_iter();
        let stacks = stacks.map(|stack| {
            let stack = stack?;
            let light = sheets.next()?;
            let sheets = LightSheets::stored(stack.place, width as usize, (stack.first, stack.planes), light);
            Some((stack.source, Arc::new(sheets)))
        });
        Ok(Self { name: path.display().to_string(), matter, stacks })
    }

    /// Saves the light as an `.npz` file: an array `sheets` of what light remains at the pixels of each plane, occlusion's and then shadow's, and
    /// the description `light.json`. The file appears whole or not at all.
    ///
    /// # Errors
    /// If the file's extension is another one, sheets take 4 GiB or more, or the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), ImageError> {
        let bytes = self.encode(path)?;
        output::write(path, &bytes).map_err(|source| ImageError::Io { path: path.to_owned(), source })
    }

    /// The bytes that [`StoredLight::save`] writes into a file.
    ///
    /// # Errors
    /// As for [`StoredLight::save`].
    pub fn encode(&self, path: &Path) -> Result<Vec<u8>, ImageError> {
        Self::check_format(path)?;
        let sheets: Vec<&LightSheets> = self.stacks.iter().flatten().map(|(_, sheets)| &**sheets).collect();
        let [side, planes] = [
            sheets.iter().map(|sheets| sheets.side).max().unwrap_or(0) as u64,
            sheets.iter().map(|sheets| sheets.planes() as u64).sum(),
        ];
        let stacks: Vec<&[f32]> = sheets.iter().map(|sheets| &sheets.light[..]).collect();
        let json = to_json(self, hash_of(&stacks));
        let json = json.map_err(|error| ImageError::Io { path: path.to_owned(), source: error.into() })?;
        let array = npy::encode(&[planes, side, side], stacks.iter().flat_map(|light| light.iter().copied()));
        archive(&[(SHEETS, &array), (DESCRIPTION, json.as_bytes())]).ok_or_else(|| {
            let found = format!("{planes} sheets of {side}×{side}, 4 GiB or more");
            content(path, "size", found, "less, by a larger shading.light_step".to_owned())
        })
    }
}
