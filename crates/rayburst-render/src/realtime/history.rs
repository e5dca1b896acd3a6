//! What lives from frame to frame.

use std::sync::Arc;

use rayburst_image::Plane3;
use rayburst_math::glam::{Vec2, Vec3};
use rayburst_scene::FlatScene;

use super::{filters::Filters, indirect::Gathered, motion::is_same_scene, view::FrameView};

/// The frame before, for motion vectors and temporal filters; kept by whoever asks for frames. It begins
/// anew where the size or the scene is another one, and at cuts, which the caller knows of.
#[derive(Clone, Debug, Default)]
pub struct History {
    number: u32,
    before: Option<(FrameView, Arc<FlatScene>)>,
    ambient: Vec3,
    /// The picture of the frame before, at the size that is rendered.
    pub(crate) picture: Plane3,
    /// The histories of filters.
    pub(crate) filters: Filters,
}

/// Weight of a frame in the running mean of the ambient light, once there are many.
const LATEST: f32 = 1.0 / 16.0;

impl History {
    /// A history without frames.
    pub fn new() -> Self {
        Self::default()
    }

    /// Forgets all frames: for cuts.
    pub fn reset(&mut self) {
        *self = Self::default();
    }

    /// Frames since the history began.
    pub fn frames(&self) -> u32 {
        self.number
    }

    /// The view and the scene of the frame before.
    pub fn before(&self) -> Option<(FrameView, &FlatScene)> {
        self.before.as_ref().map(|(view, scene)| (*view, &**scene))
    }

    /// Begins anew if a frame of this size and scene does not follow on the last one.
    pub(crate) fn prepare(&mut self, size: (u32, u32), scene: &FlatScene) {
        let follows = self
            .before
            .as_ref()
            .is_none_or(|(view, before)| view.size() == size && is_same_scene(scene, before));
        if !follows {
            self.reset();
        }
    }

    /// Where the rays of the next frame go through the pixels, relative to their centres: the points of
    /// Roberts' R₂ sequence.
    pub(crate) fn jitter(&self) -> Vec2 {
        let at = |step: u32| {
            // In units of 2⁻³², the first frame in the middle.
            let fraction = self.number.wrapping_mul(step);
            (fraction >> 8) as f32 / (1 << 24) as f32
        };
        let wrapped = |v: f32| if v >= 0.5 { v - 1.0 } else { v };
        Vec2::new(wrapped(at(0xc13f_a9a9)), wrapped(at(0x91e1_0da6)))
    }

    /// Learns from the paths of a frame what longer ones would bring, as radiance from everywhere; returns
    /// what that is by now.
    ///
    /// Of the light B that arrives at a surface, a share T arrives at the next one as the end of paths that
    /// go on; so B = light found + T·B, and what is missing of the light that was found is T·B.
    pub(crate) fn learn(&mut self, gathered: &Gathered) -> Vec3 {
        let mean = |sum: [f64; 3]| {
            let n = gathered.paths.max(1) as f64;
            Vec3::new((sum[0] / n) as f32, (sum[1] / n) as f32, (sum[2] / n) as f32)
        };
        let tail = mean(gathered.tail).clamp(Vec3::ZERO, Vec3::splat(0.95));
        let missing = tail * mean(gathered.light) / (Vec3::ONE - tail);
        if missing.is_finite() {
            let weight = LATEST.max(1.0 / (self.number + 1) as f32);
            self.ambient = self.ambient.lerp(missing, weight);
        }
        self.ambient
    }

    /// Ends a frame.
    pub(crate) fn advance(&mut self, view: FrameView, scene: &Arc<FlatScene>, picture: &Plane3) {
        self.number = self.number.wrapping_add(1);
        self.before = Some((view, scene.clone()));
        self.picture.clone_from(picture);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_cover_the_pixel_evenly_over_time() {
        let mut history = History::new();
        assert_eq!(history.jitter(), Vec2::ZERO);
        let mut seen = [0; 16];
        for number in 0..256 {
            history.number = number;
            let at = (history.jitter() + 0.5) * 4.0;
            assert!(at.min_element() >= 0.0 && at.max_element() < 4.0);
            seen[at.y as usize * 4 + at.x as usize] += 1;
        }
        assert!(seen.iter().all(|n| (12..=20).contains(n)), "{seen:?}");
    }
}
