//! Light of polygons in closed form against sampling of the same polygons and lobes.

use std::f32::consts::TAU;

use rayburst_math::{
    Frame,
    glam::{DVec3, Vec2, Vec3},
    hash::Rng,
    warp,
};
use rayburst_scene::{
    Bsdf,
    ltc::{self, PolygonIntegral, PolygonShading},
};

/// Corners of a convex polygon on an ellipse.
fn ellipse(centre: Vec3, normal: Vec3, radii: Vec2, corners: usize) -> Vec<Vec3> {
    let frame = Frame::from_normal(normal);
    let corner = |i: usize| {
        let (sin, cos) = (TAU * i as f32 / corners as f32).sin_cos();
        centre + frame.to_world(Vec3::new(cos * radii.x, sin * radii.y, 0.0))
    };
    (0..corners).map(corner).collect()
}

fn area_vector(polygon: &[Vec3]) -> Vec3 {
    (1..polygon.len() - 1)
        .map(|i| 0.5 * (polygon[i] - polygon[0]).cross(polygon[i + 1] - polygon[0]))
        .sum()
}

/// Distance along a direction from the origin to a polygon.
fn hit(polygon: &[Vec3], direction: Vec3) -> Option<f32> {
    let normal = area_vector(polygon);
    let t = polygon[0].dot(normal) / direction.dot(normal);
    let inside = |i: usize| {
        let (a, b) = (polygon[i], polygon[(i + 1) % polygon.len()]);
        (b - a).cross(t * direction - a).dot(normal) >= 0.0
    };
    (t > 0.0 && t.is_finite() && (0..polygon.len()).all(inside)).then_some(t)
}

/// ∫f·cos θ over a polygon in the local frame for f = `bsdf` − `less`, by samples of its area and of
/// `guide`'s lobes, combined (Veach, Guibas: "Optimally Combining Sampling Techniques for Monte Carlo
/// Rendering", SIGGRAPH 1995).
fn sampled(bsdf: &Bsdf, less: &Bsdf, guide: &Bsdf, wo: Vec3, polygon: &[Vec3]) -> Vec3 {
    const SAMPLES: u32 = 20_000;
    let normal = area_vector(polygon);
    let area = normal.length();
    let triangles: Vec<(Vec3, Vec3, Vec3, f32)> = (1..polygon.len() - 1)
        .map(|i| {
            let (a, b, c) = (polygon[0], polygon[i], polygon[i + 1]);
            (a, b - a, c - a, 0.5 * (b - a).cross(c - a).length() / area)
        })
        .collect();
    let mut sum = DVec3::ZERO;
    let mut add = |wi: Vec3, t: f32| {
        let by_area = t * t / wi.dot(normal).abs().max(1e-30);
        let weight = 1.0 / (by_area + guide.pdf(wo, wi));
        if weight.is_finite() {
            sum += ((bsdf.evaluate(wo, wi) - less.evaluate(wo, wi)) * weight).as_dvec3();
        }
    };
    for i in 0..SAMPLES {
        // Roberts' sequence of low discrepancy.
        let at = |g: f64| (0.5 + g * f64::from(i)).fract() as f32;
        let u = Vec3::new(at(0.819_172_5), at(0.671_043_6), at(0.549_700_5));
        let mut choice = u.z;
        for &(a, e1, e2, share) in &triangles {
            if choice < share {
                let b = warp::uniform_triangle(u.truncate());
                let p = a + b.x * e1 + b.y * e2;
                add(p.normalize_or_zero(), p.length());
                break;
            }
            choice -= share;
        }
        if let Some(s) = guide.sample(wo, u)
            && !s.delta
            && let Some(t) = hit(polygon, s.wi)
        {
            add(s.wi, t);
        }
    }
    (sum / f64::from(SAMPLES)).as_vec3()
}

const COLOR: Vec3 = Vec3::new(0.8, 0.5, 0.2);
const BLACK: Bsdf = Bsdf::BLACK;

/// A random polygon: near and far, small and large, also partly or wholly below the surface.
fn polygon(rng: &mut Rng) -> Vec<Vec3> {
    let place = warp::uniform_sphere(rng.vec2());
    let place = Vec3::new(place.x, place.y, place.z.abs() - 0.15).normalize();
    let distance = 0.2 * 40f32.powf(rng.f32());
    let radii = Vec2::new(0.1 * 30f32.powf(rng.f32()), 0.1 * 30f32.powf(rng.f32()));
    let towards = (-place + 0.8 * warp::uniform_sphere(rng.vec2())).normalize();
    ellipse(place * distance, towards, radii, 3 + rng.below(6) as usize)
}

