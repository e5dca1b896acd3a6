//! Furnaces, densities, reciprocity and conservation of every scattering model.

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};
use rayburst_math::{hash::Rng, warp};
use rayburst_testkit::statistics::{Moments, test_directions};

use super::*;

fn direction(cos: f32, phi: f32) -> Vec3 {
    let r = (1.0 - cos * cos).max(0.0).sqrt();
    Vec3::new(r * phi.cos(), r * phi.sin(), cos)
}

/// What a uniform white environment returns, by the sampler alone; stratified.
fn furnace(bsdf: &Bsdf, wo: Vec3, seed: u64) -> Moments {
    const SIDE: u32 = 48;
    const LOBES: u32 = 32;
    let mut rng = Rng::new(seed);
    let mut moments = Moments::default();
    for i in 0..SIDE * SIDE * LOBES {
        let (x, y, z) = (i % SIDE, i / SIDE % SIDE, i / (SIDE * SIDE));
        let cell = Vec2::new(x as f32, y as f32);
        let u = ((cell + rng.vec2()) / SIDE as f32).extend((z as f32 + rng.f32()) / LOBES as f32);
        let weight = bsdf.sample(wo, u.min(Vec3::splat(1.0 - f32::EPSILON)));
        moments.add(weight.map_or(0.0, |s| f64::from(s.weight.x)));
    }
    moments
}

const ROUGHNESSES: [f32; 9] = [0.0, 0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0];
const COSINES: [f32; 7] = [0.02, 0.1, 0.25, 0.5, 0.7, 0.9, 1.0];

#[test]
fn white_surfaces_vanish_in_a_white_furnace() {
    for (name, metallic, ior) in
        [("diffuse", 0.0, 1.0), ("metal", 1.0, 1.5), ("coated", 0.0, 1.5), ("half", 0.5, 1.33)]
    {
        for roughness in ROUGHNESSES {
            let bsdf = Bsdf::metallic_roughness(Vec3::ONE, metallic, roughness, ior, true);
            for (i, cos) in COSINES.into_iter().enumerate() {
                let m = furnace(&bsdf, direction(cos, 0.7), i as u64);
                let three = 3.0 * m.standard_error();
                assert!(
                    (m.mean - 1.0).abs() < 0.005,
                    "{name} roughness {roughness} cos {cos}: {} ± {three}",
                    m.mean
                );
                // The table's own error, 0.1 %, may come on top of the noise.
                assert!(m.mean < 1.001 + three, "{name} {roughness} {cos}: {}", m.mean);
                assert!((f64::from(bsdf.albedo(direction(cos, 0.0)).x) - 1.0).abs() < 0.001);
            }
        }
    }
}

#[test]
fn without_compensation_rough_metal_loses_energy_and_never_gains_any() {
    for roughness in ROUGHNESSES {
        let bsdf = Bsdf::metallic_roughness(Vec3::ONE, 1.0, roughness, 1.5, false);
        for cos in COSINES {
            let m = furnace(&bsdf, direction(cos, 0.0), 5);
            assert!(m.mean < 1.0 + 1e-5 + 3.0 * m.standard_error());
            if roughness == 1.0 && cos == 0.5 {
                assert!(m.mean < 0.9);
            }
        }
    }
}

#[test]
fn coloured_surfaces_reflect_less_than_they_receive() {
    for metallic in [0.0, 0.3, 1.0] {
        for roughness in ROUGHNESSES {
            let color = Vec3::new(0.5, 0.2, 0.9);
            let bsdf = Bsdf::metallic_roughness(color, metallic, roughness, 1.5, true);
            for cos in COSINES {
                let m = furnace(&bsdf, direction(cos, 0.0), 6);
                let albedo = f64::from(bsdf.albedo(direction(cos, 0.0)).x);
                assert!(m.mean < 1.0 && (m.mean - albedo).abs() < 0.005, "{} {albedo}", m.mean);
            }
        }
    }
}

fn rough_models() -> Vec<(String, Bsdf)> {
    let mut models = vec![("diffuse".to_owned(), Bsdf::diffuse(Vec3::splat(0.8)))];
    for metallic in [0.0, 0.5, 1.0] {
        for roughness in [0.3, 0.6, 1.0] {
            let color = Vec3::new(0.9, 0.4, 0.1);
            let bsdf = Bsdf::metallic_roughness(color, metallic, roughness, 1.5, true);
            models.push((format!("metallic {metallic} roughness {roughness}"), bsdf));
        }
    }
    models
}

