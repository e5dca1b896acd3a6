//! Screen-space passes on depth buffers with closed forms, and where they must fail.
#![allow(clippy::print_stderr)]

use std::f32::consts::PI;

use rayburst_accel::{AcceptAll, TraceOptions};
use rayburst_image::{Plane, Plane3};
use rayburst_math::{
    Frame, Ray,
    glam::{Vec2, Vec3},
    hash::Rng,
    warp,
};
use rayburst_render::realtime::{
    FrameView, ScreenOcclusion, ScreenReflections, ScreenReflectionsInput,
    ScreenReflectionsSettings, screen_occlusion, screen_reflections,
};
use rayburst_scene::{Camera, Projection};

use crate::scenes;

/// A plane or an axis-aligned box.
enum Thing {
    /// Points p with p·n = d.
    Wall(Vec3, f32),
    Block(Vec3, Vec3),
}

impl Thing {
    /// Distance along a ray and the normal there.
    fn hit(&self, origin: Vec3, direction: Vec3) -> Option<(f32, Vec3)> {
        match *self {
            Self::Wall(normal, d) => {
                let t = (d - origin.dot(normal)) / direction.dot(normal);
                (t > 1e-2 && t.is_finite()).then_some((t, normal))
            }
            Self::Block(lower, upper) => {
                let (a, b) = ((lower - origin) / direction, (upper - origin) / direction);
                let (near, far) = (a.min(b), a.max(b));
                let t = near.max_element();
                if t > far.min_element() || t <= 1e-4 {
                    return None;
                }
                let axis = (0..3).find(|&i| near[i] == t)?;
                Some((t, Vec3::AXES[axis] * -direction[axis].signum()))
            }
        }
    }
}

fn hit(things: &[Thing], origin: Vec3, direction: Vec3) -> Option<(usize, f32, Vec3)> {
    let hits = things.iter().enumerate().filter_map(|(i, thing)| {
        let (t, normal) = thing.hit(origin, direction)?;
        Some((i, t, normal))
    });
    hits.min_by(|a, b| a.1.total_cmp(&b.1))
}

/// What a camera sees of some things: depth, normals, positions, and a colour for each thing.
struct Picture {
    depth: Plane,
    normal: Plane3,
    position: Plane3,
    colour: Plane3,
}

fn colour_of(thing: usize) -> Vec3 {
    Vec3::new(1.0 + thing as f32, 0.5, 0.25)
}

fn draw(things: &[Thing], camera: &Camera, size: (u32, u32)) -> Picture {
    let planes = || Plane3::new(size.0, size.1).expect("small");
    let depth = Plane::new(size.0, size.1).expect("small");
    let mut picture = Picture { depth, normal: planes(), position: planes(), colour: planes() };
    for y in 0..size.1 {
        for x in 0..size.0 {
            let pixel = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            let (ray, _) = camera.ray(pixel, size, Vec2::ZERO);
            let Some((thing, t, normal)) = hit(things, ray.origin, ray.direction) else {
                picture.depth.set(x, y, f32::INFINITY);
                continue;
            };
            let position = ray.origin + t * ray.direction;
            picture.depth.set(x, y, (position - camera.eye()).dot(camera.frame()[2]));
            picture.normal.set(x, y, normal);
            picture.position.set(x, y, position);
            picture.colour.set(x, y, colour_of(thing));
        }
    }
    picture
}

fn cameras() -> [Camera; 2] {
    let camera = Camera::look_at(Vec3::new(0.4, 1.6, 3.0), Vec3::new(0.0, 0.4, -0.6), Vec3::Y, 1.0);
    [camera, Camera { projection: Projection::Orthographic { half_height: 1.4 }, ..camera }]
}

/// The view that a picture was drawn for.
fn view(picture: &Picture, camera: &Camera) -> FrameView {
    FrameView::new(*camera, picture.depth.size(), Vec2::ZERO)
}

fn occlusion(picture: &Picture, camera: &Camera, settings: &ScreenOcclusion) -> Plane {
    let mut visibility = Plane::default();
    let view = view(picture, camera);
    screen_occlusion(&picture.depth, &picture.normal, &view, settings, &mut visibility)
        .expect("planes of one size");
    visibility
}

