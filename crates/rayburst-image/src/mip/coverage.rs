//! Mip levels of cut-outs that cover as much as the finest level does.
//!
//! Averaging moves alpha to the middle, so that a fixed cutoff thins out foliage and wires with the
//! distance. Castaño: "Computing Alpha Mipmaps", 2010, scales the alpha of each level until its share
//! of texels that pass the test is that of the finest level. Alphas of binary masks are often equal, so
//! that no scale splits them: among equals those pass that have more around them, then a scattered
//! choice.

use rayburst_math::hash;

use super::{MipLevel, MipMap, TexelFormat, downsample::Plane};

impl MipMap {
    /// The same texture for materials that cut out what is below `cutoff`: on every level as large a
    /// share of the texels reaches it as on the finest, to a texel. Alpha is the alpha channel's, or
    /// where there is none the mean of the others. The finest level is shared, colours are kept.
    ///
    /// Cutoffs that all or no texels reach, and not-a-numbers, change nothing.
    #[must_use]
    pub fn with_coverage(&self, cutoff: f32) -> Self {
        let Some(first) = (0..=255).find(|&byte| self.coverage_value(byte) >= cutoff) else {
            return self.clone();
        };
        let mut plane = self.coverage_plane();
        let passing = plane.values.iter().filter(|&&v| v >= cutoff).count();
        let share = passing as f64 / plane.values.len() as f64;
        if first == 0 || passing == 0 || passing == plane.values.len() {
            return self.clone();
        }
        let mut levels = self.levels.clone();
        for level in &mut levels[1..] {
            plane = plane.half();
            let alphas = self.rescaled(&plane, cutoff, first, share);
            self.replace(level, &alphas);
        }
        Self { levels, ..self.clone() }
    }

    /// The share of a level's texels whose alpha, as in [`MipMap::with_coverage`], reaches a cutoff.
    ///
    /// Panics when `level` is out of range.
    pub fn coverage(&self, level: usize, cutoff: f32) -> f64 {
        let data = &self.levels[level].data;
        let passing =
            data.chunks_exact(self.channels).filter(|t| self.opacity(t) >= cutoff).count();
        passing as f64 / (data.len() / self.channels) as f64
    }

    fn has_alpha(&self) -> bool {
        self.channels.is_multiple_of(2)
    }

    /// What a byte of the channel that covers means.
    fn coverage_value(&self, byte: u8) -> f32 {
        if self.has_alpha() {
            f32::from(byte) * (1.0 / 255.0)
        } else {
            self.decode[usize::from(byte)]
        }
    }

    fn opacity(&self, texel: &[u8]) -> f32 {
        let covering = if self.has_alpha() { &texel[self.channels - 1..] } else { texel };
        let sum: f32 = covering.iter().map(|&b| self.coverage_value(b)).sum();
        sum / covering.len() as f32
    }

    /// The finest level's alphas.
    fn coverage_plane(&self) -> Plane {
        let MipLevel { width, height, ref data } = self.levels[0];
        let values = data.chunks_exact(self.channels).map(|t| self.opacity(t)).collect();
        Plane { width, height, channels: 1, values }
    }

    /// Bytes of a level: the best `share` of the alphas at least `first`, the others below.
    fn rescaled(&self, plane: &Plane, cutoff: f32, first: u8, share: f64) -> Vec<u8> {
        let count = plane.values.len();
        let wanted = (share * count as f64).round() as usize;
        let mut order: Vec<u32> = (0..count as u32).collect();
        let better = |a: &u32, b: &u32| {
            let key = |i: u32| (plane.values[i as usize], around(plane, i));
            let ((a_value, a_around), (b_value, b_around)) = (key(*a), key(*b));
            let by_value = b_value.total_cmp(&a_value).then(b_around.total_cmp(&a_around));
            by_value.then(hash::pcg(*a).cmp(&hash::pcg(*b)))
        };
        if (1..count).contains(&wanted) {
            order.select_nth_unstable_by(wanted, better);
        }
        let (passing, failing) = order.split_at(wanted);
        let value = |i: &u32| plane.values[*i as usize];
        let least = passing.iter().map(value).fold(f32::INFINITY, f32::min);
        let most = failing.iter().map(value).fold(0.0, f32::max);
        // Where all or none pass, as in the last levels, the nearest scale to 1 does.
        let threshold = match (passing.is_empty(), failing.is_empty()) {
            (true, _) => most.max(cutoff),
            (_, true) => least.min(cutoff),
            _ => 0.5 * (least + most),
        };
        let scale = if threshold > 0.0 { cutoff / threshold } else { 1.0 };
        let byte = |i: &u32| self.encode_coverage(value(i) * scale);
        let mut bytes = vec![0; count];
        for i in passing {
            bytes[*i as usize] = byte(i).max(first);
        }
        for i in failing {
            bytes[*i as usize] = byte(i).min(first - 1);
        }
        bytes
    }

