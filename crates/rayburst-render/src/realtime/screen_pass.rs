//! Effects of a frame in screen space: what rasterising engines do in place of rays, and what rays are
//! measured against.

use rayburst_image::Plane3;
use rayburst_math::glam::Vec3;
use rayon::prelude::*;

use super::{
    gbuffer::GBuffer,
    indirect::reflected_ray,
    pass::FrameContext,
    quads::{QUAD_BAND, Quads, asking},
    signals::{Lobe, Signals},
    ssao::{ScreenOcclusion, screen_occlusion},
    ssr::{
        ScreenReflections, ScreenReflectionsInput, ScreenReflectionsSettings, screen_reflections,
    },
};
use crate::Result;

/// How thick everything is taken to be behind what is seen, as a part of the scene's diagonal.
const THICKNESS: f32 = 0.01;

/// Pixels a step along the screen.
const STRIDE: u32 = 4;

/// What reflections in screen space need, kept from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct ScreenWork {
    origin: Plane3,
    direction: Plane3,
    throughput: Plane3,
    found: ScreenReflections,
}

/// Ambient occlusion from the depth buffer.
pub(crate) fn occlusion(
    frame: &FrameContext<'_>,
    gbuffer: &GBuffer,
    radius: f32,
    signals: &mut Signals,
) -> Result<()> {
    let settings = ScreenOcclusion {
        radius,
        seed: frame.settings.seed,
        frame: frame.number,
        ..ScreenOcclusion::default()
    };
    screen_occlusion(
        &gbuffer.depth,
        &gbuffer.geometric_normal,
        frame.view,
        &settings,
        &mut signals.ambient_occlusion,
    )
}

/// One reflection a block of 2×2 pixels, looked for in the picture of the frame before; where it is not on
/// the screen, the environment takes its place.
pub(crate) fn reflections(
    frame: &FrameContext<'_>,
    gbuffer: &GBuffer,
    picture: &Plane3,
    diagonal: f32,
    work: &mut ScreenWork,
    quads: &mut Quads,
) -> Result<()> {
    let size = quads.size();
    let ScreenWork { origin, direction, throughput, found } = work;
    for planes in [&mut *origin, &mut *direction, &mut *throughput] {
        if planes.size() != size {
            *planes = Plane3::new(size.0, size.1)?;
        }
    }
    let bands: Vec<_> = origin
        .bands_mut(QUAD_BAND)
        .zip(direction.bands_mut(QUAD_BAND))
        .zip(throughput.bands_mut(QUAD_BAND))
        .collect();
    let rows: Vec<_> = quads.rows();
    rows.into_par_iter().zip(bands).for_each(
        |(mut rows, ((mut origin, mut direction), mut factor))| {
            for block in rows.blocks(size.0) {
                let (x, y) = block;
                rows.set(Lobe::Glossy, block, Vec3::ZERO, 0.0);
                let ray = asking(rows.chosen.get(x, y), block).and_then(|at| {
                    let surface =
                        gbuffer.surface_at(frame.scene, frame.view, &frame.shading, at)?;
                    reflected_ray(frame, &surface, at)
                });
                direction.set(x, y, ray.map_or(Vec3::ZERO, |(ray, _)| ray.direction));
                origin.set(x, y, ray.map_or(Vec3::ZERO, |(ray, _)| ray.origin));
                factor.set(x, y, ray.map_or(Vec3::ZERO, |(_, throughput)| throughput));
            }
        },
    );
    let input = ScreenReflectionsInput {
        depth: &gbuffer.depth,
        colour: if picture.size() == gbuffer.size() { picture } else { &gbuffer.emitted },
        view: frame.view,
        origin,
        direction,
    };
    let settings = ScreenReflectionsSettings {
        thickness: THICKNESS * diagonal,
        distance: diagonal,
        stride: STRIDE,
        ..ScreenReflectionsSettings::default()
    };
    screen_reflections(&input, &settings, found)?;
    quads.rows().into_par_iter().for_each(|mut rows| {
        for (x, y) in rows.blocks(size.0) {
            let (towards, factor) = (direction.get(x, y), throughput.get(x, y));
            if towards == Vec3::ZERO {
                continue;
            }
            let (radiance, distance) = if found.validity.get(x, y) > 0.0 {
                (found.colour.get(x, y), found.distance.get(x, y))
            } else {
                let lights = &frame.lights.all;
                (lights.environment_radiance(frame.scene, towards), f32::INFINITY)
            };
            rows.set(Lobe::Glossy, (x, y), factor * radiance, distance);
        }
    });
    Ok(())
}
