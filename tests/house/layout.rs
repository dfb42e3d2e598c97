//! Every struct shared by Rust and WGSL has the same members at the same offsets in both. Needs no GPU.

use std::mem::offset_of;

use naga::proc::Layouter;
use naga::{AddressSpace, Handle, Module, Type, TypeInner};
use sheetsplat::internals::gpu::layout::{
    Band, Brick, BrickState, Culled, Cut, FieldPlanes, FieldVoxel, Frame, Gather, Gathered, Indirect, PatchRange,
    SheetGroup, Splat, Tally, TileList, Visit,
};
use sheetsplat::internals::gpu::shaders;

/// A `repr(C)` struct as Rust lays it out: name, size, and members with name, offset and size.
struct Layout {
    name: &'static str,
    size: usize,
    members: Vec<(&'static str, usize, usize)>,
    /// The member that continues to the end of its buffer, an array of `u32`.
    tail: Option<&'static str>,
}

impl Layout {
    /// Marks a struct whose last member is the first element of an array that continues; WGSL counts one element too.
    fn goes_on(self) -> Self {
        Self { tail: self.members.last().map(|last| last.0), ..self }
    }
}

/// The size of the member that a function picks.
fn size_of_member<S, M>(_: fn(&S) -> &M) -> usize {
    size_of::<M>()
}

macro_rules! layout {
    ($name:ident { $($member:ident),* $(,)? }) => {{
        // Without `..`, a missing member does not compile.
        fn all_members($name { $($member: _),* }: $name) {}
        let _ = all_members;
        Layout {
            name: stringify!($name),
            size: size_of::<$name>(),
            members: vec![$((
                stringify!($member),
                offset_of!($name, $member),
                size_of_member(|it: &$name| &it.$member),
            )),*],
            tail: None,
        }
    }};
}

fn shared() -> [Layout; 17] {
    [
        layout!(Splat { x_px, y_px, depth, from_eye, rg, ba }),
        layout!(Cut {
            sheet_at,
            sheet_along,
            surface_depth,
            surface_w,
            planes,
            box_at,
            box_along,
            box_half,
            surface_origin,
            no_surface,
            first_hit,
            unit,
            none,
            plane_count,
            has_surfaces,
            region,
            slabs,
        }),
        layout!(Frame {
            screen_from_voxel,
            right,
            down,
            ahead,
            aspect,
            pixels_from_footprint,
            footprint_from_pixels,
            light,
            half_vector,
            shading,
            background,
            gradient,
            light_place,
            light_stacks,
            faces,
            dims,
            ramps,
            size,
            amplitude,
            radius,
            support,
            falloff,
            slab_width,
            reach,
            kernel_per_depth,
            section_width,
            near,
            pixel_per_depth,
            opacity_threshold,
            compositing,
            order,
            culling,
            tiles,
            per_unit,
            headlight,
            first_channel,
            value_offset,
            whole_values,
            channel_table,
            closing
        }),
        layout!(SheetGroup { half_box, box_filter, culling, near, first_brick, brick_count, index, number }),
        layout!(FieldPlanes {
            axes,
            step,
            screen_axis,
            per_pixel,
            origin,
            value_bias,
            value_scale,
            per_number,
            min_moment,
            channel,
            colors,
            padding_0
        }),
        layout!(FieldVoxel { x, y, depth, number, gradient_xy, gradient_z }),
        layout!(Brick { present, x, y, z, extent }),
        layout!(BrickState { hidden, shaded }),
        layout!(Visit { drawn, fresh, brick, padding }),
        layout!(Indirect { draw, dispatch, count }),
        layout!(TileList { args, tiles }).goes_on(),
        layout!(Tally {
            voxels_shaded,
            sections_rasterized,
            quads,
            bricks_tested,
            bricks_visited,
            padding_0,
            padding_1,
            padding_2
        }),
        layout!(Culled { tally, tiles }).goes_on(),
        layout!(Band { first_row, rows }),
        layout!(Gather {
            along,
            chord,
            metric,
            chord_scale,
            along_scale,
            near,
            depth_error,
            groups,
            bricks,
            drawn,
            composited,
            shear,
            half_width,
            whole_below,
            beta,
            peak,
            reached,
            most_passes,
            passes_per_group,
            passes_per_brick,
            search_passes,
            hits
        }),
        layout!(PatchRange { first_row, first_patch, end_patch, row_step }),
        layout!(Gathered { tally, words }).goes_on(),
    ]
}

fn modules() -> impl Iterator<Item = (&'static str, Module)> {
    shaders::ALL.iter().map(|shader| (shader.stage, naga::front::wgsl::parse_str(&shader.source()).unwrap()))
}

fn find<'a>(module: &'a Module, name: &str) -> Option<(Handle<Type>, &'a Type)> {
    module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(name))
}

