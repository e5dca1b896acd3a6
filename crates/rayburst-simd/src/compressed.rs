//! Nodes of quantised boxes and leaves of rows without gaps, and their expansion to [`Boxes8`] and
//! [`Triangles4`].
//!
//! After Ylitie, Karras, Laine, "Efficient incoherent ray traversal on GPUs through compressed wide
//! BVHs", HPG 2017, sections 3.2 and 4.1: 80 bytes for eight boxes, whose planes are eight-bit steps of
//! a power of two from a common corner. Changed: what follows a node (inner children and leaves of
//! triangles as they are traced) is one region in units of 40 bytes: half a node, or a triangle. So one
//! byte says where a child is and what, and one addition makes a reference of it.
//!
//! A step times a power of two is exact, and the sum is rounded once whether it is fused or not: all
//! instruction sets expand to the same bits.

use bytemuck::{Pod, Zeroable};

use crate::{Boxes8, Triangles4};

/// Words of a unit: half a node, or one triangle.
pub const UNIT_WORDS: usize = 10;
/// Words of the longest leaf, which may be read of every leaf.
pub const LEAF_WORDS: usize = 4 * UNIT_WORDS;

/// Eight quantised boxes: 80 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C, align(8))]
pub struct QuantizedNode8 {
    /// The corner from which steps are counted.
    pub origin: [f32; 3],
    /// For each axis the exponent of the step, biased as in `f32`; zero is no step at all.
    pub exponents: [u8; 3],
    /// Zero.
    pub spare: u8,
    /// Steps, in rows as those of [`Boxes8`].
    pub planes: [[u8; 8]; 6],
    /// Added to each of `children`.
    pub base: u32,
    /// Zero.
    pub spare_word: u32,
    /// What is added to `base` for the children's words; [`QuantizedNode8::NO_CHILD`] for none.
    pub children: [u8; 8],
}

impl QuantizedNode8 {
    /// Marks a slot without a child, whose box expands to an empty one along x.
    pub const NO_CHILD: u8 = 0xFF;
    /// No children.
    pub const EMPTY: Self = Self {
        origin: [0.0; 3],
        exponents: [0; 3],
        spare: 0,
        planes: [[0; 8]; 6],
        base: 0,
        spare_word: 0,
        children: [Self::NO_CHILD; 8],
    };

    /// The length of a step along an axis.
    #[inline(always)]
    pub fn step(&self, axis: usize) -> f32 {
        f32::from_bits(u32::from(self.exponents[axis]) << 23)
    }
}

/// A compressed leaf of one to four triangles: ten rows of as many words, nine of coordinates as in
/// [`Triangles4`] and one of ids.
#[derive(Clone, Copy, Debug)]
pub struct TriangleRows<'a> {
    words: &'a [u32; LEAF_WORDS],
    count: usize,
}

impl<'a> TriangleRows<'a> {
    /// The leaf at the start of some words, of which no more than belong to it have a meaning; `count`
    /// beyond one to four is taken as the nearest of these.
    #[inline(always)]
    pub fn new(words: &'a [u32; LEAF_WORDS], count: usize) -> Self {
        Self { words, count: count.clamp(1, 4) }
    }

    /// How many triangles there are.
    #[inline(always)]
    pub fn count(self) -> usize {
        self.count
    }

    /// The rows.
    #[inline(always)]
    #[cfg_attr(not(target_arch = "x86_64"), allow(dead_code))]
    pub(crate) fn words(self) -> &'a [u32; LEAF_WORDS] {
        self.words
    }

    /// The corners of a triangle.
    #[inline(always)]
    pub fn corners(self, lane: usize) -> [[f32; 3]; 3] {
        let mut corners = [[0.0; 3]; 3];
        for (row, number) in corners.as_flattened_mut().iter_mut().enumerate() {
            let word = self.words[(row * self.count + lane % 4) % LEAF_WORDS];
            *number = f32::from_bits(word);
        }
        corners
    }

    /// The id of a triangle.
    #[inline(always)]
    pub fn id(self, lane: usize) -> u32 {
        self.words[(9 * self.count + lane % 4) % LEAF_WORDS]
    }
}