#[test]
fn a_plane_is_open_everywhere() {
    for camera in cameras() {
        for normal in [Vec3::Y, Vec3::new(0.3, 0.9, 0.2).normalize()] {
            for turned in [1.0, -1.0] {
                let mut picture = draw(&[Thing::Wall(normal, -0.2)], &camera, (97, 61));
                for y in 0..61 {
                    for x in 0..97 {
                        picture.normal.set(x, y, turned * normal);
                    }
                }
                let settings = ScreenOcclusion { slices: 16, ..ScreenOcclusion::default() };
                let open = occlusion(&picture, &camera, &settings);
                for y in 0..61 {
                    for (x, open) in open.row(y).iter().enumerate() {
                        assert!((open - 1.0).abs() < 0.005, "{x} {y}: {open}");
                    }
                }
            }
        }
    }
}

/// The open share beside a wall that stands on the floor, by rays of one length: what is closed is a
/// segment of the disc that directions project to (Nusselt).
fn beside_wall(distance: f32, radius: f32) -> f32 {
    let c = (distance / radius).min(1.0);
    1.0 - (c.acos() - c * (1.0 - c * c).sqrt()) / PI
}

#[test]
fn a_corner_is_as_dark_as_for_rays() {
    let things = [Thing::Wall(Vec3::Y, 0.0), Thing::Wall(Vec3::Z, -1.0)];
    for camera in cameras() {
        let size = (160, 120);
        let picture = draw(&things, &camera, size);
        for radius in [0.3, 0.8] {
            let settings = ScreenOcclusion { radius, slices: 8, steps: 16, ..Default::default() };
            let frames = 8;
            let mut mean = Plane::<f32>::new(size.0, size.1).expect("small");
            for frame in 0..frames {
                let open = occlusion(&picture, &camera, &ScreenOcclusion { frame, ..settings });
                for (sum, open) in mean.values_mut().iter_mut().zip(open.values()) {
                    *sum += open / frames as f32;
                }
            }
            let (mut worst, mut sum, mut count, mut darkened) = (0.0f32, 0.0, 0, 0);
            for y in 0..size.1 {
                for x in 0..size.0 {
                    let p = picture.position.get(x, y);
                    let floor = picture.colour.get(x, y).x == 1.0;
                    let (own, other) = if floor { (p.z + 1.0, p.y) } else { (p.y, p.z + 1.0) };
                    assert!(other.abs() < 1e-3);
                    // Both planes must be in view as far as rays reach.
                    let reach = [-1.0, 1.0].into_iter().all(|side: f32| {
                        let [x0, y0, z0] = (p + side * radius * Vec3::X).to_array();
                        let ends = [
                            Vec3::new(x0, y0.max(if floor { radius } else { 0.0 }), -1.0),
                            Vec3::new(x0, 0.0, if floor { z0 } else { -1.0 + radius }),
                        ];
                        ends.into_iter().all(|end| {
                            camera.project(end, size).is_some_and(|(p, _)| {
                                p.cmpge(Vec2::ZERO).all() && p.x < 160.0 && p.y < 120.0
                            })
                        })
                    });
                    if !reach {
                        continue;
                    }
                    let error = mean.get(x, y) - beside_wall(own, radius);
                    worst = worst.max(error.abs());
                    sum += error.abs();
                    count += 1;
                    darkened += u32::from(mean.get(x, y) < 0.8);
                }
            }
            eprintln!("radius {radius}: mean error {}, worst {worst}", sum / count as f32);
            assert!(count > 1000 && darkened > 100, "{count} {darkened}");
            assert!(sum / (count as f32) < 0.004 && worst < 0.1, "{} {worst}", sum / count as f32);
        }
    }
}

#[test]
fn occlusion_is_the_same_on_any_number_of_threads_and_changes_with_the_frame() {
    let things =
        [Thing::Wall(Vec3::Y, 0.0), Thing::Block(Vec3::new(-0.5, 0.0, -1.0), Vec3::splat(0.6))];
    let [camera, _] = cameras();
    let picture = draw(&things, &camera, (70, 45));
    let settings = ScreenOcclusion::default();
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("starts");
        pool.install(|| occlusion(&picture, &camera, &settings))
    };
    assert_eq!(on(1), on(5));
    assert_ne!(on(1), occlusion(&picture, &camera, &ScreenOcclusion { frame: 1, ..settings }));
}

