//! Figure 26.16: rays that a flat mirror reflects stay together, those of curved and rough surfaces do
//! not.

use rayburst::{
    glam::Vec2,
    math::{Ray, hash::Rng},
};

use super::{
    Drawing,
    canvas::{Anchor, Canvas, Pen, Style, ink},
    secondary_rays::{Coherence, Reflector, SIDE, measure},
    slice::{Slice, SliceBuilder, Substance},
    symbols::eye,
};
use crate::error::Result;

/// Eye rays of each panel.
const RAYS: u32 = 5;
/// Width of a panel, units.
const PANEL: f32 = 3.45;
/// Where surfaces begin and flat ones end upwards.
const FOOT: f32 = 1.37;
const GROUND: f32 = 1.62;
/// The eye of a panel.
const EYE: Vec2 = Vec2::new(0.5, 3.75);
/// The ball of a panel.
const BALL: Vec2 = Vec2::new(1.7, FOOT + RADIUS);
const RADIUS: f32 = 0.45;

fn name(reflector: Reflector) -> &'static str {
    match reflector {
        Reflector::Plane => "flat mirror",
        Reflector::Balls => "curved mirror",
        Reflector::Diffuse => "diffuse surface",
    }
}

/// Draws eye rays and what becomes of them, three times.
pub(super) fn draw() -> Result<Drawing> {
    let mut canvas = Canvas::new(790, 420)?;
    let mut builder = SliceBuilder::default();
    let (mirror, stone) = ((ink::SKY, ink::BLUE), (ink::STONE, ink::GREY));
    for (i, reflector) in Reflector::ALL.into_iter().enumerate() {
        let left = PANEL * i as f32;
        let low = Vec2::new(left + 0.2, FOOT);
        let high = Vec2::new(left + 3.1, GROUND);
        let none = Substance::default();
        match reflector {
            Reflector::Plane => builder.rectangle(low, high, mirror, none),
            Reflector::Diffuse => builder.rectangle(low, high, stone, none),
            Reflector::Balls => {
                builder.disk(Vec2::new(left, 0.0) + BALL, RADIUS, mirror, none);
            }
        }
    }
    let slice = builder.build(canvas.size().y)?;
    canvas.heading(
        "Figure 26.16 · coherent secondary rays",
        "Rays that go the same way visit the same nodes. A flat mirror keeps eye rays together, other surfaces do not.",
    );
    slice.draw(&mut canvas);
    let (mut rng, mut errors) = (Rng::new(16), 0.0f32);
    for (i, reflector) in Reflector::ALL.into_iter().enumerate() {
        errors = errors.max(panel(&mut canvas, &slice, i, reflector, &mut rng));
    }
    let measured = measure()?;
    let captions = Reflector::ALL.into_iter().zip(&measured).enumerate();
    for (i, (reflector, coherence)) in captions {
        caption(
            &mut canvas,
            slice.page(Vec2::new(PANEL * i as f32 + 0.2, 0.0)).x,
            reflector,
            coherence,
        );
    }
    let [plane, _, diffuse] = &measured;
    canvas.footing(&format!(
        "Of 64 neighbours on their way into a terrain, {:.0} visit a node together after the flat mirror, {:.1} after the diffuse surface.",
        plane.together, diffuse.together
    ));
    Ok(Drawing { picture: canvas.into_image(), numbers: numbers(&measured, errors) })
}

/// Eye rays of a panel and what its surface sends on; returns how much hits differ from those of brute
/// force.
fn panel(
    canvas: &mut Canvas,
    slice: &Slice,
    index: usize,
    reflector: Reflector,
    rng: &mut Rng,
) -> f32 {
    let left = Vec2::new(PANEL * index as f32, 0.0);
    let from = left + EYE;
    // The side of the ball that reflects to the right.
    let beside = (BALL - EYE).normalize().perp();
    let mut error = 0.0f32;
    for i in 0..RAYS {
        let share = (i as f32 + 0.5) / RAYS as f32;
        let target = match reflector {
            Reflector::Balls => BALL + beside * RADIUS * (0.1 + 0.85 * share),
            _ => Vec2::new(1.4 + 0.6 * share, GROUND),
        };
        let direction = left + target - from;
        let Some(hit) = slice.trace(from, direction) else { continue };
        let exact = slice.brute_force_t(&Ray::new(from.extend(0.0), direction.extend(0.0)));
        error = error.max((exact.unwrap_or(f64::INFINITY) - f64::from(hit.raw.t)).abs() as f32);
        canvas.ray(slice.page(from), slice.page(hit.position), Pen::new(ink::BLACK, 1.3));
        let onwards = match reflector {
            Reflector::Diffuse => {
                // With the density of the cosine over the half circle, one of each fifth.
                let stratum = (3 * (i + 1) % RAYS) as f32 + rng.f32();
                let sine = 2.0 * stratum / RAYS as f32 - 1.0;
                (1.0 - sine * sine).sqrt() * hit.normal + sine * hit.normal.perp()
            }
            _ => direction.normalize().reflect(hit.normal),
        };
        let length = if reflector == Reflector::Plane { 1.7 } else { 1.1 };
        let end = hit.position + length * onwards;
        canvas.arrow(slice.page(hit.position), slice.page(end), Pen::new(ink::ORANGE, 1.5));
    }
    eye(canvas, slice.page(from));
    error
}

/// What was measured, under a panel.
fn caption(canvas: &mut Canvas, x: f32, reflector: Reflector, c: &Coherence) {
    let top = 304.0;
    let title = Vec2::new(x, top);
    canvas.text(title, name(reflector), 14.0, ink::BLACK, Anchor::Start, Style::Bold);
    let lines = [
        format!("{} between neighbours", degrees(c.angle)),
        format!("{:.0} % of node visits in bundles", 100.0 * c.packet_share),
        format!("{:.1} rays of 64 visit together", c.together),
        format!("{:.1} nodes visited by a ray alone", c.nodes),
    ];
    for (i, line) in lines.iter().enumerate() {
        let at = Vec2::new(x, top + 21.0 + 18.0 * i as f32);
        canvas.text(at, line, 12.5, ink::BLACK, Anchor::Start, Style::Plain);
    }
}

fn degrees(angle: f64) -> String {
    if angle < 10.0 { format!("{angle:.2}°") } else { format!("{angle:.0}°") }
}

fn numbers(measured: &[Coherence; 3], error: f32) -> Vec<(&'static str, String)> {
    let of = |value: &dyn Fn(&Coherence) -> String| {
        let all = Reflector::ALL.into_iter().zip(measured);
        all.map(|(r, c)| format!("{} {}", name(r), value(c))).collect::<Vec<_>>().join(" · ")
    };
    vec![
        (
            "rays of each kind",
            format!(
                "{} as tiles of 8 × 8; the curved mirror is balls of 16 rays across",
                SIDE * SIDE
            ),
        ),
        ("angle between neighbours", of(&|c| degrees(c.angle))),
        ("node visits in bundles", of(&|c| format!("{:.1} %", 100.0 * c.packet_share))),
        ("rays that visit together", of(&|c| format!("{:.1}", c.together))),
        ("nodes a ray visits alone", of(&|c| format!("{:.1}", c.nodes))),
        ("Mrays/s in bundles", of(&|c| format!("{:.1}", c.rates[0]))),
        ("Mrays/s interleaved", of(&|c| format!("{:.1}", c.rates[1]))),
        ("bundles over interleaved", of(&|c| format!("{:.2}", c.rates[0] / c.rates[1]))),
        ("drawn hits against brute force, largest", format!("{error:.1e}")),
    ]
}
