// The colour that the compositing buffer stands for, before the background (SPEC §§5, 6).
//
// #import shared/frame

fn finished(image: vec4f, compositing: u32) -> vec4f {
    switch compositing {
        case XRAY, AVERAGE: {
            return min(image, vec4f(1.0));
        }
        case MINIMUM: {
            return vec4f(image.rgb, select(2.0 - image.a, 0.0, image.a == 0.0));
        }
        case SURFACE: {
            // Alpha counts the channels that are equally near, of which `join` makes one surface.
            return select(vec4f(0.0), image / max(image.a, 1.0), image.a >= 1.0);
        }
        default: {
            return closed(image);
        }
    }
}

// A pixel whose culling may have stopped it, filled up with its own colour (SPEC §6): entirely from the threshold T on, not below 2T - 1.
fn closed(image: vec4f) -> vec4f {
    let least = max(2.0 * frame.closing - 1.0, 0.0);
    if frame.closing == 0.0 || image.a <= least {
        return image;
    }
    let share = min((image.a - least) / (frame.closing - least), 1.0);
    let alpha = image.a + (1.0 - image.a) * (share * share);
    return vec4f(image.rgb * (alpha / image.a), alpha);
}
