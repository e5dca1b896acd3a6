//! Leaves cut out of cards by any hit shaders, and fewer calls of them with tighter cards.

use std::sync::Arc;

use rayburst::{
    glam::Vec3Swizzles,
    math::{Sampler, hash::Rng},
    pipeline::{AnyHit, ClosestHit, RayType},
    prelude::*,
};

mod common;

use common::{
    Eye, Result, arguments,
    daylight::{SHADOW_FLAGS, Shadow, daylight, sky},
    picture, save,
};

/// How many leaves there are.
const LEAVES: u32 = 1600;

// ANCHOR: leaf
/// Half the width of a leaf at a height from 0 to 1; it is cut out of the square from (-½, 0) to (½, 1).
fn half_width(y: f32) -> f32 {
    let teeth = 0.012 * (60.0 * y).sin().abs();
    let blade = 0.62 * (y - 0.12).max(0.0).powf(0.6) * (1.0 - y).max(0.0) + teeth;
    if (0.0..0.985).contains(&y) { blade.max(0.012) } else { 0.0 }
}

/// Whether a point of the card is leaf.
fn is_leaf(p: Vec2) -> bool {
    p.x.abs() < half_width(p.y)
}
// ANCHOR_END: leaf

// ANCHOR: cards
/// What leaves are cut out of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Card {
    /// A square.
    Square,
    /// A polygon that follows the leaf.
    Tight,
}

/// A card around a leaf in the plane z = 0, as a fan of triangles.
fn card(card: Card) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let outline: &[[f32; 2]] = match card {
        Card::Square => &[[-0.5, 0.0], [0.5, 0.0], [0.5, 1.0], [-0.5, 1.0]],
        Card::Tight => &[
            [-0.02, 0.0],
            [0.02, 0.0],
            [0.155, 0.2],
            [0.2, 0.36],
            [0.2, 0.52],
            [0.145, 0.74],
            [0.02, 1.0],
            [-0.02, 1.0],
            [-0.145, 0.74],
            [-0.2, 0.52],
            [-0.2, 0.36],
            [-0.155, 0.2],
        ],
    };
    let corners = outline.iter().map(|&[x, y]| Vec3::new(x, y, 0.0)).collect();
    let triangles = (2..outline.len() as u32).map(|i| [0, i - 1, i]).collect();
    (corners, triangles)
}
// ANCHOR_END: cards

/// What an eye ray carries.
struct Seen {
    sampler: Sampler,
    color: Vec3,
}

// ANCHOR: any_hit
/// Lets rays pass beside the leaf, and counts how often it is asked.
fn cut_out(hit: &AnyHit<'_, Barycentrics, Vec3>, calls: &RwBuffer<u32>) -> AnyHitResult {
    calls.atomic_add(0, 1);
    let place = hit.object_ray().at(hit.t()).xy();
    if is_leaf(place) { hit.accept_hit() } else { hit.ignore_hit() }
}
// ANCHOR_END: any_hit

/// Daylight on a surface of a color; leaves let some through from behind.
fn shade(
    hit: &ClosestHit<'_, Barycentrics, Vec3>,
    seen: &mut Seen,
    shadow_ray: RayType<Shadow>,
    is_thin: bool,
) {
    let inverse = hit.world_to_object().matrix3.transpose();
    let mut normal = (inverse * Vec3::Z).normalize();
    if normal.dot(hit.world_ray().direction) > 0.0 {
        normal = -normal;
    }
    let light = |normal: Vec3, dimension: u32| {
        daylight(hit.world_position(), normal, &seen.sampler, dimension, |ray| {
            let mut shadow = Shadow::default();
            hit.trace_ray(shadow_ray, SHADOW_FLAGS, 0xFF, ray, &mut shadow);
            shadow.lit
        })
    };
    let mut color = *hit.record();
    let front = light(normal, 4);
    if !is_thin {
        seen.color = color * front;
        return;
    }
    let place = hit.object_ray().at(hit.t()).xy();
    let tint = hit.instance_id() as f32 / LEAVES as f32;
    color = color.lerp(Vec3::new(0.50, 0.46, 0.08), 0.7 * tint * tint);
    let vein =
        place.x.abs() < 0.012 || ((place.y - 0.8 * place.x.abs()) * 14.0).rem_euclid(1.0) < 0.1;
    if vein {
        color *= 1.35;
    }
    let through = Vec3::new(0.75, 1.0, 0.25) * light(-normal, 8);
    seen.color = color * (0.75 * front + 0.45 * through);
}

