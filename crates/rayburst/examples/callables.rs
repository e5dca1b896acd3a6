//! One shader and five callable shaders instead of 32 shaders, and callable shaders as decals.

use std::sync::Arc;

use rayburst::{
    glam::Vec3Swizzles,
    math::Sampler,
    pipeline::{CallableId, ClosestHit, RayType},
    prelude::*,
    scene::shapes,
};

mod common;

use common::{
    Eye, Result, arguments,
    daylight::{SHADOW_FLAGS, Shadow, TOWARDS_SUN, daylight, sky},
    picture, save,
};

/// How many features there are; each surface has any of them.
const FEATURES: usize = 5;
/// The mask of the pane, which shadow rays do not see.
const PANE: u8 = 1;

// ANCHOR: features
/// What features change: the parameters of the callable shaders.
#[derive(Clone, Copy)]
struct Look {
    /// The point of the unit sphere that is seen.
    place: Vec3,
    /// The cosine between normal and view, and between normal and half vector.
    facing: f32,
    highlight: f32,
    /// Reflectance, and light that is added to what the surface reflects.
    color: Vec3,
    glow: Vec3,
}

fn warm(look: &mut Look) {
    look.color = Vec3::new(0.80, 0.33, 0.14);
}

fn stripes(look: &mut Look) {
    if (6.0 * look.place.y).rem_euclid(1.0) < 0.45 {
        look.color = look.color.lerp(Vec3::new(0.05, 0.10, 0.22), 0.8);
    }
}

fn dots(look: &mut Look) {
    let turns = look.place.z.atan2(look.place.x) * 8.0 / std::f32::consts::TAU;
    let cell = Vec2::new(turns, 5.0 * look.place.y.clamp(-1.0, 1.0).asin() / 1.57);
    let apart = (cell - cell.floor() - 0.5) * Vec2::new((1.0 - look.place.y.powi(2)).sqrt(), 1.0);
    if apart.length() < 0.24 {
        look.color = Vec3::new(0.92, 0.86, 0.66);
    }
}

fn gloss(look: &mut Look) {
    look.glow += 0.9 * Vec3::splat(look.highlight.max(0.0).powi(90));
}

fn rim(look: &mut Look) {
    look.glow += 0.75 * (1.0 - look.facing).powi(3) * Vec3::new(0.25, 0.65, 1.0);
}
// ANCHOR_END: features

// ANCHOR: permutation
/// All features that the bits of `SET` name, compiled into one.
fn permutation<const SET: u32>(look: &mut Look) {
    if SET & 1 != 0 {
        warm(look);
    }
    if SET & 2 != 0 {
        stripes(look);
    }
    if SET & 4 != 0 {
        dots(look);
    }
    if SET & 8 != 0 {
        gloss(look);
    }
    if SET & 16 != 0 {
        rim(look);
    }
}
// ANCHOR_END: permutation

/// The 32 permutations.
macro_rules! permutations {
    ($($set:literal)*) => {
        [$(permutation::<$set> as fn(&mut Look)),*]
    };
}
const PERMUTATIONS: [fn(&mut Look); 1 << FEATURES] = permutations!(
    0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31
);

/// What an eye ray carries.
struct Seen {
    sampler: Sampler,
    depth: u32,
    color: Vec3,
}

/// How features come into the shaders of the spheres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Style {
    /// A hit group for each of 32 permutations.
    Permutations,
    /// One hit group that calls shaders.
    Callables,
}

/// The table's size: hit groups with a closest hit shader for spheres, and callable shaders.
pub(crate) struct Counts {
    pub(crate) groups: usize,
    pub(crate) callables: usize,
    /// Copies of features in all shaders together.
    pub(crate) features: u32,
}

// ANCHOR: decal
/// The parameters of a decal: a place on the pane, and what is printed there.
struct Decal {
    place: Vec2,
    color: Vec3,
    cover: f32,
}
// ANCHOR_END: decal

/// A smooth step from 0 to 1 about zero, so that prints have soft edges.
fn inside(distance: f32) -> f32 {
    (0.5 - 40.0 * distance).clamp(0.0, 1.0)
}

type TriangleHit<'a, R> = ClosestHit<'a, Barycentrics, R>;

/// Shades a surface of a look in daylight.
fn shade<R>(
    hit: &TriangleHit<'_, R>,
    seen: &mut Seen,
    normal: Vec3,
    color: Vec3,
    shadow_ray: RayType<Shadow>,
) {
    let light = daylight(hit.world_position(), normal, &seen.sampler, 4, |ray| {
        let mut shadow = Shadow::default();
        hit.trace_ray(shadow_ray, SHADOW_FLAGS, !PANE, ray, &mut shadow);
        shadow.lit
    });
    seen.color = color * light;
}

