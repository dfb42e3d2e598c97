//! Images in memory.

/// An image of f32 premultiplied RGBA, with row 0 at the top. Colours are display-referred (SPEC §3).
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Pixels per row.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
    /// `width · height` pixels, row by row.
    pub pixels: Vec<[f32; 4]>,
}

impl Image {
    /// Each pixel with straight alpha, its channels rounded to steps of 1/`full`; black where alpha is 0.
    pub fn straight_channels(&self, full: u16) -> impl Iterator<Item = [u16; 4]> {
        let full = f32::from(full);
        self.pixels.iter().map(move |&[r, g, b, a]| {
            let scale = if a > 0.0 { a.recip() } else { 0.0 };
            [r * scale, g * scale, b * scale, a].map(|channel| (channel * full).round().clamp(0.0, full) as u16)
        })
    }
}
