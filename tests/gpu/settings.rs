//! Invalid settings: every field at every invalid value, through a scene file, a setter, and a scene made in code, is an error that names
//! the same key; the values at the ends of the ranges draw finite images.

use std::path::Path;

use glam::{DVec3, UVec3};
use sheetsplat::cpu::{self, CpuRenderer};
use sheetsplat::headless::Error;
use sheetsplat::internals::reference::{self, Host};
use sheetsplat::scene::{Scene, SceneError};
use sheetsplat::settings::{
    Allowed, Clip, Compositing, Economies, Found, Interval, LabelTables, Light, Method, Order, Projection, Ramp,
    TransferFunction,
};
use sheetsplat::volume::{Grid, Volume, VolumeError, builtin};
use sheetsplat::{Camera, Image, Placement, RenderError, SceneView, SettingError};

use crate::common::devices::gpu;

const NAN: f64 = f64::NAN;
const INF: f64 = f64::INFINITY;
const NOT_FINITE: [f64; 3] = [NAN, INF, -INF];

/// A scene whose volume has labels and whose ramps are all stated.
fn scene() -> Scene {
    let text = "[volume]\nbuiltin = 'head:16'\n[image]\nwidth = 24\nheight = 18\n[transfer]\ncolor = [[0, [1, 1, 1]]]\n\
                opacity = [[0, 0], [90, 0.5]]\ngradient_opacity = [[0, 1]]\niso_ranges = [[1, 300]]\n\
                [[transfer.label]]\nlabel = 0\nopacity = [[0, 0.1]]\n";
    Scene::parse(text, "scene.toml", Path::new(""), &[]).unwrap()
}

fn perspective(scene: &mut Scene) -> [&mut f64; 3] {
    scene.camera.projection = Projection::Perspective { fov_y: 30.0, distance: Some(200.0), near: Some(1.0) };
    match &mut scene.camera.projection {
        Projection::Perspective { fov_y, distance: Some(distance), near: Some(near) } => [fov_y, distance, near],
        other => panic!("{other:?}"),
    }
}

type Change = fn(&mut Scene);

fn share(value: f64) -> Option<Ramp<f64>> {
    Some(Ramp::new(vec![(0.0, value)]).unwrap())
}

/// A number of a scene: its key, how it is set in code, the values at the ends of its range, and values just beyond. Values that are not
/// finite are never allowed.
struct Field {
    key: &'static str,
    set: fn(&mut Scene, f64),
    good: &'static [f64],
    bad: &'static [f64],
}

const fn field(key: &'static str, set: fn(&mut Scene, f64), good: &'static [f64], bad: &'static [f64]) -> Field {
    Field { key, set, good, bad }
}

const POSITIVE: &[f64] = &[0.0, -0.0, -1.0];
const SHARE: &[f64] = &[-0.001, 1.001];
const THRESHOLD: &[f64] = &[0.0, -0.001, 1.001];