fn view(rng: &mut Rng, cos: f32) -> Vec3 {
    (Vec2::from_angle(TAU * rng.f32()) * (1.0 - cos * cos).sqrt()).extend(cos)
}

fn integral(bsdf: &Bsdf, wo: Vec3, polygon: &[Vec3]) -> PolygonIntegral {
    // Any frame, any place.
    let frame = Frame::from_normal(Vec3::new(0.36, 0.48, 0.8));
    let at = Vec3::new(3.0, -2.0, 1.0);
    let world: Vec<Vec3> = polygon.iter().map(|&p| at + frame.to_world(p)).collect();
    let shading = PolygonShading::new(bsdf, &frame, at, frame.to_world(wo));
    shading.expect("light is scattered").integrate(&world)
}

/// Errors of many cases: of a value against a reference, and what the reference is to be seen against.
#[derive(Default)]
struct Errors {
    relative: Vec<f32>,
    error: f64,
    whole: f64,
}

impl Errors {
    fn add(&mut self, value: Vec3, reference: Vec3, whole: Vec3) {
        assert!(value.is_finite() && value.min_element() >= 0.0, "{value}");
        let (error, whole) = ((value - reference).abs().element_sum(), whole.element_sum());
        self.error += f64::from(error);
        self.whole += f64::from(whole);
        if whole > 1e-5 {
            self.relative.push(error / whole);
        }
    }

    /// Sum of all errors by the sum of all light.
    fn mean(&self) -> f64 {
        self.error / self.whole
    }

    fn quantile(&mut self, q: f32) -> f32 {
        self.relative.sort_by(f32::total_cmp);
        self.relative[((self.relative.len() - 1) as f32 * q) as usize]
    }

    fn report(&mut self, what: &str) {
        eprintln!(
            "{what}: {} cases, mean of all light {:.4}; of each case's median {:.4}, 95 % {:.4}, most {:.4}",
            self.relative.len(),
            self.mean(),
            self.quantile(0.5),
            self.quantile(0.95),
            self.quantile(1.0),
        );
    }
}

const ROUGHNESSES: [f32; 8] = [0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7, 1.0];
const COSINES: [f32; 5] = [1.0, 0.87, 0.6, 0.35, 0.15];

#[test]
fn the_base_is_exact_to_a_percent() {
    let mut rng = Rng::new(90);
    for ior in [1.0, 1.33, 1.5, 2.0] {
        let mut errors = Errors::default();
        for roughness in ROUGHNESSES {
            for cos in COSINES {
                let of = |color| Bsdf::metallic_roughness(color, 0.0, roughness, ior, true);
                let (bsdf, coat) = (of(COLOR), of(Vec3::ZERO));
                for _ in 0..8 {
                    let (wo, polygon) = (view(&mut rng, cos), polygon(&mut rng));
                    let guide = Bsdf::diffuse(Vec3::ONE);
                    let reference = sampled(&bsdf, &coat, &guide, wo, &polygon);
                    let diffuse = integral(&bsdf, wo, &polygon).diffuse;
                    errors.add(diffuse, reference, reference);
                }
            }
        }
        errors.report(&format!("base, index {ior}"));
        assert!(errors.mean() < 0.005 && errors.quantile(0.95) < 0.02);
    }
}

#[test]
fn lobes_agree_with_samples() {
    let mut rng = Rng::new(91);
    for (metallic, name) in [(0.0, "plastic"), (1.0, "metal")] {
        let (mut of_total, mut of_lobe, mut of_albedo) = <(Errors, Errors, Errors)>::default();
        for roughness in ROUGHNESSES {
            for cos in COSINES {
                let of = |color| Bsdf::metallic_roughness(color, metallic, roughness, 1.5, true);
                let bsdf = of(COLOR);
                let glossy = if metallic > 0.0 { bsdf } else { of(Vec3::ZERO) };
                for _ in 0..12 {
                    let (wo, polygon) = (view(&mut rng, cos), polygon(&mut rng));
                    let reference = sampled(&glossy, &BLACK, &glossy, wo, &polygon);
                    let PolygonIntegral { diffuse, specular } = integral(&bsdf, wo, &polygon);
                    of_total.add(specular, reference, reference + diffuse);
                    of_lobe.add(specular, reference, reference);
                    of_albedo.add(specular, reference, glossy.albedo(wo));
                }
            }
        }
        of_total.report(&format!("{name}, of the total"));
        of_lobe.report(&format!("{name}, of the lobe"));
        of_albedo.report(&format!("{name}, of what a white room gives"));
        assert!(of_total.mean() < 0.02, "{}", of_total.mean());
        assert!(of_albedo.quantile(0.5) < 0.001 && of_albedo.quantile(0.95) < 0.03);
        assert!(of_albedo.quantile(1.0) < 0.2);
    }
}

