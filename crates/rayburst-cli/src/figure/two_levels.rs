//! Figure 26.8: a structure of two levels. Geometries are transformed by N once, when their bottom level is
//! built; instances of it are placed by M, each frame anew if need be.

use std::sync::Arc;

use rayburst::{
    glam::{Affine3A, Vec2, Vec3},
    math::{Ray, hash::Rng},
    prelude::{AcceptAll, Blas, BuildOptions, Instance, Tlas, TraceOptions, TriangleMesh},
};

use super::{
    Drawing,
    canvas::{Anchor, Canvas, Ink, Pen, Style, ink},
};
use crate::error::{CliError, Result};

/// Points a unit on the page.
const UNIT: f32 = 64.0;
/// Layers of triangles in a part, so that a bottom level has a size worth sharing.
const SLICES: u32 = 2000;
/// Rays that are compared.
const RAYS: u32 = 20_000;

/// A part of a tree: its outline before N, and N.
struct Part {
    outline: Vec<Vec2>,
    n: Affine3A,
    fill: Ink,
}

fn parts() -> [Part; 2] {
    let circle =
        (0..40).map(|i| Vec2::from_angle(i as f32 / 40.0 * std::f32::consts::TAU)).collect();
    let square = [(-0.5, 0.0), (0.5, 0.0), (0.5, 1.0), (-0.5, 1.0)].map(Vec2::from).to_vec();
    let placed = |scale: Vec2, at: Vec2| {
        Affine3A::from_translation(at.extend(0.0)) * Affine3A::from_scale(scale.extend(1.0))
    };
    [
        Part { outline: square, n: placed(Vec2::new(0.26, 0.9), Vec2::ZERO), fill: ink::STONE },
        Part {
            outline: circle,
            n: placed(Vec2::new(0.52, 0.62), Vec2::new(0.0, 1.3)),
            fill: [176, 221, 203, 255],
        },
    ]
}

/// The matrices M of the instances that are drawn.
fn drawn() -> Vec<Affine3A> {
    let at = |x: f32, y: f32, angle: f32, scale: f32| {
        Affine3A::from_translation(Vec3::new(x, y, 0.0))
            * Affine3A::from_rotation_z(angle)
            * Affine3A::from_scale(Vec3::splat(scale))
    };
    vec![
        at(0.8, 0.0, 0.0, 1.0),
        at(2.3, 0.1, -0.35, 0.8),
        at(4.2, 0.0, 0.12, 1.35),
        at(6.0, 0.0, 0.5, 0.9),
    ]
}

/// The outline as a prism of many thin layers along z.
fn prism(outline: &[Vec2]) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let n = outline.len() as u32;
    let z = |layer: u32| layer as f32 / SLICES as f32 * 2.0 - 1.0;
    let positions =
        (0..=SLICES).flat_map(|layer| outline.iter().map(move |p| p.extend(z(layer)))).collect();
    let indices = (0..SLICES)
        .flat_map(|layer| (0..n).map(move |i| (layer * n + i, layer * n + (i + 1) % n)))
        .flat_map(|(a, b)| [[a, b, b + n], [a, b + n, a + n]])
        .collect();
    (positions, indices)
}

/// The tree's bottom level, for one place or baked into it.
fn bottom(m: Affine3A) -> Result<Blas> {
    let meshes = parts().map(|part| (prism(&part.outline), part.n));
    let geometries: Vec<TriangleMesh<'_>> = meshes
        .iter()
        .map(|((positions, indices), n)| TriangleMesh {
            transform: Some(m * *n),
            ..TriangleMesh::new(positions, indices)
        })
        .collect();
    Blas::build(&geometries, &BuildOptions::default()).map_err(|e| CliError::failed(e.to_string()))
}

fn top(bottom: &Arc<Blas>, places: &[Affine3A]) -> Result<Tlas> {
    let instances: Vec<Instance> = places.iter().map(|&m| Instance::new(0, m)).collect();
    Tlas::build(vec![bottom.clone()], &instances, &BuildOptions::default())
        .map_err(|e| CliError::failed(e.to_string()))
}

