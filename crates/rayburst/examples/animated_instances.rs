//! Dominoes that fall: frames of one structure, of which only the top level is built anew.

use std::{sync::Arc, time::Instant};

use rayburst::{math::Sampler, prelude::*, scene::shapes};

mod common;

use common::{
    Eye, Result, arguments, contact_sheet,
    daylight::{SHADOW_FLAGS, Shadow, daylight, sky},
    normal_of, picture, save,
};

/// How many dominoes there are.
pub(crate) const DOMINOES: u32 = 110;
/// Height, width and thickness of one.
const SIZE: Vec3 = Vec3::new(0.42, 0.8, 0.11);

// ANCHOR: move
/// Where a domino is at a time from 0 to 1: on a spiral, and the more the later tilted to the next one.
fn transform(number: u32, time: f32) -> Affine3A {
    let at = |number: f32| {
        let angle = (2.0 * number + 16.0).sqrt();
        0.245 * angle * Vec3::new(angle.cos(), 0.0, angle.sin())
    };
    let place = at(number as f32);
    let ahead = (at(number as f32 + 0.5) - place).normalize_or(Vec3::Z);
    let begin = 0.92 * number as f32 / DOMINOES as f32;
    let fallen = ((time - begin) / 0.06).clamp(0.0, 1.0);
    let tilt = 1.18 * fallen * fallen;
    let turn = Affine3A::from_cols(
        Vec3::Y.cross(ahead).into(),
        Vec3::Y.into(),
        ahead.into(),
        place.into(),
    );
    // It turns about its front edge at the floor.
    let edge = Vec3::new(0.0, 0.0, 0.5 * SIZE.z);
    turn * Affine3A::from_translation(edge)
        * Affine3A::from_rotation_x(tilt)
        * Affine3A::from_translation(-edge)
}

/// All instances at a time: the floor, and the dominoes.
fn instances(time: f32) -> Vec<Instance> {
    let floor = Instance { id: DOMINOES, ..Instance::new(1, Affine3A::IDENTITY) };
    let domino = |id| Instance { id, ..Instance::new(0, transform(id, time)) };
    std::iter::once(floor).chain((0..DOMINOES).map(domino)).collect()
}
// ANCHOR_END: move

/// The bottom level: a domino and the floor.
fn bottom() -> Result<Vec<Arc<Blas>>> {
    let mut domino = shapes::Shape::default();
    let half = 0.5 * SIZE;
    domino.add_box(Vec3::new(-half.x, 0.0, -half.z), Vec3::new(half.x, SIZE.y, half.z));
    let mut floor = shapes::Shape::default();
    let corners = [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)];
    floor.add_quad(corners.map(|(x, z)| Vec3::new(60.0 * x, 0.0, 60.0 * z)));
    let build = |shape: shapes::Shape| {
        let primitive = shape.into_primitive(0);
        let mesh = TriangleMesh::new(&primitive.positions, &primitive.indices);
        Blas::build(&[mesh], &BuildOptions::default()).map(Arc::new)
    };
    Ok(vec![build(domino)?, build(floor)?])
}

/// What an eye ray carries.
struct Seen {
    sampler: Sampler,
    color: Vec3,
}

/// So many frames, how long the bottom level took to build, and how long each top level, in seconds.
pub(crate) fn render(
    frames: u32,
    size: (u32, u32),
    samples: u32,
) -> Result<(Vec<RgbImage>, f64, Vec<f64>)> {
    let begin = Instant::now();
    let bottom = bottom()?;
    let bottom_seconds = begin.elapsed().as_secs_f64();
    let eye = Eye::look_at(Vec3::new(0.0, 6.8, 8.6), Vec3::new(0.0, 0.0, 0.25), 38.0);
    let texels = RwTexture::<Vec3>::new(size.0, size.1);

    let mut table = ShaderTable::new();
    let eye_ray = table.ray_type::<Seen>("eye", 0, 0, 0);
    let shadow_ray = table.ray_type::<Shadow>("shadow", 1, 0, 1);
    table.miss("sky", |miss, seen: &mut Seen| seen.color = sky(miss.world_ray().direction));
    table.miss("nothing in between", |_, shadow: &mut Shadow| shadow.lit = true);
    let group = HitGroup::triangles("surface").closest_hit(|hit, seen: &mut Seen| {
        let color = if hit.instance_id() == DOMINOES {
            Vec3::new(0.66, 0.63, 0.58)
        } else {
            let hue = hit.instance_id() as f32 / DOMINOES as f32 * 5.2;
            0.48 + 0.34 * Vec3::new(hue.cos(), (hue - 2.1).cos(), (hue + 2.1).cos())
        };
        let normal = normal_of(hit);
        let light = daylight(hit.world_position(), normal, &seen.sampler, 4, |ray| {
            let mut shadow = Shadow::default();
            hit.trace_ray(shadow_ray, SHADOW_FLAGS, 0xFF, ray, &mut shadow);
            shadow.lit
        });
        seen.color = color * light;
    });
    table.hit(&group, ());
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
    let pipeline = table.build(2)?;

    // ANCHOR: frames
    let (mut pictures, mut top_seconds) = (Vec::new(), Vec::new());
    for frame in 0..frames {
        let time = frame as f32 / (frames - 1).max(1) as f32;
        let begin = Instant::now();
        let tlas = Tlas::build(bottom.clone(), &instances(time), &BuildOptions::default())?;
        top_seconds.push(begin.elapsed().as_secs_f64());
        pipeline.dispatch_rays(&tlas, generate, size.0, size.1, 1)?;
        pictures.push(picture(&texels, size));
    }
    // ANCHOR_END: frames
    Ok((pictures, bottom_seconds, top_seconds))
}

fn main() -> Result<()> {
    let (path, size) = arguments("animated_instances", (960, 720))?;
    let (frames, bottom, top) = render(9, (size.0 / 3, size.1 / 3), 32)?;
    common::say(format!("bottom level, once: {:.3} ms", 1e3 * bottom));
    let mean = top.iter().sum::<f64>() / top.len() as f64;
    common::say(format!("top level of {DOMINOES} dominoes, each frame: {:.3} ms", 1e3 * mean));
    save(&contact_sheet(&frames, 3), path)
}
