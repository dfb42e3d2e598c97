//! `sheetsplat orbit`: turntables.

mod made;
mod movie;
mod numbered;
mod y4m;

use std::cell::Cell;
use std::io::{self, BufWriter, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use sheetsplat::headless::HeadlessView;
use sheetsplat::image::Image;
use sheetsplat::image::output::Target;
use sheetsplat::internals::fingerprint;
use sheetsplat::provenance::Sources;
use sheetsplat::scene::{OpenVolume, Scene};
use sheetsplat::{RenderError, StoredLight};

use crate::annotate::{Annotate, Words};
use crate::arguments::{Depth, Input, check_scene_file, log_frame, parse_degrees, parse_range, scene_file};
use crate::failure::Failure;
use crate::light::{self, Stored};
use crate::outputs::{self, Outputs};
use crate::picture::{Metadata, Told};
use crate::progress::{Progress, tell};
use made::Made;
use movie::{Encoder, Format, Settings};
use numbered::Pattern;
use y4m::Chroma;

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  sheetsplat orbit scene.toml -o turn.apng
  sheetsplat orbit scene.toml -o frame-%04d.png --count 600 --frames 0..60
  sheetsplat orbit scene.toml -o - | ffmpeg -i - turn.mp4")]
pub(crate) struct Arguments {
    #[command(flatten)]
    input: Input,
    #[command(flatten)]
    annotate: Annotate,
    #[command(flatten)]
    light: Stored,
    /// Numbered images (frame-%04d.png, frame-####.exr), a movie (.apng, .gif, .y4m), or - for YUV4MPEG2 on standard output.
    #[arg(short, long, value_name = "FILES")]
    output: PathBuf,
    /// Degrees that the camera turns over all frames, right-handed about its up vector. The last frame is one step before the end.
    #[arg(long, value_name = "DEGREES", default_value_t = 360.0, allow_negative_numbers = true, value_parser = parse_degrees)]
    turn: f64,
    /// Total number of frames.
    #[arg(long, value_name = "N", default_value_t = 120, value_parser = clap::value_parser!(u32).range(1..))]
    count: u32,
    /// Draw only frames A to B - 1, counted from 0: parts of a movie can be drawn anywhere, at any time.
    #[arg(long, value_name = "A..B", value_parser = parse_range)]
    frames: Option<Range<u32>>,
    /// Write the scene as a scene file, with everything that presets, colour maps and the volume determined. `render` draws its first
    /// frame from it, and any other frame with camera.direction turned.
    #[arg(long, value_name = "FILE")]
    save_scene: Option<PathBuf>,
    #[command(flatten)]
    metadata: Metadata,
    /// Draw numbered images again that were drawn before. Without it they are kept if they show the same and are whole.
    #[arg(long)]
    overwrite: bool,
    /// Frames per second of a movie.
    #[arg(long, value_name = "N", default_value_t = 30, value_parser = clap::value_parser!(u16).range(1..))]
    fps: u16,
    /// Bits per channel of PNG and APNG.
    #[arg(long, value_enum, default_value = "8")]
    depth: Depth,
    /// Chroma resolution of YUV4MPEG2: halved in both directions, which needs an even width and height, or full.
    #[arg(long, value_enum, default_value = "420")]
    chroma: Chroma,
}

impl Arguments {
    /// The files that are read and named so far.
    fn inputs(&self, scene: &Scene) -> Vec<PathBuf> {
        [self.input.files(scene), Vec::from_iter(self.light.file())].concat()
    }
}

pub(crate) fn run(arguments: &Arguments, progress: bool) -> Result<(), Failure> {
    let Arguments { input, output, count, overwrite, .. } = arguments;
    let frames = arguments.frames.clone().unwrap_or(0..*count);
    if frames.end > *count {
        let Range { start, end } = frames;
        return Err(Failure::Input(format!("--frames: found {start}..{end}, allowed: within 0..{count} (--count)")));
    }
    arguments.annotate.check_format(output)?;
    if let Some(path) = &arguments.save_scene {
        check_scene_file(path)?;
    }
    let format = if output == Path::new("-") { Some(Format::Y4m) } else { Format::of(output) };
    let (scene, times) = input.scene_and_times()?;
    if let Some(format) = format {
        return movie(arguments, (scene, times), format, frames, progress);
    }
    let pattern = Pattern::parse(output).ok_or_else(|| {
        let allowed = "numbered images (frame-%04d.png, frame-####.png), a movie (.apng, .gif, .y4m), or -";
        Failure::Input(format!("--output: found {}, allowed: {allowed}", output.display()))
    })?;
    Image::check_format(output)?;
    let scene_file = arguments.save_scene.iter().map(|path| ("--save-scene", path.clone()));
    let named = frames.clone().map(|frame| ("--output", pattern.path(frame)));
    let named: Vec<_> = named.chain([("--output", pattern.list())]).chain(scene_file).collect();
    let outputs = Outputs::distinct(named.iter().cloned(), false)?;
    outputs.refuse(&arguments.inputs(&scene))?;
    named.iter().try_for_each(|(_, path)| outputs::check_writable(path))?;
    // All frames are in one folder.
    outputs::check_folder(&pattern.list())?;
    arguments.save_scene.iter().try_for_each(|path| outputs::check_folder(path))?;
    let made = Made::open(pattern.list()).map_err(outputs::failed(&pattern.list()))?;
    let frames: Vec<u32> = frames.collect();
    let kept = Cell::new(0_usize);
    let is_kept = |frame: u32, shown: blake3::Hash| {
        let is_kept = !overwrite && made.has(shown, &pattern.path(frame));
        kept.set(kept.get() + usize::from(is_kept));
        is_kept
    };
    let (shown, volume) = Shown::load(arguments, (scene, times), &outputs, true)?;
    shown.draw(arguments, (volume, &frames), progress, is_kept, |frame, shown, (image, told)| {
        let path = pattern.path(frame);
        let bytes = arguments.metadata.encode(image, (&path, arguments.depth.into()), told)?;
        outputs::write(&[(&path, bytes.clone())], &[])?;
        made.add(shown, &bytes).map_err(outputs::failed(made.path()))
    })?;
    if kept.get() > 0 {
        tell(progress, &format!("{} of {} frames are kept, drawn before", kept.get(), frames.len()));
    }
    Ok(())
}

fn movie(
    arguments: &Arguments,
    (scene, times): (Scene, Option<Range<u32>>),
    format: Format,
    frames: Range<u32>,
    progress: bool,
) -> Result<(), Failure> {
    let Arguments { input, output, fps, depth, chroma, .. } = arguments;
    let settings = Settings {
        width: scene.image.width,
        height: scene.image.height,
        frames: frames.end - frames.start,
        fps: *fps,
        depth: (*depth).into(),
        chroma: *chroma,
    };
    format.check(&settings).map_err(|message| Failure::Input(format!("{}: {message}", input.name)))?;
    let frames: Vec<u32> = frames.collect();
    let is_printed = output == Path::new("-");
    let output_file = (!is_printed).then_some(("--output", output.as_path()));
    let scene_file = arguments.save_scene.as_deref().map(|path| ("--save-scene", path));
    let named: Vec<_> = output_file.into_iter().chain(scene_file).collect();
    let outputs = Outputs::check(&named, is_printed, &arguments.inputs(&scene))?;
    // The volume is loaded before anything is written, because the files it was read from are then known.
    let (shown, volume) = Shown::load(arguments, (scene, times), &outputs, false)?;
    let encode = move |to: &mut dyn Write, failed: &dyn Fn(io::Error) -> Failure| {
        let mut encoder = Encoder::new(format, &settings, &mut *to).map_err(failed)?;
        shown.draw(
            arguments,
            (volume, &frames),
            progress,
            |_, _| false,
            |_, _, (image, _)| encoder.add(image).map_err(failed),
        )?;
        encoder.finish().and_then(|()| to.flush()).map_err(failed)
    };
    if is_printed {
        return encode(&mut io::stdout().lock(), &|error| Failure::Other(format!("standard output: {error}")));
    }
    let failed = outputs::failed(output);
    let mut file = Target::of(output).and_then(Target::create).map_err(&failed)?;
    encode(&mut BufWriter::new(&mut file), &failed)?;
    outputs::commit(vec![file])
}

/// What the frames show.
struct Shown<'a> {
    /// With everything stated that depends on the volume, at the first time.
    scene: Scene,
    times: Option<Range<u32>>,
    words: Words,
    outputs: &'a Outputs,
    /// Whether frames that were drawn before may be kept, for which their hashes are needed.
    is_resumed: bool,
    /// Whether frames tell nothing beside their pixels.
    is_bare: bool,
    light: Option<Arc<StoredLight>>,
}

