//! Pictures in memory: linear RGB, 8-bit RGB, and named planar layers.

use std::collections::BTreeMap;

use glam::Vec3;
use rayon::prelude::*;

use crate::limits::check_size;
use crate::{ImageError, Result};

/// A picture of linear Rec. 709 values, row by row from the top left.
#[derive(Clone, Debug, PartialEq)]
pub struct RgbImage {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height` values.
    pub pixels: Vec<Vec3>,
}

impl RgbImage {
    /// A picture of one colour; the size must have passed [`check_size`].
    pub fn new(width: u32, height: u32, colour: Vec3) -> Self {
        Self { width, height, pixels: vec![colour; width as usize * height as usize] }
    }

    /// A picture from a function of the pixel's column and row.
    pub fn from_fn(width: u32, height: u32, mut value: impl FnMut(u32, u32) -> Vec3) -> Self {
        let mut pixels = Vec::with_capacity(width as usize * height as usize);
        for y in 0..height {
            pixels.extend((0..width).map(|x| value(x, y)));
        }
        Self { width, height, pixels }
    }

    /// The value of column `x` and row `y`.
    #[inline]
    pub fn get(&self, x: u32, y: u32) -> Vec3 {
        self.pixels[y as usize * self.width as usize + x as usize]
    }

    /// Changes every pixel.
    pub fn map(mut self, f: impl Fn(Vec3) -> Vec3 + Sync) -> Self {
        self.pixels.par_iter_mut().for_each(|p| *p = f(*p));
        self
    }

    /// Checks that `other` has the same size.
    pub fn check_same_size(&self, other: &Self) -> Result<()> {
        let (a, b) = ((self.width, self.height), (other.width, other.height));
        if a == b { Ok(()) } else { Err(ImageError::SizeMismatch { a, b }) }
    }
}

/// A picture of display-encoded (sRGB) bytes, three a pixel, row by row from the top left.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rgb8Image {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `3 * width * height` bytes.
    pub data: Vec<u8>,
}

/// How a channel's samples are stored in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Precision {
    /// 16-bit floats: enough for colours. Finite values stay finite: at most ±65504.
    Half,
    /// 32-bit floats, bit for bit: for depths, positions, ids and accumulators.
    #[default]
    Float,
}

/// One plane of samples, row by row from the top left.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// `R`, `G`, `B`, `X`, `Z`… without the layer's name.
    pub name: String,
    /// `width * height` values.
    pub values: Vec<f32>,
    /// How a file stores them.
    pub precision: Precision,
}

/// Channels that belong together. The beauty picture is the layer with the empty name.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Layer {
    /// `albedo`, `normal`…; may hold dots itself.
    pub name: String,
    /// The planes.
    pub channels: Vec<Channel>,
}

impl Layer {
    /// A three-channel layer from interleaved values.
    pub fn from_vec3(name: &str, names: [&str; 3], values: &[Vec3], precision: Precision) -> Self {
        let channels = (0..3)
            .map(|i| Channel {
                name: names[i].to_owned(),
                values: values.iter().map(|v| v[i]).collect(),
                precision,
            })
            .collect();
        Self { name: name.to_owned(), channels }
    }

    /// A one-channel layer.
    pub fn from_scalar(name: &str, channel: &str, values: Vec<f32>) -> Self {
        let channel = Channel { name: channel.to_owned(), values, precision: Precision::Float };
        Self { name: name.to_owned(), channels: vec![channel] }
    }

    /// The plane of that name.
    pub fn channel(&self, name: &str) -> Option<&[f32]> {
        self.channels.iter().find(|c| c.name == name).map(|c| c.values.as_slice())
    }
}

/// A picture of many named planes and text attributes: what an EXR file holds.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct LayeredImage {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// The layers; channel names are unique within `layer.channel`.
    pub layers: Vec<Layer>,
    /// Text attributes: sample count, seed, integrator…
    pub attributes: BTreeMap<String, String>,
}

impl LayeredImage {
    /// A picture with the beauty layer only, as 32-bit floats.
    pub fn from_rgb(picture: &RgbImage) -> Self {
        let beauty = Layer::from_vec3("", ["R", "G", "B"], &picture.pixels, Precision::Float);
        Self {
            width: picture.width,
            height: picture.height,
            layers: vec![beauty],
            attributes: BTreeMap::new(),
        }
    }

    /// The layer of that name; the beauty's is empty.
    pub fn layer(&self, name: &str) -> Option<&Layer> {
        self.layers.iter().find(|l| l.name == name)
    }

    /// A layer as a picture: from `R G B`, from `X Y Z`, or from `Y` or a single channel as grey.
    pub fn rgb(&self, layer: &str) -> Option<RgbImage> {
        let layer = self.layer(layer)?;
        let planes = [["R", "G", "B"], ["r", "g", "b"], ["X", "Y", "Z"], ["x", "y", "z"]]
            .into_iter()
            .find_map(|n| Some([layer.channel(n[0])?, layer.channel(n[1])?, layer.channel(n[2])?]))
            .or_else(|| {
                let only = (layer.channels.len() == 1).then(|| &*layer.channels[0].values);
                layer.channel("Y").or(only).map(|c| [c; 3])
            })?;
        let [r, g, b] = planes;
        let pixels = (0..r.len()).map(|i| Vec3::new(r[i], g[i], b[i])).collect();
        Some(RgbImage { width: self.width, height: self.height, pixels })
    }

    /// The picture to show: the layer without a name, or else one that other programs give the
    /// beauty, or else the first layer that [`Self::rgb`] can read.
    pub fn beauty(&self) -> Option<RgbImage> {
        let usual = |l: &&Layer| {
            let last = l.name.rsplit('.').next().unwrap_or_default().to_ascii_lowercase();
            matches!(&*last, "rgba" | "rgb" | "beauty" | "combined" | "color" | "colour")
        };
        self.rgb("")
            .or_else(|| self.layers.iter().filter(usual).find_map(|l| self.rgb(&l.name)))
            .or_else(|| self.layers.iter().find_map(|l| self.rgb(&l.name)))
    }

    /// Checks sizes, plane lengths and names.
    pub fn validate(&self, name: &str) -> Result<()> {
        let pixels = check_size(name, self.width.into(), self.height.into())?;
        let invalid = |text: String| Err(ImageError::Invalid(format!("{name}: {text}")));
        let mut names = Vec::new();
        for layer in &self.layers {
            for channel in &layer.channels {
                let full = full_name(&layer.name, &channel.name);
                if channel.values.len() != pixels {
                    return invalid(format!(
                        "channel '{full}' has {} values, the picture {pixels} pixels",
                        channel.values.len()
                    ));
                }
                if channel.name.is_empty() || channel.name.contains('.') || full.len() > 255 {
                    return invalid(format!(
                        "channel '{full}': a channel's name has no dot, and 1 to 255 bytes with its layer's"
                    ));
                }
                names.push(full);
            }
        }
        if names.is_empty() {
            return invalid("no channels".to_owned());
        }
        names.sort_unstable();
        if let Some(twice) = names.windows(2).find(|w| w[0] == w[1]) {
            return invalid(format!("channel '{}' occurs twice", twice[0]));
        }
        if names.iter().any(|n| n.contains('\0')) {
            return invalid("a channel's name holds a zero byte".to_owned());
        }
        Ok(())
    }
}

/// A channel's name in a file.
pub(crate) fn full_name(layer: &str, channel: &str) -> String {
    if layer.is_empty() { channel.to_owned() } else { format!("{layer}.{channel}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_become_pictures() {
        let picture = RgbImage::from_fn(3, 2, |x, y| Vec3::new(x as f32, y as f32, 0.5));
        let mut layered = LayeredImage::from_rgb(&picture);
        layered.layers.push(Layer::from_scalar("depth", "Z", vec![2.0; 6]));
        assert_eq!(layered.beauty().unwrap(), picture);
        assert_eq!(layered.rgb("depth").unwrap().get(2, 1), Vec3::splat(2.0));
        assert!(layered.rgb("normal").is_none());
        layered.validate("p").unwrap();
        layered.layers[0].name = "ViewLayer.Combined".to_owned();
        layered.layers.swap(0, 1);
        assert_eq!(layered.beauty().unwrap(), picture);
    }

    #[test]
    fn contradictions_are_named() {
        let mut layered = LayeredImage::from_rgb(&RgbImage::new(2, 2, Vec3::ONE));
        layered.layers.push(layered.layers[0].clone());
        assert!(layered.validate("p").unwrap_err().to_string().contains("'B' occurs twice"));
        layered.layers.pop();
        layered.layers[0].channels[0].values.pop();
        assert!(layered.validate("p").unwrap_err().to_string().contains("3 values"));
    }
}
