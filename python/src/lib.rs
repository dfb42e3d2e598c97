//! The part of the Python package `sheetsplat` that is written in Rust. The Python modules beside it are the public interface; they check and
//! convert arguments, and document them.

mod array;
mod camera;
mod colors;
mod error;
mod facts;
mod golden;
mod image;
mod part;
mod process;
mod provenance;
mod scene;
mod settings;
mod view;
mod volume;
mod warnings;
mod words;

/// The module `sheetsplat._native`.
#[pyo3::pymodule]
mod _native {
    #[pymodule_export]
    use crate::camera::{elevation_and_center, panned, pixel, placed, with_camera};
    #[pymodule_export]
    use crate::colors::color_volume;
    #[pymodule_export]
    use crate::facts::{color_array, label_array, placement, value_range, with_colors};
    #[pymodule_export]
    use crate::golden::{Comparison, check_golden, compare, open_image};
    #[pymodule_export]
    use crate::image::{Inputs, check_format, check_outputs, encode, save, write};
    #[pymodule_export]
    use crate::part::{Part, merge, split};
    #[pymodule_export]
    use crate::process::tidy;
    #[pymodule_export]
    use crate::provenance::{Provenance, scene_of_picture, verify};
    #[pymodule_export]
    use crate::scene::{Scene, presets};
    #[pymodule_export]
    use crate::view::View;
    #[pymodule_export]
    use crate::volume::{BytesRead, Volume, check_sizes, symbol};
    #[pymodule_export]
    use crate::words::{colormap, colormaps, eye, only};

    /// The version of the package.
    #[pymodule_export]
    #[expect(non_upper_case_globals, reason = "Python's own name")]
    const __version__: &str = env!("CARGO_PKG_VERSION");

    #[pymodule_init]
    fn init(_module: &pyo3::Bound<'_, pyo3::types::PyModule>) -> pyo3::PyResult<()> {
        crate::process::is_forked();
        crate::warnings::listen();
        Ok(())
    }
}