#[test]
fn weights_are_bounded() {
    // A weight far above one is a firefly in a picture.
    let mut rng = Rng::new(13);
    for (metallic, ior) in [(0.0, 1.5), (1.0, 1.5), (0.5, 1.2)] {
        for roughness in ROUGHNESSES {
            let bsdf = Bsdf::metallic_roughness(Vec3::ONE, metallic, roughness, ior, true);
            let mut most = 0.0f32;
            for _ in 0..20_000 {
                let wo = direction(rng.f32().powi(2).max(1e-4), 0.3);
                let sample = bsdf.sample(wo, rng.vec3());
                most = sample.map_or(most, |s| most.max(s.weight.x));
            }
            assert!(most < 16.0, "metallic {metallic} ior {ior} roughness {roughness}: {most}");
        }
    }
}

#[test]
fn samples_follow_their_density() {
    for (name, bsdf) in rough_models() {
        for cos in [0.3, 0.6, 1.0] {
            let wo = direction(cos, 0.4);
            let test = test_directions(
                100_000,
                17,
                |rng| bsdf.sample(wo, rng.vec3()).map(|s| s.wi),
                |wi| bsdf.pdf(wo, wi),
            );
            assert!(test.passes(), "{name} cos {cos}: {test:?}");
        }
    }
}

#[test]
fn weights_are_value_over_density_and_values_are_reciprocal() {
    let mut rng = Rng::new(2);
    for (name, bsdf) in rough_models() {
        for _ in 0..2000 {
            let wo =
                warp::uniform_hemisphere(rng.vec2()).max(Vec3::new(-1.0, -1.0, 1e-3)).normalize();
            if let Some(s) = bsdf.sample(wo, rng.vec3()) {
                let (f, pdf) = bsdf.evaluate_with_pdf(wo, s.wi);
                assert!(!s.delta && (s.pdf - pdf).abs() <= 1e-4 * pdf, "{name}");
                assert!((s.weight * pdf - f).abs().max_element() <= 1e-4 * f.max_element());
            }
            let wi =
                warp::uniform_hemisphere(rng.vec2()).max(Vec3::new(-1.0, -1.0, 1e-3)).normalize();
            let forward = bsdf.evaluate(wo, wi) * wo.z;
            let back = bsdf.evaluate(wi, wo) * wi.z;
            assert!((forward - back).abs().max_element() <= 1e-4 * forward.max_element(), "{name}");
        }
    }
}

#[test]
fn lambert_is_exact() {
    let bsdf = Bsdf::diffuse(Vec3::splat(0.5));
    let (wo, wi) = (direction(0.3, 1.0), direction(0.8, 2.0));
    assert!((bsdf.evaluate(wo, wi).x - 0.5 * FRAC_1_PI * 0.8).abs() < 1e-7);
    assert_eq!(bsdf.evaluate(wo, -wi), Vec3::ZERO);
    assert_eq!(bsdf.evaluate(-wo, wi), Vec3::ZERO);
    assert!(!bsdf.is_delta() && Bsdf::mirror(Vec3::ONE).is_delta());
}

#[test]
fn glass_obeys_snell_and_loses_nothing() {
    let mut rng = Rng::new(3);
    for eta in [1.0 / 1.5, 1.5, 1.0 / 2.4, 1.0] {
        let bsdf = Bsdf::interface(eta, Vec3::ONE);
        for _ in 0..500 {
            let wo = direction(rng.range(0.01, 1.0), rng.range(0.0, 6.0));
            let reflected = bsdf.specular_reflection(wo).unwrap();
            let refracted = bsdf.specular_refraction(wo);
            let sin_o = (1.0 - wo.z * wo.z).sqrt();
            match refracted {
                None => {
                    assert!(eta * sin_o >= 0.999 && (reflected.weight.x - 1.0).abs() < 1e-6);
                }
                Some(t) => {
                    assert!((t.weight.x + reflected.weight.x - 1.0).abs() < 1e-6);
                    let sin_t = t.wi.truncate().length();
                    assert!((sin_t - eta * sin_o).abs() < 1e-5 && t.wi.z < 0.0);
                    assert!((t.wi.length() - 1.0).abs() < 1e-5);
                    // Reversed, seen from the other side, the path comes back with the same weight.
                    if t.wi.z > -0.05 || wo.z < 0.05 {
                        continue; // Grazing: cosines have few digits.
                    }
                    let other = Bsdf::interface(1.0 / eta, Vec3::ONE);
                    let from = Vec3::new(t.wi.x, t.wi.y, -t.wi.z);
                    let back = other.specular_refraction(from).unwrap();
                    assert!((back.wi - wo * Vec3::new(1.0, 1.0, -1.0)).length() < 1e-3);
                    assert!((back.weight.x - t.weight.x).abs() < 1e-3);
                }
            }
            for _ in 0..4 {
                let s = bsdf.sample(wo, rng.vec3()).unwrap();
                assert!(s.delta && (s.weight - Vec3::ONE).abs().max_element() < 1e-5);
                assert_eq!(s.transmitted, s.wi.z < 0.0);
            }
        }
    }
}

