//! A film as layers of an EXR file, and back.
//!
//! The picture and the AOVs are ordinary layers for any viewer. The exact state stands beside
//! them in layers `rayburst.accumulator.*`: channels `hi` and `lo` of each [`Sum`], and the counts.

use glam::Vec3;

use super::{AovSpec, Film, MAX_SAMPLES, PixelSum, Sum};
use crate::{Channel, ImageError, Layer, LayeredImage, Precision, Result};

/// What the layers of the saved state begin with.
pub const STATE_PREFIX: &str = "rayburst.accumulator";

impl Film {
    /// The picture and its AOVs as layers, and with `state` everything needed to go on later.
    ///
    /// `precision` is the beauty's. The state's values are always 32-bit floats.
    pub fn to_layers(&self, precision: Precision, state: bool) -> LayeredImage {
        let mean: Vec<Vec3> = self.mean().pixels;
        let mut layers = vec![Layer::from_vec3("", ["R", "G", "B"], &mean, precision)];
        for spec in &self.aovs {
            let channels = spec.channels.iter().enumerate().map(|(i, name)| Channel {
                name: name.clone(),
                values: self.aov(&spec.name, i).unwrap_or_default(),
                precision: spec.precision,
            });
            layers.push(Layer { name: spec.name.clone(), channels: channels.collect() });
        }
        if state {
            layers.extend(self.state_layers());
        }
        LayeredImage {
            width: self.width,
            height: self.height,
            layers,
            attributes: Default::default(),
        }
    }

    fn state_layers(&self) -> Vec<Layer> {
        let mut layers = Vec::new();
        for (i, name) in ["R", "G", "B"].iter().enumerate() {
            layers.push(self.sum_layer(name, |f, p| f.pixels[p].rgb[i]));
        }
        layers.push(self.sum_layer("luminance2", |f, p| f.pixels[p].luminance2));
        for (i, name) in aov_names(&self.aovs).iter().enumerate() {
            layers.push(self.sum_layer(name, |f, p| f.values[p * f.stride + i]));
        }
        let plane = |name: &str, value: fn(&PixelSum) -> u32| Channel {
            name: name.to_owned(),
            values: self.rows(|film, i| value(&film.pixels[i]) as f32),
            precision: Precision::Float,
        };
        let channels = vec![plane("samples", |p| p.samples), plane("dropped", |p| p.dropped)];
        layers.push(Layer { name: format!("{STATE_PREFIX}.count"), channels });
        layers
    }

    fn sum_layer(&self, name: &str, sum: impl Fn(&Self, usize) -> Sum) -> Layer {
        let plane = |name: &str, part: fn(Sum) -> f32| Channel {
            name: name.to_owned(),
            values: self.rows(|film, i| part(sum(film, i))),
            precision: Precision::Float,
        };
        let channels = vec![plane("hi", |s| s.hi), plane("lo", |s| s.lo)];
        Layer { name: format!("{STATE_PREFIX}.{name}"), channels }
    }

    /// The film that [`Self::to_layers`] saved with its state; `aovs` must be the same as then.
    pub fn from_layers(image: &LayeredImage, aovs: &[AovSpec]) -> Result<Self> {
        let mut film = Self::new(image.width, image.height, aovs)?;
        for i in 0..3 {
            film.load_sum(image, ["R", "G", "B"][i], |f, p| &mut f.pixels[p].rgb[i])?;
        }
        film.load_sum(image, "luminance2", |f, p| &mut f.pixels[p].luminance2)?;
        for (i, name) in aov_names(aovs).iter().enumerate() {
            film.load_sum(image, name, |f, p| {
                let at = p * f.stride + i;
                &mut f.values[at]
            })?;
        }
        film.load(image, "count", "samples", |f, p, v| f.pixels[p].samples = v as u32)?;
        film.load(image, "count", "dropped", |f, p, v| f.pixels[p].dropped = v as u32)?;
        Ok(film)
    }

    fn load_sum(
        &mut self,
        image: &LayeredImage,
        name: &str,
        sum: impl Fn(&mut Self, usize) -> &mut Sum,
    ) -> Result<()> {
        self.load(image, name, "hi", |f, p, v| sum(f, p).hi = v)?;
        self.load(image, name, "lo", |f, p, v| sum(f, p).lo = v)
    }

    fn load(
        &mut self,
        image: &LayeredImage,
        layer: &str,
        channel: &str,
        set: impl Fn(&mut Self, usize, f32),
    ) -> Result<()> {
        let name = format!("{STATE_PREFIX}.{layer}");
        let plane = image.layer(&name).and_then(|l| l.channel(channel));
        let values = plane.filter(|v| v.len() == self.pixels.len()).ok_or_else(|| {
            ImageError::Invalid(format!(
                "the picture cannot be continued: it has no channel '{name}.{channel}'; render it anew with the same AOVs"
            ))
        })?;
        let counts = layer == "count";
        let good = |value: &f32| match counts {
            true => value.fract() == 0.0 && (0.0..=MAX_SAMPLES as f32).contains(value),
            false => value.is_finite(),
        };
        if let Some(bad) = values.iter().position(|v| !good(v)) {
            let (x, y) = (bad % self.width as usize, bad / self.width as usize);
            return Err(ImageError::Invalid(format!(
                "the picture cannot be continued: '{name}.{channel}' is {} at pixel ({x}, {y})",
                values[bad]
            )));
        }
        for (place, index) in super::tile_rows(self.width, self.height) {
            for (&value, i) in values[place].iter().zip(index) {
                set(self, i, value);
            }
        }
        Ok(())
    }
}

fn aov_names(aovs: &[AovSpec]) -> Vec<String> {
    aovs.iter().flat_map(|a| a.channels.iter().map(|c| format!("aov.{}.{c}", a.name))).collect()
}
