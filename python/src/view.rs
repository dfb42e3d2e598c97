//! Views of a volume, drawn by any backend without holding Python's lock.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use numpy::PyArray3;
use pyo3::prelude::*;
use sheetsplat::StoredLight;
use sheetsplat::annotate::{Annotation, Layout, layout};
use sheetsplat::golden::Subject;
use sheetsplat::headless::{Backend, Headless, HeadlessOptions, HeadlessView};
use sheetsplat::scene::OpenVolume;
use sheetsplat::stats::Stats;
use sheetsplat::volume;

use crate::error::{Raised, forked, setting};
use crate::image::{self, Inputs};
use crate::part::{Part, window};
use crate::process::{detached, is_forked, may_commit};
use crate::provenance::{self, Known, Provenance};
use crate::scene::{Scene, annotations};
use crate::volume::Volume;

/// A picture's pixels, its statistics as JSON, the adapter and driver that made it, and how it was made.
type Drawn<'py> = (Bound<'py, PyArray3<f32>>, String, Option<(String, String)>, Provenance);

/// A view of a volume for any number of pictures. One thread draws at a time.
#[pyclass(frozen, module = "sheetsplat._native")]
pub(crate) struct View(Arc<Shared>);

/// A view, shared with a picture that nobody waits for any more.
struct Shared {
    headless: Arc<Headless>,
    annotations: Vec<Annotation>,
    current: Mutex<Current>,
    /// The process that made it, without which a device, and the threads that read a volume while it is drawn, are gone.
    bound_to: Option<u32>,
    source: Source,
}

/// Where the volume comes from.
struct Source {
    /// A scene that names it, unless it is one from memory.
    named: Option<sheetsplat::Scene>,
    inputs: volume::Inputs,
    known: Known,
}

/// What a view draws next.
struct Current {
    view: HeadlessView,
    /// The words beside its pictures, if there are any.
    layout: Option<Layout>,
    /// Width and height of its pictures.
    size: [u32; 2],
    /// The milliseconds that the last change of the scene took.
    prepare_ms: f64,
}

impl Shared {
    /// Checks that what the view draws with is in this process.
    fn check_process(&self) -> Result<(), Raised> {
        let is_here = self.bound_to.is_none_or(|process| process == std::process::id());
        if is_here { Ok(()) } else { Err(forked("a view that was made before")) }
    }

    /// How the picture that was drawn last was made.
    fn provenance(&self, current: &Current, stats: &Stats) -> Provenance {
        let Source { named, inputs, known } = &self.source;
        let is_shown = |(_, annotation): &(&str, Annotation)| self.annotations.contains(annotation);
        Provenance {
            scene: provenance::named(current.view.scene(), named.as_ref()),
            layout: current.layout.clone(),
            annotate: Annotation::ALL.into_iter().filter(is_shown).map(|(name, _)| name.to_owned()).collect(),
            stats: stats.clone(),
            volume: provenance::Drawn::of(&current.view.volume()),
            inputs: inputs.clone(),
            known: known.clone(),
        }
    }

    /// A picture that failed leaves a view that can draw the next one.
    fn lock(&self) -> MutexGuard<'_, Current> {
        self.current.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl View {
    #[new]
    #[expect(clippy::too_many_arguments, reason = "the package's Python part passes its own")]
    fn new(
        py: Python<'_>,
        volume: &Volume,
        scene: &Scene,
        backend: &str,
        adapter: Option<String>,
        annotate: Vec<String>,
        light: Option<PathBuf>,
        named: Option<&Scene>,
    ) -> PyResult<Self> {
        let annotations = annotations(&annotate)?;
        let backend: Backend = backend.parse().map_err(|allowed: String| {
            setting("backend", &format!("{backend:?}"), allowed.trim_start_matches("allowed: "))
        })?;
        let named = named.map(|named| named.scene.clone());
        let source = Source { named, inputs: volume.1.clone(), known: Known::default() };
        let (volume, scene) = (volume.0.clone(), scene.scene.clone());
        let is_streamed = matches!(volume, OpenVolume::Streamed(_));
        let view = detached(py, move || {
            let headless = headless(backend, adapter, &scene)?;
            let start = Instant::now();
            let (layout, scene) = worded(&annotations, volume.sample(), scene)?;
            let light = light.map(|path| StoredLight::open(&path)).transpose()?;
            let view = headless.view(volume, &scene)?;
            let view = match light {
                Some(light) => view.with_light(Arc::new(light))?,
                None => view,
            };
            let current = Current { view, layout, size: size(&scene), prepare_ms: milliseconds_since(start) };
            let current = Mutex::new(current);
            let is_bound = is_streamed || headless.backend() == Backend::Gpu;
            let bound_to = is_bound.then(std::process::id);
            Ok(Shared { headless, annotations, current, bound_to, source })
        })?;
        Ok(Self(Arc::new(view)))
    }

    /// Changes the scene. Only what depends on the change is computed again.
    fn set_scene(&self, py: Python<'_>, scene: &Scene) -> PyResult<()> {
        let (shared, scene) = (Arc::clone(&self.0), scene.scene.clone());
        detached(py, move || {
            shared.check_process()?;
            let (mut current, start) = (shared.lock(), Instant::now());
            let before = current.view.scene().clone();
            let volume = current.view.volume();
            let (layout, scene) = worded(&shared.annotations, volume.sample(), scene)?;
            shared.headless.set_scene(&mut current.view, &scene)?;
            if !may_commit() {
                shared.headless.set_scene(&mut current.view, &before)?;
                return Ok(());
            }
            current.layout = layout;
            current.size = size(&scene);
            current.prepare_ms = milliseconds_since(start);
            Ok(())
        })
    }

    /// Writes the view's light sheets into a file.
    fn save_light(&self, py: Python<'_>, path: PathBuf, inputs: Vec<PyRef<'_, Inputs>>) -> PyResult<()> {
        image::refuse(&inputs, [&path])?;
        let shared = Arc::clone(&self.0);
        detached(py, move || {
            StoredLight::check_format(&path)?;
            shared.check_process()?;
            let (volume, scene) = {
                let current = shared.lock();
                (current.view.volume(), current.view.scene().clone())
            };
            let bytes = StoredLight::of(&volume, &scene)?.encode(&path)?;
            image::output(&path, &bytes)
        })
    }

    /// The backend that draws.
    #[getter]
    fn backend(&self) -> &'static str {
        self.0.headless.backend().name()
    }

