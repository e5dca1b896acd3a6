//! Materials at sixteen surfaces.

use glam::Vec3;
use rayburst_math::{
    cone::GRAZING,
    lanes::{F32x16, Frame16, LANES, Mask16, Vec2x16, Vec3x16},
};

use super::{surface::Surface16, texture::lookup};
use crate::{
    FlatScene, Material, ShadingModel, ShadingOptions, TextureSlot, texture_lookup::TextureLod,
};

/// The parts of sixteen surfaces that pixels see; see [`crate::Footprint`].
#[derive(Clone, Debug)]
pub struct Footprint16 {
    cones: F32x16,
    axes: [Vec3x16; 2],
    by_cones: Mask16,
}

impl Footprint16 {
    /// Points: textures are looked up at their finest level.
    pub const NONE: Self =
        Self { cones: F32x16::ZERO, axes: [Vec3x16::ZERO; 2], by_cones: Mask16::NONE };

    /// Sections of cones of these diameters, world units.
    #[inline(always)]
    pub const fn cones(diameters: F32x16) -> Self {
        Self { cones: diameters, by_cones: Mask16::ALL, ..Self::NONE }
    }

    /// Parallelograms in the surfaces' planes, world units.
    #[inline(always)]
    pub const fn axes(axes: [Vec3x16; 2]) -> Self {
        Self { axes, ..Self::NONE }
    }

    /// Two axes of full length in the surfaces' planes; `wo` leads back along the rays.
    #[inline(always)]
    fn on(&self, surface: &Surface16, wo: Vec3x16) -> [Vec3x16; 2] {
        let [a, b] = section(self.cones, wo, surface.geometric_normal);
        [self.by_cones.select(a, self.axes[0]), self.by_cones.select(b, self.axes[1])]
    }
}

/// Materials at sixteen surfaces; see [`crate::ShadingPoint`].
#[derive(Clone, Debug)]
pub struct ShadingPoint16 {
    /// Unit normals of shading, on the side of `wo`.
    pub normal: Vec3x16,
    /// Unit normals of the triangles, on the side of `wo`.
    pub geometric_normal: Vec3x16,
    /// Radiance that leaves towards `wo`, cd/m².
    pub emitted: Vec3x16,
    /// Base colours.
    pub base_color: Vec3x16,
    /// Metalness.
    pub metallic: F32x16,
    /// Perceptual roughness.
    pub roughness: F32x16,
}

/// The numbers of sixteen materials.
struct Factors {
    base_color: Vec3x16,
    emissive: Vec3x16,
    metallic: F32x16,
    roughness: F32x16,
    normal_scale: F32x16,
    /// What shines towards the viewer.
    shines: Mask16,
    unlit: Mask16,
}

impl FlatScene {
    /// The materials at sixteen surfaces as seen from the unit directions `wo`.
    #[inline(always)]
    pub fn shading_point16(
        &self,
        surface: &Surface16,
        wo: Vec3x16,
        footprint: &Footprint16,
        options: &ShadingOptions,
    ) -> ShadingPoint16 {
        let mut materials = [&self.materials[surface.material[0] as usize]; LANES];
        for lane in 1..LANES {
            materials[lane] = &self.materials[surface.material[lane] as usize];
        }
        let factors = factors(&materials, surface.front);
        let filtered = if options.lod == TextureLod::Mip0 { Mask16::NONE } else { Mask16::ALL };
        let [p, q] = barycentric_change(&surface.edges, footprint.on(surface, wo));
        let changes = [filtered.select(p, Vec2x16::ZERO), filtered.select(q, Vec2x16::ZERO)];
        let mut mapped = surface.tangent.dot(surface.tangent).is_greater(F32x16::ZERO);
        for lane in 0..LANES {
            let texture = materials[lane].normal_texture.index();
            mapped.set_lane(lane, mapped.lane(lane) && texture.is_some());
        }
        // One after the other in a loop, so that there is one copy of the code.
        let mut texels = [Vec3x16::splat(Vec3::ONE); 4];
        for kind in 0..4 {
            let (wanted, most_taps) = match kind {
                COLOUR => (Mask16::ALL, options.most_taps),
                ROUGHNESS => (Mask16::ALL, options.most_detail_taps),
                EMISSION => (factors.shines, options.most_taps),
                _ => (mapped, options.most_detail_taps),
            };
            if wanted.any() {
                let slots = slots_of(&materials, kind);
                texels[kind] = lookup(self, &slots, wanted, &surface.uv, &changes, most_taps);
            }
        }

        let base_color = factors.base_color * surface.color * texels[COLOUR];
        let roughness = factors.roughness * texels[ROUGHNESS].y;
        let metallic = factors.metallic * texels[ROUGHNESS].z;
        let shining = factors.emissive * texels[EMISSION];
        let emitted = factors.shines.select(shining, Vec3x16::ZERO);
        let emitted = factors.unlit.select(emitted + base_color, emitted);
        let turned = mapped_normal(surface, factors.normal_scale, texels[NORMAL]);
        let normal = mapped.select(turned, surface.shading_normal);
        let away = surface.geometric_normal.dot(wo).is_less(F32x16::ZERO);
        let geometric_normal = away.select(-surface.geometric_normal, surface.geometric_normal);
        let normal = bend(away.select(-normal, normal), geometric_normal, wo);
        ShadingPoint16 { normal, geometric_normal, emitted, base_color, metallic, roughness }
    }
}

