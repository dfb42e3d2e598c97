//! Volume rendering by image-aligned sheet-buffer splatting on the GPU, through wgpu.
//!
//! The method is that of Mueller, Shareef, Huang and Crawfis, *High-Quality Splatting on Rectilinear Grids with Efficient
//! Culling of Occluded Voxels* (IEEE TVCG 5(2), 1999). Sections (§), equations, tables and figures in these docs are those of
//! that paper; "SPEC" is this project's specification of what an image must be, \[17\] is the paper's reference on
//! antialiasing.
//!
//! # From a file to a picture
//!
//! ```text
//! volume file → Volume ─ classify → ClassifiedVolume: its values, and which voxels of which bricks take part, on the GPU
//!                      ─ appearance: what the scene leaves open, such as the transfer function
//! scene file  → Scene  ─ View, FramePlan or TileBins: which bricks every group of sheets looks at (plain data)
//! SceneView: both, and what the next frame can keep of the last one
//!
//! on the GPU, by tiles:
//!   gather   every tile front to back with the sheets of a group in registers: which voxels are not hidden, their shading, their
//!            kernel sections, and the sheets into the compositing buffer
//! or by quads, per group of sheets:
//!   cull     which bricks, then which of their voxels are not hidden; those are shaded, once each, and only they need gradients
//!   tiles    where the group's splats fall
//!   splat    one quad per voxel adds its kernel sections to the group's sheet buffers
//!   composite  the sheets into the compositing buffer, and which pixels are opaque now
//!   occlude  the occlusion buffer: where a whole footprint is behind opaque pixels
//! at the end:
//!   resolve  the result over the background, into the host's target
//!   first_hit  the depths at which an opacity was reached, if asked for
//! ```
//!
//! Both rasterizers draw the same image, to rounding ([`splatting::Rasterizer`]).
//!
//! [`headless`] does all of it with a device of its own. Settings are those of [`scene`]. Every stage has a plain f64 twin in
//! [`reference`](mod@reference).
//!
//! # On a host's device
//!
//! The types at the crate's root are those a host needs. The host owns instance, adapter, device, queue, encoder and target; nothing
//! outside [`headless`] opens a device, submits, or waits.
//!
//! ```text
//! DeviceRequirements  what to ask for when opening the device
//! RendererOptions     what is drawn into → Renderer: pipelines, once
//! Volume              → GpuVolume: its textures, shared by views
//! Scene               → SceneView: what is shown of a volume, and setters
//!
//! Renderer::prepare   allocates, writes buffers; can fail
//! Renderer::record    into the host's encoder: all but the last stage
//! Renderer::present   the last stage in a pass of its own, at a Placement in the target
//! Renderer::draw      the same in a pass of the host's
//! ```
//!
//! A host with a scene around the volume makes the camera from its own matrices ([`Camera::from_clip_from_world`]) and hands over its
//! depth texture ([`SceneView::set_surfaces`]): what lies behind its surfaces is neither shown nor drawn. In turn it may ask for the depth
//! at which the volume reaches an opacity ([`SceneView::set_first_hit`]), as a texture or for single pixels ([`SceneView::pick`]).
//! [`clip`] planes and a crop box cut the volume open.
//!
//! The README has a whole frame on a host's device. Half a head, and what is at a pixel of it:
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
//! view.set_first_hit(Some(0.5));
//! headless.draw(&mut view)?;
//! let pick = headless.pick(&view, [32, 32])?.expect("the head is in the middle");
//! // On the cut face, to a voxel (of 5.3 units).
//! assert!(pick.position.y.abs() < 8.0, "{pick:?}");
//! # Ok(())
//! # }
//! ```
//!
//! # Glossary
//!
//! *voxel* a grid sample · *kernel* a radially symmetric function around each voxel of the warped grid ([`kernel`]) · *slab* the
//! space between two slicing planes ([`slab`]) · *kernel section* the part of a kernel in one slab · *footprint* a section
//! integrated along the view ray ([`footprint`]) · *sheet buffer* the image of one slab · *sheet group* consecutive sheets drawn
//! together · *compositing buffer* the accumulated image · *opacity buffer* its alpha · *occlusion buffer* the box-filtered
//! opacity buffer · *mean* of a sheet, what it holds at a pixel over the length of the ray in its slab
//! ([`splatting::Compositing`]) · *bucket* what touches one slab or group ([`bucket`]) · *iso-range* a closed interval of values that take
//! part ([`iso_range`]) · *label* which segment of a segmented volume a voxel belongs to
//! ([`Volume::labels`](volume::Volume::labels)) · *brick* 4×4×4 neighbouring voxels ([`brick`]) ·
//! *tile* a 32×32 pixel square; of the tile rasterizer one of 16×8.

pub mod appearance;
pub mod brick;
pub mod bucket;
pub mod camera;
pub mod classified_volume;
pub mod classify;
pub mod clip;
mod clip_from_world;
pub mod error;
pub mod fault;
pub mod footprint;
#[cfg(feature = "golden")]
pub mod golden;
pub mod gpu;
pub mod gpu_volume;
pub mod grid_warp;
pub mod headless;
pub mod image;
pub mod iso_range;
pub mod kernel;
pub mod means;
pub mod pass;
pub mod pick;
pub mod placement;
pub mod plan;
mod prepared_frame;
mod rasterizer;
pub mod reference;
pub mod renderer;
pub mod renderer_options;
pub mod scene;
pub mod scene_view;
pub mod shading;
pub mod slab;
pub mod slice_lists;
pub mod splatting;
pub mod stats;
pub mod surfaces;
pub mod tile_bins;
pub mod transfer_function;
pub mod value_list;
pub mod view;
pub mod volume;

pub use camera::Camera;
pub use gpu::device::DeviceRequirements;
pub use gpu_volume::GpuVolume;
pub use placement::Placement;
pub use renderer::Renderer;
pub use renderer_options::{Blend, RendererOptions};
pub use scene::Scene;
pub use scene_view::SceneView;
pub use volume::Volume;
pub use wgpu;

/// The README's code, run as a doc test.
#[cfg(all(doctest, feature = "golden"))]
#[doc = include_str!("../README.md")]
pub struct Readme;