#[test]
fn strange_inputs_give_shares() {
    let [camera, parallel] = cameras();
    for size in [(1, 1), (1, 7), (9, 1), (2, 2), (17, 3)] {
        for camera in [camera, parallel] {
            let mut picture = draw(&[Thing::Wall(Vec3::Y, 0.0)], &camera, size);
            let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 0.0, 1e-38, 3e38];
            for radius in [0.0, -1.0, f32::NAN, f32::INFINITY, 1e-30, 0.5, 1e30] {
                for (i, value) in odd.into_iter().enumerate() {
                    let place = (i as u32 % size.0, i as u32 / size.0 % size.1);
                    picture.depth.set(place.0, place.1, value);
                    picture.normal.set(size.0 - 1, size.1 - 1, Vec3::splat(value));
                    for (slices, steps) in [(0, 0), (3, 5)] {
                        let settings = ScreenOcclusion { radius, slices, steps, seed: 1, frame: 2 };
                        let open = occlusion(&picture, &camera, &settings);
                        assert_eq!(open.size(), size);
                        for y in 0..size.1 {
                            assert!(open.row(y).iter().all(|v| (0.0..=1.0).contains(v)));
                        }
                    }
                }
            }
        }
    }
    let picture = draw(&[], &camera, (5, 4));
    let open = occlusion(&picture, &camera, &ScreenOcclusion::default());
    assert!((0..4).all(|y| open.row(y).iter().all(|&v| v == 1.0)));
    let other = Plane3::new(4, 5).expect("small");
    let mut out = Plane::default();
    let failed = screen_occlusion(
        &picture.depth,
        &other,
        &view(&picture, &camera),
        &ScreenOcclusion::default(),
        &mut out,
    );
    assert!(failed.is_err_and(|e| e.to_string().contains("4x5")));
}

/// Rays of a picture's pixels mirrored at its floor, the first of the things.
fn mirrored(picture: &Picture, camera: &Camera) -> Plane3 {
    let size = picture.depth.size();
    let mut directions = Plane3::new(size.0, size.1).expect("small");
    for y in 0..size.1 {
        for x in 0..size.0 {
            // Not on the horizon, where 32 bits do not tell the floor from what is on it.
            let near = picture.position.get(x, y).length() < 100.0;
            if near && picture.colour.get(x, y) == colour_of(0) {
                let pixel = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                let (ray, _) = camera.ray(pixel, size, Vec2::ZERO);
                directions.set(x, y, ray.direction * Vec3::new(1.0, -1.0, 1.0));
            }
        }
    }
    directions
}

fn reflections(
    picture: &Picture,
    camera: &Camera,
    direction: &Plane3,
    settings: &ScreenReflectionsSettings,
) -> ScreenReflections {
    let input = ScreenReflectionsInput {
        depth: &picture.depth,
        colour: &picture.colour,
        view: &view(picture, camera),
        origin: &picture.position,
        direction,
    };
    let mut found = ScreenReflections::default();
    screen_reflections(&input, settings, &mut found).expect("planes of one size");
    found
}