#[test]
fn smooth_coats_split_light_between_mirror_and_base() {
    let bsdf = Bsdf::metallic_roughness(Vec3::splat(0.6), 0.0, 0.0, 1.5, true);
    let wo = direction(0.4, 0.0);
    let mirror = bsdf.specular_reflection(wo).unwrap();
    let mut rng = Rng::new(9);
    let mut sum = 0.0f64;
    let (mut delta, mut diffuse) = (0, 0);
    const N: u32 = 20_000;
    for _ in 0..N {
        let Some(s) = bsdf.sample(wo, rng.vec3()) else { continue };
        sum += f64::from(s.weight.x);
        if s.delta {
            assert_eq!(s.wi, mirror.wi);
            delta += 1;
        } else {
            diffuse += 1;
        }
    }
    assert!(delta > 500 && diffuse > 500);
    assert!((sum / f64::from(N) - f64::from(bsdf.albedo(wo).x)).abs() < 0.005);
}

#[test]
fn light_does_not_leak_through_the_geometric_surface() {
    let tilted = Vec3::new(0.6, 0.0, 0.8);
    let mut rng = Rng::new(4);
    let wo = direction(0.5, 0.3);
    for (_, bsdf) in rough_models() {
        let bsdf = bsdf.with_geometric_normal(tilted);
        for _ in 0..2000 {
            if let Some(s) = bsdf.sample(wo, rng.vec3()) {
                assert!(s.wi.dot(tilted) > 0.0);
            }
            let wi = warp::uniform_sphere(rng.vec2());
            if wi.dot(tilted) <= 0.0 {
                assert_eq!(bsdf.evaluate(wo, wi), Vec3::ZERO);
            }
        }
    }
}

#[test]
fn lobes_apart_are_the_whole_and_are_sampled_right() {
    let color = Vec3::new(0.8, 0.5, 0.2);
    for (metallic, ior) in [(0.0, 1.0), (0.0, 1.5), (0.4, 1.5), (1.0, 1.5)] {
        for roughness in ROUGHNESSES {
            let bsdf = Bsdf::metallic_roughness(color, metallic, roughness, ior, true);
            let mut rng = Rng::new(77);
            for cos in COSINES {
                let wo = direction(cos, 0.3);
                for _ in 0..50 {
                    let wi = warp::uniform_hemisphere(rng.vec2());
                    let apart = bsdf.evaluate_apart(wo, wi);
                    let whole = bsdf.evaluate(wo, wi);
                    let error = (apart.broad + apart.glossy - whole).abs().max_element();
                    assert!(error <= 1e-5 * whole.max_element().max(1.0), "{error}");
                }
                let (broad, glossy) = bsdf.albedos_apart(wo);
                let albedo = bsdf.albedo(wo);
                assert!((broad + glossy - albedo).abs().max_element() < 1e-5);
                for (which, expected) in [(0, broad), (1, glossy)] {
                    let mut moments = Moments::default();
                    for i in 0..4096u32 {
                        let cell = Vec2::new((i % 64) as f32, (i / 64) as f32);
                        let u = (cell + rng.vec2()) / 64.0;
                        let sample = match which {
                            0 => bsdf.sample_broad(wo, u),
                            _ => bsdf.sample_glossy(wo, u),
                        };
                        if let Some(s) = sample.filter(|s| !s.delta) {
                            let values = bsdf.evaluate_apart(wo, s.wi);
                            let (f, pdf) = match which {
                                0 => (values.broad, values.broad_pdf),
                                _ => (values.glossy, values.glossy_pdf),
                            };
                            assert!((pdf / s.pdf - 1.0).abs() < 2e-2);
                            let error = (s.weight * s.pdf - f).abs().max_element();
                            assert!(error <= 2e-2 * f.max_element() + 1e-6);
                        }
                        moments.add(sample.map_or(0.0, |s| f64::from(s.weight.y)));
                    }
                    let error = (moments.mean - f64::from(expected.y)).abs();
                    assert!(
                        error < 0.003 + 4.0 * moments.standard_error(),
                        "{which} roughness {roughness} cos {cos}: {} {expected}",
                        moments.mean
                    );
                }
            }
        }
    }
}
