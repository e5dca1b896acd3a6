//! Height fields against all their cells, one after another.

use glam::{DVec2, DVec3, Vec2, Vec3};
use rayburst_math::Ray;
use rayburst_math::hash::Rng;
use rayburst_procedural::{HeightField, HeightFieldError, Landscape, Shape};

use crate::check::{Expected, Tolerance, all_hits, check_strange_rays, compare};
use crate::random_rays::Rays;

fn patch_height(
    field: &HeightField,
    lower: DVec2,
    cell: DVec2,
    x: usize,
    z: usize,
    p: DVec2,
) -> f64 {
    let h = |x: usize, z: usize| f64::from(field.heights()[z * field.columns() + x]);
    let u = (p.x - lower.x) / cell.x - x as f64;
    let v = (p.y - lower.y) / cell.y - z as f64;
    (1.0 - v) * ((1.0 - u) * h(x, z) + u * h(x + 1, z))
        + v * ((1.0 - u) * h(x, z + 1) + u * h(x + 1, z + 1))
}

/// All roots of all patches in `f64`: a parabola through three of its points, per cell. Places on
/// edges of cells are soft: both cells have them.
fn brute_force(field: &HeightField, o: DVec3, d: DVec3) -> Vec<Expected> {
    let (lower, upper) = (field.bounds().lower.as_dvec3(), field.bounds().upper.as_dvec3());
    let (lower, upper) = (DVec2::new(lower.x, lower.z), DVec2::new(upper.x, upper.z));
    let (nx, nz) = (field.columns() - 1, field.rows() - 1);
    let cell = (upper - lower) / DVec2::new(nx as f64, nz as f64);
    // From the point nearest to the field, in units of length.
    let scale = d.length();
    let middle = DVec3::new(0.5 * (lower.x + upper.x), 0.0, 0.5 * (lower.y + upper.y));
    let shift = (middle - o).dot(d) / (scale * scale);
    let (o, d) = (o + shift * d, d / scale);
    let mut found = Vec::new();
    for z in 0..nz {
        for x in 0..nx {
            let height = |s: f64| {
                let p = o + s * d;
                p.y - patch_height(field, lower, cell, x, z, DVec2::new(p.x, p.z))
            };
            // Through the patch's own neighbourhood, for accuracy.
            let centre = lower + cell * DVec2::new(x as f64 + 0.5, z as f64 + 0.5);
            let flat = DVec2::new(d.x, d.z);
            let offset = centre - DVec2::new(o.x, o.z);
            let s0 =
                if flat.length() > 0.0 { offset.dot(flat) / flat.length_squared() } else { 0.0 };
            let w = if flat.length() > 0.0 { cell.length() / flat.length() } else { 1.0 };
            let p = |s: f64| DVec2::new(o.x + s * d.x, o.z + s * d.z);
            if (p(s0) - centre).abs().max_element() > 1.5 * cell.length() {
                continue;
            }
            let (a, b, c) = (height(s0 - w), height(s0), height(s0 + w));
            let (quadratic, linear) = (0.5 * (a + c) - b, 0.5 * (c - a));
            let roots = if quadratic.abs() <= 1e-13 * (a.abs() + c.abs()) {
                vec![-b / linear]
            } else {
                let e = linear * linear - 4.0 * quadratic * b;
                if e < 0.0 {
                    vec![]
                } else {
                    vec![
                        (-linear + e.sqrt()) / (2.0 * quadratic),
                        (-linear - e.sqrt()) / (2.0 * quadratic),
                    ]
                }
            };
            for root in roots {
                let s = s0 + w * root;
                let inside = (p(s) - lower) / cell - DVec2::new(x as f64, z as f64);
                let edge = 1e-6;
                if !(inside.min_element() >= -edge && inside.max_element() <= 1.0 + edge) {
                    continue;
                }
                let soft = inside.min_element() < edge || inside.max_element() > 1.0 - edge;
                let h = |q: DVec2| patch_height(field, lower, cell, x, z, q);
                let e = 1e-3 * cell;
                let dx = (h(p(s) + DVec2::X * e) - h(p(s) - DVec2::X * e)) / (2.0 * e.x);
                let dz = (h(p(s) + DVec2::Y * e) - h(p(s) - DVec2::Y * e)) / (2.0 * e.y);
                let normal = DVec3::new(-dx, 1.0, -dz).normalize();
                found.push(Expected { t: shift + s / scale, normal, soft });
            }
        }
    }
    found
}

