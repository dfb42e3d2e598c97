//! Contact sheets: tiles with labels below.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};
use sheetsplat::image::Image;

/// Pixels around every cell.
const MARGIN: u32 = 8;
const PAGE: f32 = 0.15;
const INK: f32 = 0.9;

const WEIGHT: FontWeight = FontWeight::Regular;
const TEXT: RasterHeight = RasterHeight::Size16;

/// An image and what is written below it, line by line.
pub(super) struct Tile {
    pub(super) image: Image,
    pub(super) label: Vec<String>,
}

/// Cells of one size for all tiles and labels.
pub(super) struct Layout {
    columns: u32,
    cell: [u32; 2],
    pub(super) size: [u32; 2],
}

impl Layout {
    /// For tiles of these sizes with these labels, filled in row by row; `None` if that is larger than any image.
    pub(super) fn new(columns: u32, tiles: &[([u32; 2], &[String])]) -> Option<Self> {
        let mut cell = [0; 2];
        for &([width, height], label) in tiles {
            let longest = label.iter().map(|line| line.chars().count()).max().unwrap_or(0);
            let text = [longest.checked_mul(get_raster_width(WEIGHT, TEXT))?, label.len().checked_mul(TEXT.val())?];
            let [text_width, text_height] = [u32::try_from(text[0]).ok()?, u32::try_from(text[1]).ok()?];
            cell = [cell[0].max(width).max(text_width), cell[1].max(height.checked_add(text_height)?)];
        }
        let cells = [columns, u32::try_from(tiles.len()).ok()?.div_ceil(columns)];
        let side = |cell: u32, count: u32| cell.checked_add(MARGIN)?.checked_mul(count)?.checked_add(MARGIN);
        Some(Self { columns, cell, size: [side(cell[0], cells[0])?, side(cell[1], cells[1])?] })
    }

    /// Draws the sheet, opaque.
    pub(super) fn draw(&self, tiles: &[Tile]) -> Image {
        let [width, height] = self.size;
        let page = vec![[PAGE, PAGE, PAGE, 1.0]; width as usize * height as usize];
        let mut sheet = Image { width, height, pixels: page };
        for (Tile { image, label }, at) in tiles.iter().zip(0..) {
            let corner = [at % self.columns, at / self.columns];
            let [left, top] = [0, 1].map(|axis| MARGIN + corner[axis] * (self.cell[axis] + MARGIN));
            for (pixel, at) in image.pixels.iter().zip(0..) {
                over(&mut sheet, [left + at % image.width, top + at / image.width], *pixel);
            }
            for (line, row) in label.iter().zip(0..) {
                write(&mut sheet, [left, top + image.height + row * TEXT.val() as u32], line);
            }
        }
        sheet
    }
}

/// Writes a line, its upper left corner at a pixel.
fn write(sheet: &mut Image, [left, top]: [u32; 2], line: &str) {
    // The font has ASCII.
    let raster = |character| get_raster(character, WEIGHT, TEXT).or_else(|| get_raster('?', WEIGHT, TEXT));
    for (character, place) in line.chars().filter_map(raster).zip(0..) {
        for (row, y) in character.rows().zip(0..) {
            for (&coverage, x) in row.iter().zip(0..) {
                let alpha = f32::from(coverage) / 255.0;
                let ink = INK * alpha;
                over(sheet, [left + place * character.width() as u32 + x, top + y], [ink, ink, ink, alpha]);
            }
        }
    }
}

/// Puts a premultiplied colour over a pixel.
fn over(sheet: &mut Image, [x, y]: [u32; 2], color: [f32; 4]) {
    let pixel = &mut sheet.pixels[y as usize * sheet.width as usize + x as usize];
    for (below, above) in pixel.iter_mut().zip(color) {
        *below = above + *below * (1.0 - color[3]);
    }
}
