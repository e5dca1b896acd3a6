//! What holds whatever is drawn: no holes, no pixel twice, the same bits everywhere.

use glam::{Affine3A, Vec2, Vec3};
use rayburst_image::Plane;
use rayburst_math::hash::Rng;
use rayburst_raster::{
    Candidate, Clusters, Coverage, IsaLevel, Mesh, Projection, Rasteriser, Solid, View, Visibility,
};
use rayburst_testkit::meshes;

use crate::views::{clusters, counts, draw, look, placed};

/// A triangulated square in the plane z = 0 from −1 to 1, its inner vertices moved by up to `shift` of a cell.
fn sheet(cells: u32, shift: f32, seed: u64) -> Clusters {
    let mut rng = Rng::new(seed);
    let mut positions = Vec::new();
    for y in 0..=cells {
        for x in 0..=cells {
            let inner = |i: u32| if i > 0 && i < cells { shift } else { 0.0 };
            let off = (rng.vec2() - 0.5) * Vec2::new(inner(x), inner(y));
            let at = (Vec2::new(x as f32, y as f32) + off) * (2.0 / cells as f32) - 1.0;
            positions.push(at.extend(0.0));
        }
    }
    let mut indices = Vec::new();
    for y in 0..cells {
        for x in 0..cells {
            let i = y * (cells + 1) + x;
            let [a, b, c, d] = [i, i + 1, i + cells + 2, i + cells + 1];
            // Either diagonal, either winding, any corner first.
            let pair = if rng.u32().is_multiple_of(2) {
                [[a, b, c], [c, d, a]]
            } else {
                [[b, c, d], [b, d, a]]
            };
            for [a, b, c] in pair {
                indices.push(if rng.u32().is_multiple_of(2) { [a, b, c] } else { [c, b, a] });
            }
        }
    }
    Clusters::new(&positions, &indices, None)
}

#[test]
fn pixel_centres_on_shared_edges_are_covered_once() {
    // One unit is a pixel, and all edges go through pixel centres: of 32² pixels each vertex is one.
    let half = Vec2::splat(16.0);
    for cells in [8, 16, 32] {
        let sheet = sheet(cells, 0.0, 1);
        for offset in [Vec2::ZERO, Vec2::splat(0.5)] {
            let view = View {
                eye: (offset / 16.0).extend(1.0),
                frame: [Vec3::X, Vec3::Y, -Vec3::Z],
                projection: Projection::Orthographic { half: half / 16.0 },
                size: (32, 32),
                jitter: Vec2::ZERO,
            };
            let counts = counts(&view, &sheet);
            let covered = counts.iter().filter(|count| count[0] == 1).count();
            // Half a pixel off, the right column and the top row may be beyond the sheet or on its edge.
            let least = if offset == Vec2::ZERO { 32 * 32 } else { 31 * 31 };
            assert!(covered >= least, "{covered}");
            assert!(counts.iter().all(|count| count[0] <= 1), "a pixel is covered twice");
        }
    }
}

#[test]
fn a_fan_around_a_pixel_centre_covers_it_once() {
    for spokes in 3..40 {
        for turn in 0..8 {
            let angle =
                |i: u32| (i as f32 + turn as f32 / 8.0) * std::f32::consts::TAU / spokes as f32;
            let mut positions = vec![Vec3::ZERO];
            positions.extend((0..spokes).map(|i| Vec3::new(angle(i).cos(), angle(i).sin(), 0.0)));
            let indices: Vec<[u32; 3]> =
                (0..spokes).map(|i| [0, 1 + i, 1 + (i + 1) % spokes]).collect();
            let fan = Clusters::new(&positions, &indices, None);
            let mut view = look(Vec3::Z * 2.0, Vec3::ZERO, 0.3, false, (33, 33));
            view.frame = [Vec3::X, Vec3::Y, -Vec3::Z];
            let counts = counts(&view, &fan);
            assert_eq!(counts[16 * 33 + 16], [1, 1], "{spokes} {turn}");
            assert!(counts.iter().all(|count| count[0] <= 1));
        }
    }
}

#[test]
fn a_sheet_has_neither_holes_nor_pixels_that_are_covered_twice() {
    let mut rng = Rng::new(9);
    for (cells, size) in [(3, (320, 200)), (40, (320, 200)), (300, (200, 120))] {
        let sheet = sheet(cells, 0.3, u64::from(cells));
        for i in 0..8 {
            // Inside the sheet's outline, at ever flatter angles and nearer.
            let height = 0.4 * 0.5f32.powi(i);
            let eye = ((rng.vec2() - 0.5) * 0.2).extend(height);
            let mut view = look(eye, Vec3::ZERO, 0.9, false, size);
            view.frame = [Vec3::X, Vec3::Y, -Vec3::Z];
            view.jitter = rng.vec2() - 0.5;
            let counts = counts(&view, &sheet);
            assert!(counts.iter().all(|count| count[0] == 1), "{cells} {i}");
        }
        // From the side: everything below the horizon, up to the sheet's end.
        let view = look(Vec3::new(0.0, 0.01, 0.02), Vec3::new(0.1, 0.7, 0.01), 0.5, false, size);
        assert!(counts(&view, &sheet).iter().all(|count| count[0] <= 1));
    }
}

