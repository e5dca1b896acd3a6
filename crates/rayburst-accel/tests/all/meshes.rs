//! Small meshes of the kinds that break structures.

use glam::Vec3;
use rayburst_accel::{
    Blas, BuildOptions, BuildQuality, Builder, Curve, FilterFn, IsaLevel, Layout, TriangleMesh,
};
use rayburst_math::{Hit, Ray};

/// A reproducible stream of numbers (SplitMix64).
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1u64 << 24) as f32
    }

    /// In [−1, 1)³.
    pub fn vector(&mut self) -> Vec3 {
        2.0 * Vec3::new(self.unit(), self.unit(), self.unit()) - Vec3::ONE
    }

    pub fn below(&mut self, limit: usize) -> usize {
        (self.bits() % limit as u64) as usize
    }
}

/// A filter of one type whatever it does: kernels are compiled for every type of filter.
pub fn filter<'a>(decide: &'a Decide<'a>) -> FilterFn<&'a Decide<'a>> {
    FilterFn(decide)
}

type Decide<'a> = dyn Fn(u32, &Ray, &Hit) -> bool + 'a;

/// An owned mesh.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    pub positions: Vec<Vec3>,
    pub indices: Vec<[u32; 3]>,
}

impl Mesh {
    pub fn geometry(&self) -> TriangleMesh<'_> {
        TriangleMesh::new(&self.positions, &self.indices)
    }

    pub fn blas(&self, isa: IsaLevel) -> Blas {
        Blas::build(&[self.geometry()], &with_isa(isa)).unwrap()
    }

    pub fn push(&mut self, corners: [Vec3; 3]) {
        let first = self.positions.len() as u32;
        self.positions.extend(corners);
        self.indices.push([first, first + 1, first + 2]);
    }

    pub fn triangle(&self, index: usize) -> [Vec3; 3] {
        self.indices[index].map(|i| self.positions[i as usize])
    }

    pub fn map(mut self, f: impl Fn(Vec3) -> Vec3) -> Self {
        for p in &mut self.positions {
            *p = f(*p);
        }
        self
    }

    pub fn merged(mut self, other: &Self) -> Self {
        let first = self.positions.len() as u32;
        self.positions.extend(&other.positions);
        self.indices.extend(other.indices.iter().map(|t| t.map(|i| i + first)));
        self
    }
}

pub fn with_isa(isa: IsaLevel) -> BuildOptions<'static> {
    BuildOptions { isa: Some(isa), ..BuildOptions::default() }
}

pub const QUALITIES: [BuildQuality; 3] =
    [BuildQuality::Fast, BuildQuality::Balanced, BuildQuality::Best];

pub fn with_quality(quality: BuildQuality) -> BuildOptions<'static> {
    BuildOptions { quality, ..BuildOptions::default() }
}

/// Options of every builder, every curve, every quality and every layout.
pub fn all_builds() -> Vec<BuildOptions<'static>> {
    let along_curves = [Builder::Lbvh, Builder::Hlbvh, Builder::Ploc].into_iter().flat_map(|b| {
        [Curve::Morton, Curve::Hilbert].map(|curve| BuildOptions {
            builder: Some(b),
            curve,
            ..BuildOptions::default()
        })
    });
    let builds = QUALITIES.map(with_quality).into_iter().chain(along_curves);
    builds.flat_map(|build| Layout::ALL.map(|layout| BuildOptions { layout, ..build })).collect()
}

/// Random triangles of some size in [−1, 1]³.
pub fn soup(seed: u64, count: usize, size: f32) -> Mesh {
    let mut random = Random::new(seed);
    let mut mesh = Mesh::default();
    for _ in 0..count {
        let centre = random.vector();
        mesh.push([(); 3].map(|()| centre + size * random.vector()));
    }
    mesh
}