const FIELDS: &[Field] = &[
    field(
        "volume.spacing[1]",
        |scene, x| scene.channels[0].spacing = Some(DVec3::new(1.0, x, 1.0)),
        &[1.0],
        &[0.0, -1.0, 1e-101],
    ),
    field(
        "camera.height",
        |scene, x| scene.camera.projection = Projection::Orthographic { height: Some(x) },
        &[0.001, 1e9],
        POSITIVE,
    ),
    field("camera.fov_y", |scene, x| *perspective(scene)[0] = x, &[0.001, 179.9], &[0.0, -1.0, 180.0]),
    field("camera.distance", |scene, x| *perspective(scene)[1] = x, &[0.01, 1e5], POSITIVE),
    field("camera.near", |scene, x| *perspective(scene)[2] = x, &[0.01, 1e5], POSITIVE),
    field("camera.direction[0]", |scene, x| scene.camera.direction.x = x, &[0.0, 1e-300, 1e300], &[]),
    field("camera.up[1]", |scene, x| scene.camera.up.y = x, &[0.0, -1e-300, 1e5], &[]),
    field("camera.center[2]", |scene, x| scene.camera.center = Some(DVec3::new(0.0, 0.0, x)), &[0.0, -1e9], &[]),
    field("image.width", |scene, x| scene.image.width = x as u32, &[1.0, 300.0], &[0.0]),
    field("image.height", |scene, x| scene.image.height = x as u32, &[1.0, 300.0], &[0.0]),
    field("image.background[3]", |scene, x| scene.image.background[3] = x, &[0.0, 1.0], SHARE),
    field(
        "clip.planes[1][3]",
        |scene, x| scene.clip.planes = vec![[0.0, 1.0, 0.0, 5.0], [1.0, 0.0, 0.0, x]],
        &[-1e9, 0.0, 1e9],
        &[],
    ),
    field(
        "clip.crop[0][2]",
        |scene, x| scene.clip.crop = Some([DVec3::new(-1.0, -1.0, x), DVec3::ONE]),
        &[-1e300, 0.99],
        &[],
    ),
    field("clip.crop[1][0]", |scene, x| scene.clip.crop = Some([-DVec3::ONE, DVec3::new(x, 1.0, 1.0)]), &[1e300], &[]),
    field(
        "transfer.color[0][1][2]",
        |scene, x| scene.channels[0].transfer.color = Some(Ramp::new(vec![(0.0, DVec3::new(0.0, 1.0, x))]).unwrap()),
        &[0.0, 1.0],
        SHARE,
    ),
    field("transfer.opacity[0][1]", |scene, x| scene.channels[0].transfer.opacity = share(x), &[0.0, 1.0], SHARE),
    field(
        "transfer.gradient_opacity[0][1]",
        |scene, x| scene.channels[0].transfer.gradient_opacity = share(x),
        &[0.0, 1.0],
        SHARE,
    ),
    field(
        "transfer.iso_ranges[0][1]",
        |scene, x| scene.channels[0].transfer.iso_ranges = Some(vec![[-1e300, x]]),
        &[-1e300, 1e300],
        &[],
    ),
    field(
        "transfer.label[0].opacity[0][1]",
        |scene, x| {
            _ = scene.channels[0]
                .transfer
                .labels
                .insert(0, LabelTables { opacity: share(x), ..LabelTables::default() });
        },
        &[0.0, 1.0],
        SHARE,
    ),
    field("shading.ambient", |scene, x| scene.shading.ambient = x, &[0.0, 1e30], &[-0.001]),
    field("shading.diffuse", |scene, x| scene.shading.diffuse = x, &[0.0, 1e30], &[-0.001]),
    field("shading.specular", |scene, x| scene.shading.specular = x, &[0.0, 1e30], &[-0.001]),
    field("shading.shininess", |scene, x| scene.shading.shininess = x, &[1e-30, 1e30], POSITIVE),
    field(
        "shading.light[1]",
        |scene, x| scene.shading.light = Light::Direction(DVec3::new(1.0, x, 0.0)),
        &[1e300],
        &[],
    ),
    field("splatting.radius", |scene, x| scene.splatting.radius = x, &[1.0, 4.0], &[0.0, 0.999, 4.001]),
    field("splatting.falloff", |scene, x| scene.splatting.falloff = x, &[0.01, 16.0], &[0.0, -1.0, 16.001]),
    field("splatting.slab_width", |scene, x| scene.splatting.slab_width = x, &[0.05, 8.0], &[0.0, 0.049, 8.001]),
    field("splatting.opacity_threshold", |scene, x| scene.splatting.opacity_threshold = x, &[1e-9, 1.0], THRESHOLD),
    field(
        "splatting.experimental.whole_below",
        |scene, x| scene.splatting.experimental.whole_below = x,
        &[0.0, 1.0],
        SHARE,
    ),
    field("splatting.experimental.beta", |scene, x| scene.splatting.experimental.beta = x, &[1e-9, 1.0], THRESHOLD),
    field(
        "splatting.experimental.resolution",
        |scene, x| scene.splatting.experimental.resolution = x,
        &[0.0, 1.0],
        SHARE,
    ),
];

impl Field {
    fn is_of_integers(&self) -> bool {
        matches!(self.key, "image.width" | "image.height")
    }

    fn bad(&self) -> Vec<f64> {
        let not_finite = if self.is_of_integers() { &[][..] } else { &NOT_FINITE };
        self.bad.iter().chain(not_finite).copied().collect()
    }

