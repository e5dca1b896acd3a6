//! Sixteen texture lookups through footprints, the twin of [`FlatScene::texture_within`].
//!
//! Lookups by linear filters and between mip levels, which nearly all are, go in vectors; others one after
//! the other. sRGB is decoded by a polynomial instead of a table.

use rayburst_image::{MipMap, TexelFormat};
use rayburst_math::lanes::{F32x16, I32x16, LANES, Mask16, U32x16, Vec2x16, Vec3x16};

use super::surface::UvSet16;
use crate::{
    FlatScene, Texture, TextureSlot, WrapMode,
    texture_ellipse::{LONGEST, MAX_TAPS, ROUND},
};

/// What sixteen slots refer to.
struct Slots<'a> {
    images: [Option<&'a MipMap>; LANES],
    /// Lanes with a texture.
    textured: Mask16,
    /// Of these, lanes whose filters are not all linear.
    odd: Mask16,
    /// Width and height of the finest level.
    size: Vec2x16,
    last_level: F32x16,
    wrap: [Wraps; 2],
    /// Whether images hold sRGB.
    encoded: Mask16,
    second_set: Mask16,
    /// Rows of the slots' transforms.
    transform: [[F32x16; 3]; 2],
}

/// How lanes go on beyond an axis' end.
#[derive(Clone, Copy)]
struct Wraps {
    mirrored: Mask16,
    clamped: Mask16,
}

/// Colours of slots' textures averaged over the parallelograms that two changes of barycentric coordinates
/// span; white where there is none, and where a lane is not `wanted`.
#[inline(always)]
pub(super) fn lookup(
    scene: &FlatScene,
    slots: &[&TextureSlot; LANES],
    wanted: Mask16,
    uv: &[UvSet16; 2],
    changes: &[Vec2x16; 2],
    most_taps: u32,
) -> Vec3x16 {
    let found = Slots::of(scene, slots, wanted);
    if !found.textured.any() {
        return Vec3x16::splat(glam::Vec3::ONE);
    }
    // Without branches: what is carried around them ends up in single registers.
    let (first, first_axes) = on_set(&uv[0], changes);
    let (second, second_axes) = on_set(&uv[1], changes);
    let raw = found.second_set.select(second, first);
    let raw_axes = [
        found.second_set.select(second_axes[0], first_axes[0]),
        found.second_set.select(second_axes[1], first_axes[1]),
    ];
    let [a, b] = found.transform;
    let at = Vec2x16 {
        x: (a[0] * raw.x + a[1] * raw.y) + a[2],
        y: (b[0] * raw.x + b[1] * raw.y) + b[2],
    };
    let [p, q] = raw_axes;
    let axes = [
        Vec2x16 { x: a[0] * p.x + a[1] * p.y, y: b[0] * p.x + b[1] * p.y },
        Vec2x16 { x: a[0] * q.x + a[1] * q.y, y: b[0] * q.x + b[1] * q.y },
    ];
    let mut colour = found.average(at, axes, most_taps.clamp(1, MAX_TAPS));
    if found.odd.any() {
        one_by_one(scene, slots, found.odd, &raw, &raw_axes, most_taps, &mut colour);
    }
    found.textured.select(colour, Vec3x16::splat(glam::Vec3::ONE))
}

#[inline(always)]
fn on_set(set: &UvSet16, changes: &[Vec2x16; 2]) -> (Vec2x16, [Vec2x16; 2]) {
    let [second, third] = set.edges;
    let mut axes = [Vec2x16::ZERO; 2];
    for i in 0..2 {
        axes[i] = second * changes[i].x + third * changes[i].y;
    }
    (set.at, axes)
}

#[inline(never)]
fn one_by_one(
    scene: &FlatScene,
    slots: &[&TextureSlot; LANES],
    odd: Mask16,
    at: &Vec2x16,
    axes: &[Vec2x16; 2],
    most_taps: u32,
    colour: &mut Vec3x16,
) {
    for lane in 0..LANES {
        if odd.lane(lane) {
            let axes = [axes[0].lane(lane), axes[1].lane(lane)];
            let texel = scene.texture_within(slots[lane], at.lane(lane), axes, most_taps);
            colour.set_lane(lane, texel.truncate());
        }
    }
}

