//! Anisotropic texture lookups: averages over an ellipse by several trilinear taps along its longer
//! axis.
//!
//! McCormack, Perry, Farkas, Jouppi: "Feline: Fast Elliptical Lines for Anisotropic Texture Mapping",
//! SIGGRAPH 1999; the ellipse is that of Heckbert: "Fundamentals of Texture Mapping and Image Warping",
//! 1989. Taps lie within the longer axis, as far apart as the shorter one is long, and weigh the same: a
//! pixel is a box. Gaussian weights are up to 2.6 times as far from the mean over random parallelograms
//! of checks and noise, and elliptical weighted averages are no nearer where they read as many texels.

use glam::{Vec2, Vec4};
use rayburst_image::MipMap;

use crate::{
    Texture,
    texture_lookup::{minified, trilinear},
};

/// The most taps of a lookup. Longer ellipses are widened, which blurs and does not alias.
pub const MAX_TAPS: u32 = 16;

/// Ellipses that are longer than wide by less are looked up once.
pub(crate) const ROUND: f32 = 1.3;

/// The longest axis in texels, so that squares stay finite.
pub(crate) const LONGEST: f32 = 1e8;

/// The ellipse of a parallelogram: what has the same second moments.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Ellipse {
    /// The longer axis, full length.
    major: Vec2,
    /// Full lengths of the axes.
    lengths: [f32; 2],
}

impl Ellipse {
    /// Of the parallelogram of two vectors, by the eigenvalues of the sum of their outer squares.
    #[inline]
    fn of_parallelogram([a, b]: [Vec2; 2]) -> Self {
        let clamp = |v: Vec2| v.clamp(Vec2::splat(-LONGEST), Vec2::splat(LONGEST));
        let (a, b) = (clamp(a), clamp(b));
        let xx = a.x * a.x + b.x * b.x;
        let yy = a.y * a.y + b.y * b.y;
        let xy = a.x * a.y + b.x * b.y;
        let half_difference = 0.5 * (xx - yy);
        let root = (half_difference * half_difference + xy * xy).sqrt();
        let length = (0.5 * (xx + yy) + root).sqrt();
        let width = if length > 0.0 { a.perp_dot(b).abs() / length } else { length };
        // Of the two forms of the eigenvector, the one without cancellation.
        let axis = if half_difference >= 0.0 {
            Vec2::new(half_difference + root, xy)
        } else {
            Vec2::new(xy, root - half_difference)
        };
        Self { major: axis.normalize_or_zero() * length, lengths: [length, width.min(length)] }
    }
}

/// A texture averaged over the parallelogram of two vectors around `uv`, all after any transform and
/// in units of UV. Broken vectors take the finest level, endless ones the coarsest. One tap takes the
/// level of a square of the same area.
pub(crate) fn lookup_ellipse(
    texture: &Texture,
    image: &MipMap,
    uv: Vec2,
    axes: [Vec2; 2],
    most_taps: u32,
) -> Vec4 {
    let most_taps = most_taps.clamp(1, MAX_TAPS);
    let size = Vec2::new(image.width() as f32, image.height() as f32);
    if axes.iter().any(|axis| axis.is_nan()) {
        return trilinear(texture, image, uv, 0.0);
    }
    let ellipse = Ellipse::of_parallelogram(axes.map(|axis| axis * size));
    let [length, width] = ellipse.lengths;
    if most_taps == 1 {
        return trilinear(texture, image, uv, (length * width).sqrt());
    }
    // What is narrower than a texel is magnified across.
    let tap = width.max(length / most_taps as f32).max(1.0);
    let coarsest = tap >= image.width().max(image.height()) as f32;
    if length <= tap * ROUND || texture.mip.is_none() || coarsest {
        return trilinear(texture, image, uv, (length * tap.min(length)).sqrt());
    }
    let taps = ((length / tap).ceil() as u32).clamp(2, most_taps.max(2));
    let step = ellipse.major / size / taps as f32;
    let first = uv - 0.5 * (taps - 1) as f32 * step;
    let lod = tap.log2();
    let sum: Vec4 = (0..taps).map(|i| minified(texture, image, first + i as f32 * step, lod)).sum();
    sum / taps as f32
}

#[cfg(test)]
mod tests {
    use rayburst_image::{TexelFormat, Texels};
    use rayburst_math::hash::Rng;

    use super::*;
    use crate::WrapMode;

    const SIDE: u32 = 256;

    /// Checks of 8×8 texels, or noise.
    fn image(checks: bool, rng: &mut Rng) -> MipMap {
        let mut byte = |i: u32| match checks {
            true => 255 * u8::from((i % SIDE / 8 + i / SIDE / 8).is_multiple_of(2)),
            false => (rng.f32() * 255.0) as u8,
        };
        let data = (0..SIDE * SIDE).map(&mut byte).collect();
        MipMap::new(Texels { width: SIDE, height: SIDE, channels: 1, data }, TexelFormat::Linear)
    }

    /// The mean over a parallelogram of the finest level, by many samples.
    fn exact(texture: &Texture, image: &MipMap, uv: Vec2, axes: [Vec2; 2]) -> f32 {
        let (mut sum, steps) = (0.0, 48);
        for i in 0..steps * steps {
            let place = Vec2::new((i % steps) as f32, (i / steps) as f32) + 0.5;
            let s = place / steps as f32 - 0.5;
            sum += trilinear(texture, image, uv + s.x * axes[0] + s.y * axes[1], 0.0).x;
        }
        sum / (steps * steps) as f32
    }