    fn with(&self, value: f64) -> Scene {
        let mut scene = scene();
        (self.set)(&mut scene, value);
        scene
    }

    /// The scene read back from the file that `Scene::to_toml` writes, whatever the value.
    fn parsed(&self, value: f64) -> Result<Scene, SceneError> {
        let text = self.with(value).to_toml(Path::new("")).unwrap();
        Scene::parse(&text, "scene.toml", Path::new(""), &[])
    }
}

/// Sets everything in a scene through the setters.
fn set_all(view: &mut SceneView, scene: &Scene, transfer: &TransferFunction) -> Result<(), SettingError> {
    view.set_camera(scene.camera)?;
    view.set_image(scene.image)?;
    view.set_clip(scene.clip.clone())?;
    view.set_transfer_function(transfer.clone())?;
    view.set_shading(scene.shading)?;
    view.set_light(scene.shading.light)?;
    view.set_splatting(scene.splatting)
}

#[test]
fn invalid_values_have_the_same_key_everywhere() {
    let gpu = gpu();
    let volume = scene().load_volume().unwrap();
    let transfer = scene().channels[0].transfer.resolve(&volume);
    let mut view = gpu.view(volume.clone(), &scene()).unwrap();
    let before = view.scene().clone();
    let mut native = CpuRenderer::new(volume.clone(), &scene()).unwrap();
    for field in FIELDS {
        for value in field.bad() {
            let (key, scene) = (field.key, field.with(value));
            let error = scene.check().unwrap_err();
            assert_eq!(error.key, key, "{value}");
            assert!(matches!(error.found, Found::Number(found) if found.to_bits() == value.to_bits()), "{error}");
            match field.parsed(value) {
                Err(SceneError::Invalid { origin, key, allowed, .. }) => {
                    assert_eq!((origin.as_str(), key.as_str()), ("scene.toml", field.key), "{value}");
                    assert_eq!(allowed, error.allowed, "{key} = {value}");
                }
                other => panic!("{key} = {value}: {other:?}"),
            }
            let refused = |result: Result<(), RenderError>| match result {
                Err(RenderError::OutOfRange(error)) => assert_eq!(error.key, key, "{value}"),
                other => panic!("{key} = {value}: {other:?}"),
            };
            refused(gpu.view(volume.clone(), &scene).map(|_| ()));
            refused(gpu.render_volume(volume.clone(), &scene).map(|_| ()));
            refused(cpu::render(volume.clone(), &scene).map(|_| ()));
            refused(native.set_scene(&scene));
            refused(reference::render(&volume, std::slice::from_ref(&transfer), &scene).map(|_| ()));
            match gpu.render(&scene) {
                Err(Error::Render(error)) => refused(Err(error)),
                other => panic!("{key} = {value}: {:?}", other.map(|rendering| rendering.stats)),
            }
            // Spacing belongs to the volume, not to a view.
            if scene.channels[0].spacing.is_none() {
                let transfer = scene.channels[0].transfer.resolve(&volume);
                refused(set_all(&mut view, &scene, &transfer).map_err(RenderError::from));
                refused(if transfer.check().is_err() {
                    let good = self::scene();
                    reference::render(&volume, std::slice::from_ref(&transfer), &good).map(|_| ())
                } else {
                    scene.check().map_err(RenderError::from)
                });
            }
            set_all(&mut view, &before, &transfer).unwrap();
        }
    }
    assert_eq!((view.scene(), native.scene()), (&before, &before));
}

#[test]
fn the_ends_of_ranges_are_allowed_and_drawn() {
    let gpu = gpu();
    let volume = scene().load_volume().unwrap();
    let mut view = gpu.view(volume.clone(), &scene()).unwrap();
    for field in FIELDS {
        for &value in field.good {
            let (key, scene) = (field.key, field.with(value));
            scene.check().unwrap();
            assert_eq!(field.parsed(value).unwrap(), scene, "{key} = {value}");
            set_all(&mut view, &scene, &scene.channels[0].transfer.resolve(&volume)).unwrap();
            let drawn = gpu.draw(&mut view).unwrap_or_else(|error| panic!("{key} = {value}: {error}"));
            let is_finite = |image: &Image| image.pixels.iter().flatten().all(|channel| channel.is_finite());
            assert!(is_finite(&drawn.image), "{key} = {value}");
            match cpu::render(volume.clone(), &scene) {
                Ok(drawn) => assert!(is_finite(&drawn.image), "{key} = {value} natively"),
                // This backend has none of them.
                Err(RenderError::OutOfRange(error)) => {
                    assert_ne!(scene.splatting.experimental, Economies::default(), "{error}");
                    assert_eq!(error.key, key);
                }
                Err(error) => panic!("{key} = {value} natively: {error}"),
            }
        }
    }
}

