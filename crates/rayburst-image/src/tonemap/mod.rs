//! Tone maps: scene-linear radiance, already exposed, to display-linear 0 to 1.
//!
//! Every operator is a pure function of one colour, so that it runs anywhere in a frame. Negative
//! and non-finite values count as zero, infinity as a very bright value.

mod aces;
mod agx;
mod neutral;
mod reinhard;

use glam::Vec3;
use rayon::prelude::*;

use crate::RgbImage;
use crate::colour::clamp_bad;

/// A tone mapping operator.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum ToneMap {
    /// Clips at 1.
    None,
    /// Reinhard's extended curve on luminance.
    Reinhard,
    /// Hill's fit of ACES' reference rendering and sRGB output transforms.
    Aces,
    /// Sobotka's AgX, base look, by Wrensch's polynomial.
    Agx,
    /// Khronos PBR Neutral: exact colours up to 0.8, compressed highlights.
    #[default]
    Neutral,
}

impl ToneMap {
    /// Every operator by name.
    pub const ALL: [(&'static str, Self); 5] = [
        ("none", Self::None),
        ("reinhard", Self::Reinhard),
        ("aces", Self::Aces),
        ("agx", Self::Agx),
        ("neutral", Self::Neutral),
    ];

    /// The operator of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.iter().find(|(n, _)| *n == name).map(|(_, map)| *map)
    }

    /// The operator's name.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Reinhard => "reinhard",
            Self::Aces => "aces",
            Self::Agx => "agx",
            Self::Neutral => "neutral",
        }
    }

    /// Maps one colour; each component of the result is in 0 to 1.
    #[inline]
    pub fn apply(self, colour: Vec3) -> Vec3 {
        let colour = sanitise(colour);
        let mapped = match self {
            Self::None => colour,
            Self::Reinhard => reinhard::map(colour),
            Self::Aces => aces::map(colour),
            Self::Agx => agx::map(colour),
            Self::Neutral => neutral::map(colour),
        };
        mapped.clamp(Vec3::ZERO, Vec3::ONE)
    }

    /// Exposes a picture by `ev` stops and maps it.
    pub fn apply_image(self, picture: &RgbImage, ev: f32) -> RgbImage {
        let scale = crate::exposure::scale(ev);
        let pixels = picture.pixels.par_iter().map(|&p| self.apply(p * scale)).collect();
        RgbImage { width: picture.width, height: picture.height, pixels }
    }
}

/// Bright enough to be white in every operator, and small enough to be squared.
const BRIGHTEST: f32 = 1e9;

fn sanitise(c: Vec3) -> Vec3 {
    Vec3::from_array(c.to_array().map(|v| clamp_bad(v, BRIGHTEST)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lead_back() {
        for (name, map) in ToneMap::ALL {
            assert_eq!(ToneMap::from_name(name), Some(map));
            assert_eq!(map.name(), name);
        }
        assert_eq!(ToneMap::from_name("filmic"), None);
    }

    #[test]
    fn every_operator_is_monotone_on_greys_and_stays_in_range() {
        for (name, map) in ToneMap::ALL {
            let mut last = -1.0;
            for i in 0..400 {
                let grey = map.apply(Vec3::splat(2f32.powf(i as f32 * 0.1 - 20.0)));
                assert!(grey.min_element() >= 0.0 && grey.max_element() <= 1.0, "{name} {grey}");
                assert!(grey.max_element() - grey.min_element() < 4e-3, "{name} {grey}");
                assert!(grey.y >= last - 2e-4, "{name} falls at {i}: {last} to {}", grey.y);
                last = grey.y;
            }
            assert!(last > 0.97, "{name}: the brightest is {last}");
            assert!(map.apply(Vec3::ZERO).max_element() < 1e-3, "{name}");
        }
    }

    #[test]
    fn bad_numbers_give_good_ones() {
        for (name, map) in ToneMap::ALL {
            for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -3.0, f32::MAX] {
                let out = map.apply(Vec3::new(bad, 0.5, bad));
                assert!(out.is_finite(), "{name} {bad} {out}");
            }
        }
    }

    #[test]
    fn an_image_is_exposed_first() {
        let grey = RgbImage::new(2, 1, Vec3::splat(0.1));
        let out = ToneMap::None.apply_image(&grey, 2.0);
        assert!((out.get(1, 0).x - 0.4).abs() < 1e-6);
    }
}
