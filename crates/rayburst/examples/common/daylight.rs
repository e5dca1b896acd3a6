//! Daylight for programs that paint with plain colours: a sun and a sky.
#![allow(dead_code, reason = "not every program stands in daylight")]

use rayburst::{
    math::{Frame, Sampler, warp},
    prelude::*,
};

/// The sun's direction and half the angle under which it is seen, radians: larger than the real one, for
/// soft shadows.
pub(crate) const TOWARDS_SUN: Vec3 = Vec3::new(-0.52, 0.72, 0.46);
const SUN_RADIUS: f32 = 0.035;
const SUN: Vec3 = Vec3::new(0.78, 0.70, 0.56);

/// What a shadow ray carries; its miss shader says that there is light.
#[derive(Default)]
pub(crate) struct Shadow {
    pub(crate) lit: bool,
}

/// The flags of a shadow ray: any hit will do, and nobody asks what it is.
pub(crate) const SHADOW_FLAGS: RayFlags =
    RayFlags::ACCEPT_FIRST_HIT_AND_END_SEARCH.union(RayFlags::SKIP_CLOSEST_HIT_SHADER);

/// What is seen of the sky in a direction.
pub(crate) fn sky(direction: Vec3) -> Vec3 {
    let up = direction.normalize().y.clamp(0.0, 1.0).sqrt();
    Vec3::new(0.70, 0.77, 0.84).lerp(Vec3::new(0.20, 0.36, 0.62), up)
}

/// The light that a white surface sends back: from a point of the sun, and from a random direction of the
/// sky, each if `is_lit` says of a shadow ray that nothing is in its way. Takes four random numbers from
/// `dimension` on.
pub(crate) fn daylight(
    position: Vec3,
    normal: Vec3,
    sampler: &Sampler,
    dimension: u32,
    is_lit: impl Fn(&Ray) -> bool,
) -> Vec3 {
    let shadow = |direction| Ray::with_interval(position, direction, 1e-3, f32::INFINITY);
    let disk = SUN_RADIUS * warp::concentric_disk(sampler.get_2d(dimension));
    let sun = Frame::from_normal(TOWARDS_SUN.normalize()).to_world(disk.extend(1.0)).normalize();
    let up = warp::cosine_hemisphere(sampler.get_2d(dimension + 2));
    let upwards = Frame::from_normal(normal).to_world(up);
    let mut light = Vec3::ZERO;
    if sun.dot(normal) > 0.0 && is_lit(&shadow(sun)) {
        light += SUN * sun.dot(normal);
    }
    if is_lit(&shadow(upwards)) {
        light += 0.8 * sky(upwards);
    }
    light
}
