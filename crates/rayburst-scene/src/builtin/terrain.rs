//! Mountains around a lake: one height field of any number of distinct triangles.
//!
//! Ridged multifractal with its domain warped (Musgrave; Quílez: "Domain Warping", 2002). Made in
//! parallel, rows at a time. No texture coordinates, so that ten million triangles stay small.

use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;

use super::{Parameter, ParameterKind, Values, new_scene, outdoors::add_daylight, view::view};
use crate::{
    Material, Primitive, Scene,
    shapes::{Shape, noise},
};

pub(super) const PARAMETERS: &[Parameter] = &[Parameter {
    name: "triangles",
    meaning: "number of triangles, about",
    kind: ParameterKind::Number { default: 2_000_000.0, min: 200.0, max: 100_000_000.0 },
}];

/// Side of the square, metres.
const SIDE: f32 = 6000.0;
/// Distance between ridges, about.
const FEATURE: f32 = 1600.0;
/// Height of the highest peaks above the lake, about.
const PEAK: f32 = 1500.0;

pub(super) fn build(values: &Values) -> Scene {
    let cells = ((values.get("triangles") / 2.0).sqrt().round() as u32).max(1);
    let mut scene = new_scene("terrain");
    let ground = scene.add_material("ground", Material::diffuse(Vec3::ONE));
    scene.add_mesh("ground", vec![height_field(cells, ground)]);

    let water = Material::plastic(Vec3::new(0.012, 0.035, 0.045), 0.12);
    let water = scene.add_material("water", Material { ior: 1.33, ..water });
    let mut lake = Shape::default();
    let half = 0.5 * SIDE;
    lake.add_quad([
        Vec3::new(-half, 0.0, half),
        Vec3::new(half, 0.0, half),
        Vec3::new(half, 0.0, -half),
        Vec3::new(-half, 0.0, -half),
    ]);
    scene.add_mesh("lake", vec![lake.into_primitive(water)]);

    add_daylight(&mut scene, Vec3::new(-0.72, 0.42, 0.45));
    let octaves = octaves(cells);
    let above =
        |x: f32, z: f32, by: f32| Vec3::new(x, height(Vec2::new(x, z), octaves).max(0.0) + by, z);
    let eye = above(300.0, 1750.0, 130.0);
    scene.views.push(view("lake", eye, Vec3::new(-160.0, 230.0, -900.0), 44.0));
    let eye = above(-900.0, 700.0, 120.0);
    scene.views.push(view("shore", eye, Vec3::new(300.0, 120.0, -600.0), 50.0));
    scene
}

/// Height above the lake at a place in metres.
fn height(place: Vec2, octaves: u32) -> f32 {
    let p = place * (1.0 / FEATURE);
    let warp = Vec2::new(noise::fbm(p * 0.9, 3, 101), noise::fbm(p * 0.9, 3, 202));
    let ridges = noise::ridged(p + warp * 0.55, octaves, 7);
    // Low in the middle, where the lake is; high towards the corners.
    let bowl = (place * (2.0 / SIDE)).length_squared().min(1.2);
    let broad = noise::fbm(p * 0.6, 2, 33);
    PEAK * (ridges * (0.10 + 0.95 * bowl) + 0.22 * broad - 0.09)
}

/// Octaves of detail: none finer than two cells.
fn octaves(cells: u32) -> u32 {
    (31 - (cells / 4).max(1).leading_zeros()).clamp(3, 12)
}

fn height_field(cells: u32, material: u32) -> Primitive {
    let side = cells + 1;
    let step = SIDE / cells as f32;
    let octaves = octaves(cells);
    let place = |i: u32| (i as f32 - 0.5 * cells as f32) * step;
    let at = |x: i64, z: i64| {
        let fit = |i: i64| (i as f32 - 0.5 * cells as f32) * step;
        height(Vec2::new(fit(x), fit(z)), octaves)
    };
    let rows: Vec<Vec<f32>> = (-1..=i64::from(side))
        .into_par_iter()
        .map(|z| (-1..=i64::from(side)).map(|x| at(x, z)).collect())
        .collect();

    let count = side as usize * side as usize;
    let mut positions = vec![Vec3::ZERO; count];
    let mut normals = vec![Vec3::ZERO; count];
    let mut colors = vec![Vec4::ZERO; count];
    positions
        .par_chunks_mut(side as usize)
        .zip(normals.par_chunks_mut(side as usize))
        .zip(colors.par_chunks_mut(side as usize))
        .enumerate()
        .for_each(|(z, ((positions, normals), colors))| {
            // The rows above have a margin of one on all sides.
            let [north, here, south] = [&rows[z], &rows[z + 1], &rows[z + 2]];
            for x in 0..side as usize {
                let position = Vec3::new(place(x as u32), here[x + 1], place(z as u32));
                let slope = Vec2::new(here[x + 2] - here[x], south[x + 1] - north[x + 1]);
                let normal = Vec3::new(-slope.x, 2.0 * step, -slope.y).normalize();
                positions[x] = position;
                normals[x] = normal;
                colors[x] = color(position, normal).extend(1.0);
            }
        });
    let mut indices = vec![[0u32; 3]; 2 * cells as usize * cells as usize];
    indices.par_chunks_mut(2 * cells as usize).enumerate().for_each(|(z, row)| {
        for (x, pair) in row.chunks_exact_mut(2).enumerate() {
            let a = z as u32 * side + x as u32;
            let (b, c, d) = (a + 1, a + side, a + side + 1);
            pair[0] = [a, c, d];
            pair[1] = [a, d, b];
        }
    });
    Primitive {
        positions,
        indices,
        normals: Some(normals),
        colors: Some(colors),
        material,
        ..Primitive::default()
    }
}

/// What grows or lies there: sand at the shore, meadow, forest, rock where it is steep, snow high up.
fn color(position: Vec3, normal: Vec3) -> Vec3 {
    let place = Vec2::new(position.x, position.z);
    let patches = noise::fbm(place * (1.0 / 160.0), 3, 55);
    let fade = |from: f32, to: f32, v: f32| {
        let t = ((v - from) / (to - from)).clamp(0.0, 1.0);
        t * t * (3.0 - 2.0 * t)
    };
    let sand = Vec3::new(0.36, 0.30, 0.21);
    let meadow = Vec3::new(0.13, 0.19, 0.055);
    let forest = Vec3::new(0.045, 0.085, 0.03);
    let rock = Vec3::new(0.21, 0.19, 0.175);
    let snow = Vec3::new(0.84, 0.86, 0.90);
    let green = meadow.lerp(forest, fade(-0.15, 0.2, patches));
    let mut color = sand.lerp(green, fade(6.0, 32.0, position.y + 20.0 * patches));
    color = color.lerp(rock, fade(0.80, 0.66, normal.y + 0.08 * patches));
    color = color.lerp(rock, fade(380.0, 600.0, position.y + 160.0 * patches));
    let steep = fade(0.56, 0.74, normal.y);
    color.lerp(snow, steep * fade(560.0, 760.0, position.y + 140.0 * patches))
}
