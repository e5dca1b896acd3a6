//! Coverage: where rays pass through surfaces that alpha cuts out or thins.
//!
//! Stochastic transparency (Enderton, Sintorn, Shirley, Luebke, I3D 2010): a blended surface stops a
//! ray with the probability of its alpha. The random number is a hash of the ray's key and of what is
//! hit, never of the order in which a structure visits candidates, so all structures agree.

use glam::Vec2;
use rayburst_accel::CandidateFilter;
use rayburst_math::{Hit, Ray, hash};

use crate::{AlphaMode, FlatScene, TextureSlot, texture_ellipse::MAX_TAPS};

impl FlatScene {
    /// Whether alpha lets no ray pass anywhere, so that no filter is needed.
    pub fn is_opaque(&self) -> bool {
        self.geometries.iter().all(|g| {
            self.materials
                .get(g.primitive.material as usize)
                .is_none_or(|m| m.alpha_mode() == AlphaMode::Opaque)
        })
    }

    /// Alpha at a hit: the material's, its textures' and the vertices' multiplied; 1 for opaque
    /// materials. Textures are taken at their finest level.
    #[inline]
    pub fn alpha(&self, hit: &Hit) -> f32 {
        self.alpha_within(hit, [Vec2::ZERO; 2])
    }

    /// The same averaged over a footprint, given as steps of the hit's barycentric coordinates, see
    /// [`crate::Surface::barycentric_change`]. Cut-outs do not get thinner with it: their textures' levels
    /// keep the share that reaches the cutoff.
    pub fn alpha_within(&self, hit: &Hit, steps: [Vec2; 2]) -> f32 {
        let (_, geometry) = self.records(hit);
        let Some(material) = self.materials.get(geometry.material as usize) else { return 1.0 };
        if material.alpha_mode() == AlphaMode::Opaque {
            return 1.0;
        }
        let mut alpha = material.base_color[3];
        let lookup = |slot: &TextureSlot| {
            let uv = self.uv_at(hit, slot.uv_set);
            match steps == [Vec2::ZERO; 2] {
                true => self.texture(slot, uv, 0.0),
                false => {
                    self.texture_within(slot, uv, self.uv_steps(hit, slot.uv_set, steps), MAX_TAPS)
                }
            }
        };
        if material.base_color_texture.index().is_some() {
            alpha *= lookup(&material.base_color_texture).w;
        }
        if let Some(index) = material.alpha_texture.index() {
            let texel = lookup(&material.alpha_texture);
            let has_alpha = self
                .textures
                .get(index)
                .and_then(|t| self.images.get(t.image as usize))
                .is_some_and(|image| image.channels() % 2 == 0);
            alpha *= if has_alpha { texel.w } else { (texel.x + texel.y + texel.z) / 3.0 };
        }
        if let Some(colors) = &geometry.primitive.colors {
            let [a, b, c] =
                geometry.primitive.indices[hit.primitive as usize].map(|i| colors[i as usize].w);
            alpha *= (1.0 - hit.u - hit.v) * a + hit.u * b + hit.v * c;
        }
        alpha
    }

    /// The probability with which [`AlphaFilter`] stops a ray at a hit.
    #[inline]
    pub fn coverage(&self, hit: &Hit) -> f32 {
        self.coverage_within(hit, [Vec2::ZERO; 2])
    }

    /// The same for a footprint, see [`FlatScene::alpha_within`].
    pub fn coverage_within(&self, hit: &Hit, steps: [Vec2; 2]) -> f32 {
        let (_, geometry) = self.records(hit);
        let Some(material) = self.materials.get(geometry.material as usize) else { return 1.0 };
        match material.alpha_mode() {
            AlphaMode::Opaque => 1.0,
            AlphaMode::Mask => {
                f32::from(u8::from(self.alpha_within(hit, steps) >= material.alpha_cutoff))
            }
            AlphaMode::Blend => self.alpha_within(hit, steps).clamp(0.0, 1.0),
        }
    }
}

/// Stops rays where alpha says so.
#[derive(Clone, Copy, Debug)]
pub struct AlphaFilter<'a> {
    scene: &'a FlatScene,
    keys: &'a [u32],
}

