//! Every instruction set against [`Scalar`], and [`Scalar`] against what it means.

use crate::{
    Boxes8, Isa, IsaLevel, Kernel, Nearest, Scalar, ShearRay, SlabRay, TriangleHits, Triangles4,
};

/// A reproducible stream of numbers in [−1, 1).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> f32 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    }

    pub(crate) fn vector(&mut self) -> [f32; 3] {
        [self.next(), self.next(), self.next()]
    }
}

fn slab_ray(inverse: [f32; 3], near_offset: [f32; 3], far_offset: [f32; 3]) -> SlabRay {
    let widened = |[x, y, z]: [f32; 3]| [x, y, z, f32::NAN];
    SlabRay::new(widened(inverse), widened(near_offset), widened(far_offset))
}

struct Slab<'a>(&'a Boxes8, &'a SlabRay, f32, f32);

impl Kernel for Slab<'_> {
    type Output = (u32, [f32; 8]);

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> Self::Output {
        let mut distances = [0.0; 8];
        let mask = isa.slab8(self.0, self.1, self.2, self.3, &mut distances);
        (mask, distances)
    }
}

struct Test<'a>(&'a Triangles4, &'a ShearRay, f32, f32);

impl Kernel for Test<'_> {
    type Output = TriangleHits;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> TriangleHits {
        let mut hits = TriangleHits::default();
        let mask = isa.triangles4(self.0, self.1, self.2, self.3, &mut hits);
        assert_eq!(mask, hits.mask);
        hits
    }
}

pub(crate) fn random_boxes(random: &mut Random) -> Boxes8 {
    let mut boxes = Boxes8::EMPTY;
    for slot in 0..7 {
        for axis in 0..3 {
            let (a, b) = (random.next(), random.next());
            boxes.planes[2 * axis][slot] = a.min(b);
            boxes.planes[2 * axis + 1][slot] = a.max(b);
        }
    }
    boxes
}

pub(crate) fn random_block(random: &mut Random, degenerate: bool) -> Triangles4 {
    let mut block = Triangles4 { vertices: [[[f32::NAN; 4]; 3]; 3], ids: [7, 8, 9, u32::MAX] };
    for lane in 0..3 {
        for corner in 0..3 {
            for (axis, x) in random.vector().into_iter().enumerate() {
                // On a lattice, many edge functions are exactly zero.
                block.vertices[corner][axis][lane] = if degenerate { (2.0 * x).round() } else { x };
            }
        }
    }
    block
}

#[test]
fn boxes_are_met_alike_up_to_the_rounding_of_a_plane() {
    let mut random = Random(1);
    let mut met = 0;
    for _ in 0..20_000 {
        let boxes = random_boxes(&mut random);
        let (origin, direction) = (random.vector(), random.vector());
        let inverse = direction.map(|d| 1.0 / if d == 0.0 { 1e-9 } else { d });
        let offset = [0, 1, 2].map(|axis| origin[axis] * inverse[axis]);
        let margin = inverse.map(|i| 1e-5 * i.abs());
        let widened = |sign: f32| [0, 1, 2].map(|a| offset[a] + sign * margin[a]);
        let exact = slab_ray(inverse, offset, offset);
        let wide = slab_ray(inverse, widened(1.0), widened(-1.0));
        let (certain, _) = Scalar.dispatch_slab(&boxes, &exact);
        for level in IsaLevel::available() {
            let (mask, distances) = level.dispatch(Slab(&boxes, &wide, 0.0, 10.0));
            assert_eq!(mask & certain, certain, "{}", level.name());
            assert_eq!(mask & 0x80, 0, "an empty slot is met");
            let (scalar_mask, scalar) = Slab(&boxes, &wide, 0.0, 10.0).run(Scalar);
            for slot in (0..8).filter(|slot| mask & scalar_mask & (1 << slot) != 0) {
                let tolerance = 1e-5 * (1.0 + offset.iter().fold(0.0, |m: f32, o| m.max(o.abs())));
                assert!((distances[slot] - scalar[slot]).abs() <= tolerance);
                met += 1;
            }
        }
    }
    assert!(met > 1000);
}

impl Scalar {
    fn dispatch_slab(self, boxes: &Boxes8, ray: &SlabRay) -> (u32, [f32; 8]) {
        Slab(boxes, ray, 0.0, 10.0).run(self)
    }
}