impl<'a> Slots<'a> {
    #[inline(never)]
    fn of(scene: &'a FlatScene, slots: &[&TextureSlot; LANES], wanted: Mask16) -> Self {
        let wraps = Wraps { mirrored: Mask16::NONE, clamped: Mask16::NONE };
        let mut found = Self {
            images: [None; LANES],
            textured: Mask16::NONE,
            odd: Mask16::NONE,
            size: Vec2x16 { x: F32x16::ONE, y: F32x16::ONE },
            last_level: F32x16::ZERO,
            wrap: [wraps; 2],
            encoded: Mask16::NONE,
            second_set: Mask16::NONE,
            transform: [
                [F32x16::ONE, F32x16::ZERO, F32x16::ZERO],
                [F32x16::ZERO, F32x16::ONE, F32x16::ZERO],
            ],
        };
        for (lane, slot) in slots.iter().enumerate() {
            if !wanted.lane(lane) {
                continue;
            }
            let Some((texture, image)) = scene.texture_image(slot) else { continue };
            found.images[lane] = Some(image);
            found.textured.set_lane(lane, true);
            let linear = Texture { image: texture.image, wrap: texture.wrap, ..Texture::new(0) };
            found.odd.set_lane(lane, *texture != linear);
            found.size.x.0[lane] = image.width() as f32;
            found.size.y.0[lane] = image.height() as f32;
            found.last_level.0[lane] = (image.levels().len() - 1) as f32;
            for (wraps, mode) in found.wrap.iter_mut().zip(texture.wrap) {
                wraps.mirrored.set_lane(lane, mode == WrapMode::MirroredRepeat);
                wraps.clamped.set_lane(lane, mode == WrapMode::ClampToEdge);
            }
            found.encoded.set_lane(lane, image.format() == TexelFormat::Srgb);
            found.second_set.set_lane(lane, slot.uv_set > 0);
            for (rows, row) in found.transform.iter_mut().zip(slot.transform) {
                for (row, value) in rows.iter_mut().zip(row) {
                    row.0[lane] = value;
                }
            }
        }
        found
    }

    /// Averages over the ellipses of parallelograms, see [`crate::texture_ellipse`].
    #[inline(always)]
    fn average(&self, at: Vec2x16, axes: [Vec2x16; 2], most_taps: u32) -> Vec3x16 {
        let broken = !(axes[0].dot(axes[0]) + axes[1].dot(axes[1])).is_at_least(F32x16::ZERO);
        let mut scaled = [Vec2x16::ZERO; 2];
        for i in 0..2 {
            let axis = axes[i] * self.size;
            scaled[i] = Vec2x16 {
                x: broken.select(F32x16::ZERO, axis.x.clamp(-LONGEST, LONGEST)),
                y: broken.select(F32x16::ZERO, axis.y.clamp(-LONGEST, LONGEST)),
            };
        }
        let [a, b] = scaled;
        let (xx, yy) = (a.x * a.x + b.x * b.x, a.y * a.y + b.y * b.y);
        let xy = a.x * a.y + b.x * b.y;
        let half_difference = 0.5 * (xx - yy);
        let root = (half_difference * half_difference + xy * xy).sqrt();
        let length = (0.5 * (xx + yy) + root).sqrt();
        let width = a.perp_dot(b).abs() / length;
        let width = length.is_greater(F32x16::ZERO).select(width, length).min(length);
        let one = F32x16::ONE;
        let wide = half_difference.is_at_least(F32x16::ZERO);
        let axis = Vec2x16 {
            x: wide.select(half_difference + root, xy),
            y: wide.select(xy, root - half_difference),
        };
        let unit = 1.0 / axis.dot(axis).sqrt();
        let unit = unit.is_finite().select(unit, F32x16::ZERO);
        let major = axis * (unit * length);

        let tap = width.max(length * (1.0 / most_taps as f32)).max(one);
        let coarsest = tap.is_at_least(self.size.x.max(self.size.y));
        let only_one = if most_taps == 1 { Mask16::ALL } else { Mask16::NONE };
        let single = only_one | length.is_at_most(tap * ROUND) | coarsest;
        let several = -(-(length / tap)).floor();
        let several = several.max(F32x16::splat(2.0)).min(F32x16::splat(most_taps as f32));
        let taps = single.select(one, several);
        let across = only_one.select(width, tap.min(length));
        let texels = single.select((length * across).sqrt(), tap);
        let step = Vec2x16 { x: major.x / self.size.x, y: major.y / self.size.y } * (1.0 / taps);
        let lod = texels.max(one).log2().min(self.last_level);
        let fine = lod.floor();
        let between = lod - fine;
        let levels = [fine, (fine + 1.0).min(self.last_level)];
        let shares = [1.0 - between, between];
        let weight = 1.0 / taps;
        let first = at - step * (0.5 * (taps - 1.0));

        let mut colour = Vec3x16::ZERO;
        let mut done = F32x16::ZERO;
        loop {
            let going = done.is_less(taps) & self.textured;
            if !going.any() {
                return colour;
            }
            let place = first + step * done;
            for i in 0..2 {
                let wanted = going & shares[i].is_greater(F32x16::ZERO);
                if wanted.any() {
                    let weight = wanted.select(weight * shares[i], F32x16::ZERO);
                    self.bilinear(place, levels[i].to_i32(), wanted, weight, &mut colour);
                }
            }
            done += one;
        }
    }