/// Values that are allowed one by one, but not together.
#[test]
fn settings_that_exclude_each_other_have_the_same_key_everywhere() {
    let gpu = gpu();
    let volume = builtin::volume("head:16").unwrap();
    let mut view = gpu.view(volume.clone(), &scene()).unwrap();
    let cases: [(&str, Change); 13] = [
        ("volume.spacing", |scene| scene.channels[0].spacing = Some(DVec3::new(1.0, 1.0, 10001.0))),
        ("camera.direction", |scene| scene.camera.direction = DVec3::ZERO),
        ("camera.up", |scene| scene.camera.up = DVec3::ZERO),
        ("camera.up", |scene| scene.camera.up = -1e200 * scene.camera.direction),
        ("camera.up", |scene| scene.camera.direction = DVec3::new(0.0, 1e-11, -1e-200 - 1.0)),
        ("clip.planes", |scene| scene.clip.planes = vec![[1.0, 0.0, 0.0, 0.0]; 7]),
        ("clip.planes[0]", |scene| scene.clip.planes = vec![[0.0, 0.0, 0.0, 1.0]]),
        ("clip.crop", |scene| scene.clip.crop = Some([DVec3::ZERO, DVec3::new(1.0, 0.0, 1.0)])),
        ("transfer.iso_ranges", |scene| scene.channels[0].transfer.iso_ranges = Some(Vec::new())),
        ("transfer.iso_ranges[1]", |scene| scene.channels[0].transfer.iso_ranges = Some(vec![[0.0, 0.0], [2.0, 1.0]])),
        ("shading.light", |scene| scene.shading.light = Light::Direction(DVec3::ZERO)),
        ("splatting.compositing", |scene| {
            (scene.splatting.compositing, scene.splatting.method) =
                (Compositing::Maximum, Method::CompositeEverySample);
        }),
        ("splatting.compositing", |scene| {
            (scene.splatting.compositing, scene.splatting.order) = (Compositing::Surface, Order::BackToFront);
        }),
    ];
    for (expected, change) in cases {
        let mut scene = scene();
        change(&mut scene);
        assert_eq!(scene.check().unwrap_err().key, expected);
        let text = scene.to_toml(Path::new("")).unwrap();
        match Scene::parse(&text, "scene.toml", Path::new(""), &[]) {
            Err(SceneError::Invalid { key, .. }) => assert_eq!(key, expected),
            other => panic!("{expected}: {other:?}"),
        }
        let by_both = [gpu.view(volume.clone(), &scene).map(|_| ()), cpu::render(volume.clone(), &scene).map(|_| ())];
        for refused in by_both {
            match refused {
                Err(RenderError::OutOfRange(error)) => assert_eq!(error.key, expected),
                other => panic!("{expected}: {other:?}"),
            }
        }
        if scene.channels[0].spacing.is_none() {
            let transfer = scene.channels[0].transfer.resolve(&volume);
            assert_eq!(set_all(&mut view, &scene, &transfer).unwrap_err().key, expected);
        }
    }
}