/// A sphere's look before features, and its normal.
fn plain<R>(hit: &TriangleHit<'_, R>) -> (Look, Vec3) {
    let view = -hit.world_ray().direction.normalize();
    let place = hit.object_ray().at(hit.t()).normalize_or(Vec3::Y);
    let normal = hit.object_to_world().transform_vector3(place).normalize_or(Vec3::Y);
    let halfway = (view + TOWARDS_SUN.normalize()).normalize_or(Vec3::Y);
    let color = Vec3::new(0.30, 0.42, 0.46);
    let (facing, highlight) = (normal.dot(view).clamp(0.0, 1.0), normal.dot(halfway));
    (Look { place, facing, highlight, color, glow: Vec3::ZERO }, normal)
}

/// 32 spheres, a wall and a floor, and a pane in front of them.
fn scene(style: Style) -> Result<Tlas> {
    let ball = shapes::sphere(Vec3::ZERO, 1.0, 5).into_primitive(0);
    let ball = TriangleMesh::new(&ball.positions, &ball.indices);
    let square =
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| Vec3::new(x, y, 0.0));
    let square = TriangleMesh::new(&square, &[[0, 1, 2], [0, 2, 3]]);
    let options = BuildOptions::default();
    let blases = vec![
        Arc::new(Blas::build(&[ball], &options)?),
        Arc::new(Blas::build(&[square], &options)?),
    ];
    let place = |x, y, z| Affine3A::from_translation(Vec3::new(x, y, z));
    let scaled = |x, y| Affine3A::from_scale(Vec3::new(x, y, 1.0));
    let wall = Instance {
        contribution: 2,
        ..Instance::new(1, place(0.0, 0.0, -0.62) * scaled(30.0, 30.0))
    };
    let pane_at = place(2.75, -1.15, 1.6) * Affine3A::from_rotation_y(-0.12) * scaled(1.75, 1.05);
    let pane = Instance { contribution: 4, mask: PANE, ..Instance::new(1, pane_at) };
    let mut instances = vec![wall, pane];
    for set in 0..1u32 << FEATURES {
        let (column, row) = ((set % 8) as f32, (set / 8) as f32);
        let at = place(1.15 * (column - 3.5), 1.15 * (1.5 - row), 0.0);
        let transform = at * Affine3A::from_scale(Vec3::splat(0.5));
        let contribution = if style == Style::Permutations { 6 + 2 * set } else { 6 };
        instances.push(Instance { id: set, contribution, ..Instance::new(0, transform) });
    }
    Ok(Tlas::build(blases, &instances, &options)?)
}

