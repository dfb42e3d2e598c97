//! Light sheets (SPEC §14) as plain data, for every backend: what light remains in the slabs of a second splatting that is seen from the light (Nulkar and
//! Mueller, *Splatting with shadows*, Volume Graphics 2001), spread from sheet to sheet (Schott and others, *A directional occlusion shading model for
//! interactive direct volume rendering*, 2009). `reference::light` is the f64 evaluation.
//!
//! ```text
//! volume ─ matter ─→ the amounts of all voxels that take part, brick by brick; they depend on no direction
//! light  ─ view ───→ the light's geometry: pixels, slabs, and where a point lies among them
//! both   ─ splat ──→ the footprints of voxels
//!        ─ band ───→ their amounts a_k in one slab after the other, in some rows, as the light that they let through, exp(-a_k)
//!        ─ sheets ─→ T_{k+1} = B(T_k·exp(-a_k)) slab by slab; behind no light bricks are left out
//! point  ─ lights ─→ T of occlusion and of shadow there, and from them A and S
//! ```
//!
//! Everything is `f32` by IEEE `+ - × ÷ √` alone and each sum is taken in one order, so that stacks have the same bytes on every machine with any number of
//! threads (SPEC §12).

mod band;
mod box_filter;
mod kept;
mod lights;
mod lit;
mod matter;
mod profile;
mod sheets;
mod source;
mod splat;
mod streamed;
mod view;
mod window;

pub use kept::KeptLight;
pub use lights::{Left, LightStack, Lights};
pub use matter::LightMatter;
pub use sheets::LightSheets;
pub(crate) use source::{LightSource, sources};
pub use streamed::StreamedLight;