/// How far a point is above or below the surface: no less than its distance.
fn vertical_distance(field: &HeightField, point: DVec3) -> f64 {
    let (lower, upper) = (field.bounds().lower.as_dvec3(), field.bounds().upper.as_dvec3());
    let (lower, upper) = (DVec2::new(lower.x, lower.z), DVec2::new(upper.x, upper.z));
    let cells = DVec2::new((field.columns() - 1) as f64, (field.rows() - 1) as f64);
    let cell = (upper - lower) / cells;
    let at = ((DVec2::new(point.x, point.z) - lower) / cell).floor();
    let at = at.clamp(DVec2::ZERO, cells - 1.0);
    let p = DVec2::new(point.x, point.z);
    // The distance to the tangent plane, not along y: steep patches magnify rounding in x and z.
    let (x, z) = (at.x as usize, at.y as usize);
    let h = |q: DVec2| patch_height(field, lower, cell, x, z, q);
    let slope = DVec2::new(
        h(p + DVec2::X * 0.5 * cell.x) - h(p - DVec2::X * 0.5 * cell.x),
        h(p + DVec2::Y * 0.5 * cell.y) - h(p - DVec2::Y * 0.5 * cell.y),
    ) / cell;
    (point.y - h(p)).abs() / (1.0 + slope.length_squared()).sqrt()
}

fn random_field(seed: u64, columns: usize, rows: usize, step: f32) -> HeightField {
    let mut rng = Rng::new(seed);
    let heights =
        (0..columns * rows).map(|_| (rng.range(-1.0, 1.0) / step).round() * step).collect();
    HeightField::new(columns, rows, heights, Vec2::new(-3.0, 1.0), Vec2::new(2.0, 7.0)).unwrap()
}

#[test]
fn height_fields_agree_with_brute_force() {
    let ridges = Landscape {
        seed: 3,
        level: 4,
        frequency: 3.0,
        octaves: 4,
        ridges: 0.7,
        ..Default::default()
    };
    let fields = [
        (random_field(1, 13, 9, 1e-7), 60_000),
        // Steps make flat cells, plane cells and heights that are equal.
        (random_field(2, 6, 14, 0.5), 60_000),
        (random_field(4, 2, 2, 1e-7), 40_000),
        (ridges.height_field(Vec2::splat(-100.0), Vec2::splat(100.0), 30.0).unwrap(), 40_000),
    ];
    for (i, (field, count)) in fields.iter().enumerate() {
        let bounds = field.bounds();
        let size = f64::from(bounds.diagonal());
        let mut rays = Rays::new(i as u64, bounds.lower, bounds.upper);
        let tolerance = Tolerance { distance: 2e-7 * size, band: 1e-3, normal: 1e-5 };
        let counts = compare(
            field,
            &mut rays,
            *count,
            tolerance,
            &mut |o, d| brute_force(field, o, d),
            &|p| vertical_distance(field, p),
        );
        assert!(counts.hits > count / 3 && counts.soft < count / 20, "{counts:?}");
        check_strange_rays(field);
    }
}

#[test]
fn no_ray_falls_through_a_fine_landscape() {
    let landscape = Landscape { level: 8, ..Default::default() };
    let field = landscape.height_field(Vec2::ZERO, Vec2::ONE, 0.1).unwrap();
    let mut rng = Rng::new(9);
    for _ in 0..100_000 {
        // From above the highest point to below the lowest one, over any cells, edges and corners:
        // an odd number of hits, front and back in turn.
        let snap = rng.below(2) == 0;
        let mut place = || {
            let v = rng.vec2();
            if snap { (v * 256.0).round() / 256.0 } else { v }
        };
        let (a, b) = (place(), place());
        let (a, b) = (Vec3::new(a.x, 0.11, a.y), Vec3::new(b.x, -0.11, b.y));
        let ray = Ray::new(a, b - a);
        let hits = all_hits(&field, &ray);
        assert!(hits.len() % 2 == 1, "{ray:?} {hits:?}");
        for (i, hit) in hits.iter().enumerate() {
            // A crossing on a fold may have the normal of the patch that it leaves.
            let cosine = hit.normal.dot(ray.direction.normalize());
            let folds = [hit.uv.x, hit.uv.y]
                .iter()
                .any(|u| (u * 256.0).fract().min(1.0 - (u * 256.0).fract()) < 1e-3);
            assert!(
                hit.is_front(&ray) == (i % 2 == 0) || folds || cosine.abs() < 1e-3,
                "{ray:?} {hits:?}"
            );
        }
    }
}

