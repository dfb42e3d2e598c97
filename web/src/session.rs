//! A volume with its scene, and the pictures of it.

use std::cell::OnceCell;
use std::path::Path;
use std::rc::Rc;
use std::sync::Arc;

#[cfg(not(feature = "gpu"))]
use glam::DVec4;
use glam::{DVec2, DVec3};
#[cfg(feature = "gpu")]
use js_sys::{Array, Float64Array};
use js_sys::{Map, Uint8Array};
use serde::Serialize;
use sheetsplat::scene::{Channel, ImageSettings, VolumeSource};
use sheetsplat::settings::{Camera, Sphere, navigation};
use sheetsplat::volume::{Files, ReadOptions};
use sheetsplat::{Pick, Scene, Volume};
use wasm_bindgen::prelude::wasm_bindgen;
use wasm_bindgen::{JsCast, JsValue};

use crate::facts::{Facts, Histogram, Placed};
use crate::unset::without;
use crate::{Drawer, error, nothing};

/// A volume, how it is shown, and what draws it. A worker has one; several workers that share a frame get the same calls.
#[wasm_bindgen]
pub struct Session {
    /// Whether the object keeps its size while the camera turns about it.
    all_around: bool,
    size: [u32; 2],
    /// A scene whose volume is not loaded yet.
    pending: Option<Scene>,
    shown: Option<Shown>,
    pub(crate) drawer: Drawer,
}

/// A scene with its volume.
struct Shown {
    scene: Scene,
    volume: Arc<Volume>,
    /// Those of the volume's channels, once they are asked for.
    histograms: Histograms,
    /// The scene's original camera.
    home: Camera,
    /// What a camera that fits the object shows.
    object: Option<Sphere>,
}

type Histograms = Rc<OnceCell<Vec<Histogram>>>;

#[wasm_bindgen]
impl Session {
    /// Changes the scene: the text of a scene file without the keys `unset` and with `KEY=VALUE` overrides, for the volume file `source` where the
    /// text names none. With `keeps_camera` the camera of the same volume stays. Returns whether [`Self::load`] must follow, because the volume
    /// is another one.
    #[wasm_bindgen(js_name = setScene)]
    pub async fn set_scene(
        &mut self,
        text: &str,
        unset: Vec<String>,
        sets: Vec<String>,
        source: Option<String>,
        is_new: bool,
        keeps_camera: bool,
    ) -> Result<bool, JsValue> {
        let folder = Path::new("");
        let text = without(text, &unset);
        let scene = match source {
            Some(name) => Scene::parse_for(VolumeSource::File(name.into()), &text, "scene", folder, &sets),
            None => Scene::parse(&text, "scene", folder, &sets),
        };
        let scene = scene.map_err(error)?;
        match &self.shown {
            Some(Shown { scene: old, volume, histograms, home, object })
                if !is_new && sources(old) == sources(&scene) =>
            {
                let kept = keeps_camera.then_some((old.camera, *home, *object));
                let loaded = (Arc::clone(volume), Rc::clone(histograms));
                self.show(scene, loaded, kept).await?;
                Ok(false)
            }
            _ => {
                self.pending = Some(scene);
                Ok(true)
            }
        }
    }

    /// Loads the pending scene's volume from files, a map of names to `Uint8Array`s.
    pub async fn load(&mut self, files: &Map) -> Result<(), JsValue> {
        let Some(scene) = self.pending.take() else { return Err(error("no scene is waiting for its volume")) };
        let mut given: Vec<(String, Vec<u8>)> = Vec::new();
        files.for_each(&mut |bytes, name| {
            given.push((name.as_string().unwrap_or_default(), bytes.unchecked_into::<Uint8Array>().to_vec()));
        });
        let files: Files = given.into_iter().collect();
        let volume = scene.load_volume_with(&ReadOptions::default().with_files(files)).map_err(error)?;
        // The old volume need not fit into memory beside the new one's lists.
        self.show(scene, (Arc::new(volume), Histograms::default()), None).await
    }

    /// Changes the picture's size in pixels.
    pub fn resize(&mut self, width: u32, height: u32) {
        self.size = [width.max(1), height.max(1)];
    }

    /// Turns the camera about its centre, so that what is in front follows a pointer that moves right and down by some heights of the picture.
    pub fn orbit(&mut self, right: f64, down: f64) {
        /// Degrees for a drag over the whole height.
        const TURN: f64 = 180.0;
        if let Some(shown) = &mut self.shown {
            navigation::orbit(&mut shown.scene.camera, DVec2::new(right, down) * TURN);
        }
    }

