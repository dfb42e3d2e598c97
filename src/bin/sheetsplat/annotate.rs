//! `--annotate`: words beside the pictures.

use std::ffi::OsStr;
use std::path::Path;

use sheetsplat::SettingError;
use sheetsplat::annotate::{self, Annotation, Layout};
use sheetsplat::image::Image;
use sheetsplat::internals::text::filled;
use sheetsplat::scene::Scene;
use sheetsplat::volume::Volume;

use crate::arguments::Input;
use crate::failure::Failure;

/// The choice of annotations.
#[derive(clap::Args)]
pub(crate) struct Annotate {
    /// Words beside the picture, which gets smaller, separated by commas: scale, a bar of a round length; colors, the colour of each value, for
    /// each channel; legend, the colour of each label or channel; sides, the sides of the patient (R, L, A, P, S, I).
    #[arg(long, value_name = "LIST", value_parser = Named, value_delimiter = ',')]
    annotate: Vec<Annotation>,
}

/// Reads an annotation's name.
#[derive(Clone)]
struct Named;

impl clap::builder::TypedValueParser for Named {
    type Value = Annotation;

    fn parse_ref(
        &self,
        command: &clap::Command,
        argument: Option<&clap::Arg>,
        value: &OsStr,
    ) -> Result<Annotation, clap::Error> {
        let names = clap::builder::PossibleValuesParser::new(Annotation::ALL.map(|(name, _)| name));
        let name = names.parse_ref(command, argument, value)?;
        name.parse().map_err(|error| clap::Error::raw(clap::error::ErrorKind::InvalidValue, format!("{error}\n")))
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = clap::builder::PossibleValue> + '_>> {
        Some(Box::new(Annotation::ALL.into_iter().map(|(name, _)| clap::builder::PossibleValue::new(name))))
    }
}

/// The words beside a scene's pictures; without any, pictures stay as they are.
pub(crate) struct Words {
    layout: Option<Layout>,
    /// The names of the annotations.
    names: Vec<String>,
}

impl Annotate {
    /// Whether there are no words.
    pub(crate) fn is_empty(&self) -> bool {
        self.annotate.is_empty()
    }

    /// The words beside a scene's pictures, in any direction of its camera, and the scene of the pictures beside them, with everything stated that
    /// depends on the volume. `explicit` is as for [`Input::settled`].
    pub(crate) fn settled(
        &self,
        (input, output): (&Input, &Path),
        volume: &Volume,
        scene: &Scene,
        explicit: impl Fn(&Scene, &Volume) -> Scene,
    ) -> Result<(Words, Scene), Failure> {
        let scene = input.settled(volume, scene, |scene, _| scene.clone())?;
        let invalid = |error: SettingError| Failure::Input(format!("--{error}"));
        let chosen = if self.is_empty() && !is_data(output) {
            // A picture has the words that it had.
            input.picture.annotations().iter().map(|name| name.parse()).collect::<Result<_, _>>().map_err(invalid)?
        } else {
            self.annotate.clone()
        };
        let layout = || annotate::layout(&chosen, &scene, volume);
        let layout = (!chosen.is_empty()).then(layout).transpose().map_err(invalid)?;
        let beside = layout.as_ref().map_or_else(|| scene.clone(), |layout| layout.scene(&scene));
        let is_chosen = |(_, annotation): &(&str, Annotation)| chosen.contains(annotation);
        let names = Annotation::ALL.into_iter().filter(is_chosen).map(|(name, _)| name.to_owned()).collect();
        Ok((Words { layout, names }, explicit(&beside, volume)))
    }

    /// Checks that the output is a picture to look at, not data.
    pub(crate) fn check_format(&self, output: &Path) -> Result<(), Failure> {
        if is_data(output) && !self.annotate.is_empty() {
            let found = output.display();
            return Err(Failure::Input(format!("--annotate: found {found}, allowed: PNG files and movies")));
        }
        Ok(())
    }
}

/// Whether a file is no picture to look at: an image of floats, or a part of one.
fn is_data(output: &Path) -> bool {
    let extension = output.extension();
    extension.is_some_and(|extension| ["exr", "npy", "npz"].iter().any(|data| extension.eq_ignore_ascii_case(data)))
}

impl Words {
    /// The names of the annotations.
    pub(crate) fn names(&self) -> &[String] {
        &self.names
    }

    /// The scene of the whole image, for that of a picture.
    pub(crate) fn whole(&self, scene: &Scene) -> Scene {
        self.layout.as_ref().map_or_else(|| scene.clone(), |layout| layout.whole(scene))
    }

    /// The image of a scene's picture with its words.
    pub(crate) fn draw(&self, picture: Image, scene: &Scene, volume: &Volume) -> Image {
        match &self.layout {
            Some(layout) => layout.draw(&picture, scene, volume),
            None => picture,
        }
    }

    /// Adds the words to a hash, for the camera of a picture's scene.
    pub(crate) fn add_to(&self, hash: &mut blake3::Hasher, scene: &Scene, volume: &Volume) {
        if self.layout.is_some() {
            let blank = filled([scene.image.width, scene.image.height], [0.0; 4]);
            let Image { width, height, pixels } = self.draw(blank, scene, volume);
            [width, height].iter().for_each(|number| _ = hash.update(&number.to_le_bytes()));
            let bytes: Vec<u8> = pixels.iter().flatten().flat_map(|channel| channel.to_le_bytes()).collect();
            hash.update(&bytes);
        }
    }
}
