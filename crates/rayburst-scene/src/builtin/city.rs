//! A city on a grid: boxes upon boxes whose sides coincide, from towers to window sills.
//!
//! Blocks are built from the middle outwards until there are triangles enough, each from a seed of
//! its own, so that a larger city contains the smaller one.

mod building;
mod street;

use glam::Vec3;
use rayburst_math::hash::Rng;

use super::{Parameter, ParameterKind, Values, new_scene, outdoors::add_daylight, view::view};
use crate::{Material, Scene, shapes::Shape};

pub(super) const PARAMETERS: &[Parameter] = &[Parameter {
    name: "triangles",
    meaning: "number of triangles, about",
    kind: ParameterKind::Number { default: 1_000_000.0, min: 10_000.0, max: 50_000_000.0 },
}];

/// Metres: a lot, the lots of a block, the street between blocks.
const LOT: f32 = 26.0;
const LOTS: (u32, u32) = (3, 2);
const STREET: f32 = 16.0;
const PITCH: (f32, f32) = (LOT * LOTS.0 as f32 + STREET, LOT * LOTS.1 as f32 + STREET);

/// What things are made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stuff {
    Concrete,
    Limestone,
    Brick,
    Terracotta,
    Glass,
    Roof,
    Metal,
    Asphalt,
    Pavement,
    Paint,
    Leaves,
    Trunk,
    CarRed,
    CarWhite,
    CarBlue,
    CarBlack,
    Land,
}

const STUFF: [(Stuff, &str, Material); 17] = {
    const fn matt(r: f32, g: f32, b: f32) -> Material {
        Material {
            base_color: [r, g, b, 1.0],
            metallic: 0.0,
            ior: 1.0,
            flags: Material::DOUBLE_SIDED,
            ..Material::GLTF_DEFAULT
        }
    }
    const fn gloss(r: f32, g: f32, b: f32, roughness: f32) -> Material {
        Material { ior: 1.5, roughness, ..matt(r, g, b) }
    }
    [
        (Stuff::Concrete, "concrete", matt(0.42, 0.41, 0.39)),
        (Stuff::Limestone, "limestone", matt(0.60, 0.53, 0.42)),
        (Stuff::Brick, "brick", matt(0.32, 0.13, 0.085)),
        (Stuff::Terracotta, "terracotta", matt(0.50, 0.27, 0.16)),
        (Stuff::Glass, "glass", gloss(0.05, 0.075, 0.10, 0.2)),
        (Stuff::Roof, "roof", matt(0.20, 0.20, 0.21)),
        (Stuff::Metal, "metal", gloss(0.45, 0.46, 0.48, 0.45)),
        (Stuff::Asphalt, "asphalt", matt(0.075, 0.077, 0.08)),
        (Stuff::Pavement, "pavement", matt(0.34, 0.33, 0.32)),
        (Stuff::Paint, "road paint", matt(0.65, 0.64, 0.60)),
        (Stuff::Leaves, "leaves", matt(0.09, 0.17, 0.045)),
        (Stuff::Trunk, "trunk", matt(0.12, 0.08, 0.05)),
        (Stuff::CarRed, "red car", gloss(0.45, 0.03, 0.02, 0.25)),
        (Stuff::CarWhite, "white car", gloss(0.70, 0.70, 0.68, 0.25)),
        (Stuff::CarBlue, "blue car", gloss(0.03, 0.08, 0.30, 0.25)),
        (Stuff::CarBlack, "black car", gloss(0.02, 0.02, 0.022, 0.25)),
        (Stuff::Land, "land", matt(0.10, 0.12, 0.08)),
    ]
};

/// One shape for each material.
#[derive(Debug)]
struct City {
    shapes: Vec<Shape>,
}

impl City {
    fn shape(&mut self, stuff: Stuff) -> &mut Shape {
        &mut self.shapes[stuff as usize]
    }

    /// Adds a box by its lower corner and size.
    fn add(&mut self, stuff: Stuff, corner: Vec3, size: Vec3) {
        self.shape(stuff).add_box(corner, corner + size);
    }

