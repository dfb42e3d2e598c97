//! The devices that tests draw on, and everything that draws whole frames.

use sheetsplat::DeviceRequirements;
use sheetsplat::cpu;
use sheetsplat::headless::{GpuHeadless, HeadlessOptions, Rendering};
use sheetsplat::scene::Scene;
use sheetsplat::settings::{FootprintForm, Rasterizer, Splatting};
use sheetsplat::volume::Volume;
use sheetsplat::wgpu::{Features, Limits, TextureFormat};

use super::adapter::adapter;
use super::pool::{Lent, Pool};

/// Everything that draws whole frames: the rasterizers on the GPU, and the native backend.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Drawing {
    /// A GPU's rasterizer.
    By(Rasterizer),
    /// The native backend.
    Native,
}

/// All of them.
pub(crate) const DRAWINGS: [Drawing; 3] =
    [Drawing::By(Rasterizer::Quads), Drawing::By(Rasterizer::Tiles), Drawing::Native];

impl Drawing {
    /// Draws a frame, which must succeed.
    pub(crate) fn render(self, gpu: &GpuHeadless, volume: &Volume, scene: &Scene) -> Rendering {
        let Self::By(rasterizer) = self else { return cpu::render(volume.clone(), scene).unwrap() };
        let splatting = Splatting { rasterizer, ..scene.splatting };
        gpu.render_volume(volume.clone(), &Scene { splatting, ..scene.clone() }).unwrap()
    }

    /// Whether sheets are summed in f16, or amounts rounded to it.
    pub(crate) fn rounds_to_f16(self) -> bool {
        self == Self::By(Rasterizer::Quads)
    }
}

/// Both rasterizers, each with all footprint forms that it supports.
pub(crate) const FORMS: [(Rasterizer, FootprintForm); 3] = [
    (Rasterizer::Quads, FootprintForm::SummedArea),
    (Rasterizer::Quads, FootprintForm::Sections),
    (Rasterizer::Tiles, FootprintForm::SummedArea),
];

/// Everything that draws whole frames, each with all footprint forms that it supports.
pub(crate) fn drawn_forms() -> impl Iterator<Item = (Drawing, FootprintForm)> {
    let native = (Drawing::Native, FootprintForm::SummedArea);
    FORMS.into_iter().map(|(rasterizer, form)| (Drawing::By(rasterizer), form)).chain([native])
}

/// The options of a device on the adapter that the tests draw on.
pub(crate) fn on_adapter() -> HeadlessOptions {
    HeadlessOptions::default().with_adapter(adapter())
}

/// A device as the program opens it, with f32 sheets, that this test has to itself while it runs. The test fails without a GPU or software driver.
pub(crate) fn gpu() -> &'static GpuHeadless {
    static POOL: Pool<GpuHeadless> = Pool::new();
    thread_local!(static LENT: Lent<GpuHeadless> = POOL.lend(new_gpu));
    LENT.with(|lent| lent.thing)
}

/// Such a device that no other test has used.
pub(crate) fn new_gpu() -> GpuHeadless {
    let options = on_adapter().with_sheet_format(TextureFormat::Rgba32Float);
    GpuHeadless::new(&options).unwrap_or_else(|error| panic!("the adapter that the tests draw on: {error}"))
}

/// A device with WebGPU's default limits, except that storage bindings have at most `bytes` bytes.
pub(crate) fn gpu_with_small_bindings(bytes: u64) -> GpuHeadless {
    let limits = Limits { max_storage_buffer_binding_size: bytes, ..Limits::default() };
    let requirements = DeviceRequirements { features: Features::FLOAT32_BLENDABLE, limits };
    let options = on_adapter().with_requirements(requirements).with_sheet_format(TextureFormat::Rgba32Float);
    GpuHeadless::new(&options).unwrap_or_else(|error| panic!("the adapter that the tests draw on: {error}"))
}
