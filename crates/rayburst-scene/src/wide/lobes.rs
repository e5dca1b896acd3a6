//! The metallic-roughness lobes of sixteen surfaces: the twin of [`crate::Bsdf`] for that model, for passes
//! that keep broad and glossy light apart.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;
use rayburst_math::lanes::{F32x16, Mask16, Vec2x16, Vec3x16, cosine_hemisphere};

use crate::bsdf::{DIFFUSE_SPREAD, SMOOTH_ALPHA, albedo};

/// Albedos of single reflection off microfacets: factors of the reflectances at normal incidence and at
/// grazing angles.
#[derive(Clone, Copy, Debug)]
struct Albedo16 {
    a: F32x16,
    b: F32x16,
}

/// The lobes of sixteen surfaces. Directions are unit vectors in the frames around the shading normals.
#[derive(Clone, Debug)]
pub struct Lobes16 {
    alpha: F32x16,
    f0: Vec3x16,
    f90: F32x16,
    returned: Vec3x16,
    coat_f0: F32x16,
    coat_f90: F32x16,
    coat_returned: F32x16,
    base: Vec3x16,
    lost_norm: F32x16,
    base_norm: F32x16,
    lambert: Mask16,
    smooth: Mask16,
    geometric_normal: Vec3x16,
}

/// f·|cos θᵢ| of sixteen pairs of directions, see [`crate::LobeValues`].
#[derive(Clone, Copy, Debug)]
pub struct LobeValues16 {
    /// The base and the light that comes back after several bounces between microfacets.
    pub broad: Vec3x16,
    /// Single reflection off microfacets.
    pub glossy: Vec3x16,
    /// Densities of [`Lobes16::sample_broad`].
    pub broad_pdf: F32x16,
    /// Densities of [`Lobes16::sample_glossy`].
    pub glossy_pdf: F32x16,
}

/// Sixteen sampled directions, see [`crate::BsdfSample`].
#[derive(Clone, Copy, Debug)]
pub struct LobeSample16 {
    /// Which there are.
    pub some: Mask16,
    /// Where to.
    pub wi: Vec3x16,
    /// f·|cos θᵢ| / density, of the lobe's part of f alone.
    pub weight: Vec3x16,
    /// Densities per solid angle.
    pub pdf: F32x16,
    /// Directions of perfect mirrors.
    pub delta: Mask16,
    /// Angles by which ray cones open further, radians.
    pub spread: F32x16,
}

impl LobeSample16 {
    /// These where a mask holds, others elsewhere.
    #[inline(always)]
    #[must_use]
    pub fn or(self, mask: Mask16, other: Self) -> Self {
        Self {
            some: (mask & self.some) | (!mask & other.some),
            wi: mask.select(self.wi, other.wi),
            weight: mask.select(self.weight, other.weight),
            pdf: mask.select(self.pdf, other.pdf),
            delta: (mask & self.delta) | (!mask & other.delta),
            spread: mask.select(self.spread, other.spread),
        }
    }
}

impl Albedo16 {
    #[inline(always)]
    fn lost(&self) -> F32x16 {
        ((1.0 - self.a) - self.b).max(F32x16::ZERO)
    }

    /// For light from cosines.
    #[inline(always)]
    fn directional(cos: F32x16, alpha: F32x16) -> Self {
        let (row, t) = cell(alpha.sqrt());
        let (column, s) = cell(cos.max(F32x16::ZERO).sqrt());
        let mut corners = [F32x16::ZERO; 8];
        albedo::gather_directional(&row.to_i32().0, &column.to_i32().0, &mut corners);
        let [a00, b00, a01, b01, a10, b10, a11, b11] = corners;
        let mix = |p: F32x16, q: F32x16, t: F32x16| p + (q - p) * t;
        let a = mix(mix(a00, a01, s), mix(a10, a11, s), t);
        let b = mix(mix(b00, b01, s), mix(b10, b11, s), t);
        let smooth = alpha.is_equal(F32x16::ZERO);
        let weight = schlick_weight(cos);
        Self { a: smooth.select(1.0 - weight, a), b: smooth.select(weight, b) }
    }