#[test]
fn closed_meshes_are_entered_and_left() {
    let mut rng = Rng::new(2);
    for mesh in [meshes::sphere(200, 100), meshes::sphere(12, 7), meshes::spiky_sphere(64, 32, 8)] {
        let (clusters, bounds) = (clusters(&mesh), mesh.bounds());
        for i in 0..6 {
            let towards = (rng.vec3() - 0.5).normalize() * bounds.diagonal();
            let inside = i % 2 == 1;
            let reach = if inside { 0.01 } else { 0.8 };
            let view =
                look(bounds.centre() + reach * towards, bounds.centre(), 0.7, false, (160, 120));
            let mut hit = 0;
            for [all, front] in counts(&view, &clusters) {
                // From inside one more back than fronts, from outside as many.
                assert_eq!(all - front, front + u32::from(inside), "{}", mesh.name);
                hit += all;
            }
            assert!(hit > 1000);
        }
    }
}

#[test]
fn what_is_as_deep_is_seen_of_the_first_mesh_and_the_first_triangle() {
    let corners =
        [Vec3::new(-3.0, -3.0, 0.0), Vec3::new(9.0, -3.0, 0.0), Vec3::new(-3.0, 9.0, 0.0)];
    let repeated: Vec<[u32; 3]> = vec![[0, 1, 2]; 200];
    let many = Clusters::new(&corners, &repeated, None);
    let one = Clusters::new(&corners, &[[0, 1, 2]], None);
    for parallel in [false, true] {
        let view = look(Vec3::new(0.1, 0.2, 2.0), Vec3::ZERO, 0.4, parallel, (80, 70));
        for first_is_many in [false, true] {
            let meshes = if first_is_many { [&many, &one] } else { [&one, &many] };
            let meshes = meshes.map(|clusters| placed(clusters, true));
            let seen = draw(&view, &meshes, &Solid);
            for y in 0..70 {
                for x in 0..80 {
                    assert_eq!(
                        seen.identify(seen.triangles.get(x, y)),
                        Some((0, 0)),
                        "{x} {y} {parallel}"
                    );
                }
            }
        }
    }
}

/// Leaves out a pattern of pixels of every other triangle.
struct Pattern;

impl Coverage for Pattern {
    fn covers(&self, pixel: u32, candidate: &Candidate) -> bool {
        !(pixel + candidate.primitive).is_multiple_of(3)
    }
}

/// Some meshes, placed in several ways; every other one asks for coverage.
fn crowd(clusters: &[Clusters]) -> Vec<Mesh<'_>> {
    let mut rng = Rng::new(31);
    let mut meshes = Vec::new();
    for instance in 0..24 {
        let clusters = &clusters[instance as usize % clusters.len()];
        let scale = 0.2 + rng.vec3();
        let transform = Affine3A::from_translation(4.0 * (rng.vec3() - 0.5))
            * Affine3A::from_rotation_y(rng.range(0.0, 6.0))
            * Affine3A::from_scale(if instance % 3 == 0 { -scale } else { scale });
        let transform = if instance == 0 { Affine3A::IDENTITY } else { transform };
        meshes.push(Mesh { clusters, transform, instance, geometry: 0, opaque: instance % 2 == 0 });
    }
    meshes
}

fn bits(seen: &Visibility) -> (Vec<u32>, Vec<u32>) {
    let (width, height) = seen.depth.size();
    let pixels = || (0..height).flat_map(move |y| (0..width).map(move |x| (x, y)));
    let depths = pixels().map(|(x, y)| seen.depth.get(x, y).to_bits()).collect();
    (depths, pixels().map(|(x, y)| seen.triangles.get(x, y)).collect())
}

#[test]
fn pictures_depend_neither_on_threads_nor_on_instruction_sets_nor_on_earlier_pictures() {
    let parts = [meshes::sphere(90, 45), meshes::cube(), meshes::random_soup(900, 0.4, 6)];
    let parts = parts.each_ref().map(clusters);
    let meshes = crowd(&parts);
    for parallel in [false, true] {
        for eye in [Vec3::new(3.0, 2.0, 5.0), Vec3::new(0.2, 0.1, 0.3)] {
            let half = if parallel { 2.5 } else { 0.7 };
            let view = look(eye, Vec3::ZERO, half, parallel, (333, 190));
            let expected = bits(&draw(&view, &meshes, &Pattern));
            let shown = expected.1.iter().filter(|&&id| id != u32::MAX).count();
            assert!(shown > 10_000, "{shown}");
            let mut levels = IsaLevel::available();
            levels.extend(IsaLevel::available());
            for (i, level) in levels.into_iter().enumerate() {
                let threads = 1 + i % 3;
                let pool =
                    rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool");
                pool.install(|| {
                    let mut rasteriser = Rasteriser::new(level);
                    let (mut to, mut depth) = (Visibility::default(), Plane::default());
                    // Another view first, of another size, then the same one twice.
                    let other = look(-eye, Vec3::ONE, half, !parallel, (100, 200));
                    rasteriser.draw(&other, &meshes, &Solid, &mut to).expect("draws");
                    for _ in 0..2 {
                        rasteriser.draw(&view, &meshes, &Pattern, &mut to).expect("draws");
                        assert!(bits(&to) == expected, "{} {threads} {parallel}", level.name());
                        rasteriser.draw_depth(&view, &meshes, &Pattern, &mut depth).expect("draws");
                        assert!(depth == to.depth, "depth alone is as deep");
                    }
                });
            }
        }
    }
}