#[test]
fn a_mirror_shows_what_is_on_the_screen_and_fails_for_what_is_not() {
    let block = Thing::Block(Vec3::new(-0.9, 0.0, -1.4), Vec3::new(0.5, 0.8, -0.8));
    // High above the view, seen only in the mirror.
    let lamp = Thing::Block(Vec3::new(-12.0, 7.0, -24.0), Vec3::new(12.0, 7.2, -6.0));
    let things = [Thing::Wall(Vec3::Y, 0.0), block, lamp];
    for camera in cameras() {
        let size = (240, 160);
        let picture = draw(&things, &camera, size);
        let directions = mirrored(&picture, &camera);
        for (stride, least) in [(1, 97), (4, 90)] {
            let settings = ScreenReflectionsSettings { stride, ..Default::default() };
            let found = reflections(&picture, &camera, &directions, &settings);
            let (mut expected, mut right, mut off_screen, mut nothing, mut wrong) = (0, 0, 0, 0, 0);
            for y in 0..size.1 {
                for x in 0..size.0 {
                    let valid = found.validity.get(x, y) == 1.0;
                    assert_eq!(valid, found.distance.get(x, y).is_finite());
                    let (p, d) = (picture.position.get(x, y), directions.get(x, y));
                    if d == Vec3::ZERO {
                        assert!(!valid);
                        continue;
                    }
                    let Some((thing, t, _)) = hit(&things, p, d) else {
                        nothing += 1;
                        wrong += u32::from(valid);
                        continue;
                    };
                    let end = p + t * d;
                    let shown = camera.project(end, size).is_some_and(|(pixel, depth)| {
                        pixel.cmpge(Vec2::ZERO).all()
                            && pixel.x < size.0 as f32
                            && pixel.y < size.1 as f32
                            && (picture.depth.get(pixel.x as u32, pixel.y as u32) - depth).abs()
                                < 0.02
                    });
                    if shown {
                        expected += 1;
                        let distance = found.distance.get(x, y);
                        right += u32::from(
                            valid
                                && found.colour.get(x, y) == colour_of(thing)
                                && (distance - t).abs() < 0.02 * t + 0.02,
                        );
                    } else {
                        off_screen += 1;
                        wrong += u32::from(valid);
                    }
                }
            }
            eprintln!(
                "{expected} on screen, {right} found; {off_screen} not, {nothing} nowhere, {wrong} found"
            );
            assert!(expected > 1000 && off_screen > 1000, "{expected} {off_screen}");
            // At edges and where the block stands on the floor, pixels are too coarse; long steps pass
            // over the block's upper edge.
            assert!(right * 100 >= expected * least, "{right} of {expected}");
            assert!(wrong * 100 <= off_screen + nothing, "{wrong} of {off_screen} and {nothing}");
        }
    }
}

#[test]
fn rays_pass_behind_thin_things() {
    // A post in front of a wall; a ray from left to right behind the post meets the wall.
    let post = Thing::Block(Vec3::new(-0.1, -3.0, -2.05), Vec3::new(0.1, 3.0, -2.0));
    let things = [Thing::Wall(Vec3::Z, -6.0), post];
    let camera = Camera::look_at(Vec3::ZERO, -Vec3::Z, Vec3::Y, 1.0);
    let picture = draw(&things, &camera, (120, 80));
    let mut rays = Picture { ..draw(&things, &camera, (1, 1)) };
    rays.position.set(0, 0, Vec3::new(-0.9, 0.0, -3.0));
    let mut direction = Plane3::new(1, 1).expect("small");
    let towards = Vec3::new(1.0, 0.0, -1.5).normalize();
    direction.set(0, 0, towards);
    let mut found = ScreenReflections::default();
    let input = ScreenReflectionsInput {
        depth: &picture.depth,
        colour: &picture.colour,
        view: &view(&picture, &camera),
        origin: &rays.position,
        direction: &direction,
    };
    let thin = ScreenReflectionsSettings { thickness: 0.1, ..Default::default() };
    screen_reflections(&input, &thin, &mut found).expect("planes of one size");
    assert_eq!(found.validity.get(0, 0), 1.0);
    assert_eq!(found.colour.get(0, 0), colour_of(0));
    assert!((found.distance.get(0, 0) - 3.0 / -towards.z).abs() < 0.02);
    // Thick as the room it is in the way.
    let thick = ScreenReflectionsSettings { thickness: 10.0, ..thin };
    screen_reflections(&input, &thick, &mut found).expect("planes of one size");
    assert_eq!(found.colour.get(0, 0), colour_of(1));
}

