//! What a surface looks like at a hit: its material's textures looked up, the normal mapped, the
//! scattering model made.
//!
//! Shading normals (interpolated or mapped) may make mirror directions point into the surface. Such
//! normals are bent just far enough that the mirror direction of the view leaves the surface
//! (Keller, Wächter, Raab, Seibert, van Antwerpen, Korndörfer, Kettner: "The Iray Light Transport
//! Simulation and Rendering System", 2017, section A.3): no black rims. Normals that already do are
//! not changed.

use glam::{Vec2, Vec3};
use rayburst_math::Frame;

use crate::{
    Bsdf, BsdfSample, FlatScene, Footprint, Material, ShadingModel, Surface, TextureSlot,
    texture_ellipse::MAX_TAPS, texture_lookup::TextureLod,
};

/// How surfaces are shaded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadingOptions {
    /// How mip levels are found.
    pub lod: TextureLod,
    /// Whether rough surfaces give back the light that single scattering between microfacets loses.
    pub energy_compensation: bool,
    /// The most taps of a texture lookup, 1 to [`MAX_TAPS`]; longer footprints are widened.
    pub most_taps: u32,
}

impl Default for ShadingOptions {
    fn default() -> Self {
        Self { lod: TextureLod::Cones, energy_compensation: true, most_taps: MAX_TAPS }
    }
}

/// A point of a surface ready for light to be scattered. `wo` and `wi` are unit vectors in the world
/// that leave the point.
#[derive(Clone, Copy, Debug)]
pub struct ShadingPoint {
    /// The scattering, in `frame`.
    pub bsdf: Bsdf,
    /// Frame around the shading normal, on the side of `wo`.
    pub frame: Frame,
    /// Radiance that leaves towards `wo`, cd/m².
    pub emitted: Vec3,
    /// Base colour: textures, factors and vertex colours multiplied.
    pub base_color: Vec3,
    /// Metalness after textures.
    pub metallic: f32,
    /// Perceptual roughness after textures.
    pub roughness: f32,
}

impl ShadingPoint {
    /// f·|cos θᵢ| and the density of sampling `wi`, see [`Bsdf::evaluate_with_pdf`].
    #[inline]
    pub fn evaluate(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        self.bsdf.evaluate_with_pdf(self.frame.to_local(wo), self.frame.to_local(wi))
    }

    /// A direction in the world for a ray to go on, see [`Bsdf::sample`].
    #[inline]
    pub fn sample(&self, wo: Vec3, u: Vec3) -> Option<BsdfSample> {
        let sample = self.bsdf.sample(self.frame.to_local(wo), u)?;
        Some(BsdfSample { wi: self.frame.to_world(sample.wi).normalize(), ..sample })
    }
}

impl FlatScene {
    /// The material at a surface as seen from the unit direction `wo`. Textures are averaged over the
    /// footprint, unless the options say otherwise.
    pub fn shading_point(
        &self,
        surface: &Surface,
        wo: Vec3,
        footprint: Footprint,
        options: &ShadingOptions,
    ) -> ShadingPoint {
        let material = &self.materials[surface.material as usize];
        let textured = [
            &material.base_color_texture,
            &material.metallic_roughness_texture,
            &material.emissive_texture,
            &material.normal_texture,
        ];
        let filtered = options.lod != TextureLod::Mip0
            && footprint != Footprint::NONE
            && textured.iter().any(|slot| slot.index().is_some());
        let steps = if filtered {
            surface.barycentric_change(footprint.on(surface, wo))
        } else {
            [Vec2::ZERO; 2]
        };
        let lookup = |slot: &TextureSlot| {
            let set = slot.uv_set.min(1) as usize;
            let axes = steps.map(|weights| surface.uv_change(set, weights));
            self.texture_within(slot, surface.uv[set], axes, options.most_taps)
        };

        let [r, g, b, _] = material.base_color;
        let mut base_color = Vec3::new(r, g, b) * surface.color.truncate();
        if material.base_color_texture.index().is_some() {
            base_color *= lookup(&material.base_color_texture).truncate();
        }
        let (mut metallic, mut roughness) = (material.metallic, material.roughness);
        if material.metallic_roughness_texture.index().is_some() {
            let texel = lookup(&material.metallic_roughness_texture);
            roughness *= texel.y;
            metallic *= texel.z;
        }
        let mut emitted = Vec3::ZERO;
        if material.is_emissive() && (surface.front || material.is_double_sided()) {
            emitted = Vec3::from_array(material.emissive);
            if material.emissive_texture.index().is_some() {
                emitted *= lookup(&material.emissive_texture).truncate();
            }
        }
        let bsdf = match material.model() {
            ShadingModel::MetallicRoughness => Bsdf::metallic_roughness(
                base_color,
                metallic,
                roughness,
                material.ior,
                options.energy_compensation,
            ),
            ShadingModel::Dielectric => {
                let ior = material.ior.max(1.0);
                let eta = if surface.front { 1.0 / ior } else { ior };
                // What passes through a solid meets two interfaces.
                Bsdf::interface(eta, base_color.max(Vec3::ZERO).map(f32::sqrt))
            }
            ShadingModel::Mirror => Bsdf::mirror(base_color),
            ShadingModel::Unlit => {
                emitted += base_color;
                Bsdf::BLACK
            }
        };

        let mut normal = surface.shading_normal;
        if material.normal_texture.index().is_some() && surface.tangent.truncate() != Vec3::ZERO {
            let texel = lookup(&material.normal_texture).truncate();
            normal = mapped_normal(surface, material, texel);
        }
        let geometric = surface.normal_towards(wo);
        if geometric != surface.geometric_normal {
            normal = -normal;
        }
        let normal = bend(normal, geometric, wo);
        let frame = Frame::from_normal(normal);
        let bsdf = bsdf.with_geometric_normal(frame.to_local(geometric));
        ShadingPoint { bsdf, frame, emitted, base_color, metallic, roughness }
    }
}

