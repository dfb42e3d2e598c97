// What the economies of §8 change in a kernel: a whole one is in a single sheet, and a footprint ends where it adds too little. When off, every function
// here returns its input unchanged.
//
// #import gather/lanes
// #import gather/state
// #import shared/frame
// #import shared/local_ray

// Sheet depths beyond every kernel's reach.
const WHOLE = 1e6;

// The slot in which lanes hold their rims, behind those of `kernel`.
const RIM_SLOT = 8u;

// The distances from a voxel to the planes of a group: the first plane, and the four after it.
struct KernelPlanes {
    first: f32,
    others: vec4f,
}

// Planes that put a whole kernel into the sheet `whole`, beyond the kernel's reach on either side of it.
fn economic_planes(planes: KernelPlanes, whole: f32) -> KernelPlanes {
    if ECONOMIES && whole >= 0.0 {
        return KernelPlanes(-WHOLE, select(vec4f(-WHOLE), vec4f(WHOLE), vec4f(1.0, 2.0, 3.0, 4.0) > vec4f(whole)));
    }
    return planes;
}

// The ρ² from which on a footprint adds too little, for each sheet.
fn economic_rim(amount: f32, maps: SectionMaps) -> vec4f {
    if ECONOMIES {
        let amplitude = select(vec4f(1.0), maps.amplitude, PERSPECTIVE);
        return log(amount * amplitude * gather.peak) / frame.falloff;
    }
    return vec4f(0.0);
}

// Holds this lane's rim for the others.
fn hold_rim(own: vec4f) {
    if ECONOMIES {
        hold(RIM_SLOT, own);
    }
}

// Another lane's rim.
fn rim_of(own: vec4f, other: u32) -> vec4f {
    if ECONOMIES {
        return held(RIM_SLOT, own, other);
    }
    return own;
}

// The Gaussian of ρ², up to the footprint's rim.
fn within_rim(in_plane: vec4f, rho_squared: vec4f, rim: f32) -> vec4f {
    if ECONOMIES {
        return select(vec4f(0.0), in_plane, rho_squared < vec4f(rim));
    }
    return in_plane;
}