/// Draws a bottom level and its instances.
pub(super) fn draw() -> Result<Drawing> {
    let mut canvas = Canvas::new(790, 400)?;
    canvas.heading(
        "Figure 26.8 · a structure of two levels",
        "The bottom level holds geometry, transformed by N when it is built. Instances place it by M and share its memory.",
    );
    let shared = Arc::new(bottom(Affine3A::IDENTITY)?);
    let places = drawn();
    let world = top(&shared, &places)?;

    let floor = 310.0;
    let left = |p: Vec3| Vec2::new(150.0 + 1.2 * UNIT * p.x, floor - 1.2 * UNIT * p.y);
    let right = |p: Vec3| Vec2::new(290.0 + UNIT * p.x, floor - UNIT * p.y);
    tree(&mut canvas, Affine3A::IDENTITY, &left);
    let bounds = shared.bounds();
    frame(&mut canvas, left(bounds.lower), left(bounds.upper), ink::ORANGE);
    let names = ["N₁: trunk", "N₂: crown"];
    for (part, name) in parts().iter().zip(names) {
        let at = left(part.n.transform_point3(Vec3::new(0.0, 0.4, 0.0)));
        let label = at + Vec2::new(-62.0, 4.0);
        canvas.arrow(label + Vec2::new(6.0, -4.0), at, Pen::new(ink::BLACK, 1.2));
        canvas.text(label, name, 12.5, ink::BLACK, Anchor::End, Style::Plain);
    }
    canvas.line(
        right(Vec3::new(-0.1, 0.0, 0.0)),
        right(Vec3::new(7.2, 0.0, 0.0)),
        Pen::new(ink::GREY, 1.2),
    );
    for (number, &m) in places.iter().enumerate() {
        tree(&mut canvas, m, &right);
        let corner = |i: u32| {
            let pick = |axis: u32, lo: f32, hi: f32| if i >> axis & 1 == 0 { lo } else { hi };
            let (lo, hi) = (bounds.lower, bounds.upper);
            m.transform_point3(Vec3::new(
                pick(0, lo.x, hi.x),
                pick(1, lo.y, hi.y),
                pick(2, lo.z, hi.z),
            ))
        };
        let low = (0..8).map(corner).fold(Vec3::INFINITY, Vec3::min);
        let high = (0..8).map(corner).fold(Vec3::NEG_INFINITY, Vec3::max);
        frame(&mut canvas, right(low), right(high), ink::BLUE);
        let name = ["M₁", "M₂", "M₃", "M₄"][number];
        let above = right(Vec3::new(0.5 * (low.x + high.x), high.y, 0.0)) - Vec2::new(0.0, 7.0);
        canvas.text(above, name, 14.0, ink::BLUE, Anchor::Middle, Style::Bold);
    }
    let all = world.bounds();
    let margin = Vec3::new(0.12, 0.55, 0.0);
    frame(
        &mut canvas,
        right(all.lower - Vec3::new(0.12, 0.12, 0.0)),
        right(all.upper + margin),
        ink::GREY,
    );
    let (from, to) = (right(Vec3::new(all.lower.x - 0.12, 1.35, 0.0)), left(bounds.upper));
    let (from, to) = (from - Vec2::X * 4.0, Vec2::new(to.x + 5.0, from.y));
    canvas.arrow(from, to, Pen::new(ink::ORANGE, 1.8));
    let middle = from.lerp(to, 0.5) - Vec2::new(0.0, 9.0);
    canvas.label(middle, "all refer to it", ink::ORANGE, Anchor::Middle);
    canvas.label(Vec2::new(150.0, 348.0), "bottom level", ink::ORANGE, Anchor::Middle);
    canvas.label(Vec2::new(520.0, 348.0), "top level: instances", ink::BLUE, Anchor::Middle);

    let (different, farthest) = compare(&world, &places)?;
    let bottom_bytes = shared.stats().bytes;
    let triangles = shared.stats().primitives;
    let mut numbers = vec![
        ("triangles of the bottom level", triangles.to_string()),
        ("bytes of the bottom level, whatever the instances", bottom_bytes.to_string()),
    ];
    let counts = [
        (1, "bytes of the top level, 1 instance"),
        (10, "bytes of the top level, 10 instances"),
        (100, "bytes of the top level, 100 instances"),
        (1000, "bytes of the top level, 1000 instances"),
    ];
    let mut largest = 0;
    for (count, name) in counts {
        let places: Vec<Affine3A> =
            (0..count).map(|i| Affine3A::from_translation(Vec3::X * i as f32)).collect();
        largest = top(&shared, &places)?.stats().bytes;
        numbers.push((name, largest.to_string()));
    }
    numbers.push(("bytes of 1000 copies instead", (1000 * bottom_bytes).to_string()));
    numbers.push(("hits that differ from copies", format!("{different} of {RAYS} rays")));
    numbers.push(("largest difference of their t", format!("{farthest:.1e}")));
    canvas.footing(&format!(
        "1000 instances of {triangles} triangles: {:.1} MB, copies would take {:.0} MB. {different} of {RAYS} rays see a difference.",
        (bottom_bytes + largest) as f64 / 1e6,
        1e-3 * bottom_bytes as f64
    ));
    Ok(Drawing { picture: canvas.into_image(), numbers })
}