    /// Draws a picture.
    fn draw<'py>(&self, py: Python<'py>) -> PyResult<Drawn<'py>> {
        let shared = Arc::clone(&self.0);
        let (rendering, stats, made) = detached(py, move || {
            shared.check_process()?;
            let mut current = shared.lock();
            let mut rendering = shared.headless.draw(&mut current.view).map_err(Raised::from)?;
            rendering.stats.prepare_ms = std::mem::take(&mut current.prepare_ms);
            let made = shared.provenance(&current, &rendering.stats);
            if let Some(layout) = &current.layout {
                let volume = current.view.volume();
                rendering.image = layout.draw(&rendering.image, current.view.scene(), volume.sample());
            }
            let stats = serde_json::to_string(&rendering.stats);
            Ok((rendering, stats, made))
        })?;
        let stats = stats.map_err(|error| pyo3::exceptions::PyRuntimeError::new_err(error.to_string()))?;
        let made_on = rendering.made_on().map(|made_on| (made_on.adapter, made_on.driver));
        Ok((image::array(py, rendering.image)?, stats, made_on, made))
    }

    /// Draws a part of a picture, with its statistics as JSON.
    fn draw_part(
        &self,
        py: Python<'_>,
        slabs: Option<(i32, i32)>,
        region: Option<(u32, u32, u32, u32)>,
    ) -> PyResult<(Part, String)> {
        let shared = Arc::clone(&self.0);
        let (drawn, stats) = detached(py, move || {
            shared.check_process()?;
            let mut current = shared.lock();
            if current.layout.is_some() {
                return Err(setting("annotate", "words with a part of a picture", "no words beside parts"));
            }
            let window = window(current.size, slabs, region);
            let (drawn, mut stats) = shared.headless.draw_part(&mut current.view, &window).map_err(Raised::from)?;
            stats.prepare_ms = std::mem::take(&mut current.prepare_ms);
            Ok((drawn, serde_json::to_string(&stats)))
        })?;
        let stats = stats.map_err(|error| pyo3::exceptions::PyRuntimeError::new_err(error.to_string()))?;
        Ok((Part(Arc::new(drawn)), stats))
    }
}

/// The words beside a scene's pictures, and the scene of the pictures beside them; without words, the scene itself.
fn worded(
    annotations: &[Annotation],
    volume: &sheetsplat::Volume,
    scene: sheetsplat::Scene,
) -> Result<(Option<Layout>, sheetsplat::Scene), Raised> {
    if annotations.is_empty() {
        return Ok((None, scene));
    }
    scene.check_for(volume)?;
    let layout = layout(annotations, &scene, volume)?;
    let beside = layout.scene(&scene).explicit(volume);
    Ok((Some(layout), beside))
}

fn size(scene: &sheetsplat::Scene) -> [u32; 2] {
    [scene.image.width, scene.image.height]
}

fn milliseconds_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

/// A backend, the adapter's name that it was opened by, and what draws with it.
type Entry = (Backend, Option<String>, Arc<Headless>);

/// The backend for a scene. A GPU's device is opened once for each adapter's name.
fn headless(backend: Backend, adapter: Option<String>, scene: &sheetsplat::Scene) -> Result<Arc<Headless>, Raised> {
    static OPENED: Mutex<Vec<Entry>> = Mutex::new(Vec::new());
    // Devices do not survive a fork.
    let backend = match backend {
        Backend::Gpu if is_forked() => return Err(forked("backend \"gpu\"")),
        Backend::Auto if is_forked() => Backend::Cpu,
        backend => backend,
    };
    let mut options = HeadlessOptions::default().with_backend(backend);
    options.adapter = adapter.clone();
    let is_automatic = backend == Backend::Auto;
    let mut opened = OPENED.lock().unwrap_or_else(PoisonError::into_inner);
    let is_known = |entry: &&Entry| entry.0 == backend && entry.1 == adapter;
    if let Some((.., headless)) = opened.iter().find(is_known).filter(|_| !is_automatic) {
        return Ok(headless.clone());
    }
    let headless = Arc::new(Headless::for_scenes(&options, [scene])?);
    if !is_automatic {
        opened.push((backend, adapter, headless.clone()));
    }
    Ok(headless)
}