/// The plant: leaves around a centre above the ground, each an instance of one card.
fn plant(card_kind: Card) -> Result<Tlas> {
    let (corners, triangles) = card(card_kind);
    let leaf = TriangleMesh { opaque: false, ..TriangleMesh::new(&corners, &triangles) };
    let ground = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
        .map(|(x, y)| Vec3::new(60.0 * x, 60.0 * y, 0.0));
    let ground = TriangleMesh::new(&ground, &[[0, 1, 2], [0, 2, 3]]);
    let options = BuildOptions::default();
    let blases = vec![
        Arc::new(Blas::build(&[leaf], &options)?),
        Arc::new(Blas::build(&[ground], &options)?),
    ];
    let flat = Affine3A::from_rotation_x(-std::f32::consts::FRAC_PI_2);
    let mut instances = vec![Instance { contribution: 2, ..Instance::new(1, flat) }];
    let mut rng = Rng::new(7);
    for id in 0..LEAVES {
        // Leaves hang outwards from a ball, the golden angle apart.
        let y = 1.0 - 1.75 * (id as f32 + 0.5) / LEAVES as f32;
        let angle = 2.399_963 * id as f32;
        let side = (1.0 - y * y).sqrt();
        let out = Vec3::new(side * angle.cos(), y, side * angle.sin());
        let radius = rng.range(0.3, 1.0);
        let at = Vec3::new(0.0, 1.45, 0.0) + radius * out * Vec3::new(1.25, 1.0, 1.25);
        let along = (out + 0.5 * (rng.vec3() - 0.5) - 0.55 * Vec3::Y).normalize_or(Vec3::X);
        let normal = along.cross(rng.vec3() - 0.5).normalize_or(Vec3::Z);
        let normal = (normal + 1.2 * Vec3::Y.reject_from(along)).normalize_or(Vec3::Z);
        let size = rng.range(0.34, 0.55);
        let transform = Affine3A::from_cols(
            (size * along.cross(normal)).into(),
            (size * along).into(),
            (size * normal).into(),
            at.into(),
        );
        instances.push(Instance { id, ..Instance::new(0, transform) });
    }
    Ok(Tlas::build(blases, &instances, &options)?)
}

/// A plant and its shadow, and how often any hit shaders ran.
pub(crate) fn render(card: Card, size: (u32, u32), samples: u32) -> Result<(RgbImage, u32)> {
    let tlas = plant(card)?;
    let eye = Eye::look_at(Vec3::new(0.6, 2.6, 6.6), Vec3::new(0.25, 1.2, 0.0), 34.0);
    let texels = RwTexture::<Vec3>::new(size.0, size.1);
    let calls = RwBuffer::<u32>::new(1);

    let mut table = ShaderTable::new();
    let eye_ray = table.ray_type::<Seen>("eye", 0, 0, 0);
    let shadow_ray = table.ray_type::<Shadow>("shadow", 1, 0, 1);
    table.miss("sky", |miss, seen: &mut Seen| seen.color = sky(miss.world_ray().direction));
    table.miss("nothing in between", |_, shadow: &mut Shadow| shadow.lit = true);
    // ANCHOR: groups
    let leaf = HitGroup::triangles("leaf")
        .closest_hit(|hit, seen: &mut Seen| shade(hit, seen, shadow_ray, true))
        .any_hit(|hit, _: &mut Seen| cut_out(hit, &calls));
    let leaf_shadow =
        HitGroup::triangles("leaf's shadow").any_hit(|hit, _: &mut Shadow| cut_out(hit, &calls));
    table.hit(&leaf, Vec3::new(0.16, 0.34, 0.06));
    table.hit(&leaf_shadow, Vec3::ZERO);
    // ANCHOR_END: groups
    let ground = HitGroup::triangles("ground")
        .closest_hit(|hit, seen: &mut Seen| shade(hit, seen, shadow_ray, false));
    table.hit(&ground, Vec3::new(0.62, 0.57, 0.50));
    table.no_hit();

    let generate = table.ray_generation(|launch| {
        let mut sum = Vec3::ZERO;
        for sample in 0..samples {
            let (ray, sampler) = eye.ray(launch.launch_index(), launch.launch_dimensions(), sample);
            let mut seen = Seen { sampler, color: Vec3::ZERO };
            launch.trace_ray(eye_ray, RayFlags::empty(), 0xFF, &ray, &mut seen);
            sum += seen.color;
        }
        texels.store(launch.launch_index().truncate(), sum / samples as f32);
    });
    table.build(2)?.dispatch_rays(&tlas, generate, size.0, size.1, 1)?;
    Ok((picture(&texels, size), calls.load(0)))
}

fn main() -> Result<()> {
    let (path, size) = arguments("cutouts", (640, 480))?;
    // ANCHOR: compare
    let (square, square_calls) = render(Card::Square, size, 16)?;
    let (tight, tight_calls) = render(Card::Tight, size, 16)?;
    let apart = |(a, b): (&Vec3, &Vec3)| (*a - *b).abs().max_element() > 1e-3;
    let different = square.pixels.iter().zip(&tight.pixels).filter(|pair| apart(*pair)).count();
    common::say(format!("any hit shaders ran {square_calls} times with square cards"));
    common::say(format!("and {tight_calls} times with tight ones; {different} pixels differ"));
    // ANCHOR_END: compare
    save(&tight, path)
}