/// Draws a tree placed by M.
fn tree(canvas: &mut Canvas, m: Affine3A, page: &impl Fn(Vec3) -> Vec2) {
    for part in parts() {
        let at = |p: &Vec2| page((m * part.n).transform_point3(p.extend(0.0)));
        let outline: Vec<Vec2> = part.outline.iter().map(at).collect();
        canvas.polygon(&outline, part.fill, Some(Pen::new(ink::BLACK, 1.1)));
    }
}

/// Draws a box.
fn frame(canvas: &mut Canvas, a: Vec2, b: Vec2, ink: Ink) {
    let corners = [a, Vec2::new(b.x, a.y), b, Vec2::new(a.x, b.y), a];
    canvas.polyline(&corners, Pen::dashed(ink, 1.3));
}

/// How many random rays see something else among instances than among copies, and how far hits are apart.
fn compare(world: &Tlas, places: &[Affine3A]) -> Result<(u32, f32)> {
    let copies = places.iter().map(|&m| bottom(m)).collect::<Result<Vec<Blas>>>()?;
    let options = TraceOptions::default();
    let mut rng = Rng::new(268);
    let (mut different, mut farthest) = (0, 0.0f32);
    for _ in 0..RAYS {
        let origin = Vec3::new(rng.range(-1.0, 9.0), rng.range(-1.0, 4.0), rng.range(-0.9, 0.9));
        let ray = Ray::new(origin, (rng.vec3() - 0.5).normalize_or(Vec3::X));
        let here = world.closest_hit(&ray, &options, &AcceptAll);
        let there = copies
            .iter()
            .map(|copy| copy.closest_hit(&ray, &options, &AcceptAll).t)
            .fold(f32::INFINITY, f32::min);
        if here.t == there {
            continue;
        }
        let apart = (here.t - there).abs();
        if apart < 1e-3 { farthest = farthest.max(apart) } else { different += 1 }
    }
    Ok((different, farthest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instances_look_like_copies_and_share_memory() {
        let shared = Arc::new(bottom(Affine3A::IDENTITY).unwrap());
        let places = drawn();
        let world = top(&shared, &places).unwrap();
        let (different, farthest) = compare(&world, &places).unwrap();
        assert!(different == 0 && farthest < 1e-4, "{different} {farthest}");
        let many: Vec<Affine3A> =
            (0..100).map(|i| Affine3A::from_translation(Vec3::X * i as f32)).collect();
        let many = top(&shared, &many).unwrap();
        assert!(Arc::ptr_eq(&many.blases()[0], &shared));
        assert!(many.stats().bytes < shared.stats().bytes / 10, "a hundred instances are small");
    }
}