    /// Looks at the same centre in another direction: six numbers, the direction and the vector that is up.
    pub fn look(&mut self, vectors: &[f64]) -> Result<(), JsValue> {
        let Some(shown) = &mut self.shown else { return Ok(()) };
        let &[a, b, c, x, y, z] = vectors else { return Err(error("look: found fewer or more than two vectors")) };
        let camera = shown.scene.camera.looking([DVec3::new(a, b, c), DVec3::new(x, y, z)]);
        camera.check().map_err(error)?;
        shown.scene.camera = camera;
        Ok(())
    }

    /// Multiplies the height of what the picture shows.
    pub fn zoom(&mut self, factor: f64) {
        let size = self.size;
        if let Some(shown) = &mut self.shown {
            let (grid, height) = (*shown.volume.grid(), shown.height(size));
            navigation::zoom(&mut shown.scene.camera, &grid, height, factor);
        }
    }

    /// Moves the camera, so that what is at its centre's depth follows a pointer, as for [`Self::orbit`].
    pub fn pan(&mut self, right: f64, down: f64) {
        let size = self.size;
        if let Some(shown) = &mut self.shown {
            let height = shown.height(size);
            shown.scene.camera.center = shown.camera(size).camera.center;
            navigation::pan(&mut shown.scene.camera, DVec2::new(right, down) * height);
        }
    }

    /// Moves the camera to where the scene states it.
    pub fn home(&mut self) {
        if let Some(shown) = &mut self.shown {
            shown.scene.camera = shown.home;
        }
    }

    /// What the picture shows at a pixel; `undefined` where it is not opaque enough.
    pub async fn pick(&mut self, x: u32, y: u32) -> Result<JsValue, JsValue> {
        let drawn = self.drawn()?;
        let pick = self.drawer.pick(&drawn, [x, y]).await?;
        pick.map_or(Ok(JsValue::UNDEFINED), |pick| plain(&Picked::of(&pick)))
    }

    /// The volume, and how its scene shows it.
    pub fn facts(&self) -> Result<JsValue, JsValue> {
        let shown = self.shown()?;
        let histograms = shown.histograms.get_or_init(|| shown.volume.channels().map(Histogram::new).collect());
        plain(&Facts::new(&shown.volume, &shown.scene, histograms))
    }

    /// Where the camera is.
    pub fn camera(&self) -> Result<JsValue, JsValue> {
        let shown = self.shown()?;
        let scene = shown.camera(self.size).explicit(&shown.volume);
        plain(&Placed::new(&scene.camera, shown.height(self.size)))
    }

    /// The scene as the text of a scene file, with everything stated that depends on the volume.
    pub fn scene(&self) -> Result<String, JsValue> {
        let shown = self.shown()?;
        shown.camera(self.size).explicit(&shown.volume).to_toml(Path::new("")).map_err(error)
    }
}

#[cfg(feature = "gpu")]
#[wasm_bindgen]
impl Session {
    /// What [`Self::set_pose`] of a session that takes this one's place needs; `undefined` without a volume.
    pub fn pose(&self) -> Result<Option<Array>, JsValue> {
        let Some(Shown { scene, home, object, .. }) = &self.shown else { return Ok(None) };
        let [camera, home] = [scene.camera, *home].map(|camera| {
            let scene = Scene { camera, ..Scene::new(VolumeSource::Builtin("cube".to_owned())) };
            scene.to_toml(Path::new("")).map_err(error)
        });
        let object = object.map_or(JsValue::UNDEFINED, |Sphere { center, radius }| {
            Float64Array::from(&center.extend(radius).to_array()[..]).into()
        });
        Ok(Some(Array::of3(&camera?.into(), &home?.into(), &object)))
    }
}

#[cfg(not(feature = "gpu"))]
#[wasm_bindgen]
impl Session {
    /// Moves the camera to where another session's is: it and its home as texts of scene files, and the sphere that it frames, by its centre and radius.
    #[wasm_bindgen(js_name = setPose)]
    pub fn set_pose(&mut self, camera: &str, home: &str, object: Option<Vec<f64>>) -> Result<(), JsValue> {
        let shown = self.shown.as_mut().ok_or_else(nothing)?;
        let [camera, home] = [camera, home]
            .map(|text| Scene::parse(text, "scene", Path::new(""), &[]).map(|scene| scene.camera).map_err(error));
        (shown.scene.camera, shown.home) = (camera?, home?);
        shown.object = object.filter(|numbers| numbers.len() == 4).map(|numbers| {
            let sphere = DVec4::from_slice(&numbers);
            Sphere { center: sphere.truncate(), radius: sphere.w }
        });
        Ok(())
    }
}

