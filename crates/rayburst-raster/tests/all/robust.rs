//! Anything may be empty, degenerate, huge or not a number.

use glam::{Affine3A, Vec2, Vec3};
use rayburst_image::Plane;
use rayburst_math::hash::Rng;
use rayburst_raster::{
    Clusters, IsaLevel, Mesh, Projection, RasterError, Rasteriser, Solid, View, Visibility,
};
use rayburst_testkit::meshes;

use crate::views::{clusters, draw, look, placed};

fn shown(seen: &Visibility) -> usize {
    let (_, height) = seen.depth.size();
    (0..height).map(|y| seen.triangles.row(y).iter().filter(|&&id| id != u32::MAX).count()).sum()
}

#[test]
fn nothing_is_drawn_of_nothing() {
    let view = look(Vec3::Z, Vec3::ZERO, 0.5, false, (1, 1));
    assert_eq!(shown(&draw(&view, &[], &Solid)), 0);
    let empty = Clusters::new(&[], &[], None);
    assert!(empty.bounds().is_empty() && empty.triangle(0).is_none());
    assert_eq!(shown(&draw(&view, &[placed(&empty, true)], &Solid)), 0);
    let cube = clusters(&meshes::cube());
    let inside = look(meshes::cube().bounds().centre(), Vec3::ONE * 9.0, 0.5, false, (1, 1));
    assert_eq!(shown(&draw(&inside, &[placed(&cube, true)], &Solid)), 1);
    // Indices out of range are inactive.
    let broken = Clusters::new(&[Vec3::ZERO, Vec3::X, Vec3::Y], &[[0, 1, 3], [0, 1, 2]], None);
    assert!(broken.triangle(0).is_none() && broken.triangle(1).is_some());
}

#[test]
fn sizes_out_of_range_are_refused() {
    let mut rasteriser = Rasteriser::new(IsaLevel::detect());
    let (mut seen, mut depth) = (Visibility::default(), Plane::default());
    for size in [(0, 0), (0, 5), (5, 0)] {
        let view = View { size, ..look(Vec3::Z, Vec3::ZERO, 0.5, false, (1, 1)) };
        let refused = rasteriser.draw(&view, &[], &Solid, &mut seen);
        assert!(matches!(refused, Err(RasterError::Size(_))), "{size:?}");
        assert!(rasteriser.draw_depth(&view, &[], &Solid, &mut depth).is_err());
    }
    let view = View { size: (70_000, 1), ..look(Vec3::Z, Vec3::ZERO, 0.5, false, (1, 1)) };
    let refused = rasteriser.draw(&view, &[], &Solid, &mut seen);
    assert!(matches!(refused, Err(RasterError::TooLarge(70_000, 1))));
}

#[test]
fn what_reaches_behind_the_eye_is_seen_up_to_the_eye() {
    // A floor far beyond the view, the eye just above: all below the horizon shows it.
    let far = 1000.0;
    let corners = [
        Vec3::new(-far, 0.0, -far),
        Vec3::new(far, 0.0, -far),
        Vec3::new(far, 0.0, far),
        Vec3::new(-far, 0.0, far),
    ];
    let floor = Clusters::new(&corners, &[[0, 1, 2], [0, 2, 3]], None);
    for height in [1.0, 1e-2, 1e-4] {
        let eye = Vec3::new(0.3, height, -0.2);
        let mut view = look(eye, eye - Vec3::Z, 0.8, false, (200, 150));
        view.frame = [Vec3::X, Vec3::Y, -Vec3::Z];
        let seen = draw(&view, &[placed(&floor, true)], &Solid);
        for y in 0..150 {
            let below = (f64::from(y) + 0.5 - 75.0) / 75.0 * 0.8;
            let depth = f64::from(height) / below;
            for x in 0..200 {
                let found = f64::from(seen.depth.get(x, y));
                if below < 0.0 {
                    assert_eq!(found, f64::INFINITY, "above the horizon");
                } else if depth < 900.0 {
                    assert!((found - depth).abs() < 1e-4 * depth, "{height} {y} {found} {depth}");
                }
            }
        }
    }
    // From inside a closed mesh every pixel shows it, however near the eye comes to its side.
    let cube = clusters(&meshes::cube());
    let bounds = meshes::cube().bounds();
    for near in [0.5, 0.1, 1e-3, 1e-6] {
        let mut eye = bounds.centre();
        eye.x = bounds.upper.x - near * bounds.extent().x;
        for towards in [Vec3::X, -Vec3::X, Vec3::new(1.0, 0.3, -0.2), Vec3::Z] {
            let view = look(eye, eye + towards, 1.3, false, (128, 96));
            assert_eq!(shown(&draw(&view, &[placed(&cube, true)], &Solid)), 128 * 96, "{near}");
        }
    }
    // What is behind is not seen.
    let view = look(bounds.upper + Vec3::X, bounds.upper + 9.0 * Vec3::X, 1.0, false, (64, 64));
    assert_eq!(shown(&draw(&view, &[placed(&cube, true)], &Solid)), 0);
    let view = look(bounds.upper + Vec3::X, bounds.upper + 9.0 * Vec3::X, 9.0, true, (64, 64));
    assert_eq!(shown(&draw(&view, &[placed(&cube, true)], &Solid)), 0);
}

