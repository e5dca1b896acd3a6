//! Figure 26.23: texture filtering of rays. A reflective hemisphere in a room of checkerboards, with one
//! ray through the centre of each pixel: textures at their finest level, by ray cones and by ray
//! differentials, beside the truth, which is the mean of a thousand rays a pixel.

use std::{sync::Arc, time::Instant};

use rayburst::{
    glam::Vec2,
    image::{
        FilterKind, Rgb8Image, RgbImage, ToneMap,
        exposure::auto_exposure,
        metrics::{Metric, StoredAs, compare},
        quantise::{Dither, to_srgb8},
    },
    math::{RayCone, RayDifferential},
    render::{IntegratorKind, RenderSettings, Renderer},
    scene::{Camera, FlatScene, TextureLod},
};

use super::{
    Drawing,
    canvas::{Anchor, Canvas, Pen, Style, ink},
    rendering,
};
use crate::error::Result;

const SIZE: (u32, u32) = (384, 288);
/// Samples of the truth.
const TRUTH: u32 = 1024;
/// Samples that are timed, and how often; the fastest counts.
const TIMED: u32 = 8;
const REPEATS: u32 = 3;
/// A part of the picture that is shown larger: corner and size in pixels, and points a pixel.
const PART: ((u32, u32), (u32, u32)) = ((238, 108), (96, 72));
const MAGNIFIED: f32 = 2.0;
const MARGIN: f32 = 24.0;
const GAP: f32 = 8.0;

/// What was measured of a way to filter.
#[derive(Clone, Copy, Debug)]
struct Measured {
    /// Of the developed picture, linear and 0 to 1.
    rmse: f64,
    flip: f64,
    nanoseconds: f64,
    bytes: usize,
}

fn label(lod: TextureLod) -> &'static str {
    match lod {
        TextureLod::Mip0 => "mip 0",
        TextureLod::Cones => "ray cones",
        TextureLod::Differentials => "ray differentials",
    }
}

fn bytes(lod: TextureLod) -> usize {
    match lod {
        TextureLod::Mip0 => 0,
        TextureLod::Cones => size_of::<RayCone>(),
        TextureLod::Differentials => size_of::<RayDifferential>(),
    }
}

/// Renders the four pictures and compares them.
pub(super) fn draw() -> Result<Drawing> {
    let (flat, camera) = rendering::scene("hemisphere-room")?;
    let truth = render(&flat, camera, TextureLod::Mip0, None, TRUTH)?.0;
    let stops = auto_exposure(&truth);
    let shown = |picture: &RgbImage| ToneMap::default().apply_image(picture, stops);
    let truth = shown(&truth);
    let mut pictures = Vec::new();
    let mut measured = Vec::new();
    for (_, lod) in TextureLod::ALL {
        let picture = shown(&render(&flat, camera, lod, CENTRE, 1)?.0);
        let error = |metric| compare(metric, &truth, &picture, StoredAs::Linear);
        measured.push(Measured {
            rmse: error(Metric::Rmse)?.value,
            flip: error(Metric::Flip)?.value,
            nanoseconds: f64::INFINITY,
            bytes: bytes(lod),
        });
        pictures.push(picture);
    }
    for _ in 0..REPEATS {
        for ((_, lod), measured) in TextureLod::ALL.into_iter().zip(&mut measured) {
            let (_, time) = render(&flat, camera, lod, CENTRE, TIMED)?;
            measured.nanoseconds = measured.nanoseconds.min(time);
        }
    }
    pictures.push(truth);
    Ok(Drawing { picture: page(&pictures, &measured)?, numbers: numbers(&measured) })
}

/// The radius of a filter that is the centre of the pixel.
const CENTRE: Option<f32> = Some(1e-3);

/// A picture without noise, and nanoseconds of a thread for each of its rays.
fn render(
    flat: &Arc<FlatScene>,
    camera: Camera,
    texture_lod: TextureLod,
    filter_radius: Option<f32>,
    spp: u32,
) -> Result<(RgbImage, f64)> {
    let settings = RenderSettings {
        size: SIZE,
        spp,
        integrator: IntegratorKind::Whitted,
        filter: FilterKind::Box,
        filter_radius,
        texture_lod,
        ..RenderSettings::default()
    };
    let mut renderer = Renderer::new(flat.clone(), camera, settings)?;
    let begin = Instant::now();
    rendering::finish(&mut renderer, 0, spp)?;
    let seconds = begin.elapsed().as_secs_f64() * rayon::current_num_threads() as f64;
    Ok((renderer.picture(), 1e9 * seconds / renderer.rays().total().max(1) as f64))
}