impl Session {
    /// Without a volume.
    pub(crate) fn with(all_around: bool, drawer: Drawer) -> Self {
        Self { all_around, size: [1, 1], pending: None, shown: None, drawer }
    }

    /// Shows a scene of a volume, with a camera, its home and its object that are kept. After an error the old one stays.
    async fn show(
        &mut self,
        scene: Scene,
        (volume, histograms): (Arc<Volume>, Histograms),
        kept: Option<(Camera, Camera, Option<Sphere>)>,
    ) -> Result<(), JsValue> {
        let [width, height] = self.size;
        let scene = Scene { image: ImageSettings { width, height, ..scene.image }, ..scene };
        scene.check_for(&volume).map_err(error)?;
        let (camera, home, object) = kept.unwrap_or_else(|| {
            let object = self.all_around.then(|| scene.sphere(&volume, &scene.resolve(&volume))).flatten();
            let camera = scene.camera_for(&volume);
            (camera, camera, object)
        });
        let shown = Shown { scene: Scene { camera, ..scene }, volume, histograms, home, object };
        self.drawer.set_volume(&shown.volume, &shown.camera(self.size)).await?;
        self.shown = Some(shown);
        Ok(())
    }

    /// Gives the volume, if there is one, to what draws, which has lost it.
    #[cfg(feature = "gpu")]
    pub(crate) async fn show_again(&mut self) -> Result<(), JsValue> {
        let Some(shown) = &self.shown else { return Ok(()) };
        self.drawer.set_volume(&shown.volume, &shown.camera(self.size)).await
    }

    /// What is drawn now.
    pub(crate) fn drawn(&self) -> Result<Scene, JsValue> {
        Ok(self.shown()?.camera(self.size))
    }

    fn shown(&self) -> Result<&Shown, JsValue> {
        self.shown.as_ref().ok_or_else(nothing)
    }
}

impl Shown {
    /// The scene for a picture of some width and height.
    fn camera(&self, size: [u32; 2]) -> Scene {
        let [width, height] = size;
        let camera = self.object.map_or(self.scene.camera, |object| object.fit(&self.scene.camera, size));
        Scene { camera, image: ImageSettings { width, height, ..self.scene.image }, ..self.scene.clone() }
    }

    /// The height of the picture in world units.
    fn height(&self, size: [u32; 2]) -> f64 {
        let framed = self.camera(size).explicit(&self.volume);
        navigation::height(&framed.camera, self.volume.grid(), self.scene.splatting.radius, size)
    }
}

/// A pick with the names that JavaScript gives its fields.
#[derive(Serialize)]
struct Picked {
    position: [f64; 3],
    depth: f64,
    voxel: [u32; 3],
    channel: usize,
    value: f32,
    label: Option<u16>,
}

impl Picked {
    fn of(pick: &Pick) -> Self {
        let Pick { position, depth, voxel, channel, value, label, .. } = *pick;
        Self { position: position.to_array(), depth, voxel: voxel.to_array(), channel, value, label }
    }
}

/// What decides which volume a scene shows: its channels' volumes with their numbers, without those that are channels of the first one's volume.
fn sources(scene: &Scene) -> Vec<(usize, Channel)> {
    let source = |(number, channel): (usize, &Channel)| {
        let Channel { volume, spacing, labels, index, time, level, series, .. } = channel.clone();
        let mut source = Channel::new(volume);
        (source.spacing, source.labels) = (spacing, labels);
        (source.index, source.time, source.level, source.series) = (index, time, level, series);
        (number == 0 || source.volume != VolumeSource::Memory).then_some((number, source))
    };
    scene.channels.iter().enumerate().filter_map(source).collect()
}

/// Plain data as a JavaScript object.
pub(crate) fn plain(value: &impl Serialize) -> Result<JsValue, JsValue> {
    let serializer = serde_wasm_bindgen::Serializer::json_compatible();
    value.serialize(&serializer).map_err(error)
}