#[test]
fn triangles_are_met_alike_bit_for_bit() {
    let mut random = Random(2);
    let mut met = [0; 2];
    for i in 0..40_000 {
        let degenerate = i % 2 == 0;
        let block = random_block(&mut random, degenerate);
        let (mut origin, mut direction) = (random.vector(), random.vector());
        if degenerate {
            origin = origin.map(|x| (2.0 * x).round());
            direction = direction.map(|x| (2.0 * x).round());
            if direction == [0.0; 3] {
                direction = [1.0, 0.0, 0.0];
            }
        }
        let ray = ShearRay::new(&origin, &direction, 1.0);
        let expected = Test(&block, &ray, -1.0, 5.0).run(Scalar);
        assert_eq!(expected.mask & 8, 0, "a lane of NaN is met");
        met[i % 2] += expected.mask.count_ones();
        for level in IsaLevel::available() {
            let hits = level.dispatch(Test(&block, &ray, -1.0, 5.0));
            assert_eq!(hits.mask, expected.mask, "{}", level.name());
            for lane in (0..4).filter(|lane| expected.mask & (1 << lane) != 0) {
                let bits = |h: &TriangleHits| [h.t[lane], h.u[lane], h.v[lane]].map(f32::to_bits);
                assert_eq!(bits(&hits), bits(&expected), "{}", level.name());
                assert_eq!((hits.front ^ expected.front) >> lane & 1, 0);
            }
        }
    }
    assert!(met[0] > 1000 && met[1] > 1000, "{met:?}");
}

struct NearestOf<'a>(&'a Triangles4, &'a ShearRay, f32, [u32; 2]);

impl Kernel for NearestOf<'_> {
    type Output = Nearest;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> Nearest {
        isa.nearest4(self.0, self.1, 0.0, self.2, self.3)
    }
}

#[test]
fn the_nearest_triangle_is_that_of_all() {
    let mut random = Random(5);
    let mut met = [0; 2];
    for i in 0..40_000 {
        let block = random_block(&mut random, i % 4 == 0);
        let (mut origin, direction) = (random.vector(), random.vector());
        if i % 4 == 0 {
            // Through corners of the lattice.
            origin = [0, 1, 2].map(|k| block.vertices[i / 4 % 3][k][0] - direction[k]);
        }
        let ray = ShearRay::new(&origin, &direction, 1.0);
        let keep = [[u32::MAX; 2], [u32::MAX, 0], [0, u32::MAX]][i % 3];
        for level in IsaLevel::available() {
            let hits = level.dispatch(Test(&block, &ray, 0.0, 2.0));
            let mask = (hits.front & keep[0] | !hits.front & keep[1]) & hits.mask;
            let lanes = || (0..4).filter(|lane| mask >> lane & 1 != 0);
            let nearest = level.dispatch(NearestOf(&block, &ray, 2.0, keep));
            if nearest.doubtful {
                met[0] += 1;
                continue;
            }
            met[1] += usize::from(mask != 0);
            assert_eq!(nearest.mask, mask, "{}", level.name());
            let t = lanes().map(|lane| hits.t[lane]).fold(f32::INFINITY, f32::min);
            assert_eq!(nearest.t, t);
            if mask != 0 {
                assert_eq!(hits.t[nearest.lane as usize], t);
                assert_eq!(lanes().filter(|&lane| hits.t[lane] == t).count(), 1);
            }
        }
    }
    assert!(met[0] > 100 && met[1] > 200, "{met:?}");
}

struct NearestOfFour<'a>([&'a Triangles4; 4], [&'a ShearRay; 4], [[f32; 2]; 4], [[u32; 2]; 4]);

impl Kernel for NearestOfFour<'_> {
    /// Together, then each by itself.
    type Output = [[Nearest; 4]; 2];

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> Self::Output {
        let Self(blocks, rays, spans, keep) = self;
        let mut single = [Nearest::NONE; 4];
        for (i, nearest) in single.iter_mut().enumerate() {
            *nearest = isa.nearest4(blocks[i], rays[i], spans[i][0], spans[i][1], keep[i]);
        }
        [isa.nearest4_of4(blocks, rays, spans, keep), single]
    }
}

#[test]
fn four_rays_meet_their_triangles_as_each_does() {
    let mut random = Random(6);
    let mut kinds = [0; 3];
    for i in 0..20_000 {
        let blocks = [(); 4].map(|()| random_block(&mut random, i % 4 == 0));
        let rays = [0, 1, 2, 3].map(|ray: usize| {
            let (mut origin, direction) = (random.vector(), random.vector());
            if i % 4 == 0 {
                // Through corners of the lattice.
                let corner = &blocks[ray].vertices[i / 4 % 3];
                origin = [0, 1, 2].map(|k| corner[k][0] - direction[k]);
            }
            ShearRay::new(&origin, &direction, 1.0)
        });
        let spans = [0.0, 0.1, 0.0, 0.5].map(|t_min| [t_min, 1.0 + random.next().abs()]);
        let keep = [[u32::MAX; 2], [u32::MAX, 0], [0, u32::MAX], [u32::MAX; 2]];
        let (blocks, rays) = (blocks.each_ref(), rays.each_ref());
        for level in IsaLevel::available() {
            let [all, single] = level.dispatch(NearestOfFour(blocks, rays, spans, keep));
            for (together, alone) in all.iter().zip(&single) {
                // What is doubtful is asked again.
                assert_eq!(together.doubtful, alone.doubtful, "{}", level.name());
                let kind = if alone.doubtful { 0 } else { 1 + usize::from(alone.mask != 0) };
                kinds[kind] += 1;
                assert!(
                    kind == 0 || together == alone,
                    "{}: {together:?}, {alone:?}",
                    level.name()
                );
            }
        }
    }
    assert!(kinds.iter().all(|&count| count > 1000), "{kinds:?}");
}