/// [`crate::Isa::expand8`]. Not inlined: it is long, and kernels that care for speed have their own.
#[inline(never)]
pub(crate) fn expand8(node: &QuantizedNode8) -> (Boxes8, [u32; 8]) {
    let mut boxes = Boxes8::EMPTY;
    for (row, (planes, steps)) in boxes.planes.iter_mut().zip(&node.planes).enumerate() {
        for (slot, (plane, &steps)) in planes.iter_mut().zip(steps).enumerate() {
            if row > 1 || node.children[slot] != QuantizedNode8::NO_CHILD {
                *plane = f32::from(steps) * node.step(row / 2) + node.origin[row / 2];
            }
        }
    }
    (boxes, node.children.map(|child| node.base.wrapping_add(u32::from(child))))
}

/// [`crate::Isa::expand4`]. Not inlined, as above.
#[inline(never)]
pub(crate) fn expand4(rows: TriangleRows<'_>, unused: u32) -> Triangles4 {
    let mut block = Triangles4 { vertices: [[[UNUSED; 4]; 3]; 3], ids: [unused; 4] };
    for lane in 0..rows.count {
        for (vertices, corner) in block.vertices.iter_mut().zip(rows.corners(lane)) {
            for (row, x) in vertices.iter_mut().zip(corner) {
                row[lane] = x;
            }
        }
        block.ids[lane] = rows.id(lane);
    }
    block
}

