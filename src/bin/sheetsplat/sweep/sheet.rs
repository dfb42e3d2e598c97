//! Contact sheets: tiles with labels below them.

use sheetsplat::image::Image;
use sheetsplat::internals::text::{em, filled, lay, line, width, write};

/// Pixels around every cell.
const MARGIN: u32 = 8;
const PAGE: f32 = 0.15;

/// The colour of labels, and the least height of their font in pixels, which grows with the tiles.
const INK: [f32; 3] = [0.9; 3];
const LEAST: f32 = 13.0;

/// An image and the lines of text below it.
pub(super) struct Tile {
    pub(super) image: Image,
    pub(super) label: Vec<String>,
}

/// Cells of one size, which fit every tile and label.
pub(super) struct Layout {
    columns: u32,
    /// The height of the labels' font in pixels.
    em: f32,
    cell: [u32; 2],
    pub(super) size: [u32; 2],
}

impl Layout {
    /// The layout for tiles of these sizes with these labels, row by row; `None` if the sheet would exceed the maximum image size.
    pub(super) fn new(columns: u32, tiles: &[([u32; 2], &[String])]) -> Option<Self> {
        let em = tiles.iter().map(|&(size, _)| em(size)).fold(LEAST, f32::max);
        let mut cell = [0; 2];
        for &([tile_width, height], label) in tiles {
            let text_height = u32::try_from(label.len()).ok()?.checked_mul(line(em))?;
            let text_width = label.iter().map(|text| width(text, em)).max().unwrap_or(0);
            cell = [cell[0].max(tile_width).max(text_width), cell[1].max(height.checked_add(text_height)?)];
        }
        let cells = [columns, u32::try_from(tiles.len()).ok()?.div_ceil(columns)];
        let side = |cell: u32, count: u32| cell.checked_add(MARGIN)?.checked_mul(count)?.checked_add(MARGIN);
        Some(Self { columns, em, cell, size: [side(cell[0], cells[0])?, side(cell[1], cells[1])?] })
    }

    /// Draws the sheet on an opaque background.
    pub(super) fn draw(&self, tiles: &[Tile]) -> Image {
        let mut sheet = filled(self.size, [PAGE, PAGE, PAGE, 1.0]);
        for (Tile { image, label }, at) in tiles.iter().zip(0..) {
            let corner = [at % self.columns, at / self.columns];
            let [left, top] = [0, 1].map(|axis| MARGIN + corner[axis] * (self.cell[axis] + MARGIN));
            lay(&mut sheet, [left, top], image);
            for (text, row) in label.iter().zip(0..) {
                write(&mut sheet, [left, top + image.height + row * line(self.em)], text, self.em, INK);
            }
        }
        sheet
    }
}