#[test]
fn a_shared_edge_belongs_to_a_triangle_on_either_side() {
    // Two triangles of a quad, met exactly on their diagonal from many sides.
    let mut random = Random(3);
    for _ in 0..20_000 {
        let [a, b, c, d] = [(); 4].map(|()| random.vector());
        let mut block = Triangles4 { vertices: [[[f32::NAN; 4]; 3]; 3], ids: [0; 4] };
        for (lane, corners) in [[a, b, c], [c, d, a]].into_iter().enumerate() {
            for (corner, position) in corners.into_iter().enumerate() {
                for axis in 0..3 {
                    block.vertices[corner][axis][lane] = position[axis];
                }
            }
        }
        let on_edge = [0, 1, 2].map(|axis| 0.5 * (a[axis] + c[axis]));
        let origin = random.vector();
        let direction = [0, 1, 2].map(|axis| on_edge[axis] - origin[axis]);
        let ray = ShearRay::new(&origin, &direction, 1.0);
        for level in IsaLevel::available() {
            let hits = level.dispatch(Test(&block, &ray, 0.0, f32::INFINITY));
            // Both on one side of the edge as seen by the ray: it may pass beside the fold.
            let side = |p: [f32; 3]| {
                let sub =
                    |x: [f32; 3], y: [f32; 3]| [0, 1, 2].map(|i| f64::from(x[i]) - f64::from(y[i]));
                let (e, f, g) = (sub(c, a), sub(p, a), direction.map(f64::from));
                e[0] * (f[1] * g[2] - f[2] * g[1])
                    + e[1] * (f[2] * g[0] - f[0] * g[2])
                    + e[2] * (f[0] * g[1] - f[1] * g[0])
            };
            if side(b) * side(d) < -1e-6 {
                assert_ne!(hits.mask, 0, "{}: a ray slips through", level.name());
            }
        }
    }
}

struct Order<'a>(&'a Boxes8, &'a SlabRay, f32, f32);

impl Kernel for Order<'_> {
    /// Mask, sorted keys and children, children by slot.
    type Output = (u32, Vec<u32>, Vec<u32>, Vec<u32>);

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> Self::Output {
        let children = [10, 11, 12, 13, 14, 15, 16, 17];
        let (mut keys, mut found, mut met) = ([0; 8], [0; 8], [0; 8]);
        let mask = isa.slab8(self.0, self.1, self.2, self.3, &mut [0.0; 8]);
        let node = (self.0, &children);
        let span = [self.2, self.3];
        let [count] = isa.sorted8([node], [self.1], [span], [&mut keys], [&mut found]);
        // Beside a ray that starts elsewhere, nothing changes.
        let mut other = [[0; 8]; 4];
        let [a, b, c, d] = &mut other;
        let (nodes, rays, spans) = ([node; 2], [self.1; 2], [[0.5 * self.3, self.3], span]);
        let [_, again] = isa.sorted8(nodes, rays, spans, [a, b], [c, d]);
        assert_eq!((again, &b[..count], &d[..count]), (count, &keys[..count], &found[..count]));
        let (met_count, first) = isa.met8(node, self.1, self.2, self.3, &mut met);
        assert_eq!((count, met_count), (mask.count_ones() as usize, count));
        if mask == 0 {
            return (mask, vec![], vec![], vec![]);
        }
        let mut by_slot = met[..count - 1].to_vec();
        by_slot.insert(0, children[first as usize]);
        (mask, keys[..count].to_vec(), found[..count].to_vec(), by_slot)
    }
}

