//! The WGSL files below `shaders/`, as they are in the program.

use super::imports::{self, File, Numbers};

/// The text of a file.
#[cfg(not(target_arch = "wasm32"))]
macro_rules! text {
    ($file:expr) => {
        include_str!(concat!("../../../shaders/", $file, ".wgsl"))
    };
}

/// The text of a file without comments, indents and spaces beside signs, because a page's code must be short. Lines stay, so that messages name the right ones.
#[cfg(target_arch = "wasm32")]
macro_rules! text {
    ($file:expr) => {{
        const TEXT: &str = include_str!(concat!("../../../shaders/", $file, ".wgsl"));
        const CODE: ([u8; TEXT.len()], usize) = comments::without(TEXT);
        const BYTES: [u8; CODE.1] = comments::first(&CODE.0);
        match std::str::from_utf8(&BYTES) {
            Ok(code) => code,
            Err(_) => panic!("comments end at characters"),
        }
    }};
}

macro_rules! files {
    ($($name:literal)*) => {
        &[$({
            const IMPORTS: &([&str; imports::MOST], usize) =
                &imports::of(include_str!(concat!("../../../shaders/", $name, ".wgsl")));
            File {
                name: $name,
                path: concat!($name, ".wgsl"),
                text: text!($name),
                imports: IMPORTS.0.split_at(IMPORTS.1).0,
            }
        }),*]
    };
}

/// Every file. Only those that stages are assembled from are in a program.
pub(super) const FILES: &[File; 85] = files![
    "classify" "clear" "compact" "composite" "cull_bricks" "cull_voxels" "field" "field_colors" "first_hit" "gather"
    "gather_planes" "join" "occlude" "resolve" "sample" "shade" "splat" "splat_perspective" "tiles" "values"
    "gather/amounts" "gather/bits" "gather/economic_kernel" "gather/economies" "gather/group" "gather/kernel"
    "gather/patch" "gather/pixels" "gather/plane_reach" "gather/planes" "gather/queue" "gather/ramps" "gather/region"
    "gather/sheet_reach" "gather/sheets" "gather/slabs" "gather/state" "gather/subgroup_barrier"
    "gather/subgroup_lanes" "gather/subgroup_main" "gather/uniforms" "gather/voxels" "gather/walk"
    "gather/workgroup_barrier" "gather/workgroup_lanes" "gather/workgroup_main"
    "shared/band" "shared/brick" "shared/cells" "shared/channels" "shared/colors" "shared/compositing"
    "shared/corners" "shared/culled" "shared/cut" "shared/exact" "shared/field_voxel" "shared/finished"
    "shared/first_surface" "shared/footprints" "shared/frame" "shared/gradient" "shared/light" "shared/local_ray" "shared/means"
    "shared/number" "shared/opaque" "shared/own_color" "shared/plane_quads" "shared/planes" "shared/project"
    "shared/ramps" "shared/scan" "shared/seen" "shared/shading" "shared/sheets" "shared/slab" "shared/slab_integral" "shared/splat"
    "shared/splatted_color" "shared/tally" "shared/texels" "shared/tile_list" "shared/turned_quads" "shared/volume"
];

/// What each of them imports.
pub(super) const IMPORTS: &Numbers<{ FILES.len() }> = &imports::numbers(FILES);

#[cfg(target_arch = "wasm32")]
mod comments {
    /// The bytes of a text without its comments, indents and spaces beside signs, and their number. WGSL has no strings.
    pub(super) const fn without<const N: usize>(text: &str) -> ([u8; N], usize) {
        let (text, mut code, mut count, mut at, mut is_comment) = (text.as_bytes(), [0; N], 0, 0, false);
        while at < N {
            is_comment = text[at] != b'\n' && (is_comment || text[at] == b'/' && at + 1 < N && text[at + 1] == b'/');
            let is_indent = text[at] == b' ' && (count == 0 || code[count - 1] == b'\n');
            // A space may divide two signs that would be another one together, `> =` or `- -`.
            let is_beside_sign = text[at] == b' ' && count > 0 && at + 1 < N && {
                let (before, after) = (code[count - 1], text[at + 1]);
                (is_sign(before) || is_sign(after))
                    && !(matches!(before, b'<' | b'>') && after == b'=')
                    && !(before == b'-' && after == b'-')
            };
            if !is_comment && !is_indent && !is_beside_sign {
                code[count] = text[at];
                count += 1;
            }
            at += 1;
        }
        (code, count)
    }

    const fn is_sign(byte: u8) -> bool {
        matches!(byte, b'%'..=b'/' | b':'..=b'>' | b'[' | b']' | b'{'..=b'}') && byte != b'.'
    }

    pub(super) const fn first<const N: usize>(bytes: &[u8]) -> [u8; N] {
        let (mut first, mut at) = ([0; N], 0);
        while at < N {
            first[at] = bytes[at];
            at += 1;
        }
        first
    }
}