/// What lanes without a triangle hold: the NaN of all bits.
const UNUSED: f32 = f32::from_bits(u32::MAX);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Isa, IsaLevel, Kernel, Scalar, SlabRay, tests::Random};

    struct Expand<'a>(&'a QuantizedNode8, &'a [u32; LEAF_WORDS], usize);

    impl Kernel for Expand<'_> {
        type Output = (Boxes8, [u32; 8], Triangles4);

        #[inline(always)]
        fn run<I: Isa>(self, isa: I) -> Self::Output {
            let (boxes, children) = isa.expand8(self.0);
            (boxes, children, isa.expand4(TriangleRows::new(self.1, self.2), 7))
        }
    }

    #[test]
    fn nodes_and_leaves_expand_to_the_same_bits() {
        let mut random = Random(11);
        for i in 0..20_000 {
            let bits = [(); 20].map(|()| random.next().to_bits() ^ random.next().to_bits() << 9);
            let mut node: QuantizedNode8 = bytemuck::cast(bits);
            node.origin = random.vector().map(|x| x * 1e3);
            node.exponents = [0, 1, 2].map(|axis| node.exponents[axis] % 140);
            if i % 3 == 0 {
                node.children[i % 8] = QuantizedNode8::NO_CHILD;
            }
            let leaf = [(); LEAF_WORDS].map(|()| random.next().to_bits());
            for count in 1..=4 {
                let words = |(boxes, children, block): (Boxes8, [u32; 8], Triangles4)| {
                    let boxes: [u32; 48] = bytemuck::cast(boxes);
                    let block: [u32; 40] = bytemuck::cast(block);
                    (boxes, children, block)
                };
                let expected = words((
                    expand8(&node).0,
                    expand8(&node).1,
                    expand4(TriangleRows::new(&leaf, count), 7),
                ));
                for level in IsaLevel::available() {
                    let found = words(level.dispatch(Expand(&node, &leaf, count)));
                    assert!(found == expected, "{}", level.name());
                }
            }
        }
    }

    struct Meet<'a>(&'a QuantizedNode8, &'a SlabRay);

    impl Kernel for Meet<'_> {
        /// Slots that are met, then the same by the other two operations, sorted and not.
        type Output = [u32; 3];

        #[inline(always)]
        fn run<I: Isa>(self, isa: I) -> [u32; 3] {
            let Self(node, ray) = self;
            let mask = isa.quantized_slab8(node, ray, 0.0, 10.0, &mut [0.0; 8]);
            let (mut keys, mut found) = ([0; 8], [0; 8]);
            let (spans, rays) = ([[0.0, 10.0]], [ray]);
            let [count] = isa.quantized_sorted8([node], rays, spans, [&mut keys], [&mut found]);
            let slots_of =
                |found: &[u32]| found.iter().fold(0, |mask, word| mask | 1 << (word - node.base));
            let sorted = slots_of(&found[..count]);
            assert!(keys[..count].is_sorted_by(|a, b| a > b));
            let (count, first) = isa.quantized_met8(node, ray, 0.0, 10.0, &mut found);
            let others = if count == 0 { 0 } else { slots_of(&found[..count - 1]) | 1 << first };
            [mask, sorted, others]
        }
    }

    #[test]
    fn quantised_boxes_are_met_like_the_expanded_ones() {
        let mut random = Random(12);
        let (mut met, mut differing) = (0, 0);
        for _ in 0..20_000 {
            let mut node = QuantizedNode8::EMPTY;
            node.origin = random.vector();
            node.exponents = [0, 1, 2].map(|_| 119 + (random.next().abs() * 3.0) as u8);
            node.base = 800;
            // A child's word tells its slot.
            for slot in 0..8 {
                if random.next() > -0.7 {
                    node.children[slot] = slot as u8;
                }
                for axis in 0..3 {
                    let steps = [(); 2].map(|()| (random.next().abs() * 255.0) as u8);
                    node.planes[2 * axis][slot] = steps[0].min(steps[1]);
                    node.planes[2 * axis + 1][slot] = steps[0].max(steps[1]);
                }
            }
            let (origin, direction) = (random.vector(), random.vector());
            let inverse = direction.map(|d| 1.0 / if d == 0.0 { 1e-9 } else { d });
            let ray = |margin: f32| {
                let offset = |sign: f32| {
                    [0, 1, 2, 0].map(|a| origin[a] * inverse[a] + sign * margin * inverse[a].abs())
                };
                let [x, y, z] = inverse;
                SlabRay::new([x, y, z, f32::NAN], offset(1.0), offset(-1.0))
            };
            let boxes = expand8(&node).0;
            let mask = |margin| Scalar.slab8(&boxes, &ray(margin), 0.0, 10.0, &mut [0.0; 8]);
            let (certain, possible) = (mask(0.0), mask(2e-5));
            for level in IsaLevel::available() {
                let [mask, sorted, others] = level.dispatch(Meet(&node, &ray(1e-5)));
                assert!(mask == sorted && mask == others, "{}", level.name());
                assert!(mask & certain == certain && mask & !possible == 0, "{}", level.name());
                met += mask.count_ones();
                differing += (mask ^ certain).count_ones();
            }
        }
        assert!(met > 5_000 && differing < met / 100, "{met}, {differing}");
    }

    #[test]
    fn a_node_is_eighty_bytes_and_expands_to_what_it_says() {
        assert_eq!(size_of::<QuantizedNode8>(), 80);
        let mut node = QuantizedNode8::EMPTY;
        assert_eq!(expand8(&node).0.planes[0], [f32::INFINITY; 8]);
        assert_eq!(expand8(&node).0.planes[1], [f32::NEG_INFINITY; 8]);
        node.origin = [1.0, 2.0, 3.0];
        node.exponents = [127, 126, 0];
        node.base = 80;
        node.children[2] = 9;
        node.planes.iter_mut().enumerate().for_each(|(row, planes)| planes[2] = 10 + row as u8);
        let (boxes, children) = expand8(&node);
        assert_eq!(boxes.planes.map(|row| row[2]), [11.0, 12.0, 8.0, 8.5, 3.0, 3.0]);
        assert_eq!(children[2], 89);
    }
}
