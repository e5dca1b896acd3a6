//! Ray casting: can two points of space see each other (chapter 26.1)?

use rayburst_math::{Ray, glam::Vec3};
use rayburst_scene::FlatScene;

/// Whether nothing lies between the points of each pair, ends included; alpha counts as solid.
///
/// The answer is the same for (a, b) and (b, a): the ray always goes from the lower point to the
/// higher one in the order of their coordinates. A point sees itself.
pub fn visible(scene: &FlatScene, pairs: &[(Vec3, Vec3)]) -> Vec<bool> {
    let rays: Vec<Ray> = pairs
        .iter()
        .map(|&(a, b)| {
            let order = a.to_array().partial_cmp(&b.to_array());
            let (from, to) =
                if order == Some(std::cmp::Ordering::Greater) { (b, a) } else { (a, b) };
            Ray::with_interval(from, to - from, 0.0, 1.0)
        })
        .collect();
    let mut occluded = vec![false; rays.len()];
    scene.any_hits(&rays, None, &mut occluded);
    occluded.into_iter().map(|blocked| !blocked).collect()
}
