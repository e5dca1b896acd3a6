//! Figure 26.3: `trace()` and `shade()` call each other.

use rayburst::glam::Vec2;

use super::{
    Drawing,
    canvas::{Anchor, Canvas, Pen, Style, ink},
    ray_tree::{RayKind, RayTree, Rules},
    slice::{SliceBuilder, Substance},
    symbols::{cross, eye, lamp},
};
use crate::error::Result;

const LIGHT: Vec2 = Vec2::new(4.9, 4.5);
const EYE: Vec2 = Vec2::new(0.45, 3.3);
/// The screen, seen from its edge: bottom, top and number of pixels.
const SCREEN: (Vec2, Vec2, u32) = (Vec2::new(1.75, 1.7), Vec2::new(1.75, 3.3), 8);

/// Draws the trees of two eye rays.
pub(super) fn draw() -> Result<Drawing> {
    let mut canvas = Canvas::new(790, 460)?;
    let mut builder = SliceBuilder::default();
    let diffuse = Substance { diffuse: true, ..Substance::default() };
    let mirror = Substance { mirror: true, ..Substance::default() };
    let glossy = Substance { diffuse: true, mirror: true, ..Substance::default() };
    let stone = (ink::STONE, ink::GREY);
    builder.rectangle(Vec2::new(0.0, 0.0), Vec2::new(10.3, 0.35), stone, diffuse);
    let glass = (ink::SKY, ink::BLUE);
    builder.rectangle(Vec2::new(2.7, 0.35), Vec2::new(6.0, 0.9), glass, mirror);
    let ball = ([238, 218, 228, 255], ink::PINK);
    builder.disk(Vec2::new(7.6, 2.5), 1.0, ball, glossy);
    let slice = builder.build(canvas.size().y)?;

    let mut tree = RayTree::default();
    let rules = Rules { max_depth: 6, light: Some(LIGHT), escape: 1.5 };
    let (low, high, pixels) = SCREEN;
    let centre_of = |pixel: u32| low.lerp(high, (pixel as f32 + 0.5) / pixels as f32);
    for pixel in [3, 5] {
        tree.grow(&slice, &rules, EYE, centre_of(pixel) - EYE);
    }

    canvas.heading(
        "Figure 26.3 · trace() and shade()",
        "A ray through each pixel: trace() finds the nearest hit, shade() sends shadow and reflection rays, trace() again.",
    );
    slice.draw(&mut canvas);
    for pixel in 0..=pixels {
        let at = slice.page(low.lerp(high, pixel as f32 / pixels as f32));
        canvas.line(at - Vec2::new(5.0, 0.0), at + Vec2::new(5.0, 0.0), Pen::new(ink::BLACK, 1.2));
    }
    canvas.line(slice.page(low), slice.page(high), Pen::new(ink::BLACK, 1.8));
    canvas.label(slice.page(low) + Vec2::new(0.0, 18.0), "pixels", ink::BLACK, Anchor::Middle);

    for ray in &tree.rays {
        let (from, to) = (slice.page(ray.from), slice.page(ray.to));
        match ray.kind {
            RayKind::Eye => canvas.ray(from, to, Pen::new(ink::BLACK, 1.8)),
            RayKind::Reflection if ray.hit => canvas.ray(from, to, Pen::new(ink::BLUE, 1.8)),
            RayKind::Reflection => canvas.arrow(from, to, Pen::new(ink::BLUE, 1.8)),
            RayKind::Refraction => canvas.ray(from, to, Pen::new(ink::GREEN, 1.8)),
            RayKind::Shadow => {
                canvas.ray(from, to, Pen::dashed(ink::ORANGE, 1.6));
                if ray.hit {
                    cross(&mut canvas, to);
                    // The way that the light does not come.
                    canvas.line(to, slice.page(LIGHT), Pen::dashed([213, 94, 0, 70], 1.0));
                }
            }
        }
    }
    lamp(&mut canvas, slice.page(LIGHT));
    canvas.label(slice.page(LIGHT) + Vec2::new(-14.0, 4.0), "light", ink::BLACK, Anchor::End);
    eye(&mut canvas, slice.page(EYE));
    canvas.label(slice.page(EYE) + Vec2::new(0.0, 24.0), "eye", ink::BLACK, Anchor::Middle);
    annotate(&mut canvas, &slice, &tree);

    let shadow = tree.rays.iter().filter(|r| r.kind == RayKind::Shadow);
    let blocked = shadow.clone().filter(|r| r.hit).count();
    let deepest = tree.rays.iter().map(|r| r.depth).max().unwrap_or(0);
    let numbers = vec![
        ("rays", tree.rays.len().to_string()),
        ("trace() calls", tree.traced.to_string()),
        ("shade() calls", tree.shaded.to_string()),
        ("shadow rays", format!("{} ({blocked} blocked)", shadow.count())),
        ("largest ray depth", deepest.to_string()),
        ("angle in − angle out, largest", format!("{:.1e} rad", tree.reflection_error)),
        (
            "hits that differ from testing every triangle in 64 bits",
            format!(
                "{} of {} rays × {} triangles",
                tree.differing,
                tree.rays.len(),
                slice.triangles()
            ),
        ),
    ];
    canvas.footing(&format!(
        "{} rays: trace() {}×, shade() {}×. Nearest hits that differ from testing all {} triangles: {}.",
        tree.rays.len(),
        tree.traced,
        tree.shaded,
        slice.triangles(),
        tree.differing
    ));
    Ok(Drawing { picture: canvas.into_image(), numbers })
}

/// Names of functions where they are called.
fn annotate(canvas: &mut Canvas, slice: &super::slice::Slice, tree: &RayTree) {
    let mut call = |at: Vec2, text: &str, anchor| {
        canvas.text(at, text, 13.0, ink::BLACK, anchor, Style::Bold);
    };
    for ray in &tree.rays {
        let (from, to) = (slice.page(ray.from), slice.page(ray.to));
        match (ray.kind, ray.depth) {
            (RayKind::Eye, _) => {
                call(from.lerp(to, 0.47) + Vec2::new(8.0, -8.0), "trace()", Anchor::Start);
                call(to + Vec2::new(10.0, 20.0), "shade()", Anchor::Start);
            }
            (RayKind::Reflection, 2) => {
                call(from.lerp(to, 0.6) + Vec2::new(12.0, 14.0), "trace()", Anchor::Start);
                call(to + Vec2::new(10.0, 18.0), "shade()", Anchor::Start);
            }
            (RayKind::Reflection, _) => {
                call(to + Vec2::new(8.0, 12.0), "trace(): nothing hit", Anchor::Start);
            }
            _ => {}
        }
    }
}
