//! Light sheets in files (SPEC §14): pictures in them are those of light sheets that are made anew.

use std::sync::Arc;

use glam::DVec3;
use sheetsplat::headless::Backend;
use sheetsplat::scene::{OpenVolume, Scene};
use sheetsplat::settings::Light;
use sheetsplat::volume::{ReadOptions, StreamedVolume};
use sheetsplat::{Image, StoredLight};

use crate::channels::{bytes, scene, streamed, volume};
use crate::merging::headless;
use crate::streamed::in_four;

const LIGHT: &str = "shading={occlusion=0.8,shadow=0.7,light=\"upper-left\",ambient=0.6,diffuse=0.4,light_step=4}";

fn lit(channels: u32, sets: &[&str]) -> Scene {
    scene(channels, &[sets, &[LIGHT]].concat())
}

/// The light that a file holds.
fn round_trip(light: &StoredLight) -> Arc<StoredLight> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("light.npz");
    light.save(&path).unwrap();
    Arc::new(StoredLight::open(&path).unwrap())
}

#[test]
fn pictures_and_parts_have_the_same_bytes() {
    let (two, labelled) = (volume(2, false), volume(1, true));
    let stream = |volume| StreamedVolume { memory: bytes(volume) * 4, ..streamed(volume).1 };
    let after = "splatting={opacity_threshold=1,classification=\"after\"}";
    let maximum = "splatting={opacity_threshold=1,classification=\"before\",compositing=\"maximum\"}";
    for (channels, volume, sets) in [
        (1, OpenVolume::from(labelled.clone()), &[][..]),
        (1, labelled.clone().into(), &[after, "camera.projection=perspective", "clip.planes=[[0.5,0.3,1,2]]"]),
        (2, two.clone().into(), &[maximum]),
        (2, stream(&two).into(), &[after]),
        (2, stream(&two).into(), &[maximum]),
    ] {
        let scene = lit(channels, sets);
        let stored = round_trip(&StoredLight::of(&volume, &scene).unwrap());
        for backend in [Backend::Cpu, Backend::Gpu] {
            let headless = headless(backend);
            let made = headless.render_volume(volume.clone(), &scene).unwrap();
            let mut view = headless.view(volume.clone(), &scene).unwrap().with_light(Arc::clone(&stored)).unwrap();
            let drawn = headless.draw(&mut view).unwrap();
            assert!(drawn.image == made.image, "{backend} {sets:?}");
            assert_eq!(drawn.stats.light_ms, None, "{backend} {sets:?}: no sheets are made");
            let mut other = headless.view(volume.clone(), &scene).unwrap();
            let [stored, made] = [&mut view, &mut other].map(|view| in_four(headless, view));
            assert_eq!(stored.len(), made.len());
            assert!(stored == made, "{backend} {sets:?}");
            assert!(Image::merge(stored).is_ok());
        }
    }
}

