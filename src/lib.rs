//! Volume rendering by image-aligned sheet-buffer splatting on the GPU, through wgpu.
//!
//! The method is that of Mueller, Shareef, Huang and Crawfis, *High-Quality Splatting on Rectilinear Grids with Efficient
//! Culling of Occluded Voxels* (IEEE TVCG 5(2), 1999). Sections (§), equations, tables and figures in these docs are those of
//! that paper. "SPEC" is this project's specification of images, and \[17\] is the paper's reference on antialiasing.
//!
//! # A picture of a file
//!
//! [`headless`] opens a GPU device of its own, without a window. A [`Scene`] states what is drawn and how; [`Scene::parse`] reads a
//! scene file's text, and [`Scene::from_volume`] makes a scene with the defaults for one volume.
//!
//! ```
//! use sheetsplat::Scene;
//! use sheetsplat::headless::{Headless, HeadlessOptions};
//! use sheetsplat::scene::VolumeSource;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let settings = ["image={width=64,height=64}".to_owned()];
//! let scene = Scene::from_volume(VolumeSource::Builtin("head:48".to_owned()), &settings)?;
//! let headless = Headless::new(&HeadlessOptions::default())?;
//! let rendering = headless.render(&scene)?;
//! assert_eq!(rendering.image.pixels.len(), 64 * 64);
//! # Ok(())
//! # }
//! ```
//!
//! # Many pictures of one volume
//!
//! A [`SceneView`] keeps what the next frame can reuse (§5); its setters state the cost of each change. It can also find the point of the
//! volume at a pixel:
//!
//! ```
//! use sheetsplat::Scene;
//! use sheetsplat::headless::{Headless, HeadlessOptions};
//! use sheetsplat::scene::VolumeSource;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let settings = ["clip.planes=[[0, 1, 0, 0]]".to_owned(), "image={width=64,height=64}".to_owned()];
//! let scene = Scene::from_volume(VolumeSource::Builtin("head:48".to_owned()), &settings)?;
//! let headless = Headless::new(&HeadlessOptions::default())?;
//! let mut view = headless.view(scene.load_volume()?, &scene)?;
//! view.set_first_hit(Some(0.5))?;
//! headless.draw(&mut view)?;
//! let pick = headless.pick(&view, [32, 32])?.expect("the head is in the middle");
//! // The picked point lies on the cut face, to within one voxel, which is 5.3 units long.
//! assert!(pick.position.y.abs() < 8.0, "{pick:?}");
//! # Ok(())
//! # }
//! ```
//!
//! # On a host's device
//!
//! An application that owns a wgpu device uses the types at the crate's root. The host owns instance, adapter, device, queue, encoder and
//! target; only [`headless`] opens a device, submits, or waits.
//!
//! | type | what the host does with it |
//! |---|---|
//! | [`DeviceRequirements`] | requests what the renderer needs when it opens the device |
//! | [`Renderer`], [`RendererOptions`] | makes the pipelines, once for each kind of target |
//! | [`Volume`], [`GpuVolume`] | loads a volume and puts it on the GPU, shared by all views |
//! | [`Scene`], [`SceneView`] | states what is shown of a volume, and changes it |
//! | [`Renderer::prepare`] | allocates and writes buffers; this can fail |
//! | [`Renderer::record`] | encodes all stages except the last into the host's encoder |
//! | [`Renderer::present`], [`Renderer::draw`] | encodes the last stage, in a pass of its own or of the host's, at a [`Placement`] |
//!
//! A host with a scene around the volume makes the camera from its own matrices ([`Camera::from_clip_from_world`]) and passes its
//! depth texture ([`SceneView::set_surfaces`]): what lies behind its surfaces is neither visible nor drawn. It may also request the depth
//! at which the volume reaches an opacity ([`SceneView::set_first_hit`]), as a texture or for single pixels ([`SceneView::pick`]).
//! [`Clip`](settings::Clip) planes and a crop box cut the volume open. `docs/guide/library.md` has a whole frame on a host's device.
//!
//! # The stages
//!
//! ```text
//! volume file → Volume ─ classify → on the GPU: the values, and for each brick which of its voxels take part
//!                      ─ appearance → what the scene does not state, such as the transfer function
//! scene file  → Scene  ─ the view's geometry → the bricks that every group of sheets visits (plain data)
//!
//! the tile rasterizer, one compute stage:
//!   gather   draws every tile front to back with a group's sheets in registers: culls, shades, adds kernel sections, composites
//! the quad rasterizer, for every group of sheets:
//!   cull     finds the bricks, then the voxels, that are not hidden; each visible voxel is shaded once, which needs its gradient
//!   tiles    marks where the group's splats fall
//!   splat    adds every voxel's kernel sections to the group's sheet buffers, one quad per voxel
//!   composite  composites the sheets into the compositing buffer and marks the pixels that have become opaque
//!   occlude  fills the occlusion buffer: where a whole footprint lies behind opaque pixels
//! at the end:
//!   resolve  composites the result over the background, into the host's target
//!   first_hit  writes the depths at which an opacity was reached, if the host requested them
//! ```
//!
//! Both rasterizers draw the same image up to rounding ([`Rasterizer`](settings::Rasterizer)). Tests compare every stage with a plain f64
//! evaluation.
//!
//! # Glossary
//!
//! *voxel* a grid sample · *kernel* a radially symmetric function around each voxel of the warped grid · *slab* the
//! space between two slicing planes · *kernel section* the part of a kernel in one slab · *footprint* a section
//! integrated along the view ray · *sheet buffer* the image of one slab · *sheet group* consecutive sheets drawn
//! together · *compositing buffer* the accumulated image · *opacity buffer* its alpha · *occlusion buffer* the box-filtered
//! opacity buffer · *mean* of a sheet, the sheet's value at a pixel divided by the length of the ray in its slab
//! ([`Compositing`](settings::Compositing)) · *bucket* the voxels that touch one slab or group · *iso-range* a closed interval of values
//! that take part · *label* the number of the segment that a voxel of a segmented volume belongs to
//! ([`Volume::labels`]) · *brick* 4×4×4 neighbouring voxels · *tile* a square of 32×32 pixels.

