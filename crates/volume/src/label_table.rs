//! Tables of labels beside a volume: the names and colours of numbers, as FreeSurfer, Slicer and ITK-SNAP write them.

use std::path::Path;

use glam::DVec3;

use super::Volume;
use super::access::{Access, ReadOptions};
use super::address::builtin_name;
use super::error::volume::{VolumeError, invalid};
use super::loaded::Legend;

/// The number of bytes that a table has at most. Those of published atlases have fewer than a million.
const MOST_BYTES: u64 = 16 << 20;

/// Names and colours of labels by their numbers in files.
///
/// Lines of a table are `NUMBER NAME RED GREEN BLUE`, as in FreeSurfer's `FreeSurferColorLUT.txt` and Slicer's `.ctbl`, or
/// `NUMBER RED GREEN BLUE … "NAME"`, as in ITK-SNAP's label descriptions. Colours are whole numbers up to 255. What follows the colours, and lines that
/// begin with `#`, are left out.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelTable {
    origin: String,
    legend: Legend,
}

impl LabelTable {
    /// FreeSurfer's own labels, those of `aseg`, `aparc+aseg` and `wmparc` volumes, with their usual colours.
    pub fn freesurfer() -> Self {
        let origin = "builtin:freesurfer";
        let legend = parse(Path::new(origin), include_str!("freesurfer.txt")).unwrap_or_default();
        Self { origin: origin.to_owned(), legend }
    }

    /// Reads a table.
    ///
    /// # Errors
    /// If the file cannot be read, has more than 16 MiB, or has a line of another form. The error names the file and the line.
    pub fn open(path: &Path, options: &ReadOptions) -> Result<Self, VolumeError> {
        Self::read(path, &Access::new(options)?)
    }

    /// [`Self::open`] with what a scene may read, or [`Self::freesurfer`] by its name `builtin:freesurfer`.
    #[doc(hidden)]
    pub fn read(path: &Path, access: &Access) -> Result<Self, VolumeError> {
        match builtin_name(path) {
            Some("freesurfer") => return Ok(Self::freesurfer()),
            Some(_) => {
                return Err(invalid(path, "label table", "another name", "builtin:freesurfer, or a file's path"));
            }
            None => {}
        }
        let (mut source, mut budget, mut text) = (access.open(path)?, MOST_BYTES, String::new());
        while let Some(line) = source.line(&mut budget)? {
            text.push_str(&line);
            text.push('\n');
        }
        Ok(Self { origin: path.display().to_string(), legend: parse(path, &text)? })
    }
}

impl Volume {
    /// The same volume with a table's names and colours for its labels: those of a segmented volume, or else its values, which are labels then. A table
    /// precedes what the volume's file says.
    ///
    /// # Errors
    /// If the values are no labels: whole numbers from 0 on.
    pub fn with_label_table(mut self, table: &LabelTable) -> Result<Self, VolumeError> {
        let LabelTable { origin, legend } = table;
        let is_segmented = self.labels().is_some();
        let are_labels = |value: f32| value >= 0.0 && value.fract() == 0.0 || value.is_nan();
        if let Some(value) = self.values().iter().find(|&value| !is_segmented && !are_labels(value)) {
            let found = format!("a volume with the value {value}");
            return Err(invalid(Path::new(origin), "label table", found, "labels: whole numbers from 0 on".to_owned()));
        }
        let (names, colors) = (legend.label_names(self.label_ids()), legend.label_colors(self.label_ids()));
        let stated = if is_segmented { self.label_colors() } else { self.palette().unwrap_or_default() };
        // The first one of each stays.
        let colors = Legend::ascending([&colors, stated].concat()).unwrap_or_default();
        self.label_names.extend(names);
        match is_segmented {
            true => self.label_colors = colors,
            false => (self.is_label_map, self.palette) = (true, Some(colors)),
        }
        Ok(self)
    }
}

fn parse(path: &Path, text: &str) -> Result<Legend, VolumeError> {
    let mut names = Vec::new();
    let mut colors = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let Some((id, name, color)) = row(line) else {
            let allowed = "NUMBER NAME RED GREEN BLUE, or NUMBER RED GREEN BLUE … \"NAME\", with colours from 0 to 255";
            return Err(invalid(path, &format!("line {number}"), line.to_owned(), allowed.to_owned()));
        };
        names.push((id, name.to_owned()));
        colors.push((id as f64, color));
    }
    Ok(Legend { names, palette: Legend::ascending(colors), are_labels: true })
}

