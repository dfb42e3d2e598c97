// The means of sheets along pixels' rays, for the compositing modes that use them; `splatting::Compositing` defines them.
// The stage declares `COMPOSITING` and `cut`.
//
// #import shared/cut
// #import shared/frame

// The weight of a pixel's sheets, and which of them count.
struct Means {
    // The factor for sheets.
    weight: f32,
    // The range of sheet depths of the middles of slabs that count.
    counted: vec2f,
}

// The tolerance for slabs' middles, in slabs, and for rays beside a box of voxel centres, in grid steps: in views along an axis rounding would
// decide otherwise.
const HAIR = 0.01;

fn is_by_means() -> bool {
    return COMPOSITING >= MAXIMUM;
}

// The range of depths along w in which a ray lies in the box with this half size in grid steps; reversed if it is empty.
fn in_box(at: vec3f, half: vec3f) -> vec2f {
    var depths = vec2f(cut.box_half.w, FAR);
    for (var axis = 0u; axis < 3u; axis += 1u) {
        let place = dot(cut.box_at[axis].xyz, at) - cut.box_at[axis].w;
        let slope = dot(cut.box_along[axis].xyz, at);
        let crossings = (vec2f(-half[axis], half[axis]) - place) / slope;
        let inside = vec2f(min(crossings.x, crossings.y), max(crossings.x, crossings.y));
        depths.x = select(depths.x, max(depths.x, inside.x), slope != 0.0);
        depths.y = select(depths.y, min(depths.y, inside.y), slope != 0.0);
        depths.y = select(depths.y, -FAR, slope == 0.0 && abs(place) > half[axis]);
    }
    return depths;
}

// The weight of sheets for the pixel at a point of the image.
fn means(point_px: vec2f) -> Means {
    let at = place_of(point_px);
    let offset = select(0.0, frame.pixel_per_depth, frame.near > 0.0) * at.xy;
    // The ray's length per unit of depth along w.
    let stretch = sqrt(1.0 + dot(offset, offset));
    if COMPOSITING == AVERAGE {
        let within = both(in_box(at, cut.box_half.xyz), shown_depths(point_px));
        let centers = in_box(at, cut.box_half.xyz - (0.5 - HAIR));
        let is_in = within.x < within.y && centers.x <= centers.y;
        return Means(select(0.0, 1.0 / (stretch * (within.y - within.x)), is_in), vec2f(0.0));
    }
    let weight = abs(dot(cut.sheet_along.xyz, at)) / (stretch * frame.slab_width);
    if COMPOSITING != MINIMUM {
        return Means(weight, vec2f(0.0));
    }
    let within = both(in_box(at, cut.box_half.xyz + HAIR), shown_depths(point_px));
    let sheets = sheet_depths(at, within);
    let middle = 0.5 * (sheets.x + sheets.y);
    let half_slab = 0.5 * frame.slab_width;
    let counted = vec2f(min(sheets.x, middle - half_slab), max(sheets.y, middle + half_slab));
    let hair = HAIR * frame.slab_width;
    return Means(weight, select(vec2f(FAR, -FAR), counted + vec2f(-hair, hair), within.x < within.y));
}

// The intersection of two ranges.
fn both(a: vec2f, b: vec2f) -> vec2f {
    return vec2f(max(a.x, b.x), min(a.y, b.y));
}