/// However long and thin a triangle is, the distance is as good as its corners are.
#[test]
fn distances_to_slivers_are_accurate() {
    let mut random = Random(11);
    let (mut count, mut worst) = (0, 0.0f64);
    while count < 20_000 {
        let width = 10f32.powf(3.0 * random.next() - 3.0);
        let (along, across) = (random.vector(), random.vector());
        let a = random.vector();
        let point = |s: f32, t: f32| [0, 1, 2].map(|i| a[i] + 100.0 * s * along[i] + t * across[i]);
        let corners = [a, point(1.0, 0.0), point(0.5, width)];
        let mut block = Triangles4 { vertices: [[[f32::NAN; 4]; 3]; 3], ids: [0; 4] };
        for corner in 0..3 {
            for axis in 0..3 {
                block.vertices[corner][axis][0] = corners[corner][axis];
            }
        }
        let (origin, direction) = (random.vector(), random.vector());
        let longest = direction.iter().fold(0.0f32, |l, d| l.max(d.abs()));
        // Through a point of the inside, as long as a coordinate is one.
        let inside = point(0.2 + 0.3 * (random.next() + 1.0), 0.2 * width);
        let direction = direction.map(|d| d / longest);
        let way = 3.0 * random.next();
        let origin = [0, 1, 2].map(|i| inside[i] + 0.1 * origin[i] - way * direction[i]);
        let direction = [0, 1, 2].map(|i| inside[i] - origin[i]);
        let longest = direction.iter().fold(0.0f32, |l, d| l.max(d.abs()));
        let direction = direction.map(|d| d / longest);
        let ray = ShearRay::new(&origin, &direction, 1.0);
        let hits = Test(&block, &ray, f32::NEG_INFINITY, f32::INFINITY).run(Scalar);

        let wide = |v: [f32; 3]| v.map(f64::from);
        let minus = |p: [f64; 3], q: [f64; 3]| [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
        let dot = |p: [f64; 3], q: [f64; 3]| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
        let [a, b, c] = corners.map(wide);
        let (p, q) = (minus(b, a), minus(c, a));
        let normal =
            [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
        let facing = dot(normal, wide(direction)) / dot(normal, normal).sqrt();
        // Seen from the side, a corner that is off moves the hit far along the ray.
        if hits.mask == 0 || facing.abs() < 0.3 {
            continue;
        }
        let t = dot(normal, minus(a, wide(origin))) / dot(normal, wide(direction));
        worst = worst.max((f64::from(hits.t[0]) - t).abs());
        count += 1;
    }
    // Corners are up to 175 away, where numbers are multiples of 2⁻¹⁶.
    assert!(worst < 2.0 / f64::from(1 << 15), "{worst}");
}

#[test]
fn children_are_sorted_farthest_first() {
    let mut random = Random(3);
    let mut counts = [0; 9];
    for i in 0..40_000 {
        let mut boxes = random_boxes(&mut random);
        let inverse = random.vector().map(|x| 1.0 / x);
        let mut offset = [0, 1, 2].map(|axis| random.next() * inverse[axis]);
        if i % 2 == 0 {
            // From within boxes: many are met, at equal distances.
            for slot in 0..8 - (i / 2) % 4 {
                for axis in 0..3 {
                    boxes.planes[2 * axis][slot] = -random.next().abs();
                    boxes.planes[2 * axis + 1][slot] = random.next().abs();
                }
            }
            offset = [0.0; 3];
        }
        let ray = slab_ray(inverse, offset, offset);
        for level in IsaLevel::available() {
            let (mask, keys, found, met) = level.dispatch(Order(&boxes, &ray, 0.0, 10.0));
            let distances = level.dispatch(Slab(&boxes, &ray, 0.0, 10.0)).1;
            counts[keys.len()] += 1;
            assert!(keys.is_sorted_by(|a, b| a > b), "{}: {keys:?}", level.name());
            let by_slot: Vec<u32> =
                (0..8).filter(|slot| mask >> slot & 1 != 0).map(|slot| slot + 10).collect();
            assert_eq!(met, by_slot, "{}", level.name());
            for (key, child) in keys.iter().zip(&found) {
                let slot = key & crate::SLOT;
                assert_eq!(child - 10, slot);
                assert_eq!(key & !crate::SLOT, distances[slot as usize].to_bits() & !crate::SLOT);
            }
        }
    }
    assert!(counts.iter().all(|&count| count > 50), "{counts:?}");
}

#[test]
fn the_last_key_within_a_limit_is_found() {
    struct Last<'a>(&'a [u32; 8], u32);
    impl Kernel for Last<'_> {
        type Output = usize;
        #[inline(always)]
        fn run<I: Isa>(self, isa: I) -> usize {
            isa.last_within8(self.0, self.1)
        }
    }
    let mut random = Random(4);
    for _ in 0..5_000 {
        let keys = [0; 8].map(|_: u32| (random.next().abs() * 10.0).to_bits());
        for limit in [0, keys[3], (random.next().abs() * 10.0).to_bits(), i32::MAX as u32] {
            let expected = keys.iter().rposition(|&key| key <= limit).map_or(0, |i| i + 1);
            for level in IsaLevel::available() {
                assert_eq!(level.dispatch(Last(&keys, limit)), expected, "{}", level.name());
            }
        }
    }
}
