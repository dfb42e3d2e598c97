// Compositing of one sheet (eq. 2, SPEC §5).

// (1 - exp(-a)) / a, 1 at 0. The difference loses a small a's digits in f32; there the series is exact.
fn absorbed(a: f32) -> f32 {
    if a < 0.0625 {
        return 1.0 - a * (0.5 - a * (1.0 / 6.0 - a * (1.0 / 24.0 - a / 120.0)));
    }
    return (1.0 - exp(-a)) / a;
}

// A sheet over or under what is there.
fn composite(behind: vec4f, sheet: vec4f, compositing: u32, order: u32) -> vec4f {
    var s = sheet;
    switch compositing {
        case EXPONENTIAL: {
            s *= absorbed(s.a);
        }
        case XRAY: {
            return behind + s;
        }
        default: {
            s /= max(s.a, 1.0);
        }
    }
    if order == FRONT_TO_BACK {
        return behind + (1.0 - behind.a) * s;
    }
    return s + (1.0 - s.a) * behind;
}
