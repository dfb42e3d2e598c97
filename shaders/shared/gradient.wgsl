// Gradients of voxels: of values, or of the membership of labels (SPEC §15), which `gpu::membership` uploads by blocks of 8×8×8 voxels.
// The stage declares `membership`.
//
// #import shared/frame
// #import shared/texels
// #import shared/volume

// Whether any channel has gradients of membership.
override MEMBERSHIP: bool = false;

const MEMBERSHIP_SIDE = 8u;

// The words of a block's mask of the voxels that have gradients.
const MEMBERSHIP_MASK = 16u;

// The words of each channel before all others: the place of its directory, or 0, and whether its labels lie beside its values.
const MEMBERSHIP_HEADER = 2u;

// The gradient of a voxel of the channel that is read.
fn gradient_at(voxel: vec3u) -> Gradient {
    if !MEMBERSHIP {
        return gradient_of(half_differences(voxel));
    }
    let header = MEMBERSHIP_HEADER * channel_read;
    let directory = membership_word(header);
    if directory == 0u {
        return gradient_of(half_differences(voxel));
    }
    let is_beside = membership_word(header + 1u) != 0u;
    let at = membership_place(directory, voxel);
    var own = Gradient(vec3f(0.0), 0.0);
    if at != 0u {
        let half = vec3u(membership_word(at), membership_word(at + 1u), membership_word(at + 2u));
        own = gradient_of(bitcast<vec3f>(half));
    }
    if !is_beside {
        return own;
    }
    // Opacities depend on the values' gradient.
    let differences = gradient_of(half_differences(voxel));
    return Gradient(select(differences.normal, own.normal, at != 0u), differences.magnitude);
}

// The place of a voxel's gradient; 0 if it has none.
fn membership_place(directory: u32, voxel: vec3u) -> u32 {
    let across = (frame.dims.xyz + (MEMBERSHIP_SIDE - 1u)) / MEMBERSHIP_SIDE;
    let block = voxel / MEMBERSHIP_SIDE;
    let record = membership_word(directory + block.x + across.x * (block.y + across.y * block.z));
    if record == 0u {
        return 0u;
    }
    let at = voxel % MEMBERSHIP_SIDE;
    let slot = at.x + MEMBERSHIP_SIDE * (at.y + MEMBERSHIP_SIDE * at.z);
    let bits = membership_word(record + slot / 32u);
    if ((bits >> (slot % 32u)) & 1u) == 0u {
        return 0u;
    }
    var before = countOneBits(bits & ((1u << (slot % 32u)) - 1u));
    for (var word = 0u; word < slot / 32u; word += 1u) {
        before += countOneBits(membership_word(record + word));
    }
    return record + MEMBERSHIP_MASK + 3u * before;
}

// The words lie in no pages.
fn membership_word(index: u32) -> u32 {
    let texel = folded(index, textureDimensions(membership).x);
    return textureLoad(membership, texel.xy, texel.z, 0).x;
}