/// A closed sphere of `2·n²` or so triangles, vertices shared.
pub fn sphere(n: u32) -> Mesh {
    let mut mesh = Mesh::default();
    let rings = n;
    let sectors = 2 * n;
    mesh.positions.push(Vec3::Y);
    for ring in 1..rings {
        let theta = std::f32::consts::PI * ring as f32 / rings as f32;
        for sector in 0..sectors {
            let phi = std::f32::consts::TAU * sector as f32 / sectors as f32;
            let (sin, cos) = theta.sin_cos();
            mesh.positions.push(Vec3::new(sin * phi.cos(), cos, sin * phi.sin()));
        }
    }
    mesh.positions.push(-Vec3::Y);
    let last = mesh.positions.len() as u32 - 1;
    let at = |ring: u32, sector: u32| 1 + (ring - 1) * sectors + sector % sectors;
    for sector in 0..sectors {
        mesh.indices.push([0, at(1, sector + 1), at(1, sector)]);
        for ring in 1..rings - 1 {
            let [a, b] = [at(ring, sector), at(ring, sector + 1)];
            let [c, d] = [at(ring + 1, sector), at(ring + 1, sector + 1)];
            mesh.indices.extend([[a, b, c], [b, d, c]]);
        }
        mesh.indices.push([last, at(rings - 1, sector), at(rings - 1, sector + 1)]);
    }
    mesh
}

/// A closed box from −1 to 1 whose faces are grids of `n × n` cells, vertices shared.
pub fn grid_box(n: u32) -> Mesh {
    let mut mesh = Mesh::default();
    let mut ids = std::collections::BTreeMap::new();
    let mut vertex = |mesh: &mut Mesh, p: [u32; 3]| {
        *ids.entry(p).or_insert_with(|| {
            let p = Vec3::new(p[0] as f32, p[1] as f32, p[2] as f32);
            mesh.positions.push(p * (2.0 / n as f32) - Vec3::ONE);
            mesh.positions.len() as u32 - 1
        })
    };
    for axis in 0..3 {
        for side in [0, n] {
            for i in 0..n {
                for j in 0..n {
                    let quad = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(a, b)| {
                        let mut p = [0; 3];
                        p[axis] = side;
                        p[(axis + 1) % 3] = a;
                        p[(axis + 2) % 3] = b;
                        vertex(&mut mesh, p)
                    });
                    let [a, b, c, d] = quad;
                    if side == 0 {
                        mesh.indices.extend([[a, c, b], [a, d, c]]);
                    } else {
                        mesh.indices.extend([[a, b, c], [a, c, d]]);
                    }
                }
            }
        }
    }
    mesh
}

/// Long thin triangles.
pub fn needles(seed: u64, count: usize) -> Mesh {
    let mut random = Random::new(seed);
    let mut mesh = Mesh::default();
    for _ in 0..count {
        let (a, b) = (random.vector(), random.vector());
        mesh.push([a, b, b + 1e-3 * random.vector()]);
    }
    mesh
}

/// Triangles of zero area, on a line or a point, among few others.
pub fn degenerate(seed: u64, count: usize) -> Mesh {
    let mut random = Random::new(seed);
    let mut mesh = Mesh::default();
    for i in 0..count {
        let (a, b, c) = (random.vector(), random.vector(), random.vector());
        mesh.push(match i % 5 {
            0 => [a, a, a],
            1 => [a, a, b],
            2 => [Vec3::ZERO, Vec3::X, Vec3::X * 2.0],
            3 => [a, b, a],
            _ => [a, b, c],
        });
    }
    mesh
}

/// A ray from around a mesh of this radius to somewhere in it.
pub fn ray_at(random: &mut Random, centre: Vec3, radius: f32) -> Ray {
    let origin = centre + 2.0 * radius * random.vector();
    let target = centre + radius * random.vector();
    let length = [1.0, 1e-3, 1e4][random.below(3)];
    Ray::new(origin, (target - origin) * length)
}
