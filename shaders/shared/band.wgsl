// The rows of the image whose compositing buffer is one binding; `gpu::layout::Band` documents the fields.
struct Band {
    first_row: u32,
    rows: u32,
}