/// A label's number, name and colour.
fn row(line: &str) -> Option<(u64, &str, DVec3)> {
    let (id, rest) = line.split_once(char::is_whitespace)?;
    let id = id.parse().ok()?;
    if let Some((colors, name)) = rest.split_once('"') {
        return Some((id, name.strip_suffix('"')?, color(colors.split_whitespace())?));
    }
    let (name, colors) = rest.trim_start().split_once(char::is_whitespace)?;
    Some((id, name, color(colors.split_whitespace())?))
}

/// The first three of some fields as red, green and blue.
fn color<'a>(mut fields: impl Iterator<Item = &'a str>) -> Option<DVec3> {
    let mut next = || fields.next()?.parse::<u8>().ok().map(|share| f64::from(share) / 255.0);
    Some(DVec3::new(next()?, next()?, next()?))
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use glam::UVec3;

    use super::*;

    fn table(text: &str) -> Result<LabelTable, VolumeError> {
        Ok(LabelTable { origin: "t.txt".to_owned(), legend: parse(Path::new("t.txt"), text)? })
    }

    fn map() -> Volume {
        Volume::from_values("map", UVec3::new(3, 1, 1), DVec3::ONE, vec![0_u16, 17, 2035]).unwrap()
    }

    #[test]
    fn freesurfers_labels_have_names_and_colours() {
        let volume = map().with_label_table(&LabelTable::freesurfer()).unwrap();
        assert_eq!(volume.label_names()[&17], "Left-Hippocampus");
        assert_eq!(volume.label_names()[&2035], "ctx-rh-insula");
        let palette = volume.palette().unwrap();
        assert!(palette.contains(&(17.0, DVec3::new(220.0, 216.0, 20.0) / 255.0)));
        assert!(palette.contains(&(3001.0, DVec3::new(230.0, 155.0, 215.0) / 255.0)));
        assert!(palette.is_sorted_by(|a, b| a.0 < b.0));
        assert!(volume.is_known_label_map());
    }

    /// Lines as the programs write them.
    #[test]
    fn rows_of_freesurfer_slicer_and_itk_snap() {
        let text = "#No. Label Name: R G B A\n\n  17  Left-Hippocampus   220 216 20  0\n3 tumour 255 0 0 255\n";
        let snap = "# ITK-SnAP Label Description File\n    0     0    0    0        0  0  0    \"Clear Label\"\n   17   255    0  128        1  1  1    \"Label 17\"\n";
        let found = map().with_label_table(&table(text).unwrap()).unwrap();
        assert_eq!(found.label_names()[&3], "tumour");
        let found = found.with_label_table(&table(snap).unwrap()).unwrap();
        assert_eq!((&*found.label_names()[&17], &*found.label_names()[&3]), ("Label 17", "tumour"));
        assert!(found.palette().unwrap().contains(&(17.0, DVec3::new(255.0, 0.0, 128.0) / 255.0)));
    }

    #[test]
    fn other_lines_are_refused_by_their_number() {
        for line in
            ["17", "x name 1 2 3", "-1 name 1 2 3", "1 name 1 2", "1 name 1 2 256", "1 1 2 3 \"a", "1 1 2 \"a\""]
        {
            let message = table(&format!("1 a 1 2 3\n{line}\n")).unwrap_err().to_string();
            assert!(message.starts_with(&format!("t.txt: line 2: found {line}, allowed: NUMBER NAME")), "{message}");
        }
    }

    #[test]
    fn amounts_have_no_labels() {
        let volume = Volume::from_values("a", UVec3::new(2, 1, 1), DVec3::ONE, vec![0.0_f32, 0.5]).unwrap();
        let message = volume.with_label_table(&LabelTable::freesurfer()).unwrap_err().to_string();
        assert!(
            message.starts_with("builtin:freesurfer: label table: found a volume with the value 0.5, allowed: labels"),
            "{message}"
        );
    }
}
