//! Text in images: an embedded font, whose outlines fill pixels by `f32` sums in a fixed order, so that the same words are the same bytes everywhere.

use std::sync::LazyLock;

use ab_glyph::{Font, FontRef, GlyphId, PxScale, ScaleFont, point};

use super::canvas::over;
use crate::image::Image;

/// DejaVu Sans with the characters that `assets/fonts/README.md` lists.
static FONT: LazyLock<FontRef<'static>> = LazyLock::new(|| {
    FontRef::try_from_slice(include_bytes!("../../assets/fonts/DejaVuSans.ttf")).expect("the embedded font is a font")
});

/// The distance between lines, and from a line's top to its baseline, in heights of the font.
const LINE: f32 = 1.2;
const BASELINE: f32 = 0.95;

/// The character that stands for those that the font lacks.
const UNKNOWN: char = '\u{fffd}';

/// The mark of omitted text.
const ELLIPSIS: &str = "…";

/// The distance between lines in pixels, for a font's height (its em) in pixels.
pub fn line(em: f32) -> u32 {
    (em * LINE).ceil() as u32
}

/// The width of a line of text in pixels, rounded up.
pub fn width(text: &str, em: f32) -> u32 {
    placed(text, em).1.ceil() as u32
}

/// The text, or as many of its first characters as fit a width in pixels with an ellipsis.
pub fn fitted(text: &str, em: f32, room: u32) -> String {
    if width(text, em) <= room {
        return text.to_owned();
    }
    let ends: Vec<usize> = text.char_indices().map(|(at, _)| at).collect();
    let shortened = |&end: &usize| format!("{}{ELLIPSIS}", text[..end].trim_end());
    ends.iter().rev().map(shortened).find(|shortened| width(shortened, em) <= room).unwrap_or_default()
}

/// Writes a line with its upper left corner at a pixel, in a colour with alpha 1. The part outside the image is left out.
pub fn write(image: &mut Image, [left, top]: [u32; 2], text: &str, em: f32, ink: [f32; 3]) {
    let scale = scale(em);
    let baseline = (em * BASELINE).round();
    for (glyph, pen) in placed(text, em).0 {
        let glyph = glyph.with_scale_and_position(scale, point(pen, baseline));
        let Some(outline) = FONT.outline_glyph(glyph) else { continue };
        let corner = outline.px_bounds().min;
        outline.draw(|x, y, coverage| {
            let at = [(corner.x, x, left), (corner.y, y, top)];
            let [x, y] = at.map(|(corner, offset, start)| corner as i64 + i64::from(offset) + i64::from(start));
            let alpha = coverage.clamp(0.0, 1.0);
            if let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y)) {
                over(image, [x, y], [ink[0] * alpha, ink[1] * alpha, ink[2] * alpha, alpha]);
            }
        });
    }
}

/// The glyphs of a text with their pens, and the pen at its end.
fn placed(text: &str, em: f32) -> (Vec<(GlyphId, f32)>, f32) {
    let font = FONT.as_scaled(scale(em));
    let (mut pen, mut last) = (0.0, None);
    let glyphs = text.chars().map(|character| {
        let known = FONT.glyph_id(character);
        let glyph = if known.0 == 0 { FONT.glyph_id(UNKNOWN) } else { known };
        pen += last.map_or(0.0, |last| font.kern(last, glyph));
        let start = pen;
        pen += font.h_advance(glyph);
        last = Some(glyph);
        (glyph, start)
    });
    let glyphs = glyphs.collect();
    (glyphs, pen)
}

/// The rasterizer's scale is the distance from the font's ascender to its descender.
fn scale(em: f32) -> PxScale {
    let units = FONT.units_per_em().unwrap_or(1.0);
    PxScale::from(em * FONT.height_unscaled() / units)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::annotate::canvas::empty;

    /// The first and the last row with ink of a text in white.
    fn rows(text: &str, em: f32) -> [usize; 2] {
        let size = [width(text, em), line(em)];
        let mut image = empty(size);
        write(&mut image, [0, 0], text, em, [1.0; 3]);
        let is_inked = |row: &[[f32; 4]]| row.iter().any(|pixel| pixel[3] > 0.3);
        let inked: Vec<bool> = image.pixels.chunks(size[0] as usize).map(is_inked).collect();
        [inked.iter().position(|&is| is), inked.iter().rposition(|&is| is)].map(Option::unwrap_or_default)
    }

    #[test]
    fn letters_grow_with_the_font() {
        for em in [8.0, 16.0, 33.0, 54.0_f32] {
            let [first, last] = rows("RLAPI", em);
            let height = (last - first + 1) as f32;
            // Capitals of DejaVu without curves are 0.729 em high. Rows count of which 0.3 have ink: at each end 0.3 rows may be lost, or 0.7 won.
            assert!((-0.6..1.4).contains(&(height - 0.729 * em)), "{em}: {height}");
            let [_, descent] = rows("gjpqy", em);
            assert!(descent > last && (descent as u32) < line(em), "{em}: a line holds descenders");
        }
        let [small, large] = [10.0, 40.0].map(|em| width("0.5 µm", em) as f32);
        assert!((large / small - 4.0).abs() < 0.3, "{small} {large}");
    }

    #[test]
    fn characters_are_those_of_units_and_names_and_others_are_marked() {
        let is_known = |character: char| FONT.glyph_id(character).0 != 0;
        let texts = "RLAPSI 0123456789 .-+e× µm μm Å °C cm³ cm² 10⁻³ s⁻¹ Ω ‰ − … é ß ø Ł ğ α β γ Δ σ Ж";
        assert_eq!(texts.chars().filter(|&character| !is_known(character)).collect::<String>(), "");
        assert!(!is_known('脳') && is_known(UNKNOWN));
        assert_eq!(width("脳", 16.0), width("\u{fffd}", 16.0));
        assert!(width("脳", 16.0) > 0);
    }

    #[test]
    fn long_text_is_shortened_to_its_room() {
        let text = "fluid around the brain";
        assert_eq!(fitted(text, 16.0, 400), text);
        let short = fitted(text, 16.0, 80);
        assert!(short.ends_with('…') && text.starts_with(short.trim_end_matches('…')), "{short}");
        assert!(width(&short, 16.0) <= 80 && width(&short, 16.0) > 55, "{short}");
        assert_eq!(fitted(text, 16.0, 3), "");
    }
}
