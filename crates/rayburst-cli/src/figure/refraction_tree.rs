//! Figure 26.4: a smooth boundary sends a reflection and a refraction ray, each of which does again.

use rayburst::glam::Vec2;

use super::{
    Drawing,
    canvas::{Anchor, Canvas, Pen, Style, ink},
    ray_tree::{RayKind, RayTree, Rules},
    slice::{SliceBuilder, Substance},
    symbols::eye,
};
use crate::error::Result;

const EYE: Vec2 = Vec2::new(0.5, 3.9);
const IOR: f32 = 1.5;
/// Rays below this share are counted, but not drawn.
const FAINT: f32 = 0.001;

/// Draws the tree of one eye ray through a glass ball onto a glass prism.
pub(super) fn draw() -> Result<Drawing> {
    let mut canvas = Canvas::new(790, 460)?;
    let mut builder = SliceBuilder::default();
    let glass = Substance { ior: Some(IOR), ..Substance::default() };
    let look = ([208, 228, 240, 150], ink::BLUE);
    builder.disk(Vec2::new(3.9, 2.5), 1.35, look, glass);
    let prism = [Vec2::new(7.3, 0.6), Vec2::new(9.3, 1.0), Vec2::new(7.0, 2.7)];
    builder.polygon(&prism, look, glass);
    let slice = builder.build(canvas.size().y)?;

    let mut tree = RayTree::default();
    let rules = Rules { max_depth: 8, light: None, escape: 1.2 };
    tree.grow(&slice, &rules, EYE, Vec2::new(3.2, 3.15) - EYE);

    canvas.heading(
        "Figure 26.4 · reflection and refraction",
        "At each boundary of air (n₁ = 1) and glass (n₂ = 1.5) two rays go on; their strength is Fresnel's share.",
    );
    slice.draw(&mut canvas);
    for ray in tree.rays.iter().rev().filter(|r| r.weight >= FAINT) {
        let tint = match ray.kind {
            RayKind::Reflection => ink::ORANGE,
            RayKind::Refraction => ink::GREEN,
            RayKind::Eye | RayKind::Shadow => ink::BLACK,
        };
        // Weak rays are pale, but seen.
        let strength = ray.weight.sqrt().clamp(0.0, 1.0);
        let alpha = (60.0 + 195.0 * strength) as u8;
        let pen = Pen::new([tint[0], tint[1], tint[2], alpha], 0.7 + 1.5 * strength);
        let (from, to) = (slice.page(ray.from), slice.page(ray.to));
        if ray.hit {
            canvas.ray(from, to, pen);
        } else {
            canvas.arrow(from, to, pen);
        }
    }
    for ray in tree
        .rays
        .iter()
        .filter(|r| r.kind != RayKind::Eye && (r.weight > 0.5 || r.weight > 0.02 && r.depth <= 3))
    {
        let at = slice.page(ray.from).lerp(slice.page(ray.to), 0.32);
        let side = (slice.page(ray.to) - slice.page(ray.from)).normalize().perp() * 14.0;
        let share = format!("{:.1} %", 100.0 * ray.weight);
        canvas.text(at + side, &share, 10.5, ink::BLACK, Anchor::Middle, Style::Plain);
    }
    eye(&mut canvas, slice.page(EYE));
    canvas.label(slice.page(EYE) + Vec2::new(0.0, 26.0), "eye", ink::BLACK, Anchor::Middle);
    let key = Vec2::new(560.0, 92.0);
    for (i, (name, color)) in
        [("eye ray", ink::BLACK), ("reflection", ink::ORANGE), ("refraction", ink::GREEN)]
            .into_iter()
            .enumerate()
    {
        let at = key + Vec2::new(0.0, 20.0 * i as f32);
        canvas.ray(at, at + Vec2::new(46.0, 0.0), Pen::new(color, 2.0));
        canvas.label(at + Vec2::new(56.0, 4.5), name, ink::BLACK, Anchor::Start);
    }

    let total = tree.leaving + tree.cut;
    let numbers = vec![
        ("rays to depth 8", tree.rays.len().to_string()),
        ("largest |n₁ sin θ₁ − n₂ sin θ₂|", format!("{:.1e}", tree.snell_error)),
        ("largest |angle in − angle out|", format!("{:.1e} rad", tree.reflection_error)),
        ("total internal reflections", tree.total_reflections.to_string()),
        ("light that leaves", format!("{:.6}", tree.leaving)),
        ("light cut off by the depth limit", format!("{:.6}", tree.cut)),
        ("sum − 1", format!("{:.1e}", total - 1.0)),
        (
            "hits that differ from testing every triangle in 64 bits",
            format!("{} of {} rays", tree.differing, tree.rays.len()),
        ),
    ];
    canvas.footing(&format!(
        "{} rays to depth 8. Snell's law holds within {:.0e}; reflected and refracted shares sum to 1 within {:.0e}.",
        tree.rays.len(),
        tree.snell_error.max(1e-9),
        (total - 1.0).abs().max(1e-9)
    ));
    Ok(Drawing { picture: canvas.into_image(), numbers })
}
