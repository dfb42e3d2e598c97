// Composites one sheet buffer into the compositing buffer (eq. 2, front to back by default; SPEC §5).

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> band: Band;
@group(0) @binding(2) var sheet: texture_2d<f32>;
@group(0) @binding(3) var<storage, read_write> acc: array<vec4f>;

override TILE: u32 = 16u;

// (1 - exp(-a)) / a, 1 at 0. The difference loses a small a's digits in f32; there the series is exact.
fn absorbed(a: f32) -> f32 {
    if a < 0.0625 {
        return 1.0 - a * (0.5 - a * (1.0 / 6.0 - a * (1.0 / 24.0 - a / 120.0)));
    }
    return (1.0 - exp(-a)) / a;
}

@compute @workgroup_size(TILE, TILE)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= frame.size.x || id.y >= band.rows {
        return;
    }
    var s = textureLoad(sheet, vec2u(id.x, id.y + band.first_row), 0);
    if s.a <= 0.0 {
        return;
    }
    let at = id.y * frame.size.x + id.x;
    let behind = acc[at];
    switch frame.compositing {
        case EXPONENTIAL: {
            s *= absorbed(s.a);
        }
        case XRAY: {
            acc[at] = behind + s;
            return;
        }
        default: {
            s /= max(s.a, 1.0);
        }
    }
    if frame.order == FRONT_TO_BACK {
        acc[at] = behind + (1.0 - behind.a) * s;
    } else {
        acc[at] = s + (1.0 - s.a) * behind;
    }
}
