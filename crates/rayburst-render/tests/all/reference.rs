//! The batched path tracer against its readable twin, and the twin against all triangles.

use rayburst_accel::{AcceptAll, TraceOptions};
use rayburst_math::{Ray, hash::Rng, warp};
use rayburst_render::{LightSampling, Reference, trace_naive};

use crate::scenes::{picture, settings, zoo};

#[test]
fn batches_give_the_references_samples() {
    let (scene, camera) = zoo();
    for light_sampling in [LightSampling::Both, LightSampling::LightOnly, LightSampling::BsdfOnly] {
        let mut settings = settings((40, 30), 4);
        settings.light_sampling = light_sampling;
        settings.max_depth = 9;
        let batched = picture(&scene, camera, &settings);
        let twin = Reference::new(&scene, &camera, &settings).ray_trace_image();
        for (i, (a, b)) in batched.pixels.iter().zip(&twin.pixels).enumerate() {
            let error = (*a - *b).abs().max_element() / (1e-3 + b.max_element());
            assert!(error < 1e-4, "{light_sampling:?}, pixel {i}: {a} instead of {b}");
        }
    }
}

#[test]
fn the_reference_needs_no_structure() {
    let (scene, camera) = zoo();
    let settings = settings((16, 12), 1);
    let with = Reference::new(&scene, &camera, &settings).ray_trace_image();
    let without = Reference::new(&scene, &camera, &settings).exhaustive().ray_trace_image();
    // Distances differ in their last bits, so that a path may take another turn now and then.
    let differ = with
        .pixels
        .iter()
        .zip(&without.pixels)
        .filter(|(a, b)| (**a - **b).abs().max_element() > 1e-3 * (1e-2 + b.max_element()));
    assert!(differ.count() <= 2);
}

#[test]
fn structures_find_what_the_naive_loop_finds() {
    let (scene, _) = zoo();
    let mut rng = Rng::new(12);
    let centre = scene.bounds.centre();
    let mut hits = 0;
    for _ in 0..2000 {
        let origin = centre + scene.bounds.diagonal() * (rng.vec3() - 0.5);
        let ray = Ray::new(origin, 3.0 * warp::uniform_sphere(rng.vec2()));
        let naive = trace_naive(&scene, &ray, &AcceptAll);
        let hit = scene.tlas.closest_hit(&ray, &TraceOptions::default(), &AcceptAll);
        assert_eq!(naive.is_hit(), hit.is_hit());
        if hit.is_hit() {
            hits += 1;
            let ids = |h: rayburst_math::Hit| (h.instance, h.geometry, h.primitive, h.kind);
            assert_eq!(ids(naive), ids(hit));
            assert!((naive.t - hit.t).abs() <= 1e-5 * hit.t);
        }
    }
    assert!(hits > 200, "{hits}");
}