/// The spheres behind a printed pane.
pub(crate) fn render(style: Style, size: (u32, u32), samples: u32) -> Result<(RgbImage, Counts)> {
    let tlas = scene(style)?;
    let eye = Eye::look_at(Vec3::new(0.0, 0.0, 11.5), Vec3::new(0.0, -0.02, 0.0), 25.5);
    let texels = RwTexture::<Vec3>::new(size.0, size.1);

    let mut table = ShaderTable::new();
    let eye_ray = table.ray_type::<Seen>("eye", 0, 0, 0);
    let shadow_ray = table.ray_type::<Shadow>("shadow", 1, 0, 1);
    table.miss("sky", |miss, seen: &mut Seen| seen.color = sky(miss.world_ray().direction));
    table.miss("nothing in between", |_, shadow: &mut Shadow| shadow.lit = true);
    table.no_hit();
    table.no_hit();
    let wall = HitGroup::triangles("wall").closest_hit(|hit, seen: &mut Seen| {
        shade(hit, seen, Vec3::Z, Vec3::splat(0.72), shadow_ray);
    });
    table.hit(&wall, ());
    table.no_hit();

    // ANCHOR: decals
    let decals: Vec<CallableId<Decal>> = vec![
        table.callable(|_, decal: &mut Decal| {
            decal.color = Vec3::new(0.85, 0.10, 0.12);
            let place = decal.place - Vec2::new(-0.95, 0.0);
            decal.cover = inside((place.length() - 0.55).abs() - 0.13);
        }),
        table.callable(|_, decal: &mut Decal| {
            decal.color = Vec3::new(0.95, 0.72, 0.10);
            let place = decal.place - Vec2::new(0.75, 0.0);
            let turn = place.y.atan2(place.x) - std::f32::consts::FRAC_PI_2;
            let point = (2.5 * turn).cos().abs();
            decal.cover = inside(place.length() - 0.34 - 0.36 * point.powi(3));
        }),
        table.callable(|_, decal: &mut Decal| {
            decal.color = Vec3::splat(0.95);
            let frame = (decal.place.abs() - Vec2::new(1.65, 0.95)).max_element().abs() - 0.03;
            decal.cover = inside(frame);
        }),
    ];
    let pane = HitGroup::triangles("pane").closest_hit(|hit, seen: &mut Seen| {
        // What is behind the pane, a little darker.
        let ray = Ray { t_min: hit.t(), ..*hit.world_ray() };
        let mut behind = Seen { depth: seen.depth + 1, color: Vec3::ZERO, ..*seen };
        hit.trace_ray(eye_ray, RayFlags::empty(), 0xFF, &ray, &mut behind);
        seen.color = behind.color * Vec3::new(0.80, 0.88, 0.86);
        // What is printed on it, one decal over the other.
        let place = hit.object_ray().at(hit.t()).xy() * Vec2::new(1.75, 1.05);
        for &shader in hit.record() {
            let mut decal = Decal { place, color: Vec3::ZERO, cover: 0.0 };
            hit.call_shader(shader, &mut decal);
            seen.color = seen.color.lerp(decal.color, decal.cover);
        }
    });
    table.hit(&pane, decals);
    table.no_hit();
    // ANCHOR_END: decals

    let counts = match style {
        Style::Permutations => {
            // ANCHOR: many
            for features in PERMUTATIONS {
                let group = HitGroup::triangles("permutation").closest_hit(
                    move |hit: &TriangleHit<'_, ()>, seen: &mut Seen| {
                        let (mut look, normal) = plain(hit);
                        features(&mut look);
                        shade(hit, seen, normal, look.color, shadow_ray);
                        seen.color += look.glow;
                    },
                );
                table.hit(&group, ());
                table.no_hit();
            }
            let features = (0..1u32 << FEATURES).map(u32::count_ones).sum();
            Counts { groups: PERMUTATIONS.len(), callables: 0, features }
            // ANCHOR_END: many
        }
        Style::Callables => {
            // ANCHOR: one
            let features: Vec<CallableId<Look>> = [warm, stripes, dots, gloss, rim]
                .map(|feature: fn(&mut Look)| table.callable(move |_, look| feature(look)))
                .to_vec();
            let group = HitGroup::triangles("any features").closest_hit(
                move |hit: &TriangleHit<'_, ()>, seen: &mut Seen| {
                    let (mut look, normal) = plain(hit);
                    for (bit, &feature) in features.iter().enumerate() {
                        if hit.instance_id() & 1 << bit != 0 {
                            hit.call_shader(feature, &mut look);
                        }
                    }
                    shade(hit, seen, normal, look.color, shadow_ray);
                    seen.color += look.glow;
                },
            );
            table.hit(&group, ());
            table.no_hit();
            Counts { groups: 1, callables: FEATURES, features: FEATURES as u32 }
            // ANCHOR_END: one
        }
    };

    let generate = table.ray_generation(|launch| {
        let mut sum = Vec3::ZERO;
        for sample in 0..samples {
            let (ray, sampler) = eye.ray(launch.launch_index(), launch.launch_dimensions(), sample);
            let mut seen = Seen { sampler, depth: 0, color: Vec3::ZERO };
            launch.trace_ray(eye_ray, RayFlags::empty(), 0xFF, &ray, &mut seen);
            sum += seen.color;
        }
        texels.store(launch.launch_index().truncate(), sum / samples as f32);
    });
    table.build(3)?.dispatch_rays(&tlas, generate, size.0, size.1, 1)?;
    Ok((picture(&texels, size), counts))
}

fn main() -> Result<()> {
    let (path, size) = arguments("callables", (768, 400))?;
    // ANCHOR: compare
    let (many, permutations) = render(Style::Permutations, size, 32)?;
    let (one, callables) = render(Style::Callables, size, 32)?;
    for counts in [permutations, callables] {
        let Counts { groups, callables, features } = counts;
        common::say(format!("{groups} + {callables} shaders with {features} copies of features"));
    }
    common::say(format!("the pictures are the same: {}", many.pixels == one.pixels));
    // ANCHOR_END: compare
    save(&one, path)
}