/// The amount of light is the scene's; where it comes from, and what keeps it off, is the file's.
#[test]
fn light_of_another_scene_is_refused() {
    let volume = OpenVolume::from(volume(1, false));
    let fixed = |scene: Scene| {
        let mut scene = scene.explicit(volume.sample());
        (scene.shading.light, scene.shading.occlusion) = (Light::Direction(DVec3::new(-0.4, -0.8, 0.5)), 0.0);
        scene
    };
    let scene = fixed(lit(1, &[]));
    let light = Arc::new(StoredLight::of(&volume, &scene).unwrap());
    let headless = headless(Backend::Cpu);
    let view = |scene: &Scene| headless.view(volume.clone(), scene).unwrap().with_light(Arc::clone(&light));
    let refused = |change: &dyn Fn(&mut Scene), words: &str| {
        let mut other = scene.clone();
        change(&mut other);
        let error = view(&other).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains(words), "no {words:?} in {error}");
        // A view keeps its scene and its light.
        let mut kept = view(&scene).unwrap();
        assert_eq!(headless.set_scene(&mut kept, &other).unwrap_err().to_string(), error);
        assert_eq!(kept.scene(), view(&scene).unwrap().scene());
    };
    refused(&|scene| scene.shading.occlusion = 0.5, "light: occlusion: found none, allowed: light sheets of it");
    refused(&|scene| scene.shading.shadow = 0.0, "light: found a scene without light sheets, allowed: shading.occl");
    refused(&|scene| scene.shading.shadow_spread = 0.25, "light: shadow.spread: found 0.5, allowed: 0.25, as in");
    refused(&|scene| scene.shading.light_step = 3.0, "light: shadow.step: found 4, allowed: 3");
    refused(&|scene| scene.shading.light = Light::UpperLeft, "light: shadow.to_light: found [");
    refused(&|scene| scene.splatting.radius = 1.75, "light: shadow.kernel: found [2.0, 2.0], allowed: [1.75, 2.0]");
    refused(&|scene| scene.camera.up = DVec3::new(0.1, 0.0, 1.0), "light: shadow.up: found [0.0, 0.0, 1.0]");
    refused(&|scene| scene.channels[0].transfer.iso_ranges = Some(vec![[50.0, 200.0]]), "light: matter: found ");
    refused(&|scene| scene.clip.planes = vec![[1.0, 0.0, 0.0, 3.0]], "light: matter: found ");
    // Neither the camera nor shading decides.
    let mut other = scene.clone();
    other.camera.direction = DVec3::new(0.9, 0.1, 0.2);
    (other.shading.shadow, other.shading.ambient, other.clip.shade_faces) = (0.3, 0.1, false);
    let made = headless.render_volume(volume.clone(), &other).unwrap().image;
    let mut kept = view(&scene).unwrap();
    kept.set_camera(other.camera).unwrap();
    headless.set_scene(&mut kept, &other).unwrap();
    assert!(headless.draw(&mut kept).unwrap().image == made);
    // Light that follows the camera does not turn with it.
    let headlight = lit(1, &[]).explicit(volume.sample());
    let follows = Arc::new(StoredLight::of(&volume, &headlight).unwrap());
    let mut view = headless.view(volume.clone(), &headlight).unwrap().with_light(Arc::clone(&follows)).unwrap();
    let error = view.turn(10.0).unwrap_err().to_string();
    assert!(error.contains("light: occlusion.to_light: found ["), "{error}");
    assert_eq!(view.scene().camera, headlight.camera);
    // The f64 evaluation makes its own.
    let exact = crate::merging::headless(Backend::Reference).view(volume.clone(), &headlight).unwrap();
    let error = exact.with_light(follows).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("light: found stored light for backend \"reference\""), "{error}");
    let unlit = crate::channels::scene(1, &[]);
    assert!(StoredLight::of(&volume, &unlit).unwrap_err().to_string().contains("shading: found a scene without"));
    let nothing = lit(1, &["transfer.opacity=[[0,0]]"]);
    assert!(StoredLight::of(&volume, &nothing).unwrap_err().to_string().contains("transfer: found no voxel"));
}