#[test]
fn strange_rays_find_nothing_and_give_numbers() {
    let things =
        [Thing::Wall(Vec3::Y, 0.0), Thing::Block(Vec3::new(-0.5, 0.0, -1.0), Vec3::splat(0.6))];
    let odd = [f32::NAN, f32::INFINITY, -1e38, -1.0, 0.0, 1e-38, 1.0, 3e38];
    for camera in cameras() {
        for size in [(1, 1), (1, 9), (8, 1), (3, 2), (33, 17)] {
            let mut picture = draw(&things, &camera, size);
            let mut directions = mirrored(&picture, &camera);
            for (i, a) in odd.into_iter().enumerate() {
                for (j, b) in odd.into_iter().enumerate() {
                    let place = (j as u32 % size.0, i as u32 % size.1);
                    directions.set(place.0, place.1, Vec3::new(a, b, -1.0));
                    picture.position.set(size.0 - 1, size.1 - 1, Vec3::new(b, a, 0.3));
                    picture.depth.set(0, 0, a);
                    for settings in [
                        ScreenReflectionsSettings::default(),
                        ScreenReflectionsSettings {
                            thickness: b,
                            distance: a,
                            steps: 7,
                            stride: 0,
                        },
                    ] {
                        let found = reflections(&picture, &camera, &directions, &settings);
                        assert_eq!(found.validity.size(), size);
                        for y in 0..size.1 {
                            for x in 0..size.0 {
                                assert!(found.colour.get(x, y).is_finite());
                                assert!(!found.distance.get(x, y).is_nan());
                                assert!([0.0, 1.0].contains(&found.validity.get(x, y)));
                            }
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn reflections_are_the_same_on_any_number_of_threads() {
    let things =
        [Thing::Wall(Vec3::Y, 0.0), Thing::Block(Vec3::new(-0.5, 0.0, -1.0), Vec3::splat(0.6))];
    let [camera, _] = cameras();
    let picture = draw(&things, &camera, (70, 45));
    let directions = mirrored(&picture, &camera);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("starts");
        pool.install(|| reflections(&picture, &camera, &directions, &Default::default()))
    };
    let (a, b) = (on(1), on(5));
    assert_eq!((a.colour, a.distance, a.validity), (b.colour, b.distance, b.validity));
}

#[test]
fn a_room_with_blocks_is_about_as_dark_as_for_rays() {
    let (scene, camera) = scenes::built_in("cornell");
    let size = (96, 96);
    let depth = Plane::<f32>::new(size.0, size.1).expect("small");
    let mut picture = Picture {
        depth,
        normal: Plane3::new(size.0, size.1).expect("small"),
        position: Plane3::new(size.0, size.1).expect("small"),
        colour: Plane3::new(size.0, size.1).expect("small"),
    };
    let radius = 0.15;
    let trace = |ray: &Ray| scene.tlas.closest_hit(ray, &TraceOptions::default(), &AcceptAll);
    let mut by_rays = Plane::<f32>::new(size.0, size.1).expect("small");
    let mut rng = Rng::new(6);
    for y in 0..size.1 {
        for x in 0..size.0 {
            let (ray, _) = camera.ray(scenes::pixel_centre(x, y), size, Vec2::ZERO);
            let hit = trace(&ray);
            picture.depth.set(x, y, f32::INFINITY);
            by_rays.set(x, y, 1.0);
            if !hit.is_hit() {
                continue;
            }
            let surface = scene.surface(&hit);
            let depth = (surface.position - camera.eye()).dot(camera.frame()[2]);
            picture.depth.set(x, y, depth);
            picture.normal.set(x, y, surface.geometric_normal);
            let frame = Frame::from_normal(surface.normal_towards(-ray.direction));
            let rays = 128;
            let open = (0..rays).filter(|_| {
                let direction = frame.to_world(warp::cosine_hemisphere(rng.vec2()));
                let origin = surface.spawn(direction);
                !trace(&Ray::with_interval(origin, direction, 0.0, radius)).is_hit()
            });
            by_rays.set(x, y, open.count() as f32 / rays as f32);
        }
    }
    let settings = ScreenOcclusion { radius, slices: 16, steps: 12, seed: 0, frame: 0 };
    let open = occlusion(&picture, &camera, &settings);
    let (mut error, mut bias, mut dark) = (0.0, 0.0, 0.0);
    for y in 0..size.1 {
        for (a, b) in open.row(y).iter().zip(by_rays.row(y)) {
            error += (a - b).abs() / (96.0 * 96.0);
            bias += (a - b) / (96.0 * 96.0);
            dark += (1.0 - b) / (96.0 * 96.0);
        }
    }
    eprintln!("rays close {dark} on average; mean difference {error}, bias {bias}");
    assert!(dark > 0.03 && error < 0.25 * dark && bias.abs() < 0.1 * dark, "{error} of {dark}");
}