    /// Cosine-weighted averages over the hemisphere.
    #[inline(always)]
    fn average(alpha: F32x16) -> Self {
        let (row, t) = cell(alpha.sqrt());
        let mut ends = [F32x16::ZERO; 4];
        albedo::gather_average(&row.to_i32().0, &mut ends);
        let [a0, b0, a1, b1] = ends;
        let smooth = alpha.is_equal(F32x16::ZERO);
        let (a, b) = (a0 + (a1 - a0) * t, b0 + (b1 - b0) * t);
        Self {
            a: smooth.select(F32x16::splat(20.0 / 21.0), a),
            b: smooth.select(F32x16::splat(1.0 / 21.0), b),
        }
    }
}

/// Cells of the table's axes, and the places in them.
#[inline(always)]
fn cell(x: F32x16) -> (F32x16, F32x16) {
    let x = x.clamp(0.0, 1.0) * (albedo::SIDE - 1) as f32;
    let i = x.floor().min(F32x16::splat((albedo::SIDE - 2) as f32));
    (i, x - i)
}

#[inline(always)]
fn schlick_weight(cos: F32x16) -> F32x16 {
    let m = (1.0 - cos).clamp(0.0, 1.0);
    let m2 = m * m;
    m2 * m2 * m
}

#[inline(always)]
fn schlick(f0: Vec3x16, f90: F32x16, cos: F32x16) -> Vec3x16 {
    let weight = schlick_weight(cos);
    f0 + (all(f90) - f0) * weight
}

#[inline(always)]
fn all(value: F32x16) -> Vec3x16 {
    Vec3x16 { x: value, y: value, z: value }
}

#[inline(always)]
fn lerp(a: Vec3x16, b: Vec3x16, t: F32x16) -> Vec3x16 {
    a * (1.0 - t) + b * t
}

/// The part of the lost light that later bounces return.
#[inline(always)]
fn returned(f0: F32x16, f90: F32x16, average: &Albedo16) -> F32x16 {
    let mean = f0 + (f90 - f0) * (1.0 / 21.0);
    mean * mean * (average.a + average.b) / (1.0 - mean * average.lost())
}

#[inline(always)]
fn slope(cos: F32x16, alpha2: F32x16) -> F32x16 {
    (alpha2 + (1.0 - alpha2) * cos * cos).sqrt()
}

#[inline(always)]
fn distribution(h: Vec3x16, a2: F32x16) -> F32x16 {
    let t = (h.x * h.x + h.y * h.y) / a2 + h.z * h.z;
    FRAC_1_PI / (a2 * t * t)
}

impl Lobes16 {
    /// The lobes of materials after their textures; `geometric_normal` is in the frames, on the side of the
    /// viewer.
    #[inline(always)]
    pub fn new(
        color: Vec3x16,
        metallic: F32x16,
        roughness: F32x16,
        ior: F32x16,
        energy_compensation: bool,
        geometric_normal: Vec3x16,
    ) -> Self {
        let color = Vec3x16 {
            x: color.x.clamp(0.0, 1.0),
            y: color.y.clamp(0.0, 1.0),
            z: color.z.clamp(0.0, 1.0),
        };
        let metallic = metallic.clamp(0.0, 1.0);
        let roughness = roughness.clamp(0.0, 1.0);
        let squared = roughness * roughness;
        let sharp = squared.is_less(F32x16::splat(SMOOTH_ALPHA));
        let alpha = sharp.select(F32x16::ZERO, squared);
        let ior = ior.max(F32x16::ONE);
        let r = (ior - 1.0) / (ior + 1.0);
        let coat_f0 = r * r;
        let coat_f90 = (coat_f0 * 50.0).min(F32x16::ONE);
        let average = Albedo16::average(alpha);
        let (mut coat_returned, mut metal_returned) = (F32x16::ZERO, Vec3x16::ZERO);
        if energy_compensation {
            let one = F32x16::ONE;
            let back = returned(coat_f0, coat_f90, &average);
            coat_returned = sharp.select(F32x16::ZERO, back);
            let back = Vec3x16 {
                x: returned(color.x, one, &average),
                y: returned(color.y, one, &average),
                z: returned(color.z, one, &average),
            };
            metal_returned = sharp.select(Vec3x16::ZERO, back);
        }
        let coat_average =
            (coat_f0 * average.a + coat_f90 * average.b) + coat_returned * average.lost();
        let least = F32x16::splat(1e-6);
        let f90 = coat_f90 + (1.0 - coat_f90) * metallic;
        let lambert = f90.is_equal(F32x16::ZERO);
        Self {
            alpha,
            f0: lerp(all(coat_f0), color, metallic),
            f90,
            returned: lerp(all(coat_returned), metal_returned, metallic),
            coat_f0,
            coat_f90,
            coat_returned,
            base: color * (1.0 - metallic),
            lost_norm: FRAC_1_PI / average.lost().max(least),
            base_norm: FRAC_1_PI / (1.0 - coat_average).max(least),
            lambert,
            smooth: sharp & !lambert,
            geometric_normal,
        }
    }

