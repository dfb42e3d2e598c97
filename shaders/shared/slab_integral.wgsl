// The transfer function integrated from value to value (SPEC §9; Engel, Kraus, Ertl 2001), read from a table that `after::slab_integral` makes and
// describes. Values are given as the numbers that `after::normalization` makes of them.
// The stage declares `control_points`.
//
// #import shared/shading

// The means of the transfer function over a slab's values.
struct SlabIntegral {
    // The mean amount per unit length, without gradient opacity; 0 if no value has an opacity.
    amount: f32,
    // (v̄ - f0)/(f1 - f0): the position of the mean value between the first value and the last.
    share: f32,
    color: vec3f,
}

// The number of entries of a cell, and of a sum.
const CELL = 3u;
const SUM = 2u;

// The distance of the two Gauss nodes of an interval from its middle, in lengths of the interval.
const NODE = 0.28867513;

// A transfer function: its ramps as `ramps_of` tells them, of which the last entry is where its table starts; the table's first two entries; and the
// opacity of the first control point for gradients.
struct Table {
    ramps: vec4u,
    head: vec4f,
    domain: vec4f,
    first_graded: f32,
}

fn table_of(ramps: vec4u) -> Table {
    return Table(ramps, control_points[ramps.w], control_points[ramps.w + 1u], control_points[ramps.z].y);
}

// The first entry of a table's cells.
fn cells_of(table: Table) -> u32 {
    return table.ramps.w + 2u + u32(table.head.y);
}

// The cell that a number lies in.
fn cell_of(table: Table, x: f32) -> u32 {
    let bin = u32(clamp((x - table.domain.w) * table.domain.y, 0.0, table.head.y - 1.0));
    let ends = vec2u(control_points[table.ramps.w + 2u + bin].xy);
    let cells = cells_of(table);
    var first = ends.x;
    var last = ends.y;
    while first < last {
        let middle = (first + last + 1u) / 2u;
        let is_before = control_points[cells + CELL * middle].x <= x;
        first = select(first, middle, is_before);
        last = select(middle - 1u, last, is_before);
    }
    return first;
}

// The colour at a number.
fn color_at(table: Table, x: f32) -> vec3f {
    let within = clamp(x, table.domain.x, table.domain.z);
    let cell = cells_of(table) + CELL * cell_of(table, within);
    let start = control_points[cell];
    let along = clamp((within - start.x) * start.y, 0.0, 1.0);
    return control_points[cell + 1u].rgb + control_points[cell + 2u].rgb * along;
}

// The means of m·C and m over the part of a cell between two numbers. `cell` is its first entry.
fn mean_of_part(cell: u32, low: f32, high: f32, origin: f32) -> array<vec4f, 2> {
    let start = control_points[cell];
    let color = control_points[cell + 1u].rgb;
    let rise = control_points[cell + 2u].rgb;
    let x = low + (high - low) * vec2f(0.5 - NODE, 0.5 + NODE);
    let u = clamp((x - start.x) * start.y, vec2f(0.0), vec2f(1.0));
    let alpha = start.z + start.w * u;
    let m = 0.5 * vec2f(amount(alpha.x), amount(alpha.y));
    let sum = m.x + m.y;
    return array(vec4f(color * sum + rise * dot(m, u), sum), vec4f(dot(m, x - origin), 0.0, 0.0, 0.0));
}

// The means over the numbers from f0 to f1.
fn slab_integral(table: Table, f0: f32, f1: f32) -> SlabIntegral {
    let head = table.head;
    let domain = table.domain;
    let low = clamp(min(f0, f1), domain.x, domain.z);
    let high = clamp(max(f0, f1), domain.x, domain.z);
    if high < head.z || low > head.w {
        return SlabIntegral(0.0, 0.5, vec3f(0.0));
    }
    let cells = cells_of(table);
    let first = cell_of(table, low);
    let last = cell_of(table, high);
    let size = high - low;
    let is_one = first == last;
    let near_end = select(control_points[cells + CELL * first + 1u].w, high, is_one);
    let near = mean_of_part(cells + CELL * first, low, near_end, low);
    let near_weight = select((near_end - low) / size, 1.0, is_one);
    var color_and_amount = near[0] * near_weight;
    var moment = near[1].x * near_weight;
    if !is_one {
        let start = control_points[cells + CELL * last].x;
        let far = mean_of_part(cells + CELL * last, start, high, low);
        let far_weight = (high - start) / size;
        color_and_amount += far[0] * far_weight;
        moment += far[1].x * far_weight;
        if last > first + 1u {
            // Whole cells: two sums from the middle of the smallest block that holds them all, or the sum of a single cell.
            let a = first + 1u;
            let b = last - 1u;
            let level = firstLeadingBit(max(a ^ b, 1u));
            let sums = cells + u32(head.x) * (CELL + SUM * level);
            let before = control_points[sums + SUM * a];
            let before_color = control_points[sums + SUM * a + 1u].rgb;
            let after = select(control_points[sums + SUM * b], vec4f(0.0), a == b);
            let after_color = select(control_points[sums + SUM * b + 1u].rgb, vec3f(0.0), a == b);
            let total = before.x + after.x;
            color_and_amount += vec4f(before_color + after_color, total) / size;
            moment += (total * (before.z - low) + before.y + after.y) / size;
        }
    }
    if color_and_amount.a <= 0.0 {
        return SlabIntegral(0.0, 0.5, vec3f(0.0));
    }
    let along = clamp(moment / color_and_amount.a / select(1.0, size, size > 0.0), 0.0, 1.0);
    let share = select(select(1.0 - along, along, f0 <= f1), 0.5, size == 0.0);
    return SlabIntegral(color_and_amount.a, share, color_and_amount.rgb / color_and_amount.a);
}