/// Part of a picture.
fn part(picture: &RgbImage) -> RgbImage {
    let ((left, top), (width, height)) = PART;
    RgbImage::from_fn(width, height, |x, y| picture.get(left + x, top + y))
}

fn page(pictures: &[RgbImage], measured: &[Measured]) -> Result<Rgb8Image> {
    let cell = Vec2::new(SIZE.0 as f32, SIZE.1 as f32) * 0.5;
    let step = cell.x + GAP;
    let width = 2.0 * MARGIN + 4.0 * step - GAP;
    let mut canvas = Canvas::new(width as u32, (2.0 * cell.y + GAP + 156.0) as u32)?;
    canvas.heading(
        "Figure 26.23 · texture filtering",
        "A reflective hemisphere in a room of checkerboards, one ray a pixel. Below: a part of it, four times as large.",
    );
    let top = 66.0;
    for (i, picture) in pictures.iter().enumerate() {
        let at = Vec2::new(MARGIN + i as f32 * step, top);
        let bytes = |picture: &RgbImage| to_srgb8(picture, Dither::Triangular);
        canvas.picture(at, &bytes(picture), 0.5);
        let below = at + Vec2::new(0.0, cell.y + GAP);
        canvas.picture(below, &bytes(&part(picture)), MAGNIFIED);
        let ((left, upper), (w, h)) = PART;
        let corner = at + Vec2::new(left as f32, upper as f32) * 0.5;
        let far = corner + Vec2::new(w as f32, h as f32) * 0.5;
        let frame = [corner, Vec2::new(far.x, corner.y), far, Vec2::new(corner.x, far.y), corner];
        canvas.polyline(&frame, Pen::new(ink::YELLOW, 1.0));
        let under = at + Vec2::new(0.5 * cell.x, 2.0 * cell.y + GAP + 20.0);
        let (name, line) = match (TextureLod::ALL.get(i), measured.get(i)) {
            (Some((_, lod)), Some(m)) => {
                (label(*lod).to_owned(), format!("RMSE {:.4} · ꟻLIP {:.4}", m.rmse, m.flip))
            }
            _ => ("truth".to_owned(), format!("{TRUTH} rays a pixel")),
        };
        canvas.text(under, &name, 14.0, ink::BLACK, Anchor::Middle, Style::Bold);
        let second = under + Vec2::new(0.0, 17.0);
        canvas.text(second, &line, 12.5, ink::BLACK, Anchor::Middle, Style::Plain);
    }
    let times: Vec<String> = TextureLod::ALL
        .into_iter()
        .zip(measured)
        .map(|((_, lod), m)| {
            format!("{} {:.0} ns and {} bytes", label(lod), m.nanoseconds, m.bytes)
        })
        .collect();
    canvas.footing(&format!("Time and storage of a ray: {}.", times.join(", ")));
    Ok(canvas.into_image())
}

fn numbers(measured: &[Measured]) -> Vec<(&'static str, String)> {
    let of = |value: &dyn Fn(&Measured) -> String| {
        let all = TextureLod::ALL.into_iter().zip(measured);
        all.map(|((_, lod), m)| format!("{} {}", label(lod), value(m)))
            .collect::<Vec<_>>()
            .join(" · ")
    };
    let ranks = measured.windows(2).all(|pair| pair[0].rmse >= pair[1].rmse);
    vec![
        ("RMSE against the truth", of(&|m| format!("{:.5}", m.rmse))),
        ("ꟻLIP against the truth", of(&|m| format!("{:.5}", m.flip))),
        ("mip 0 > cones ≥ differentials in RMSE", if ranks { "yes" } else { "no" }.to_owned()),
        ("ns of a thread a ray, shadow rays counted", of(&|m| format!("{:.0}", m.nanoseconds))),
        ("bytes that a ray carries for it", of(&|m| m.bytes.to_string())),
    ]
}