impl<'a> Shown<'a> {
    /// The scene of all frames, and its volume at the first time.
    fn load(
        arguments: &Arguments,
        (scene, times): (Scene, Option<Range<u32>>),
        outputs: &'a Outputs,
        is_resumed: bool,
    ) -> Result<(Self, OpenVolume), Failure> {
        let Arguments { input, annotate, light, .. } = arguments;
        let light = light.open(input)?;
        let scene = input.choose_levels(&scene, Scene::explicit_all_around)?;
        let volume = input.open_volume(&scene, outputs)?;
        let count = volume.sample().encoding().map_or(1, |encoding| encoding.times);
        if let Some(Range { start, end }) = times.clone().filter(|times| times.end > count) {
            let allowed = format!("within 0..{count}, the times of {}", input.name);
            return Err(Failure::Input(format!("--time: found {start}..{end}, allowed: {allowed}")));
        }
        let (words, scene) =
            annotate.settled((input, &arguments.output), volume.sample(), &scene, Scene::explicit_all_around)?;
        let is_bare = arguments.metadata.is_bare();
        Ok((Self { scene, times, words, outputs, is_resumed, is_bare, light }, volume))
    }

    /// The time that a frame shows: all times take turns over all frames.
    fn time_of(&self, frame: u32, count: u32) -> Option<u32> {
        let Range { start, end } = self.times.clone()?;
        let steps = u64::from(frame) * u64::from(end - start) / u64::from(count);
        Some(start + steps as u32)
    }