/// Kinds of textures.
const COLOUR: usize = 0;
const ROUGHNESS: usize = 1;
const EMISSION: usize = 2;
const NORMAL: usize = 3;

#[inline(never)]
fn slots_of<'a>(materials: &[&'a Material; LANES], kind: usize) -> [&'a TextureSlot; LANES] {
    materials.map(|material| match kind {
        COLOUR => &material.base_color_texture,
        ROUGHNESS => &material.metallic_roughness_texture,
        EMISSION => &material.emissive_texture,
        _ => &material.normal_texture,
    })
}

#[inline(never)]
fn factors(materials: &[&Material; LANES], front: Mask16) -> Factors {
    let mut factors = Factors {
        base_color: Vec3x16::ZERO,
        emissive: Vec3x16::ZERO,
        metallic: F32x16::ZERO,
        roughness: F32x16::ZERO,
        normal_scale: F32x16::ZERO,
        shines: Mask16::NONE,
        unlit: Mask16::NONE,
    };
    for (lane, material) in materials.iter().enumerate() {
        let [r, g, b, _] = material.base_color;
        factors.base_color.set_lane(lane, Vec3::new(r, g, b));
        factors.emissive.set_lane(lane, Vec3::from_array(material.emissive));
        factors.metallic.0[lane] = material.metallic;
        factors.roughness.0[lane] = material.roughness;
        factors.normal_scale.0[lane] = material.normal_scale;
        let seen = front.lane(lane) || material.is_double_sided();
        factors.shines.set_lane(lane, material.is_emissive() && seen);
        factors.unlit.set_lane(lane, material.model() == ShadingModel::Unlit);
    }
    factors
}

/// The axes of the ellipses in which cones cut surfaces; see [`rayburst_math::cone::section`].
#[inline(always)]
fn section(width: F32x16, direction: Vec3x16, normal: Vec3x16) -> [Vec3x16; 2] {
    let cosine = normal.dot(direction).abs().max(F32x16::splat(GRAZING));
    let Frame16 { tangent, bitangent, .. } = Frame16::from_normal_tangent(normal, direction);
    [tangent * (width / cosine), bitangent * width]
}

/// How the weights of triangles' second and third corners change by each of two steps in their planes.
#[inline(always)]
fn barycentric_change(edges: &[Vec3x16; 2], steps: [Vec3x16; 2]) -> [Vec2x16; 2] {
    let normal = edges[0].cross(edges[1]);
    let scale = 1.0 / normal.dot(normal);
    let second = edges[1].cross(normal) * scale;
    let third = normal.cross(edges[0]) * scale;
    // Not finite if one coordinate of one of them is not: infinite minus infinite is not a number.
    let sum = second.abs() + third.abs();
    let fine = ((sum.x + sum.y) + sum.z).is_finite();
    let mut changes = [Vec2x16::ZERO; 2];
    for i in 0..2 {
        changes[i] = Vec2x16 {
            x: fine.select(second.dot(steps[i]), F32x16::ZERO),
            y: fine.select(third.dot(steps[i]), F32x16::ZERO),
        };
    }
    changes
}

/// The normals of normal maps' texels in the world, on the front sides.
#[inline(always)]
fn mapped_normal(surface: &Surface16, scale: F32x16, texel: Vec3x16) -> Vec3x16 {
    let normal = surface.shading_normal;
    let frame = Frame16::from_normal_tangent(normal, surface.tangent);
    let x = (2.0 * texel.x - 1.0) * scale;
    let y = (2.0 * texel.y - 1.0) * scale * surface.handedness;
    let z = 2.0 * texel.z - 1.0;
    frame.to_world(Vec3x16 { x, y, z }).normalize_or(normal)
}

/// The nearest normals for which the mirror directions of `wo` are above the surfaces.
#[inline(always)]
fn bend(normal: Vec3x16, geometric: Vec3x16, wo: Vec3x16) -> Vec3x16 {
    let reflected = normal * (2.0 * normal.dot(wo)) - wo;
    let least = (0.9 * geometric.dot(wo)).clamp(1e-4, 0.01);
    let height = reflected.dot(geometric);
    let fine = height.is_at_least(least);
    let lifted = (reflected + geometric * (least - height)).normalize_or(geometric);
    let bent = (lifted + wo).normalize_or(geometric);
    fine.select(normal, bent)
}