    /// Adds what is at `at` on one level.
    #[inline(always)]
    fn bilinear(
        &self,
        at: Vec2x16,
        level: I32x16,
        wanted: Mask16,
        weight: F32x16,
        colour: &mut Vec3x16,
    ) {
        let (mut width, mut height) = (I32x16::splat(1), I32x16::splat(1));
        self.level_size(&level, wanted, &mut width, &mut height);
        let (x0, x1, fx) = neighbours(at.x, width, &self.wrap[0]);
        let (y0, y1, fy) = neighbours(at.y, height, &self.wrap[1]);
        let mut texels = [U32x16::default(); 4];
        self.fetch(&level, wanted, [&x0, &x1], [&y0, &y1], &mut texels);
        let (gx, gy) = (1.0 - fx, 1.0 - fy);
        let upper =
            self.value(texels[0]) * (gx * gy * weight) + self.value(texels[1]) * (fx * gy * weight);
        let lower =
            self.value(texels[2]) * (gx * fy * weight) + self.value(texels[3]) * (fx * fy * weight);
        *colour = *colour + (upper + lower);
    }

    /// What the bytes of texels stand for.
    #[inline(always)]
    fn value(&self, texels: U32x16) -> Vec3x16 {
        let low = U32x16::splat(255);
        let r = (texels & low).to_f32() * (1.0 / 255.0);
        let g = ((texels >> 8) & low).to_f32() * (1.0 / 255.0);
        let b = ((texels >> 16) & low).to_f32() * (1.0 / 255.0);
        Vec3x16 {
            x: self.encoded.select(decode(r), r),
            y: self.encoded.select(decode(g), g),
            z: self.encoded.select(decode(b), b),
        }
    }

    #[inline(never)]
    fn level_size(&self, level: &I32x16, wanted: Mask16, width: &mut I32x16, height: &mut I32x16) {
        for lane in 0..LANES {
            if let (true, Some(image)) = (wanted.lane(lane), self.images[lane]) {
                let level = &image.levels()[level.0[lane] as usize];
                (width.0[lane], height.0[lane]) = (level.width as i32, level.height as i32);
            }
        }
    }

    #[inline(never)]
    fn fetch(
        &self,
        level: &I32x16,
        wanted: Mask16,
        columns: [&I32x16; 2],
        rows: [&I32x16; 2],
        texels: &mut [U32x16; 4],
    ) {
        for lane in 0..LANES {
            if let (true, Some(image)) = (wanted.lane(lane), self.images[lane]) {
                let bytes = image.bytes_at(
                    level.0[lane] as usize,
                    [columns[0].0[lane] as u32, columns[1].0[lane] as u32],
                    [rows[0].0[lane] as u32, rows[1].0[lane] as u32],
                );
                for (texels, bytes) in texels.iter_mut().zip(bytes) {
                    texels.0[lane] = bytes;
                }
            }
        }
    }
}

/// The texels around coordinates and how far they are from the first to the second.
#[inline(always)]
fn neighbours(t: F32x16, size: I32x16, wraps: &Wraps) -> (I32x16, I32x16, F32x16) {
    let period = t - 2.0 * (0.5 * t).floor();
    let mirrored = period.is_greater(F32x16::ONE).select(2.0 - period, period);
    let folded = wraps.mirrored.select(mirrored, t - t.floor());
    let folded = wraps.clamped.select(t.clamp(0.0, 1.0), folded);
    let x = folded * size.to_f32() - 0.5;
    let floor = x.floor();
    let low = floor.to_i32();
    let (zero, one, last) = (I32x16::splat(0), I32x16::splat(1), size - I32x16::splat(1));
    let (mut first, mut second) = (low.max(zero).min(last), (low + one).max(zero).min(last));
    let around = !(wraps.mirrored | wraps.clamped);
    first = (around & low.is_less(zero)).select(last, first);
    second = (around & !low.is_less(last)).select(zero, second);
    (first, second, (x - floor).clamp(0.0, 1.0))
}

/// Linear values of sRGB signals, both 0 to 1: IEC 61966-2-1, its power by a polynomial that is wrong by less
/// than 4·10⁻⁵ of it.
#[inline(always)]
fn decode(signal: F32x16) -> F32x16 {
    const POWER: [f32; 8] = [
        8.473_024e-4,
        0.035_585_07,
        0.481_884_63,
        0.878_772_45,
        -0.887_145_6,
        0.896_530_57,
        -0.552_625_4,
        0.146_183_49,
    ];
    let mut sum = F32x16::splat(POWER[7]);
    for i in 0..7 {
        sum = sum * signal + POWER[6 - i];
    }
    signal.is_at_most(F32x16::splat(0.040_45)).select(signal * (1.0 / 12.92), sum)
}

#[cfg(test)]
mod tests {
    use rayburst_image::colour::srgb_table;

    use super::*;

    #[test]
    fn every_byte_is_decoded() {
        for first in (0..256).step_by(LANES) {
            let mut signal = F32x16::ZERO;
            for lane in 0..LANES {
                signal.0[lane] = (first + lane) as f32 / 255.0;
            }
            for (lane, value) in decode(signal).0.into_iter().enumerate() {
                let exact = srgb_table()[first + lane];
                assert!((value - exact).abs() <= 4e-5 * exact, "{}", first + lane);
            }
        }
    }
}
