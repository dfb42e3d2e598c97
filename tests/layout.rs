//! Every struct that Rust and WGSL share has the same members at the same places in both. Needs no GPU.
#![expect(clippy::unwrap_used, reason = "tests")]

use std::mem::offset_of;

use naga::proc::Layouter;
use naga::{AddressSpace, Handle, Module, Type, TypeInner};
use sheetsplat::gpu::layout::{Band, Frame, Slab, Splat, Voxel};
use sheetsplat::gpu::shaders;

/// A `repr(C)` struct as Rust lays it out: name, size, and members with name, offset and size.
struct Layout {
    name: &'static str,
    size: usize,
    members: Vec<(&'static str, usize, usize)>,
}

/// The size of the member that a function picks.
fn size_of_member<S, M>(_: fn(&S) -> &M) -> usize {
    size_of::<M>()
}

macro_rules! layout {
    ($name:ident { $($member:ident),* $(,)? }) => {{
        // Without `..`: a member that is missing here does not compile.
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
        }
    }};
}

fn shared() -> [Layout; 5] {
    [
        layout!(Voxel { index, value, normal, gradient_magnitude }),
        layout!(Splat { x_px, y_px, depth, rg, ba }),
        layout!(Frame {
            screen_from_voxel,
            pixels_from_footprint,
            footprint_from_pixels,
            light,
            half_vector,
            shading,
            background,
            dims,
            ramps,
            size,
            amplitude,
            radius,
            support,
            falloff,
            slab_width,
            compositing,
            order,
            padding_0,
            padding_1,
            padding_2,
        }),
        layout!(Slab { near }),
        layout!(Band { first_row, rows }),
    ]
}

fn modules() -> impl Iterator<Item = (&'static str, Module)> {
    shaders::ALL.iter().map(|shader| (shader.stage, naga::front::wgsl::parse_str(shader.source).unwrap()))
}

fn find<'a>(module: &'a Module, name: &str) -> Option<(Handle<Type>, &'a Type)> {
    module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(name))
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
            // The size WGSL rounds a struct up to is also the smallest binding that holds one, and, as it is a multiple of
            // the alignment, the stride of an array of them.
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