    /// Root mean square errors of ours, and of one trilinear lookup of the same area.
    fn errors(image: &MipMap, ratios: [f32; 2], rng: &mut Rng) -> [f64; 2] {
        let texture = Texture::new(0);
        let (mut squares, runs) = ([0.0; 2], 200);
        for _ in 0..runs {
            let width = rng.range(0.5, 6.0);
            let ratio = rng.range(ratios[0], ratios[1]);
            let along = Vec2::from_angle(rng.range(0.0, 6.3)) * (width / SIDE as f32);
            let (long, short) = (along * ratio, along.perp());
            // A slanted pair that spans the same ellipse.
            let turn = Vec2::from_angle(rng.range(0.0, 6.3));
            let axes = [long * turn.x + short * turn.y, short * turn.x - long * turn.y];
            let uv = rng.vec2();
            let exact = exact(&texture, image, uv, axes);
            let round = width * ratio.sqrt();
            let values = [
                lookup_ellipse(&texture, image, uv, axes, MAX_TAPS),
                trilinear(&texture, image, uv, round),
            ];
            for (square, value) in squares.iter_mut().zip(values) {
                *square += f64::from((value.x - exact).powi(2)) / f64::from(runs);
            }
        }
        squares.map(f64::sqrt)
    }

    #[test]
    fn ellipses_average_what_they_cover() {
        let mut rng = Rng::new(1);
        let checks = image(true, &mut rng);
        let noise = image(false, &mut rng);
        for (image, ratios, most, gain) in [
            (&checks, [1.0, 2.0], 0.05, 1.0),
            (&checks, [2.0, 6.0], 0.04, 3.0),
            (&checks, [6.0, 15.0], 0.04, 4.0),
            (&checks, [20.0, 40.0], 0.05, 3.0),
            (&noise, [1.0, 2.0], 0.05, 0.9),
            (&noise, [2.0, 6.0], 0.03, 1.4),
            (&noise, [6.0, 15.0], 0.02, 2.0),
            (&noise, [20.0, 40.0], 0.02, 1.5),
        ] {
            let [ours, round] = errors(image, ratios, &mut rng);
            assert!(ours < most && round > gain * ours, "{ratios:?}: {ours:.4}, {round:.4}");
        }
    }

    #[test]
    fn ellipses_have_the_moments_of_their_parallelogram() {
        let mut rng = Rng::new(8);
        for _ in 0..1000 {
            let [a, b] = [rng.vec2() - 0.5, rng.vec2() - 0.5];
            let Ellipse { major, lengths: [length, width] } = Ellipse::of_parallelogram([a, b]);
            assert!((major.length() - length).abs() < 1e-5 && width <= length);
            let minor = major.perp() * (width / length);
            for direction in [Vec2::X, Vec2::Y, Vec2::new(0.6, 0.8)] {
                let moment = |p: Vec2, q: Vec2| p.dot(direction).powi(2) + q.dot(direction).powi(2);
                assert!((moment(a, b) - moment(major, minor)).abs() < 1e-4);
            }
        }
    }

    #[test]
    fn broken_endless_and_empty_footprints_are_safe() {
        let image = image(true, &mut Rng::new(2));
        for wrap in [WrapMode::Repeat, WrapMode::MirroredRepeat, WrapMode::ClampToEdge] {
            let texture = Texture { wrap: [wrap; 2], ..Texture::new(0) };
            let at = |uv: Vec2, a: Vec2, b: Vec2| {
                lookup_ellipse(&texture, &image, uv, [a, b], MAX_TAPS).x
            };
            let inside = Vec2::splat(4.0 / SIDE as f32);
            let (zero, nan, endless) = (Vec2::ZERO, Vec2::NAN, Vec2::INFINITY);
            assert_eq!(at(inside, zero, zero), 1.0);
            assert_eq!(at(inside, nan, zero), 1.0);
            assert_eq!(at(inside, nan, nan), 1.0);
            for huge in [endless, -endless, Vec2::splat(1e30), Vec2::new(f32::MAX, 0.0)] {
                for other in [huge, zero, Vec2::X * 1e-30, Vec2::Y] {
                    let value = at(inside, huge, other);
                    assert!((value - 0.5).abs() < 0.01, "{huge} {other}: {value}");
                }
            }
            // Broken places find some texel.
            for uv in [nan, endless, Vec2::splat(1e30)] {
                let value = at(uv, Vec2::X * 0.1, Vec2::Y * 0.01);
                assert!((0.0..=1.0).contains(&value));
            }
        }
    }

    #[test]
    fn textures_without_levels_are_looked_up_once() {
        let image = image(true, &mut Rng::new(2));
        let texture = Texture { mip: None, ..Texture::new(0) };
        let uv = Vec2::splat(4.0 / SIDE as f32);
        assert_eq!(
            lookup_ellipse(&texture, &image, uv, [Vec2::X, Vec2::Y * 0.01], MAX_TAPS).x,
            1.0
        );
    }
}
