//! Coverage: where rays pass through surfaces that alpha cuts out or thins.
//!
//! Stochastic transparency (Enderton, Sintorn, Shirley, Luebke, I3D 2010): a blended surface stops a
//! ray with the probability of its alpha. The random number is a hash of the ray's key and of what is
//! hit, never of the order in which a structure visits candidates, so all structures agree.

use rayburst_accel::CandidateFilter;
use rayburst_math::{Hit, Ray, hash};

use crate::{AlphaMode, FlatScene, TextureSlot};

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
    /// materials. Textures are taken at their finest level: coarser ones would thin out cut-outs.
    pub fn alpha(&self, hit: &Hit) -> f32 {
        let (_, geometry) = self.records(hit);
        let Some(material) = self.materials.get(geometry.material as usize) else { return 1.0 };
        if material.alpha_mode() == AlphaMode::Opaque {
            return 1.0;
        }
        let mut alpha = material.base_color[3];
        let lookup = |slot: &TextureSlot| self.texture(slot, self.uv_at(hit, slot.uv_set), 0.0);
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
        let (_, geometry) = self.scene.records(candidate);
        let Some(material) = self.scene.materials.get(geometry.material as usize) else {
            return true;
        };
        match material.alpha_mode() {
            AlphaMode::Opaque => true,
            AlphaMode::Mask => self.scene.alpha(candidate) >= material.alpha_cutoff,
            AlphaMode::Blend => {
                let number = hash::words(&[
                    self.keys[ray_index as usize],
                    candidate.instance,
                    candidate.geometry,
                    candidate.primitive,
                ]);
                hash::to_unit(number) < self.scene.alpha(candidate)
            }
        }
    }
}