    /// The hash of what frames of a volume show beside their own directions: the scene, what is drawn over it, and the bits of its pixels.
    fn hash(&self, volume: &OpenVolume, depth: Depth) -> Result<blake3::Hasher, Failure> {
        let mut hash = blake3::Hasher::new();
        if !self.is_resumed {
            return Ok(hash);
        }
        hash.update(fingerprint(volume, &self.scene)?.as_bytes());
        hash.update(&[u8::from(depth == Depth::Sixteen)]);
        if self.is_bare {
            hash.update(b"without metadata");
        }
        self.words.add_to(&mut hash, &self.scene, volume.sample());
        Ok(hash)
    }

    /// The files behind the volume of frames that are pictures, if they are to tell it.
    fn sources(&self, arguments: &Arguments, volume: &OpenVolume, scene: &Scene) -> Option<Sources> {
        self.is_resumed.then(|| arguments.metadata.sources(&arguments.input.picture, (volume, scene))).flatten()
    }

    /// Draws frames and passes them on, except those that are kept, given the hash of what they show. Each is independent of the others. No more than one
    /// time is in memory.
    fn draw(
        &self,
        arguments: &Arguments,
        (volume, frames): (OpenVolume, &[u32]),
        progress: bool,
        is_kept: impl Fn(u32, blake3::Hash) -> bool,
        mut take: impl FnMut(u32, blake3::Hash, (&Image, Option<Told<'_>>)) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let Arguments { input, turn, count, save_scene, depth, .. } = arguments;
        let progress = Progress::new(frames.len(), progress);
        let scene = &self.scene;
        // The angle is relative to the scene's camera, independent of the previous frame.
        let angle = |frame: u32| turn * f64::from(frame) / f64::from(*count);
        let turned = |frame: u32| Scene { camera: scene.camera.turned(angle(frame)), ..scene.clone() };
        if let Some(light) = &self.light {
            let check = |frame: &u32| light.check(&turned(*frame));
            frames.iter().try_for_each(check).map_err(|error| input.failure(RenderError::from(error)))?;
        }
        let mut current = Current { time: scene.channels.first().time, ..Current::new(scene.clone()) };
        current.hash = self.hash(&volume, *depth)?;
        current.sources = self.sources(arguments, &volume, scene);
        current.volume = Some(progress.watch(volume));
        let mut headless = None;
        for &frame in frames {
            if let Some(time) = self.time_of(frame, *count).filter(|&time| current.time != Some(time)) {
                // The old view is dropped before the next time is read.
                current = Current { time: Some(time), ..Current::new(at_time(scene, time)) };
                let volume = input.read_volume(&current.scene, self.outputs)?;
                current.hash = self.hash(&volume, *depth)?;
                current.sources = self.sources(arguments, &volume, &current.scene);
                current.volume = Some(progress.watch(volume));
            }
            let shown = current.shown(angle(frame));
            if is_kept(frame, shown) {
                progress.step();
                continue;
            }
            let headless = match &mut headless {
                Some(headless) => headless,
                none => none.insert(input.headless(false, [scene])?),
            };
            if let Some(volume) = current.volume.take() {
                // The light is that of the frames.
                let view = light::view(headless, volume, &turned(frame), self.light.as_ref());
                current.view = Some(view.map_err(|error| input.failure(error))?);
            }
            let Some(view) = &mut current.view else { continue };
            let turned = turned(frame);
            view.set_camera(turned.camera).map_err(|error| input.failure(RenderError::from(error)))?;
            let rendering = headless.draw(view).map_err(|error| input.failure(error))?;
            let image = self.words.draw(rendering.image, &turned, view.volume().sample());
            let whole = self.words.whole(&Scene { camera: turned.camera, ..current.scene.clone() });
            let annotate = self.words.names();
            let told = current.sources.as_ref().map(|sources| Told {
                scene: &whole,
                sources,
                stats: &rendering.stats,
                annotate,
            });
            take(frame, shown, (&image, told))?;
            log_frame(&format!("frame {frame}"), &rendering.stats);
            progress.step();
        }
        match save_scene {
            Some(path) => outputs::write(&[(path, scene_file(&self.words.whole(scene), path)?)], &[]),
            None => Ok(()),
        }
    }
}

/// The time that is in memory.
struct Current {
    time: Option<u32>,
    /// The scene at this time.
    scene: Scene,
    /// The files behind its volume, if frames tell it.
    sources: Option<Sources>,
    /// Before a frame of it is drawn.
    volume: Option<OpenVolume>,
    /// From then on.
    view: Option<HeadlessView>,
    hash: blake3::Hasher,
}

impl Current {
    fn new(scene: Scene) -> Self {
        let hash = blake3::Hasher::new();
        Self { time: None, scene, sources: None, volume: None, view: None, hash }
    }

    /// The hash of what a frame shows, turned by some degrees.
    fn shown(&self, angle: f64) -> blake3::Hash {
        self.hash.clone().update(&angle.to_le_bytes()).finalize()
    }
}

/// The scene at another time, in all channels of the first one's file.
fn at_time(scene: &Scene, time: u32) -> Scene {
    let first = &scene.channels.first().volume;
    let channels = scene.channels.clone().map(|mut channel| {
        channel.time = if channel.volume == *first { Some(time) } else { channel.time };
        channel
    });
    Scene { channels, ..scene.clone() }
}
