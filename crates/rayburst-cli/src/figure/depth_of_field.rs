//! Figure 26.24: depth of field by a thin lens. What lies off the plane in focus is blurred to a
//! circle of confusion of diameter `A |z − F| / z · h / (2 F tan(φ/2))` pixels at depth z, for a lens
//! of diameter A, the plane in focus at F and h rows of pixels.

use rayburst::{
    glam::Vec2,
    image::exposure::auto_exposure,
    render::{IntegratorKind, RenderSettings, Renderer},
    scene::{Camera, Projection},
};

use super::{
    Drawing,
    canvas::{Anchor, Canvas, Pen, ink},
    rendering,
};
use crate::error::{CliError, Result};

const SIZE: (u32, u32) = (800, 500);
const SPP: u32 = 96;
/// Corners of the graph on the page.
const GRAPH: (Vec2, Vec2) = (Vec2::new(484.0, 86.0), Vec2::new(764.0, 296.0));

/// Renders the scene, and measures the blur of the camera's own rays.
pub(super) fn draw() -> Result<Drawing> {
    let (flat, camera) = rendering::scene("dof")?;
    let Projection::Perspective { fov } = camera.projection else {
        return Err(CliError::failed("the scene's camera has no lens"));
    };
    let settings = RenderSettings {
        size: SIZE,
        spp: SPP,
        integrator: IntegratorKind::Path,
        ..RenderSettings::default()
    };
    let mut renderer = Renderer::new(flat, camera, settings)?;
    rendering::finish(&mut renderer, 0, SPP)?;
    let picture = renderer.picture();

    let depths: Vec<f32> = (0..24).map(|i| camera.focus * (0.4 + 0.1 * i as f32)).collect();
    let measured: Vec<f32> = depths.iter().map(|&z| blur(&camera, z)).collect();
    let formula: Vec<f64> = depths.iter().map(|&z| circle(&camera, fov, z)).collect();
    let worst =
        measured.iter().zip(&formula).map(|(m, f)| (f64::from(*m) - f).abs()).fold(0.0, f64::max);
    let largest = formula.iter().copied().fold(0.0, f64::max);

    let mut canvas = Canvas::new(790, 372)?;
    canvas.heading(
        "Figure 26.24 · depth of field",
        "A thin lens: each sample starts at another point of it. Right: diameter of the blur over depth, in pixels.",
    );
    let image = rendering::develop(&picture, auto_exposure(&picture));
    canvas.picture(Vec2::new(24.0, 66.0), &image, 0.5);
    graph(&mut canvas, &camera, &depths, &measured, &formula);
    canvas.footing(&format!(
        "Blur of rays and formula of the circle of confusion agree within {worst:.4} pixels (largest circle {largest:.1})."
    ));
    let numbers = vec![
        ("lens diameter", format!("{:.4}", camera.aperture)),
        ("distance in focus", format!("{:.4}", camera.focus)),
        ("largest circle of confusion measured", format!("{largest:.3} pixels")),
        ("largest |measured − formula|", format!("{worst:.2e} pixels")),
    ];
    Ok(Drawing { picture: canvas.into_image(), numbers })
}

/// The formula.
fn circle(camera: &Camera, fov: f32, z: f32) -> f64 {
    let (z, focus) = (f64::from(z), f64::from(camera.focus));
    let pixels = f64::from(SIZE.1) / (2.0 * focus * (0.5 * f64::from(fov)).tan());
    f64::from(camera.aperture) * (z - focus).abs() / z * pixels
}

/// Diameter in pixels of the disk in which the rays of the middle pixel, one from each point of the
/// lens's rim, meet the plane at depth `z`.
fn blur(camera: &Camera, z: f32) -> f32 {
    let middle = 0.5 * Vec2::new(SIZE.0 as f32, SIZE.1 as f32);
    let v = camera.frame()[2];
    let sharp = Camera { aperture: 0.0, ..*camera };
    let ends: Vec<Vec2> = rim()
        .filter_map(|lens| {
            let (ray, _) = camera.ray(middle, SIZE, lens);
            let t = (z - (ray.origin - camera.eye()).dot(v)) / ray.direction.dot(v);
            sharp.project(ray.at(t), SIZE).map(|(pixel, _)| pixel)
        })
        .collect();
    let pairs = ends.iter().flat_map(|a| ends.iter().map(move |b| a.distance(*b)));
    pairs.fold(0.0, f32::max)
}

/// Lens samples on the edge of the unit square, which the lens has for its rim.
fn rim() -> impl Iterator<Item = Vec2> {
    (0..64).map(|i| {
        let along = (i % 16) as f32 / 16.0;
        match i / 16 {
            0 => Vec2::new(along, 0.0),
            1 => Vec2::new(1.0, along),
            2 => Vec2::new(1.0 - along, 1.0),
            _ => Vec2::new(0.0, 1.0 - along),
        }
    })
}

fn graph(canvas: &mut Canvas, camera: &Camera, depths: &[f32], dots: &[f32], line: &[f64]) {
    let (low, high) = GRAPH;
    let deepest = depths.iter().copied().fold(0.0, f32::max);
    let largest = line.iter().copied().fold(1.0, f64::max) as f32;
    let at = |z: f32, c: f32| {
        Vec2::new(
            low.x + (high.x - low.x) * z / deepest,
            high.y - (high.y - low.y) * (c / largest).min(1.0),
        )
    };
    canvas.line(Vec2::new(low.x, high.y), high, Pen::new(ink::BLACK, 1.2));
    canvas.line(Vec2::new(low.x, high.y), low, Pen::new(ink::BLACK, 1.2));
    let focus = at(camera.focus, 0.0);
    canvas.line(focus, Vec2::new(focus.x, low.y), Pen::dashed(ink::GREY, 1.0));
    canvas.label(focus + Vec2::new(0.0, 16.0), "in focus", ink::GREY, Anchor::Middle);
    canvas.label(high + Vec2::new(0.0, 16.0), "depth", ink::BLACK, Anchor::End);
    canvas.label(
        low + Vec2::new(4.0, -8.0),
        &format!("{largest:.0} pixels"),
        ink::BLACK,
        Anchor::Start,
    );
    let curve: Vec<Vec2> = depths.iter().zip(line).map(|(&z, &c)| at(z, c as f32)).collect();
    canvas.polyline(&curve, Pen::new(ink::BLUE, 2.0));
    for (&z, &c) in depths.iter().zip(dots).filter(|(_, c)| c.is_finite()) {
        canvas.circle(at(z, c), 3.0, ink::ORANGE, None);
    }
    let key = Vec2::new(low.x + 130.0, low.y + 14.0);
    canvas.line(key, key + Vec2::new(22.0, 0.0), Pen::new(ink::BLUE, 2.0));
    canvas.label(key + Vec2::new(30.0, 4.5), "formula", ink::BLACK, Anchor::Start);
    canvas.circle(key + Vec2::new(11.0, 20.0), 3.0, ink::ORANGE, None);
    canvas.label(key + Vec2::new(30.0, 24.5), "the camera's rays", ink::BLACK, Anchor::Start);
}
