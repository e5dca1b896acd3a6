//! Colours for numbers: error heat maps, depths, counts.
//!
//! Magma and viridis (Smith, van der Walt 2015, CC0) run from dark to bright in even steps of
//! lightness, also for colour-blind eyes. 33 anchors with straight lines between them stay within
//! two steps of 255 of the originals.

use glam::Vec3;

use crate::{Rgb8Image, RgbImage, colour};

/// A map from 0 to 1 to colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ColourMap {
    /// Black, purple, orange, pale yellow: errors.
    Magma,
    /// Dark blue, green, yellow: depths and counts.
    Viridis,
}

const MAGMA: [u32; 33] = [
    0x000004, 0x030311, 0x0a0822, 0x130d33, 0x1d1146, 0x28115a, 0x36106a, 0x430f76, 0x50127c,
    0x5d177f, 0x691c81, 0x762181, 0x822681, 0x8f2a81, 0x9c2e7f, 0xa9327d, 0xb63779, 0xc33b75,
    0xcf4170, 0xdb486a, 0xe65163, 0xee5c5e, 0xf5695c, 0xf9785d, 0xfb8761, 0xfd9668, 0xfea571,
    0xfeb47b, 0xfec387, 0xfed194, 0xfde0a2, 0xfceeb0, 0xfcfdbf,
];

const VIRIDIS: [u32; 33] = [
    0x440154, 0x470d60, 0x48186a, 0x482374, 0x472d7b, 0x453681, 0x424086, 0x3f4989, 0x3b528b,
    0x375a8d, 0x33638d, 0x2f6a8e, 0x2c728e, 0x297a8e, 0x26818e, 0x23898e, 0x21908c, 0x1f988b,
    0x1f9f88, 0x21a685, 0x28ae80, 0x31b57b, 0x3ebc74, 0x4cc26c, 0x5dc963, 0x6ece58, 0x82d34c,
    0x96d83f, 0xabdc32, 0xc0df24, 0xd5e21a, 0xeae51a, 0xfde725,
];

impl ColourMap {
    /// Every map by name.
    pub const ALL: [(&'static str, Self); 2] = [("magma", Self::Magma), ("viridis", Self::Viridis)];

    /// The sRGB colour, each component 0 to 1, of a number; outside 0 to 1 the ends go on, NaN is
    /// the lower end.
    pub fn srgb(self, value: f32) -> Vec3 {
        let anchors = match self {
            Self::Magma => &MAGMA,
            Self::Viridis => &VIRIDIS,
        };
        let at = colour::clamp_bad(value, 1.0) * 32.0;
        let low = (at as usize).min(31);
        anchor(anchors[low]).lerp(anchor(anchors[low + 1]), at - low as f32)
    }

    /// A picture of a plane of numbers, `low` and `high` at the ends of the map.
    pub fn apply(self, width: u32, height: u32, values: &[f32], low: f32, high: f32) -> Rgb8Image {
        let scale = 1.0 / (high - low).max(f32::MIN_POSITIVE);
        let bytes = |v: &f32| (self.srgb((v - low) * scale) * 255.0 + 0.5).to_array();
        let data = values.iter().flat_map(bytes).map(|v| v as u8).collect();
        Rgb8Image { width, height, data }
    }

    /// The same as display-linear values, for pictures that are encoded later.
    pub fn apply_linear(
        self,
        width: u32,
        height: u32,
        values: &[f32],
        low: f32,
        high: f32,
    ) -> RgbImage {
        let scale = 1.0 / (high - low).max(f32::MIN_POSITIVE);
        let linear = |v: &f32| colour::srgb_decode3(self.srgb((v - low) * scale));
        RgbImage { width, height, pixels: values.iter().map(linear).collect() }
    }
}

fn anchor(hex: u32) -> Vec3 {
    let [_, r, g, b] = hex.to_be_bytes().map(f32::from);
    Vec3::new(r, g, b) / 255.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brighter_means_more() {
        for (name, map) in ColourMap::ALL {
            let mut last = -1.0;
            for i in 0..=200 {
                let colour = map.srgb(i as f32 / 200.0);
                let light = colour::luminance(colour::srgb_decode3(colour));
                assert!(light > last, "{name} at {i}");
                last = light;
            }
            assert_eq!(map.srgb(7.0), map.srgb(1.0));
            assert_eq!(map.srgb(f32::NAN), map.srgb(-1.0));
        }
        let picture = ColourMap::Magma.apply(2, 1, &[2.0, 4.0], 2.0, 4.0);
        assert_eq!(picture.data, [0, 0, 4, 0xfc, 0xfd, 0xbf]);
        let flat = ColourMap::Magma.apply(1, 1, &[1.0], 1.0, 1.0);
        assert_eq!(flat.data, [0, 0, 4]);
    }
}