impl<'a> AlphaFilter<'a> {
    /// For a batch of rays with one key each, a hash of (seed, pixel, sample, bounce).
    pub fn new(scene: &'a FlatScene, keys: &'a [u32]) -> Self {
        Self { scene, keys }
    }
}

impl CandidateFilter for AlphaFilter<'_> {
    #[inline]
    fn accept(&self, ray_index: u32, _: &Ray, candidate: &Hit) -> bool {
        let coverage = self.scene.coverage(candidate);
        if coverage == 0.0 || coverage == 1.0 {
            return coverage == 1.0;
        }
        let number = hash::words(&[
            self.keys[ray_index as usize],
            candidate.instance,
            candidate.geometry,
            candidate.primitive,
        ]);
        hash::to_unit(number) < coverage
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{Vec3, Vec4};
    use rayburst_accel::{BuildOptions, TraceOptions};
    use rayburst_image::{MipMap, TexelFormat, Texels};
    use rayburst_math::hash::Rng;

    use super::*;
    use crate::{Flattener, Material, Pose, Primitive, Scene, Texture};

    /// Unit squares across the z axis at the given depths.
    fn squares(depths: &[f32], material: Material, colors: Option<Vec4>) -> FlatScene {
        let mut scene = Scene::default();
        let alpha = [255u8, 0, 0, 255];
        let data = alpha.iter().flat_map(|&a| [200, 200, 200, a]).collect();
        let texels = Texels { width: 2, height: 2, channels: 4, data };
        scene.images.push(Arc::new(MipMap::new(texels, TexelFormat::Srgb)));
        scene.textures.push(Texture { magnify: crate::FilterMode::Nearest, ..Texture::new(0) });
        scene.add_material("cut", material);
        for &z in depths {
            let positions = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
            let primitive = Primitive {
                positions: positions.iter().map(|p| Vec3::new(p[0], p[1], z)).collect(),
                indices: vec![[0, 1, 2], [0, 2, 3]],
                uvs: vec![positions.iter().map(|&p| Vec2::from(p)).collect()],
                colors: colors.map(|c| vec![c; 4]),
                ..Primitive::default()
            };
            scene.add_mesh("square", vec![primitive]);
        }
        Flattener::new(&scene, BuildOptions::default()).at(&Pose::rest(&scene)).unwrap()
    }

    fn material(mode: AlphaMode, alpha: f32, texture: TextureSlot) -> Material {
        Material {
            base_color: [1.0, 1.0, 1.0, alpha],
            alpha_mode: mode as u32,
            base_color_texture: texture,
            ..Material::diffuse(Vec3::ONE)
        }
    }

    /// The share of rays through the square at (x, y) that nothing stops.
    fn passing(scene: &FlatScene, at: Option<Vec2>, rays: u32) -> f64 {
        let mut rng = Rng::new(7);
        let (mut batch, mut keys) = (Vec::new(), Vec::new());
        for _ in 0..rays {
            let p = at.unwrap_or_else(|| rng.vec2());
            batch.push(Ray::new(p.extend(-1.0), Vec3::Z));
            keys.push(rng.u32());
        }
        let options = TraceOptions::default();
        let mut passed = 0;
        for (i, ray) in batch.iter().enumerate() {
            let key = AlphaFilter::new(scene, &keys[i..=i]);
            let hit = scene.tlas.closest_hit(ray, &options, &key);
            assert_eq!(hit.is_hit(), scene.tlas.any_hit(ray, &options, &key));
            passed += u32::from(!hit.is_hit());
        }
        f64::from(passed) / f64::from(rays)
    }

    #[test]
    fn masks_cut_out_what_their_texture_says() {
        let scene = squares(&[0.0], material(AlphaMode::Mask, 1.0, TextureSlot::new(0)), None);
        assert!(!scene.is_opaque());
        for (x, y, passes) in [(0.2, 0.3, 0.0), (0.8, 0.3, 1.0), (0.2, 0.8, 1.0), (0.8, 0.8, 0.0)] {
            assert_eq!(passing(&scene, Some(Vec2::new(x, y)), 10), passes, "{x} {y}");
        }
        // The cut-out's shadow is as large as the mask.
        let share = passing(&scene, None, 40_000);
        assert!((share - 0.5).abs() < 0.0125, "{share}");
    }

    /// A square of a texture with a hole in every other texel of every other row.
    #[test]
    fn wide_footprints_pass_what_narrow_ones_pass() {
        let mut scene = Scene::default();
        let hole = |i: u32| (i % 64).is_multiple_of(2) && (i / 64).is_multiple_of(2);
        let data = (0..64 * 64).flat_map(|i| [200, 200, 200, if hole(i) { 0 } else { 255 }]);
        let texels = Texels { width: 64, height: 64, channels: 4, data: data.collect() };
        scene.images.push(Arc::new(MipMap::new(texels, TexelFormat::Srgb)));
        scene.textures.push(Texture { minify: crate::FilterMode::Nearest, ..Texture::new(0) });
        // Averages are three quarters everywhere: all or nothing without the levels for cut-outs.
        for cutoff in [0.5, 0.9] {
            let cut = material(AlphaMode::Mask, 1.0, TextureSlot::new(0));
            scene.add_material("cut", Material { alpha_cutoff: cutoff, ..cut });
        }
        let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].map(Vec2::from);
        for material in [0, 1] {
            let primitive = Primitive {
                positions: corners.iter().map(|p| p.extend(material as f32)).collect(),
                indices: vec![[0, 1, 2]],
                uvs: vec![corners.to_vec()],
                material,
                ..Primitive::default()
            };
            scene.add_mesh("triangle", vec![primitive]);
        }
        let flat = Flattener::new(&scene, BuildOptions::default()).at(&Pose::rest(&scene)).unwrap();
        let mut rng = Rng::new(17);
        for depth in [0.0, 1.0] {
            for width in [2.0, 4.0, 8.0] {
                let steps = [Vec2::X, Vec2::Y].map(|axis| axis * (width / 64.0));
                let (mut passed, runs) = (0.0, 4000);
                for _ in 0..runs {
                    let p = 0.5 * rng.vec2();
                    let ray = Ray::new(p.extend(depth - 0.5), Vec3::Z);
                    let options = TraceOptions::default();
                    let hit = flat.tlas.closest_hit(&ray, &options, &rayburst_accel::AcceptAll);
                    passed += 1.0 - flat.coverage_within(&hit, steps);
                }
                let share = passed / runs as f32;
                assert!((share - 0.25).abs() < 0.08, "{depth} {width}: {share}");
            }
        }
    }

    #[test]
    fn blended_layers_let_the_product_through() {
        let layers = [0.0, 0.5, 1.0];
        let blend = material(AlphaMode::Blend, 0.3, TextureSlot::NONE);
        let scene = squares(&layers, blend, None);
        let share = passing(&scene, None, 40_000);
        let expected: f64 = 0.7f64.powi(3);
        let sigma = (expected * (1.0 - expected) / 40_000.0).sqrt();
        assert!((share - expected).abs() < 5.0 * sigma, "{share} {expected}");
        // Vertex colours multiply.
        let faded = squares(&[0.0], blend, Some(Vec4::new(1.0, 1.0, 1.0, 0.5)));
        let share = passing(&faded, None, 40_000);
        assert!((share - 0.85).abs() < 5.0 * 0.0018, "{share}");
    }

    #[test]
    fn opaque_materials_ignore_alpha_and_separate_alpha_counts() {
        let opaque = squares(&[0.0], material(AlphaMode::Opaque, 0.0, TextureSlot::new(0)), None);
        assert!(opaque.is_opaque());
        assert_eq!(passing(&opaque, None, 100), 0.0);
        let separate = Material {
            alpha_texture: TextureSlot::new(0),
            ..material(AlphaMode::Blend, 1.0, TextureSlot::NONE)
        };
        let scene = squares(&[0.0], separate, None);
        assert_eq!(passing(&scene, Some(Vec2::new(0.8, 0.2)), 50), 1.0);
        assert_eq!(passing(&scene, Some(Vec2::new(0.2, 0.2)), 50), 0.0);
    }
}
