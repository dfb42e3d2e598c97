// Compositing of one sheet (eq. 2, SPEC §5).
//
// #import shared/frame

// (1 - exp(-a)) / a, and 1 at 0. The difference cancels in f32 for small a, where the series is exact.
fn absorbed(a: f32) -> f32 {
    if a < 0.0625 {
        return 1.0 - a * (0.5 - a * (1.0 / 6.0 - a * (1.0 / 24.0 - a / 120.0)));
    }
    return (1.0 - exp(-a)) / a;
}

// The position between the middles of a slab and the next one at which the mean opacity is one half.
fn crossing(before: f32, opacity: f32) -> f32 {
    return (0.5 - before) / (opacity - before);
}

// Composites a sheet, or its mean, over or under the image. `MINIMUM` stores 2 minus the opacity, so that 0 means that nothing has counted;
// `SURFACE` stores the mean of the last sheet until the pixel is opaque.
fn composite(behind: vec4f, sheet: vec4f, compositing: u32, order: u32) -> vec4f {
    var s = sheet;
    switch compositing {
        case EXPONENTIAL: {
            s *= absorbed(s.a);
        }
        case XRAY, AVERAGE: {
            return behind + s;
        }
        case MAXIMUM, MINIMUM: {
            s = vec4f(s.rgb / max(s.a, 1.0), min(s.a, 1.0));
            s.a = select(s.a, 2.0 - s.a, compositing == MINIMUM);
            // The nearer of equal ones is kept.
            let is_taken = s.a > behind.a || (order != FRONT_TO_BACK && s.a == behind.a);
            return select(behind, s, is_taken);
        }
        case SURFACE: {
            let at = mix(behind, s, crossing(behind.a, s.a));
            let last = select(s, vec4f(2.0 * at.rgb, 1.0), s.a >= 0.5);
            return select(last, behind, behind.a >= 1.0);
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
