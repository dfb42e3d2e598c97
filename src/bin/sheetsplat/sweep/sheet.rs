//! Contact sheets: tiles with labels below them.

use sheetsplat::image::Image;

use crate::canvas::{LINE, filled, lay, text_width, write};

/// Pixels around every cell.
const MARGIN: u32 = 8;
const PAGE: f32 = 0.15;

/// An image and the lines of text below it.
pub(super) struct Tile {
    pub(super) image: Image,
    pub(super) label: Vec<String>,
}

/// Cells of one size, which fit every tile and label.
pub(super) struct Layout {
    columns: u32,
    cell: [u32; 2],
    pub(super) size: [u32; 2],
}

impl Layout {
    /// The layout for tiles of these sizes with these labels, row by row; `None` if the sheet would exceed the maximum image size.
    pub(super) fn new(columns: u32, tiles: &[([u32; 2], &[String])]) -> Option<Self> {
        let mut cell = [0; 2];
        for &([width, height], label) in tiles {
            let text_height = u32::try_from(label.len()).ok()?.checked_mul(LINE)?;
            let text_width = label.iter().map(|line| text_width(line)).max().unwrap_or(0);
            cell = [cell[0].max(width).max(text_width), cell[1].max(height.checked_add(text_height)?)];
        }
        let cells = [columns, u32::try_from(tiles.len()).ok()?.div_ceil(columns)];
        let side = |cell: u32, count: u32| cell.checked_add(MARGIN)?.checked_mul(count)?.checked_add(MARGIN);
        Some(Self { columns, cell, size: [side(cell[0], cells[0])?, side(cell[1], cells[1])?] })
    }

    /// Draws the sheet on an opaque background.
    pub(super) fn draw(&self, tiles: &[Tile]) -> Image {
        let mut sheet = filled(self.size, [PAGE, PAGE, PAGE, 1.0]);
        for (Tile { image, label }, at) in tiles.iter().zip(0..) {
            let corner = [at % self.columns, at / self.columns];
            let [left, top] = [0, 1].map(|axis| MARGIN + corner[axis] * (self.cell[axis] + MARGIN));
            lay(&mut sheet, [left, top], image);
            for (line, row) in label.iter().zip(0..) {
                write(&mut sheet, [left, top + image.height + row * LINE], line);
            }
        }
        sheet
    }
}