#[cfg_attr(
    not(any(feature = "cpu", feature = "codecs")),
    expect(dead_code, reason = "only drawing and writing stop early")
)]
mod abandon;
mod after;
#[cfg(feature = "annotate")]
pub mod annotate;
pub mod appearance;
#[cfg(feature = "cpu")]
pub mod cpu;
mod error;
mod finished;
mod geometry;
#[cfg(feature = "golden")]
pub mod golden;
#[cfg(feature = "gpu")]
mod gpu;
pub mod headless;
pub mod image;
mod kernel;
mod light;
mod lists;
pub mod part;
#[cfg(feature = "gpu")]
mod pass;
mod pick;
#[cfg(feature = "golden")]
pub mod provenance;
#[cfg(feature = "gpu")]
mod rasterizer;
mod reference;
#[cfg(feature = "gpu")]
mod renderer;
mod rendering;
pub mod scene;
pub mod settings;
pub mod stats;
mod stored_light;
pub mod volume;

use sheetsplat_volume::internals::parallel;

pub use error::RenderError;
#[cfg(feature = "gpu")]
pub use error::device::DeviceFault;
pub use error::device::{DeviceError, InsufficientLimit};
#[cfg(feature = "gpu")]
pub use geometry::surfaces::{SurfaceDepths, Surfaces};
#[cfg(feature = "gpu")]
pub use gpu::counts::PendingCounts;
#[cfg(feature = "gpu")]
pub use gpu::device::DeviceRequirements;
#[cfg(feature = "gpu")]
pub use gpu::fault::scoped;
#[cfg(feature = "gpu")]
pub use gpu::gpu_volume::GpuVolume;
#[cfg(feature = "gpu")]
pub use gpu::options::{Blend, RendererOptions};
#[cfg(feature = "gpu")]
pub use gpu::placement::Placement;
pub use image::Image;
pub use part::Part;
pub use pick::Pick;
#[cfg(feature = "gpu")]
pub use renderer::Renderer;
#[cfg(feature = "gpu")]
pub use renderer::pick::PendingPick;
#[cfg(feature = "gpu")]
pub use renderer::scene_view::{Prepared, SceneView};
pub use scene::Scene;
pub use settings::Camera;
pub use sheetsplat_volume::SettingError;
pub use stats::Stats;
pub use stored_light::StoredLight;
pub use volume::Volume;
// The libraries whose types stand in this one's signatures.
pub use glam;
#[cfg(feature = "gpu")]
pub use wgpu;

/// The stages and lists by themselves, for this project's own tests and benches. Nothing here is part of the public interface; it changes
/// without notice.
#[doc(hidden)]
pub mod internals {
    pub use sheetsplat_volume::internals::{check_spacing, identity, plain, plain_lines, plain_whole, unit};

    pub use crate::geometry::{footprint, grid_warp, means, plane_geometry, slab, view_geometry};
    pub use crate::lists::{brick, brick_union, bucket, classify, iso_range, patch_bins, quad_plan, value_list};
    pub use crate::part::fingerprint::fingerprint;
    pub use crate::settings::camera::{Eye, ViewBasis};
    pub use crate::settings::clip::ClippedVoxels;
    pub use crate::settings::shading::MIN_GRADIENT;

    /// Work that nobody waits for any more.
    pub mod abandon {
        pub use crate::abandon::watch;
    }

    /// Text in images.
    #[cfg(feature = "annotate")]
    pub mod text {
        pub use crate::annotate::canvas::{filled, lay};
        pub use crate::annotate::style::em;
        pub use crate::annotate::text::*;
    }

    /// The reconstruction kernel.
    pub mod kernel {
        pub use crate::kernel::Kernel;
    }

    /// Light sheets.
    pub mod light {
        pub use crate::light::*;
    }

    /// Classification after splatting.
    pub mod after {
        pub use crate::after::*;
    }

    /// The passes' common parts.
    #[cfg(feature = "gpu")]
    pub mod gpu {
        pub use crate::gpu::{
            bindings, brick_lists, classified_volume, device, footprint_texture, gathered_layout, layout,
            light_texture, ramps, render_pipeline, shaders, targets, timer, uniforms, volume_texture,
        };
    }

    /// The GPU's stages.
    #[cfg(feature = "gpu")]
    pub mod pass {
        pub use crate::pass::{
            classify, composite, cull, field, field_colors, first_hit, gather, join, occlude, resolve, sample, shade,
            splat, tiles, values,
        };
    }

    /// The f64 evaluations of the stages.
    pub mod reference {
        pub use crate::reference::*;
    }
}

/// The code in the README and the guide, run as doc tests.
#[cfg(all(doctest, feature = "golden", feature = "gpu"))]
mod guide {
    #[doc = include_str!("../README.md")]
    struct Readme;
    #[doc = include_str!("../docs/guide/golden-images.md")]
    struct GoldenImages;
    #[doc = include_str!("../docs/guide/library.md")]
    struct Library;
}