/// Settings of a view that scene files do not have.
#[test]
fn settings_only_hosts_have_are_checked() {
    let gpu = gpu();
    let volume = builtin::volume("head:16").unwrap();
    let mut view = gpu.view(volume.clone(), &scene()).unwrap();
    let before = view.scene().clone();
    for angle in NOT_FINITE {
        assert_eq!(view.turn(angle).unwrap_err().key, "degrees");
    }
    for opacity in NOT_FINITE.iter().chain(THRESHOLD) {
        assert_eq!(view.set_first_hit(Some(*opacity)).unwrap_err().key, "first_hit");
        let (host, transfer) =
            (Host { first_hit: Some(*opacity), surfaces: None }, scene().channels[0].transfer.resolve(&volume));
        match reference::render_for(host, &volume, std::slice::from_ref(&transfer), &scene(), None) {
            Err(RenderError::OutOfRange(error)) => assert_eq!(error.key, "first_hit"),
            other => panic!("{other:?}"),
        }
    }
    for ranges in [vec![], vec![[2.0, 1.0]], vec![[NAN, 1.0]]] {
        assert!(view.set_iso_ranges(Some(ranges)).unwrap_err().key.starts_with("transfer.iso_ranges"));
    }
    assert_eq!(view.scene(), &before);
    let mut native = CpuRenderer::new(volume.clone(), &scene()).unwrap();
    for angle in NOT_FINITE {
        assert_eq!(native.turn(angle).unwrap_err().key, "degrees");
    }
    for opacity in NOT_FINITE.iter().chain(THRESHOLD) {
        assert_eq!(native.set_first_hit(Some(*opacity)).unwrap_err().key, "first_hit");
    }
    assert_eq!(native.scene(), &before);
    let transfer = scene().channels[0].transfer.resolve(&volume);
    for (surfaces, key) in [(vec![1.0; 24 * 18 - 1], "surfaces"), (vec![NAN; 24 * 18], "surfaces[0]")] {
        let host = Host { surfaces: Some(&surfaces), first_hit: None };
        match reference::render_for(host, &volume, std::slice::from_ref(&transfer), &scene(), None) {
            Err(RenderError::OutOfRange(error)) => assert_eq!(error.key, key),
            other => panic!("{other:?}"),
        }
    }
    view.turn(1e6).unwrap();
    view.set_first_hit(Some(0.5)).unwrap();
    let drawn = gpu.draw(&mut view).unwrap();
    assert!(drawn.image.pixels.iter().flatten().all(|channel| channel.is_finite()));
    let outside = Placement { origin: [0, 0], scissor: [1, 0, 24, 18] };
    assert_eq!(outside.check([24, 18]).unwrap_err().key, "placement.scissor");
}

#[test]
fn grids_are_checked() {
    let one = UVec3::ONE;
    for (dims, spacing, key) in [
        (UVec3::new(1, 0, 1), DVec3::ONE, "sizes"),
        (UVec3::splat(u32::MAX), DVec3::ONE, "sizes"),
        (one, DVec3::new(1.0, 1.0, 0.0), "spacing[2]"),
        (one, DVec3::new(-1.0, 1.0, 1.0), "spacing[0]"),
        (one, DVec3::new(NAN, 1.0, 1.0), "spacing[0]"),
        (one, DVec3::new(1.0, INF, 1.0), "spacing[1]"),
        (one, DVec3::new(1.0, 1e101, 1.0), "spacing[1]"),
        (one, DVec3::new(1.0, 1e5, 1.0), "spacing"),
    ] {
        assert_eq!(Grid::new(dims, spacing).check().unwrap_err().key, key, "{dims} {spacing}");
        match Volume::new("made", dims, spacing, vec![0.0]) {
            Err(VolumeError::Invalid { origin, field, .. }) => {
                assert_eq!((origin.as_str(), field.as_str()), ("made", key), "{dims} {spacing}");
            }
            other => panic!("{dims} {spacing}: {other:?}"),
        }
    }
    Volume::new("made", one, DVec3::new(1e-100, 1e-96, 1e-99), vec![0.0]).unwrap();
}

/// A host reads bounds as numbers, and may set values at them.
#[test]
fn errors_carry_numbers() {
    let camera = Camera { projection: Projection::Orthographic { height: Some(-2.0) }, ..Camera::default() };
    let SettingError { key, found, allowed, .. } = camera.check().unwrap_err();
    assert_eq!((key.as_str(), found), ("camera.height", Found::Number(-2.0)));
    let Allowed::Interval(Interval { min, max, .. }) = allowed else { panic!("{allowed}") };
    assert_eq!((min, max), (std::ops::Bound::Excluded(0.0), std::ops::Bound::Unbounded));
    let clip = Clip { planes: vec![[0.0, 0.0, 0.0, 4.0]], ..Clip::default() };
    assert_eq!(clip.check().unwrap_err().found, Found::Numbers(vec![0.0, 0.0, 0.0, 4.0]));
}