    fn triangles(&self) -> usize {
        self.shapes.iter().map(|s| s.indices.len()).sum()
    }
}

pub(super) fn build(values: &Values) -> Scene {
    let wanted = values.get("triangles") as usize;
    let mut city = City { shapes: vec![Shape::default(); STUFF.len()] };
    let mut blocks = 0;
    while city.triangles() < wanted {
        let (x, z) = spiral(blocks);
        add_block(&mut city, x, z, wanted);
        blocks += 1;
    }
    // Half the side of the square that the blocks fill.
    let half = 0.5 * (blocks as f32).sqrt() * PITCH.0.max(PITCH.1);

    let mut scene = new_scene("city");
    city.add(Stuff::Asphalt, Vec3::new(-half, -0.5, -half), Vec3::new(2.0 * half, 0.5, 2.0 * half));
    let land = 30.0 * half + 5000.0;
    city.add(Stuff::Land, Vec3::new(-land, -1.0, -land), Vec3::new(2.0 * land, 0.95, 2.0 * land));
    for (shape, (_, name, material)) in city.shapes.into_iter().zip(STUFF) {
        let material = scene.add_material(name, material);
        if !shape.indices.is_empty() {
            scene.add_mesh(name, vec![shape.into_primitive(material)]);
        }
    }
    add_daylight(&mut scene, Vec3::new(-0.75, 0.62, 0.5));
    let eye = Vec3::new(0.42 * half, 70.0 + 0.14 * half, 1.12 * half);
    scene.views.push(view("air", eye, Vec3::new(-0.02 * half, 45.0, 0.0), 36.0));
    let crossing = Vec3::new(-0.5 * PITCH.0, 0.0, 0.5 * PITCH.1);
    let eye = crossing + Vec3::new(0.4, 1.7, 1.4 * PITCH.1);
    scene.views.push(view("street", eye, crossing + Vec3::new(0.0, 14.0, -1.2 * PITCH.1), 58.0));
    scene
}

/// Block `index` of a square spiral around (0, 0).
fn spiral(index: u32) -> (i32, i32) {
    if index == 0 {
        return (0, 0);
    }
    // Ring r holds the 8r blocks that follow the first (2r − 1)².
    let ring = (1..).find(|r: &i32| index < ((2 * r + 1) * (2 * r + 1)) as u32).unwrap_or(1);
    let side = 2 * ring;
    let along = index as i32 - (side - 1) * (side - 1);
    let (edge, step) = (along / side, along % side);
    match edge {
        0 => (ring, -ring + 1 + step),
        1 => (ring - 1 - step, ring),
        2 => (-ring, ring - 1 - step),
        _ => (-ring + 1 + step, -ring),
    }
}

/// Adds the block's streets, and buildings until there are triangles enough.
fn add_block(city: &mut City, x: i32, z: i32, wanted: usize) {
    let seed = ((x as u32 as u64) << 32) | u64::from(z as u32);
    let mut rng = Rng::new(seed ^ 0xC17F);
    let size = Vec3::new(LOT * LOTS.0 as f32, 0.0, LOT * LOTS.1 as f32);
    let corner = Vec3::new(x as f32 * PITCH.0, 0.0, z as f32 * PITCH.1) - 0.5 * size;
    street::add_around(city, corner, size, &mut rng);
    // Higher towards the middle.
    let away = Vec3::new(corner.x, 0.0, corner.z).length();
    let downtown = 1.0 / (1.0 + (away / 420.0) * (away / 420.0));
    for i in 0..LOTS.0 {
        for j in 0..LOTS.1 {
            if city.triangles() >= wanted {
                return;
            }
            let lot = corner + Vec3::new(i as f32 * LOT, street::KERB, j as f32 * LOT);
            if rng.f32() < 0.06 {
                street::add_park(city, lot, &mut rng);
            } else {
                building::add(city, lot, downtown, &mut rng);
            }
        }
    }
}