    /// Lanes whose light all goes into mirrors' directions, so that light sampling is in vain.
    #[inline(always)]
    pub fn is_delta(&self) -> Mask16 {
        self.smooth & self.base.max_element().is_equal(F32x16::ZERO)
    }

    /// Lanes whose glossy lobe is a perfect mirror.
    #[inline(always)]
    pub fn is_smooth(&self) -> Mask16 {
        self.smooth
    }

    #[inline(always)]
    fn coat_albedo(&self, e: &Albedo16) -> F32x16 {
        (self.coat_f0 * e.a + self.coat_f90 * e.b) + self.coat_returned * e.lost()
    }

    /// Albedos of the broad lobes and of the glossy one; see [`crate::Bsdf::albedos_apart`].
    #[inline(always)]
    pub fn albedos_apart(&self, cos_o: F32x16) -> (Vec3x16, Vec3x16) {
        let e = Albedo16::directional(cos_o, self.alpha);
        let broad = self.returned * e.lost() + self.base * (1.0 - self.coat_albedo(&e));
        let rough = self.f0 * e.a + all(self.f90 * e.b);
        let glossy = self.smooth.select(schlick(self.f0, self.f90, cos_o), rough);
        (self.lambert.select(self.base, broad), self.lambert.select(Vec3x16::ZERO, glossy))
    }

    /// f·|cos θᵢ| of the broad lobes and of the glossy one; see [`crate::Bsdf::evaluate_apart`].
    #[inline(always)]
    pub fn evaluate_apart(&self, wo: Vec3x16, wi: Vec3x16) -> LobeValues16 {
        let zero = F32x16::ZERO;
        let reflects = wo.z.is_greater(zero)
            & wi.z.is_greater(zero)
            & self.geometric_normal.dot(wi).is_greater(zero);
        let cosine_pdf = wi.z * FRAC_1_PI;
        let o = Albedo16::directional(wo.z, self.alpha);
        let i = Albedo16::directional(wi.z, self.alpha);
        let base = (1.0 - self.coat_albedo(&o)) * (1.0 - self.coat_albedo(&i)) * self.base_norm;
        let rough = !(self.smooth | self.lambert);
        let back = rough.select(o.lost() * i.lost() * self.lost_norm * wi.z, zero);
        let broad = self.base * (base * wi.z) + self.returned * back;
        let broad = self.lambert.select(self.base * cosine_pdf, broad);

        let a2 = self.alpha * self.alpha;
        let h = (wo + wi).normalize_or(Vec3x16::splat(Vec3::Z));
        let d = distribution(h, a2);
        let (slope_o, slope_i) = (slope(wo.z, a2), slope(wi.z, a2));
        let least = F32x16::splat(f32::MIN_POSITIVE);
        let visibility = 0.5 / (wi.z * slope_o + wo.z * slope_i).max(least);
        let glossy = schlick(self.f0, self.f90, wo.dot(h)) * (d * visibility * wi.z);
        let glossy_pdf = d * 0.5 / (wo.z + slope_o);
        let shines = reflects & rough;
        LobeValues16 {
            broad: reflects.select(broad, Vec3x16::ZERO),
            glossy: shines.select(glossy, Vec3x16::ZERO),
            broad_pdf: reflects.select(cosine_pdf, zero),
            glossy_pdf: shines.select(glossy_pdf, zero),
        }
    }

