//! Scenes and rays of the suite.

use glam::{DAffine3, DVec3, Mat3, Quat, Vec3};

use crate::{
    model::{Expected, Geometry, Instance, Policy, Ray, RayType, Scene, Shape, Table, expect},
    solids::{Form, Solid},
};

/// Numbers that look random (Guy Steele, Doug Lea and Christine Flood, "Fast Splittable Pseudorandom
/// Number Generators", 2014).
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// From `low` to `high`, a number that `f32` holds.
    pub fn range(&mut self, low: f64, high: f64) -> f64 {
        let unit = (self.bits() >> 11) as f64 / (1u64 << 53) as f64;
        f64::from((low + (high - low) * unit) as f32)
    }

    pub fn below(&mut self, end: usize) -> usize {
        (self.bits() % end as u64) as usize
    }

    pub fn in_cube(&mut self, half: f64) -> DVec3 {
        DVec3::from_array([(); 3].map(|()| self.range(-half, half)))
    }
}

/// A transform with numbers that `f32` holds.
pub fn transform(matrix: Mat3, translation: Vec3) -> DAffine3 {
    DAffine3 { matrix3: matrix.as_dmat3(), translation: translation.as_dvec3() }
}

pub fn triangles(triangles: Vec<[DVec3; 3]>, opaque: bool) -> Geometry {
    Geometry { shape: Shape::Triangles(triangles), opaque, no_duplicate_any_hit: false }
}

pub fn solids(solids: Vec<Solid>, opaque: bool) -> Geometry {
    Geometry { shape: Shape::Solids(solids), opaque, no_duplicate_any_hit: false }
}

/// A large triangle across the z axis at a height, facing +z.
pub fn sheet(z: f64) -> [DVec3; 3] {
    [DVec3::new(-8.0, -4.0, z), DVec3::new(8.0, -4.0, z), DVec3::new(0.0, 12.0, z)]
}

/// A ball about a point of the z axis.
pub fn ball(z: f64, half: f64) -> Solid {
    let (centre, half) = (DVec3::new(0.0, 0.0, z), DVec3::splat(half));
    Solid { low: centre - half, high: centre + half, form: Form::Ball }
}

/// Triangles of sizes up to about one in a cube from -2 to 2.
pub fn some_triangles(random: &mut Random, count: usize) -> Vec<[DVec3; 3]> {
    let one = |random: &mut Random| {
        let centre = random.in_cube(1.5);
        let corners = [(); 3].map(|()| centre + random.in_cube(0.9));
        corners.map(|corner| corner.as_vec3().as_dvec3())
    };
    (0..count).map(|_| one(random)).collect()
}

/// Solids in a cube from -2 to 2.
pub fn some_solids(random: &mut Random, count: usize) -> Vec<Solid> {
    let one = |index: usize, random: &mut Random| {
        let centre = random.in_cube(1.5);
        let half = DVec3::from_array([(); 3].map(|()| random.range(0.2, 0.8)));
        let [low, high] = [centre - half, centre + half].map(|p| p.as_vec3().as_dvec3());
        let form = [Form::Ball, Form::Block, Form::Ball, Form::Void][index % 4];
        Solid { low, high, form }
    };
    (0..count).map(|index| one(index, random)).collect()
}

/// Transforms of all sorts: moved, turned, mirrored, stretched, sheared.
pub fn transforms() -> [DAffine3; 6] {
    let turn = |x, y| Mat3::from_quat(Quat::from_rotation_x(x) * Quat::from_rotation_y(y));
    let shear = Mat3::from_cols(Vec3::X, Vec3::new(0.4, 1.0, 0.0), Vec3::new(0.0, -0.3, 1.0));
    let diagonal = |x, y, z| Mat3::from_diagonal(Vec3::new(x, y, z));
    [
        transform(Mat3::IDENTITY, Vec3::ZERO),
        transform(turn(0.7, 1.1), Vec3::new(3.0, 0.5, 0.0)),
        transform(diagonal(-1.0, 1.0, 1.0), Vec3::new(0.0, 3.0, 1.0)),
        transform(turn(-0.4, 0.3) * diagonal(0.5, 1.5, 0.8), Vec3::new(-3.0, 0.0, 0.5)),
        transform(turn(2.0, 0.2) * diagonal(1.2, -0.7, 1.0), Vec3::new(0.0, -3.0, -1.0)),
        transform(shear * diagonal(1.0, 1.0, -1.0), Vec3::new(1.0, 1.0, 3.0)),
    ]
}

