// The counts of a frame, and the tiles that the current sheet group draws into; `gpu::layout::Culled` documents the fields.
//
// #import shared/tally

struct Culled {
    tally: Tally,
    tiles: array<atomic<u32>>,
}