/// A closed room around a point at the origin: the five sides of a box above the surface.
fn room() -> [[Vec3; 4]; 5] {
    let c = |x: f32, y: f32, z: f32| Vec3::new(2.0 * x, 3.0 * y, if z > 0.0 { 2.5 } else { -1.0 });
    let wall = |x0: f32, y0: f32, x1: f32, y1: f32| {
        [c(x0, y0, -1.0), c(x1, y1, -1.0), c(x1, y1, 1.0), c(x0, y0, 1.0)]
    };
    [
        [c(-1.0, -1.0, 1.0), c(1.0, -1.0, 1.0), c(1.0, 1.0, 1.0), c(-1.0, 1.0, 1.0)],
        wall(-1.0, -1.0, 1.0, -1.0),
        wall(1.0, -1.0, 1.0, 1.0),
        wall(1.0, 1.0, -1.0, 1.0),
        wall(-1.0, 1.0, -1.0, -1.0),
    ]
}

#[test]
fn a_room_that_shines_everywhere_gives_the_albedo() {
    let mut rng = Rng::new(92);
    for metallic in [0.0, 0.4, 1.0] {
        for ior in [1.0, 1.5] {
            for roughness in [0.04, 0.15, 0.4, 0.75, 1.0] {
                for cos in [1.0, 0.7, 0.3, 0.05] {
                    for compensated in [false, true] {
                        let bsdf =
                            Bsdf::metallic_roughness(COLOR, metallic, roughness, ior, compensated);
                        let wo = view(&mut rng, cos);
                        let sum: Vec3 =
                            room().iter().map(|wall| integral(&bsdf, wo, wall).total()).sum();
                        let albedo = bsdf.albedo(wo);
                        let error = (sum - albedo).abs().max_element();
                        assert!(
                            error < 0.004,
                            "{metallic} {ior} {roughness} {cos}: {sum} {albedo}"
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn polygons_are_cut_off_at_both_horizons() {
    let mut rng = Rng::new(93);
    let (mut errors, mut cut) = (Errors::default(), 0);
    for _ in 0..60 {
        let geometric = (Vec3::Z + 0.5 * warp::uniform_sphere(rng.vec2())).normalize();
        let bsdf = Bsdf::metallic_roughness(COLOR, 0.0, 0.6, 1.5, true);
        let bent = bsdf.with_geometric_normal(geometric);
        let cos = 0.3 + 0.6 * rng.f32();
        let wo = view(&mut rng, cos);
        if wo.dot(geometric) <= 0.0 {
            continue;
        }
        // Walls that stand in the surface.
        let around = Vec2::from_angle(TAU * rng.f32()).extend(0.0);
        let wall = ellipse(around * 1.5, -around, Vec2::new(1.0, 1.6), 8);
        let reference = sampled(&bent, &BLACK, &bent, wo, &wall);
        errors.add(integral(&bent, wo, &wall).total(), reference, reference);
        cut += u32::from((integral(&bsdf, wo, &wall).total() - reference).length() > 0.02);
    }
    errors.report("cut off");
    assert!(errors.mean() < 0.01 && cut > 10, "{} {cut}", errors.mean());
}

#[test]
fn degenerate_polygons_give_nothing_and_extreme_ones_numbers() {
    let bsdf = Bsdf::metallic_roughness(COLOR, 0.3, 0.4, 1.5, true);
    let wo = Vec3::new(0.6, 0.0, 0.8);
    let (x, y) = (Vec3::X, Vec3::Y);
    let up = Vec3::Z;
    let nothing: [&[Vec3]; 9] = [
        &[],
        &[up],
        &[up, up + x],
        &[up; 4],
        &[up, up + x, up + 2.0 * x],
        &[-up, -up + x, -up + y],
        &[2.0 * x, 3.0 * x, 2.0 * x + y],
        &[up, up + x * f32::NAN, up + y],
        &[up, up + x * f32::INFINITY, up + y],
    ];
    for polygon in nothing {
        let integral = integral(&bsdf, wo, polygon);
        assert!(integral.total().max_element() < 1e-6, "{polygon:?} {integral:?}");
        assert!(integral.total().min_element() >= 0.0, "{polygon:?} {integral:?}");
    }
    for scale in [1e-30f32, 1e-18, 1e-6, 1.0, 1e6, 1e18, 1e30] {
        let at = |p: Vec3| p * scale;
        let polygon = [at(up - x), at(up + x), at(up + y)];
        let frame = Frame::from_normal(Vec3::Z);
        let wo = frame.to_world(wo);
        let shading = PolygonShading::new(&bsdf, &frame, Vec3::ZERO, wo).expect("scatters");
        let total = shading.integrate(&polygon).total();
        assert!(total.is_finite() && total.min_element() > 0.01, "{scale} {total}");
        // A point of the surface that is a point of the light.
        let touching = shading.integrate(&[Vec3::ZERO, at(x), at(up)]).total();
        assert!(touching.is_finite() && touching.min_element() >= 0.0, "{scale} {touching}");
    }
    // All roughnesses at all angles, with a light in the surface's plane and a huge one.
    for i in 0..=40 {
        for j in 0..=40 {
            let (cos, roughness) = ((i as f32 / 40.0).powi(2).max(1e-6), j as f32 / 40.0);
            let bsdf = Bsdf::metallic_roughness(COLOR, 1.0, roughness, 1.5, true);
            let wo = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
            let frame = Frame::from_normal(Vec3::Z);
            let Some(shading) = PolygonShading::new(&bsdf, &frame, Vec3::ZERO, frame.to_world(wo))
            else {
                assert!(bsdf.is_delta());
                continue;
            };
            for polygon in [[x, y, -x], [up + 1e5 * x, up + 1e5 * y, up - 1e5 * (x + y)]] {
                let light = shading.integrate(&polygon).specular;
                assert!(
                    light.is_finite() && light.max_element() < 1.001,
                    "{cos} {roughness} {light}"
                );
            }
        }
    }
    let below = PolygonShading::new(&bsdf, &Frame::from_normal(Vec3::Z), Vec3::ZERO, -Vec3::Z);
    assert!(below.is_none());
    assert!(PolygonShading::new(&Bsdf::BLACK, &Frame::from_normal(up), Vec3::ZERO, up).is_none());
}

#[test]
fn small_lights_are_points() {
    let wo = Vec3::new(0.0, 0.6, 0.8);
    for (roughness, metallic) in [(0.3, 0.0), (0.6, 1.0), (0.9, 0.0)] {
        let bsdf = Bsdf::metallic_roughness(COLOR, metallic, roughness, 1.5, true);
        let direction = Vec3::new(0.1, -0.5, 0.7).normalize();
        for radius in [1e-1f32, 1e-2, 1e-3] {
            let light = ellipse(direction * 3.0, -direction, Vec2::splat(radius), 8);
            let point = bsdf.evaluate(wo, direction) * area_vector(&light).length() / 9.0;
            let total = integral(&bsdf, wo, &light).total();
            assert!(
                ((total - point) / point).abs().max_element() < 0.06,
                "{radius} {total} {point}"
            );
        }
    }
}

#[test]
fn the_committed_table_is_what_the_fit_makes() {
    for (part, row) in [(ltc::Part::Normal, 9), (ltc::Part::Normal, 40), (ltc::Part::Grazing, 50)] {
        let (fitted, stored) = (ltc::fit::fit_row(part, row), ltc::row_bytes(part, row));
        assert_eq!(fitted.len(), stored.len());
        let number = |b: &[u8]| i32::from(i16::from_le_bytes([b[0], b[1]]));
        let different = fitted.chunks(2).zip(stored.chunks(2));
        // Other machines' square roots and logarithms may round otherwise.
        let far = different.filter(|(a, b)| (number(a) - number(b)).abs() > 40).count();
        assert!(far <= 2, "{part:?} {row}: {far} numbers differ");
    }
}