/// Six instances of two BLASes with geometries of both kinds, opaque and not; contributions leave eight
/// records to each.
pub fn rich() -> Scene {
    let mut random = Random(7);
    let first = vec![
        triangles(some_triangles(&mut random, 10), true),
        triangles(some_triangles(&mut random, 10), false),
        solids(some_solids(&mut random, 4), true),
        solids(some_solids(&mut random, 5), false),
    ];
    let second = vec![
        solids(some_solids(&mut random, 4), false),
        triangles(some_triangles(&mut random, 12), false),
        triangles(some_triangles(&mut random, 6), true),
    ];
    let instances = transforms().into_iter().enumerate().map(|(number, transform)| Instance {
        id: 100 + number as u32,
        contribution: 8 * number as u32,
        mask: [0xFF, 0x0F, 0x01, 0xF1, 0x81, 0x55][number],
        cull_disable: number == 3,
        front_clockwise: number == 4 || number == 5,
        force_opaque: [None, None, None, Some(true), Some(false), None][number],
        ..Instance::new(number % 2, transform)
    });
    Scene { instances: instances.collect(), blases: vec![first, second] }
}

/// The ray types of the rich scene: standard and shadow.
pub const RICH_TYPES: [RayType; 2] = [
    RayType { contribution: 0, multiplier: 2, miss: 0 },
    RayType { contribution: 1, multiplier: 2, miss: 1 },
];

/// Any hit shaders of which none ends a search.
pub fn without_ends(record: usize) -> Policy {
    use Policy::{Absent, Accept, Ignore, IgnoreFront, IgnoreOdd};
    [Accept, IgnoreOdd, IgnoreFront, Ignore, Absent, IgnoreOdd, Accept][record % 7]
}

/// Any hit shaders of which some do.
pub fn with_ends(record: usize) -> Policy {
    use Policy::{Absent, Accept, End, EndEven, Ignore, IgnoreFront, IgnoreOdd};
    [End, IgnoreOdd, EndEven, Accept, Ignore, End, IgnoreFront, Absent][record % 8]
}

/// Rays into a scene around the origin, clear of edges, with all that the model expects of them.
pub fn rays(
    scene: &Scene,
    table: &Table,
    count: usize,
    flags: u32,
    seed: u64,
) -> Vec<(Ray, Expected)> {
    let mut random = Random(seed);
    let mut found = vec![];
    for _ in 0..200 * count {
        let instance = &scene.instances[random.below(scene.instances.len())];
        let origin = random.in_cube(7.0);
        let target = instance.transform.transform_point3(random.in_cube(1.2));
        let length = [0.25, 1.0, 1.0, 3.0][random.below(4)];
        let direction = ((target - origin).normalize() * length).as_vec3().as_dvec3();
        let (t_min, t_max) = match random.below(4) {
            0 => (random.range(0.0, 6.0) / length, random.range(6.0, 12.0) / length),
            1 => (random.range(-4.0, 4.0) / length, f64::INFINITY),
            _ => (0.0, f64::INFINITY),
        };
        let mask = if random.below(3) == 0 { 1 << random.below(8) } else { 0xFF };
        let ray_type = random.below(table.ray_types.len());
        let ray = Ray { origin, direction, t_min, t_max, flags, mask, ray_type };
        if let Ok(expected) = expect(scene, table, &ray) {
            found.push((ray, expected));
            if found.len() == count {
                return found;
            }
        }
    }
    panic!("only {} of {count} rays are clear", found.len());
}

/// A ray down the z axis, slightly off it.
pub fn down(z: f64) -> Ray {
    Ray {
        origin: DVec3::new(0.125, 0.0625, z),
        direction: -DVec3::Z,
        t_min: 0.0,
        t_max: f64::INFINITY,
        flags: 0,
        mask: 0xFF,
        ray_type: 0,
    }
}

/// The only ray type of small scenes.
pub const ONE_TYPE: [RayType; 1] = [RayType { contribution: 0, multiplier: 1, miss: 0 }];

/// An instance of each BLAS where it is.
pub fn scene_of(blases: Vec<Vec<Geometry>>) -> Scene {
    let instances = (0..blases.len()).map(|blas| Instance::new(blas, DAffine3::IDENTITY));
    Scene { instances: instances.collect(), blases }
}

/// What the model expects of a ray that must be clear.
pub fn clear(scene: &Scene, table: &Table, ray: Ray) -> (Ray, Expected) {
    let expected = expect(scene, table, &ray).expect("a clear ray");
    (ray, expected)
}