#[test]
fn triangles_with_unusable_corners_are_left_out_and_the_rest_is_drawn() {
    let sphere = meshes::sphere(40, 20);
    let bounds = sphere.bounds();
    let mut rng = Rng::new(77);
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30, -1e38, f32::MAX];
    let mut positions = sphere.positions.clone();
    let mut indices = sphere.indices.clone();
    for (i, &x) in bad.iter().cycle().take(60).enumerate() {
        let mut p = rng.vec3();
        p[i % 3] = x;
        positions.push(p);
        let at = positions.len() as u32 - 1;
        indices.push([at, i as u32, i as u32 + 1]);
    }
    let (plain, mixed) = (clusters(&sphere), Clusters::new(&positions, &indices, None));
    for parallel in [false, true] {
        for reach in [2.0, 0.1] {
            let eye = bounds.centre() + reach * bounds.diagonal() * Vec3::new(0.3, 0.4, 0.8);
            let half = if parallel { bounds.diagonal() } else { 0.5 };
            let view = look(eye, bounds.centre(), half, parallel, (90, 80));
            let [a, b] =
                [&plain, &mixed].map(|clusters| draw(&view, &[placed(clusters, true)], &Solid));
            assert!(a.triangles == b.triangles && a.depth == b.depth && shown(&a) > 0);
        }
    }
}

#[test]
fn huge_tiny_and_flat_things_and_strange_views_do_no_harm() {
    let soups = [
        meshes::degenerate_soup(300, 5),
        meshes::needles(300, 6),
        meshes::random_soup(300, 1.0, 7).placed("huge", 2f32.powi(58), Vec3::ZERO),
        meshes::random_soup(300, 1.0, 8).placed("tiny", 2f32.powi(-100), Vec3::ZERO),
        meshes::random_soup(300, 1.0, 9).placed("far", 1.0, Vec3::splat(1e7)),
    ];
    let odd = [f32::NAN, f32::INFINITY, 0.0, 1e-38, 1e38, -1.0];
    let mut rng = Rng::new(12);
    for mesh in &soups {
        let (clusters, bounds) = (clusters(mesh), mesh.bounds());
        for i in 0..36 {
            let towards = (rng.vec3() - 0.5).normalize() * bounds.diagonal();
            let half = Vec2::new(1.0, 0.7) * if i % 2 == 0 { 1.0 } else { bounds.diagonal() };
            let mut view = look(bounds.centre() + towards, bounds.centre(), 1.0, false, (50, 40));
            view.projection = if i % 2 == 0 {
                Projection::Perspective { half }
            } else {
                Projection::Orthographic { half }
            };
            let mut transform = Affine3A::IDENTITY;
            let x = odd[i / 6];
            match i % 6 {
                0 => view.eye.x = x,
                1 => view.jitter.y = x,
                2 => view.projection = Projection::Perspective { half: Vec2::splat(x) },
                3 => view.frame[i / 6 % 3].z = x,
                4 => transform.matrix3.x_axis *= x,
                _ => transform.translation.y = x,
            }
            let meshes = [Mesh { transform, ..placed(&clusters, true) }, placed(&clusters, true)];
            let seen = draw(&view, &meshes, &Solid);
            for y in 0..40 {
                for x in 0..50 {
                    if let Some((mesh, primitive)) = seen.identify(seen.triangles.get(x, y)) {
                        assert!(mesh < 2 && clusters.triangle(primitive).is_some());
                    }
                }
            }
        }
    }
}