    /// Directions of the broad lobes; see [`crate::Bsdf::sample_broad`].
    #[inline(always)]
    pub fn sample_broad(&self, wo: Vec3x16, u: Vec2x16) -> LobeSample16 {
        let wi = cosine_hemisphere(u);
        let pdf = wi.z * FRAC_1_PI;
        let some = wo.z.is_greater(F32x16::ZERO)
            & pdf.is_greater(F32x16::ZERO)
            & self.geometric_normal.dot(wi).is_greater(F32x16::ZERO);
        let weight = self.evaluate_apart(wo, wi).broad * (1.0 / pdf);
        let spread = F32x16::splat(DIFFUSE_SPREAD);
        LobeSample16 { some, wi, weight, pdf, delta: Mask16::NONE, spread }
    }

    /// Directions of the glossy lobes, mirrors' where they are smooth; see [`crate::Bsdf::sample_glossy`].
    #[inline(always)]
    pub fn sample_glossy(&self, wo: Vec3x16, u: Vec2x16) -> LobeSample16 {
        let (sine, cosine) = u.x.sin_cos_turns();
        let stretched = Vec3x16 { x: wo.x * self.alpha, y: wo.y * self.alpha, z: wo.z };
        let stretched = stretched.normalize_or(Vec3x16::splat(Vec3::Z));
        let z = (1.0 - u.y) * (stretched.z + 1.0) - stretched.z;
        let r = (1.0 - z * z).max(F32x16::ZERO).sqrt();
        let h = Vec3x16 { x: r * cosine, y: r * sine, z } + stretched;
        let h = Vec3x16 { x: h.x * self.alpha, y: h.y * self.alpha, z: h.z.max(F32x16::ZERO) };
        let h = h.normalize_or(Vec3x16::splat(Vec3::Z));
        let rough = h * (2.0 * wo.dot(h)) - wo;
        let mirrored = Vec3x16 { x: -wo.x, y: -wo.y, z: wo.z };
        let wi = self.smooth.select(mirrored, rough);
        let values = self.evaluate_apart(wo, wi);
        let weight = values.glossy * (1.0 / values.glossy_pdf);
        let weight = self.smooth.select(schlick(self.f0, self.f90, wo.z), weight);
        let zero = F32x16::ZERO;
        let some = wo.z.is_greater(zero)
            & wi.z.is_greater(zero)
            & self.geometric_normal.dot(wi).is_greater(zero)
            & ((weight.x + weight.y) + weight.z).is_finite()
            & !self.lambert;
        LobeSample16 {
            some,
            wi,
            weight,
            pdf: self.smooth.select(F32x16::ONE, values.glossy_pdf),
            delta: self.smooth,
            spread: self.smooth.select(zero, self.alpha * 0.5),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;
    use rayburst_math::{hash::Rng, lanes::LANES, warp};

    use super::*;
    use crate::Bsdf;

    #[test]
    fn sixteen_lobes_are_sixteen_times_one() {
        let mut rng = Rng::new(77);
        for round in 0..400 {
            let (mut color, mut wo, mut wi) = (Vec3x16::ZERO, Vec3x16::ZERO, Vec3x16::ZERO);
            let (mut metallic, mut roughness) = (F32x16::ZERO, F32x16::ZERO);
            let (mut ior, mut normal) = (F32x16::ONE, Vec3x16::ZERO);
            let mut u = Vec2x16::ZERO;
            for lane in 0..LANES {
                color.set_lane(lane, rng.vec3() * 1.1 - 0.05);
                wo.set_lane(lane, warp::uniform_hemisphere(rng.vec2()));
                wi.set_lane(lane, warp::uniform_sphere(rng.vec2()));
                metallic.0[lane] = [0.0, 1.0, rng.f32()][lane % 3];
                roughness.0[lane] = [0.0, 1.0, rng.f32(), 0.2][lane / 4];
                ior.0[lane] = [1.0, 1.5, 1.0 + rng.f32()][lane % 5 % 3];
                let tilted = Vec3::new(0.3, 0.1, 1.0).normalize();
                normal.set_lane(lane, if lane % 2 == 0 { Vec3::Z } else { tilted });
                u.set_lane(lane, if lane == 9 { Vec2::splat(0.5) } else { rng.vec2() });
            }
            let compensation = round % 2 == 0;
            let lobes = Lobes16::new(color, metallic, roughness, ior, compensation, normal);
            let values = lobes.evaluate_apart(wo, wi);
            let (broad, glossy) = lobes.albedos_apart(wo.z);
            let samples = [lobes.sample_broad(wo, u), lobes.sample_glossy(wo, u)];
            for lane in 0..LANES {
                let bsdf = Bsdf::metallic_roughness(
                    color.lane(lane),
                    metallic.0[lane],
                    roughness.0[lane],
                    ior.0[lane],
                    compensation,
                )
                .with_geometric_normal(normal.lane(lane));
                let near = |a: Vec3, b: Vec3, what: &str| {
                    let bound = 2e-4 * a.length() + 1e-6;
                    assert!((a - b).length() <= bound, "{what}: {a} {b}, lane {lane} of {round}");
                };
                let (o, i) = (wo.lane(lane), wi.lane(lane));
                let one = bsdf.evaluate_apart(o, i);
                near(one.broad, values.broad.lane(lane), "broad");
                near(one.glossy, values.glossy.lane(lane), "glossy");
                near(Vec3::splat(one.broad_pdf), Vec3::splat(values.broad_pdf.0[lane]), "pdf");
                near(Vec3::splat(one.glossy_pdf), Vec3::splat(values.glossy_pdf.0[lane]), "pdf");
                let one = bsdf.albedos_apart(o);
                near(one.0, broad.lane(lane), "broad albedo");
                near(one.1, glossy.lane(lane), "glossy albedo");
                assert_eq!(bsdf.is_delta(), lobes.is_delta().lane(lane), "lane {lane} of {round}");
                let ones =
                    [bsdf.sample_broad(o, u.lane(lane)), bsdf.sample_glossy(o, u.lane(lane))];
                for ((sample, one), broad) in samples.iter().zip(ones).zip([true, false]) {
                    let Some(one) = one else {
                        // Directions that just leave the surface may be on either side.
                        let height = normal.lane(lane).dot(sample.wi.lane(lane));
                        let none = !sample.some.lane(lane);
                        assert!(none || height < 1e-4, "lane {lane} of {round}");
                        continue;
                    };
                    let wi = sample.wi.lane(lane);
                    assert!((wi - one.wi).length() < 1e-3, "{wi} {}", one.wi);
                    assert_eq!(sample.delta.lane(lane), one.delta);
                    assert_eq!(sample.spread.0[lane], one.spread);
                    // Densities of sharp lobes change quickly: they must be those of the direction that
                    // was taken.
                    if !one.delta && sample.some.lane(lane) {
                        let at = bsdf.evaluate_apart(o, wi);
                        let pdf = if broad { at.broad_pdf } else { at.glossy_pdf };
                        let value = if broad { at.broad } else { at.glossy };
                        let bound = if roughness.0[lane] > 0.15 { 1e-3 } else { 0.05 };
                        let ratio = sample.pdf.0[lane] / pdf;
                        assert!((ratio - 1.0).abs() < bound, "{ratio}, lane {lane} of {round}");
                        let weight = sample.weight.lane(lane);
                        assert!((weight - value / pdf).length() <= bound * weight.length());
                    }
                }
            }
        }
    }
}