    fn encode_coverage(&self, value: f32) -> u8 {
        let encoder = match self.format {
            TexelFormat::Srgb if !self.has_alpha() => super::downsample::srgb_encoder(),
            _ => super::downsample::linear_encoder(),
        };
        encoder[usize::from((value * 65_535.0 + 0.5) as u16)]
    }

    fn replace(&self, level: &mut MipLevel, alphas: &[u8]) {
        let mut data = level.data.to_vec();
        for (texel, &alpha) in data.chunks_exact_mut(self.channels).zip(alphas) {
            let from = if self.has_alpha() { self.channels - 1 } else { 0 };
            texel[from..].fill(alpha);
        }
        level.data = data.into();
    }
}

/// The sum of the 3 × 3 values around a texel; the edge goes on.
fn around(plane: &Plane, index: u32) -> f32 {
    let (x, y) = (index % plane.width, index / plane.width);
    let near = |v: u32, size: u32| [v.saturating_sub(1), v, (v + 1).min(size - 1)];
    let mut sum = 0.0;
    for y in near(y, plane.height) {
        for x in near(x, plane.width) {
            sum += plane.values[(y * plane.width + x) as usize];
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use rayburst_math::hash::Rng;

    use super::*;
    use crate::texture::Texels;

    /// Thin leaves: transparent where two waves of a few texels do not meet.
    fn leaves(width: u32, height: u32, channels: u8, soft: bool) -> MipMap {
        let mut rng = Rng::new(3);
        let mut data = Vec::new();
        for y in 0..height {
            for x in 0..width {
                let wave = (0.9 * x as f32 + 1.2).sin() * (0.7 * y as f32 + 0.3 * x as f32).cos();
                let alpha = 0.5 + 0.5 * wave + 0.2 * (rng.f32() - 0.5);
                let alpha = if soft { alpha } else { f32::from(u8::from(alpha > 0.75)) };
                let byte = (alpha.clamp(0.0, 1.0) * 255.0) as u8;
                data.extend((0..channels).map(|c| if c + 1 == channels { byte } else { 90 + c }));
            }
        }
        MipMap::new(Texels { width, height, channels, data }, TexelFormat::Srgb)
    }

    #[test]
    fn every_level_covers_what_the_finest_covers() {
        for (width, height) in [(128, 128), (100, 36), (1, 64)] {
            for channels in [1, 2, 4] {
                for soft in [false, true] {
                    for cutoff in [0.1, 0.5, 0.9] {
                        let plain = leaves(width, height, channels, soft);
                        let kept = plain.with_coverage(cutoff);
                        let share = plain.coverage(0, cutoff);
                        assert!(share > 0.01 && share < 0.99);
                        for (i, level) in kept.levels().iter().enumerate() {
                            let texel = 1.0 / f64::from(level.width * level.height);
                            let error = (kept.coverage(i, cutoff) - share).abs();
                            assert!(error <= 0.5 * texel + 1e-9, "{width}×{height} level {i}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn averages_alone_would_thin_the_leaves_out() {
        let plain = leaves(128, 128, 4, false);
        let share = plain.coverage(0, 0.5);
        assert!(plain.coverage(4, 0.5) < 0.5 * share);
    }

    #[test]
    fn colours_and_the_finest_level_stay() {
        let plain = leaves(64, 32, 4, false);
        let kept = plain.with_coverage(0.5);
        for (i, level) in plain.levels().iter().enumerate() {
            for y in 0..level.height {
                for x in 0..level.width {
                    let (a, b) = (plain.texel(i, x, y), kept.texel(i, x, y));
                    assert_eq!(a[..3], b[..3]);
                    assert!(i > 0 || a[3] == b[3]);
                }
            }
        }
    }

    #[test]
    fn cutoffs_that_decide_nothing_change_nothing() {
        let plain = leaves(16, 16, 4, true);
        for cutoff in [-1.0, 0.0, 1.5, f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let kept = plain.with_coverage(cutoff);
            for (a, b) in plain.levels().iter().zip(kept.levels()) {
                assert_eq!(a.data, b.data, "{cutoff}");
            }
        }
        let solid = MipMap::new(
            Texels { width: 4, height: 4, channels: 4, data: vec![255; 64] },
            TexelFormat::Srgb,
        );
        assert_eq!(solid.with_coverage(0.5).coverage(2, 0.5), 1.0);
    }
}