/// The normal of a normal map's texel in the world, on the front side.
fn mapped_normal(surface: &Surface, material: &Material, texel: Vec3) -> Vec3 {
    let sign = if surface.tangent.w < 0.0 { -1.0 } else { 1.0 };
    let frame = Frame::from_normal_tangent(surface.shading_normal, surface.tangent.truncate());
    let local = 2.0 * texel - Vec3::ONE;
    let slope = local.truncate() * material.normal_scale * Vec2::new(1.0, sign);
    frame.to_world(slope.extend(local.z)).normalize_or(surface.shading_normal)
}

/// The normal nearest to `normal` for which the mirror direction of `wo` is above the surface, whose
/// normal on the side of `wo` is `geometric`.
fn bend(normal: Vec3, geometric: Vec3, wo: Vec3) -> Vec3 {
    let reflected = 2.0 * normal.dot(wo) * normal - wo;
    let least = (0.9 * geometric.dot(wo)).clamp(1e-4, 0.01);
    let height = reflected.dot(geometric);
    if height >= least {
        return normal;
    }
    let lifted = (reflected + (least - height) * geometric).normalize_or(geometric);
    (lifted + wo).normalize_or(geometric)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use rayburst_accel::BuildOptions;
    use rayburst_image::{MipMap, TexelFormat, Texels};
    use rayburst_math::{hash::Rng, warp};

    use super::*;
    use crate::{Flattener, Pose, Scene, Texture};

    #[test]
    fn bent_normals_reflect_off_the_surface_and_good_ones_stay() {
        let mut rng = Rng::new(12);
        let geometric = Vec3::new(0.6, 0.64, 0.48);
        let frame = Frame::from_normal(geometric);
        let (mut bent, mut kept) = (0, 0);
        for _ in 0..20_000 {
            let wo = frame.to_world(warp::uniform_hemisphere(rng.vec2()));
            let normal = frame.to_world(warp::uniform_hemisphere(rng.vec2()));
            if geometric.dot(wo) < 2e-4 {
                continue;
            }
            let n = bend(normal, geometric, wo);
            assert!((n.length() - 1.0).abs() < 1e-5 && n.dot(wo) > 0.0, "{n} {wo}");
            let mirrored = 2.0 * n.dot(wo) * n - wo;
            assert!(mirrored.dot(geometric) > 0.0, "{mirrored}");
            let before = 2.0 * normal.dot(wo) * normal - wo;
            if before.dot(geometric) > 0.01 {
                assert_eq!(n, normal);
                kept += 1;
            } else {
                bent += 1;
            }
        }
        assert!(bent > 1000 && kept > 1000);
    }

    fn surface() -> Surface {
        Surface {
            position: Vec3::ZERO,
            error: Vec3::ZERO,
            geometric_normal: Vec3::Z,
            shading_normal: Vec3::Z,
            tangent: Vec3::X.extend(1.0),
            uv: [Vec2::ZERO; 2],
            edges: [Vec3::X, Vec3::Y],
            uv_edges: [[Vec2::X, Vec2::Y]; 2],
            color: glam::Vec4::ONE,
            material: 0,
            node: 0,
            front: true,
        }
    }

    /// A scene of one material, black and white checks of 64×64 texels in every texture.
    fn scene_of(material: Material) -> FlatScene {
        let mut scene = Scene::default();
        let checks = (0..64 * 64).map(|i| if (i + i / 64) % 2 == 0 { 255 } else { 0 }).collect();
        let texels = Texels { width: 64, height: 64, channels: 1, data: checks };
        scene.images.push(Arc::new(MipMap::new(texels, TexelFormat::Linear)));
        scene.textures.push(Texture::new(0));
        scene.add_material("only", material);
        Flattener::new(&scene, BuildOptions::default()).at(&Pose::rest(&scene)).unwrap()
    }

    #[test]
    fn wide_cones_see_the_mean_and_narrow_ones_the_texel() {
        let slot = TextureSlot::new(0);
        let scene = scene_of(Material { base_color_texture: slot, ..Material::diffuse(Vec3::ONE) });
        let at = |width: f32, lod| {
            let on_texel = Surface { uv: [Vec2::splat(0.5 / 64.0); 2], ..surface() };
            let options = ShadingOptions { lod, ..ShadingOptions::default() };
            let footprint = Footprint::cone(width);
            scene.shading_point(&on_texel, Vec3::Z, footprint, &options).base_color.x
        };
        assert_eq!(at(0.0, TextureLod::Cones), 1.0);
        assert_eq!(at(1.0 / 64.0, TextureLod::Cones), 1.0);
        assert!((at(2.0 / 64.0, TextureLod::Cones) - 0.5).abs() < 0.01);
        assert_eq!(at(2.0 / 64.0, TextureLod::Mip0), 1.0);
        // Four times the area of the texture in the world: a footprint half as wide on it.
        let stretched = Surface {
            uv: [Vec2::splat(0.5 / 64.0); 2],
            edges: [2.0 * Vec3::X, 2.0 * Vec3::Y],
            ..surface()
        };
        let options = ShadingOptions::default();
        let footprint = Footprint::cone(2.0 / 64.0);
        let point = scene.shading_point(&stretched, Vec3::Z, footprint, &options);
        assert_eq!(point.base_color.x, 1.0);
        // A parallelogram of the same size says the same.
        let footprint = Footprint::axes(Vec3::X / 32.0, Vec3::Y / 32.0);
        let point = scene.shading_point(&stretched, Vec3::Z, footprint, &options);
        assert_eq!(point.base_color.x, 1.0);
    }

    #[test]
    fn sides_decide_emission_and_refraction() {
        let options = ShadingOptions::default();
        let back = Surface { front: false, ..surface() };
        let one_sided = Material { flags: 0, ..Material::emitter(Vec3::splat(3.0)) };
        let scene = scene_of(one_sided);
        assert_eq!(
            scene.shading_point(&surface(), Vec3::Z, Footprint::NONE, &options).emitted.x,
            3.0
        );
        assert_eq!(scene.shading_point(&back, -Vec3::Z, Footprint::NONE, &options).emitted.x, 0.0);
        let scene = scene_of(Material::emitter(Vec3::splat(3.0)));
        assert_eq!(scene.shading_point(&back, -Vec3::Z, Footprint::NONE, &options).emitted.x, 3.0);

        let scene = scene_of(Material::glass(1.5));
        let oblique = Vec3::new(0.6, 0.0, 0.8);
        for (surface, wo, eta) in [(surface(), oblique, 1.0 / 1.5), (back, -oblique, 1.5)] {
            let point = scene.shading_point(&surface, wo, Footprint::NONE, &options);
            assert!(point.frame.normal.dot(wo) > 0.0);
            let path = point.bsdf.specular_refraction(point.frame.to_local(wo)).unwrap();
            let wi = point.frame.to_world(path.wi);
            assert!((wi.x + eta * wo.x).abs() < 1e-5 && wi.z * wo.z < 0.0, "{wi}");
        }
    }

    #[test]
    fn unlit_surfaces_shine_and_scatter_nothing() {
        let unlit = Material {
            model: ShadingModel::Unlit as u32,
            ..Material::diffuse(Vec3::new(0.1, 0.2, 0.3))
        };
        let point = scene_of(unlit).shading_point(
            &surface(),
            Vec3::Z,
            Footprint::NONE,
            &ShadingOptions::default(),
        );
        assert_eq!(point.emitted, Vec3::new(0.1, 0.2, 0.3));
        assert!(point.bsdf.is_delta() && point.sample(Vec3::Z, Vec3::splat(0.5)).is_none());
    }

    #[test]
    fn samples_come_back_in_the_world() {
        let scene = scene_of(Material::plastic(Vec3::splat(0.5), 0.4));
        let tilted = Surface {
            geometric_normal: Vec3::Y,
            shading_normal: Vec3::new(0.28, 0.96, 0.0),
            ..surface()
        };
        let wo = Vec3::new(-0.48, 0.6, 0.64);
        let point = scene.shading_point(&tilted, wo, Footprint::NONE, &ShadingOptions::default());
        let mut rng = Rng::new(4);
        for _ in 0..1000 {
            let Some(s) = point.sample(wo, rng.vec3()) else { continue };
            let (f, pdf) = point.evaluate(wo, s.wi);
            assert!(s.wi.y > 0.0 && (pdf / s.pdf - 1.0).abs() < 1e-2);
            assert!((s.weight * s.pdf - f).abs().max_element() < 1e-2 * f.max_element());
        }
    }

    #[test]
    fn mapped_normals_follow_the_tangent_frame() {
        let material = Material { normal_scale: 0.5, ..Material::GLTF_DEFAULT };
        let flat = mapped_normal(&surface(), &material, Vec3::new(0.5, 0.5, 1.0));
        assert!((flat - Vec3::Z).length() < 1e-6);
        let texel = Vec3::new(0.8, 0.6, 0.9);
        let n = mapped_normal(&surface(), &material, texel);
        assert!((n - Vec3::new(0.3, 0.1, 0.8).normalize()).length() < 1e-6);
        let mirrored = Surface { tangent: Vec3::X.extend(-1.0), ..surface() };
        let n = mapped_normal(&mirrored, &material, texel);
        assert!((n - Vec3::new(0.3, -0.1, 0.8).normalize()).length() < 1e-6);
    }
}