/// Whether a type is an array of `u32` without gaps that continues to the end of its buffer.
fn is_endless(module: &Module, ty: Handle<Type>) -> bool {
    match module.types[ty].inner {
        TypeInner::Array { base, size: naga::ArraySize::Dynamic, stride } => {
            let element = &module.types[base].inner;
            assert!(matches!(element, TypeInner::Scalar(naga::Scalar::U32) | TypeInner::Atomic(naga::Scalar::U32)));
            assert_eq!(stride, 4);
            true
        }
        _ => false,
    }
}

#[test]
fn members_and_sizes_agree() {
    let mut failures = Vec::new();
    for layout in shared() {
        let mut shaders_with_it = 0;
        for (stage, module) in modules() {
            let Some((handle, ty)) = find(&module, layout.name) else { continue };
            shaders_with_it += 1;
            let mut layouter = Layouter::default();
            layouter.update(module.to_ctx()).unwrap();
            let TypeInner::Struct { members, span } = &ty.inner else {
                failures.push(format!("{stage}: {} is no struct", layout.name));
                continue;
            };
            let wgsl: Vec<_> = members
                .iter()
                .map(|member| {
                    let size = module.types[member.ty].inner.size(module.to_ctx()) as usize;
                    (member.name.as_deref().unwrap_or("?"), member.offset as usize, size)
                })
                .collect();
            if wgsl != layout.members {
                failures.push(format!("{stage}: {}:\n  WGSL {wgsl:?}\n  Rust {:?}", layout.name, layout.members));
            }
            let tail =
                members.iter().find(|member| is_endless(&module, member.ty)).and_then(|member| member.name.as_deref());
            if tail != layout.tail {
                failures.push(format!("{stage}: {}: goes on with {tail:?}, Rust: {:?}", layout.name, layout.tail));
            }
            // The size to which WGSL rounds a struct up is also the size of the smallest binding that holds one, and, being a multiple of the
            // alignment, the stride of an array of them.
            let stride = layouter[handle].to_stride() as usize;
            if (*span as usize, stride) != (layout.size, layout.size) {
                let (name, size) = (layout.name, layout.size);
                failures.push(format!("{stage}: {name}: WGSL {span} bytes, stride {stride}; Rust {size} bytes"));
            }
        }
        if shaders_with_it == 0 {
            failures.push(format!("{}: in no shader", layout.name));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn buffers_hold_shared_structs_or_plain_vectors() {
    let names = shared().map(|layout| layout.name);
    let mut failures = Vec::new();
    for (stage, module) in modules() {
        for (_, global) in module.global_variables.iter() {
            if !matches!(global.space, AddressSpace::Uniform | AddressSpace::Storage { .. }) {
                continue;
            }
            let element = |inner: &TypeInner| match *inner {
                TypeInner::Array { base, stride, .. } => (base, Some(stride)),
                _ => (global.ty, None),
            };
            let (element, stride) = element(&module.types[global.ty].inner);
            let element = &module.types[element];
            let variable = global.name.as_deref().unwrap_or("?");
            match element.name.as_deref() {
                Some(name) if names.contains(&name) => {
                    let size = shared().into_iter().find(|layout| layout.name == name).unwrap().size;
                    if stride.is_some_and(|stride| stride as usize != size) {
                        failures.push(format!("{stage}: {variable}: stride {stride:?}, {name} has {size} bytes"));
                    }
                }
                Some(name) => failures.push(format!("{stage}: {variable}: {name} is not compared with a Rust type")),
                // `[u32]` and `[vec4f]` on both sides, without gaps.
                None => {
                    let size = element.inner.size(module.to_ctx());
                    if stride != Some(size) {
                        failures.push(format!("{stage}: {variable}: stride {stride:?} of {size} bytes"));
                    }
                }
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}