/// A damaged file is light or an error, in bounded memory, and never a panic.
#[test]
fn damaged_files_are_errors() {
    let volume = OpenVolume::from(volume(1, false));
    let scene = lit(1, &["shading.light_step=16"]);
    let light = StoredLight::of(&volume, &scene).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("light.npz");
    let bytes = light.encode(&path).unwrap();
    let options = ReadOptions::default().with_memory(1 << 20);
    let open = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        StoredLight::open_with(&path, &options)
    };
    assert!(open(&bytes).is_ok());
    let (mut failures, mut count) = (0, 0);
    for at in (0..bytes.len()).step_by(1 + bytes.len() / 600) {
        for mask in [0x51, 0xff] {
            let mut damaged = bytes.clone();
            damaged[at] ^= mask;
            failures += u32::from(open(&damaged).is_err());
        }
        failures += u32::from(open(&bytes[..at]).is_err());
        count += 3;
    }
    // The archive's checksums find all damage but that of dates and attributes.
    assert!(failures > count * 9 / 10, "{failures} of {count}");

    // An archive that lies, with the checksums of what it says.
    let (sheets, json) = members(&bytes);
    let lie = |sheets: &[u8], from: &str, to: &str| {
        assert!(json.contains(from), "{json}");
        let json = json.replacen(from, to, 1);
        open(&archive(sheets, json.as_bytes())).map(|_| ()).unwrap_err().to_string()
    };
    let file = path.display();
    assert_eq!(lie(&sheets, "\"version\":1", "\"version\":9"), format!("{file}: light.version: found 9, allowed: 1"));
    for (from, to, words) in [
        ("\"planes\":", "\"planes\":1", ": shape: found ("),
        ("\"planes\":", "\"planes\":-", ": light: found "),
        ("\"planes\":", "\"planes\":99999999999", ": light.occlusion.planes: found 99999999999"),
        ("\"first\":", "\"first\":2000000000,\"x\":", ": light: found "),
        ("\"matter\"", "\"mater\"", ": light: found unknown field `mater`"),
        ("\"occlusion\"", "\"shadow\"", ": light: found duplicate field"),
        ("\"sheets\":\"", "\"sheets\":\"0", ": light.sheets: found other sheets, allowed: those of hash 0"),
    ] {
        let error = lie(&sheets, from, to);
        assert!(error.starts_with(&file.to_string()) && error.contains(words), "no {words:?} in {error}");
    }
    let mut bright = sheets.clone();
    let last = bright.len() - 4;
    bright[last..].copy_from_slice(&1.5_f32.to_le_bytes());
    assert!(lie(&bright, "\"version\":1", "\"version\":1").contains("light.sheets: found other sheets"));
    bright[7] = 9;
    assert!(lie(&bright, "\"version\":1", "\"version\":1").contains("found"));
    let memory = StoredLight::open_with(&path, &options.clone().with_memory(1 << 8)).map(|_| ()).unwrap_err();
    assert!(memory.to_string().contains("found"), "{memory}");
    let other = light.save(std::path::Path::new("light.exr")).unwrap_err().to_string();
    assert_eq!(other, "light.exr: extension: found \".exr\", allowed: .npz for light");
}

/// Both members of an archive of stored files.
fn members(bytes: &[u8]) -> (Vec<u8>, String) {
    let member = |at: usize| {
        let number = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        let start = at + 30 + usize::from(bytes[at + 26]);
        (start, start + number(at + 18))
    };
    let (start, end) = member(0);
    let (start_of_text, end_of_text) = member(end);
    (bytes[start..end].to_vec(), String::from_utf8(bytes[start_of_text..end_of_text].to_vec()).unwrap())
}

/// An archive of these members.
fn archive(sheets: &[u8], json: &[u8]) -> Vec<u8> {
    let (mut bytes, mut directory) = (Vec::new(), Vec::new());
    for (name, member) in [("sheets.npy", sheets), ("light.json", json)] {
        let mut sum = flate2::Crc::new();
        sum.update(member);
        let size = (member.len() as u32).to_le_bytes();
        let name_length = [name.len() as u8, 0, 0, 0];
        let header = [&[20, 0, 0, 0, 0, 0, 0, 0, 0x21, 0], &sum.sum().to_le_bytes()[..], &size, &size, &name_length];
        let at = (bytes.len() as u32).to_le_bytes();
        let header = header.concat();
        bytes.extend([b"PK\x03\x04", &header[..], name.as_bytes(), member].concat());
        directory.extend([b"PK\x01\x02\x14\0", &header[..], &[0; 10], &at, name.as_bytes()].concat());
    }
    let [at, size] = [bytes.len(), directory.len()].map(|number| (number as u32).to_le_bytes());
    bytes.extend(&directory);
    bytes.extend([&b"PK\x05\x06\0\0\0\0\x02\0\x02\0"[..], &size, &at, &[0; 2]].concat());
    bytes
}
