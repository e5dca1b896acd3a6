//! Developing: linear radiance to 8 bits.

use rayburst::{
    image::{
        Rgb8Image, RgbImage, ToneMap,
        exposure::auto_exposure,
        quantise::{Dither, to_srgb8},
    },
    render::{Display, false_colours},
};

use crate::{
    args::{render::DevelopArgs, values::Exposure},
    terminal,
};

/// Develops the pictures of one command; an automatic exposure is kept from the first.
#[derive(Clone, Debug)]
pub(crate) struct Developer {
    display: Display,
    tone_map: ToneMap,
    exposure: Option<f32>,
}

impl Developer {
    /// By the options, or by what the scene says.
    pub(crate) fn new(display: Display, args: &DevelopArgs, of_scene: Option<f32>) -> Self {
        let exposure = match args.exposure {
            Some(Exposure::Stops(stops)) => Some(stops),
            Some(Exposure::Auto) => None,
            None => of_scene,
        };
        Self { display, tone_map: args.tone_map, exposure }
    }

    /// The picture in 8 bits.
    pub(crate) fn develop(&mut self, picture: &RgbImage) -> Rgb8Image {
        match self.display {
            Display::Radiance => {
                let stops = *self.exposure.get_or_insert_with(|| {
                    let stops = auto_exposure(picture);
                    terminal::note(format!("automatic exposure: --exposure {stops:.2}"));
                    stops
                });
                let toned = self.tone_map.apply_image(picture, stops);
                to_srgb8(&toned, Dither::Triangular)
            }
            Display::Colours => to_srgb8(picture, Dither::None),
            Display::Amounts => {
                let (colours, top) = false_colours(picture);
                terminal::note(format!("the brightest colour stands for {top}"));
                to_srgb8(&colours, Dither::None)
            }
        }
    }
}
