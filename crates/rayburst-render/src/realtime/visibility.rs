use rayburst_math::Hit;
use rayburst_scene::FlatScene;
use rayon::prelude::*;

use super::{
    gbuffer::{BAND, squares},
    shadows::closest_hits,
    view::FrameView,
};

pub(crate) fn trace_primary(
    scene: &FlatScene,
    opaque: bool,
    view: &FrameView,
    keys: impl Fn((u32, u32)) -> u32 + Sync,
    hits: &mut [Hit],
) {
    let (width, height) = view.size();
    hits.par_chunks_mut((width * BAND) as usize).enumerate().for_each(|(band, hits)| {
        let top = band as u32 * BAND;
        let at: Vec<_> = squares(width, top..(top + BAND).min(height)).collect();
        let rays: Vec<_> = at.iter().map(|&(x, y)| view.ray(x, y)).collect();
        let keys: Vec<_> = at.iter().map(|&at| keys(at)).collect();
        let mut found = vec![];
        closest_hits(scene, opaque, &rays, &keys, &mut found);
        for (&(x, y), hit) in at.iter().zip(&found) {
            hits[((y - top) * width + x) as usize] = *hit;
        }
    });
}