#[test]
fn ends_of_the_interval_are_in_it_and_flat_fields_are_found() {
    let flat = HeightField::new(5, 3, vec![0.0; 15], Vec2::ZERO, Vec2::new(4.0, 2.0)).unwrap();
    let down = Ray::with_interval(Vec3::new(1.3, 2.0, 0.7), Vec3::NEG_Y, 2.0, 2.0);
    assert_eq!(all_hits(&flat, &down).len(), 1);
    assert_eq!(all_hits(&flat, &Ray { t_min: 0.0, ..down }).len(), 1);
    assert_eq!(all_hits(&flat, &Ray { t_max: 3.0, ..down }).len(), 1);
    assert_eq!(all_hits(&flat, &Ray { t_max: 1.999, t_min: 0.0, ..down }).len(), 0);
    let hit = flat.nearest(&down).unwrap();
    assert_eq!((hit.normal, hit.uv), (Vec3::Y, Vec2::new(1.3 / 4.0, 0.7 / 2.0)));
    // On the border, on a corner of cells, and in the plane.
    assert_eq!(all_hits(&flat, &Ray::new(Vec3::new(0.0, 1.0, 0.0), Vec3::NEG_Y)).len(), 1);
    assert_eq!(all_hits(&flat, &Ray::new(Vec3::new(4.0, 1.0, 2.0), Vec3::NEG_Y)).len(), 1);
    assert_eq!(
        all_hits(&flat, &Ray::new(Vec3::new(0.0, 1.0, 0.0), Vec3::new(1.0, -1.0, 1.0))).len(),
        1
    );
    assert!(all_hits(&flat, &Ray::new(Vec3::new(-1.0, 0.0, 0.5), Vec3::X)).len() <= 1);
    check_strange_rays(&flat);
}

#[test]
fn what_makes_no_field_is_named() {
    let make = |c, r, h: &[f32], upper| HeightField::new(c, r, h.to_vec(), Vec2::ZERO, upper).err();
    assert_eq!(
        make(1, 2, &[0.0; 2], Vec2::ONE),
        Some(HeightFieldError::TooFew { columns: 1, rows: 2 })
    );
    assert_eq!(
        make(2, 2, &[0.0; 5], Vec2::ONE),
        Some(HeightFieldError::Count { columns: 2, rows: 2, found: 5 })
    );
    assert_eq!(
        make(2, 2, &[0.0, 1.0, f32::NAN, 0.0], Vec2::ONE),
        Some(HeightFieldError::NotFinite { index: 2 })
    );
    assert_eq!(make(2, 2, &[0.0; 4], Vec2::new(1.0, 0.0)), Some(HeightFieldError::Rectangle));
    assert_eq!(
        make(2, 2, &[0.0; 4], Vec2::new(1.0, f32::INFINITY)),
        Some(HeightFieldError::Rectangle)
    );
    assert!(make(usize::MAX, usize::MAX, &[], Vec2::ONE).is_some());
}

#[test]
fn landscapes_repeat_and_differ_by_seed() {
    let landscape = Landscape { level: 6, ..Default::default() };
    let heights = landscape.heights();
    assert_eq!((landscape.size(), heights.len()), (65, 65 * 65));
    assert_eq!(heights, landscape.heights());
    assert_ne!(heights, Landscape { seed: 1, ..landscape }.heights());
    for ridges in [0.0, 0.5, 1.0] {
        let heights = Landscape { ridges, ..landscape }.heights();
        let (low, high) = heights.iter().fold((1f32, -1f32), |(a, b), &h| (a.min(h), b.max(h)));
        assert!(low >= -1.0 && high <= 1.0 && high - low > 0.4, "{low} {high}");
        // Neighbours are near each other: a landscape, not noise.
        let steps = heights.windows(2).filter(|w| (w[1] - w[0]).abs() > 0.5).count();
        assert!(steps < 65 + 10, "{steps}");
    }
    // A finer grid shows the same landscape.
    let fine = Landscape { level: 7, ..landscape }.heights();
    assert_eq!(fine[2 * 129 * 3 + 2 * 5], heights[65 * 3 + 5]);
    let strange = Landscape { frequency: f32::NAN, gain: f32::INFINITY, octaves: 99, ..landscape };
    assert!(strange.heights().iter().all(|h| h.is_finite()));
}
