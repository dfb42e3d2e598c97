// The colour that the compositing buffer stands for, before the background (SPEC §5).
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
            return image;
        }
    }
}
