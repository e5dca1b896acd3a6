//! Vertices from separately indexed attributes: equal combinations become one vertex.
//!
//! An open-addressing table with linear probing over the keys themselves; slots hold only the
//! vertex's number, so a probe touches four bytes and mostly one key.

/// What makes a vertex: indices of a position and of two attributes.
pub(crate) type VertexKey = [u32; 3];

const EMPTY: u32 = u32::MAX;

/// Numbers distinct keys in the order they first appear.
#[derive(Debug)]
pub(crate) struct Welder {
    slots: Vec<u32>,
    keys: Vec<VertexKey>,
}

impl Welder {
    /// An empty table.
    pub(crate) fn new() -> Self {
        Self { slots: vec![EMPTY; 64], keys: Vec::new() }
    }

    /// The keys by number.
    pub(crate) fn keys(&self) -> &[VertexKey] {
        &self.keys
    }

    /// The number of a key; new ones get the next.
    #[inline]
    pub(crate) fn number_of(&mut self, key: VertexKey) -> u32 {
        let mask = self.slots.len() - 1;
        let mut slot = hash(key) & mask;
        loop {
            let number = self.slots[slot];
            if number == EMPTY {
                break;
            }
            if self.keys[number as usize] == key {
                return number;
            }
            slot = (slot + 1) & mask;
        }
        let number = self.keys.len() as u32;
        self.slots[slot] = number;
        self.keys.push(key);
        if self.keys.len() * 2 > self.slots.len() {
            self.grow();
        }
        number
    }

    #[cold]
    fn grow(&mut self) {
        let len = self.slots.len() * 4;
        self.slots.clear();
        self.slots.resize(len, EMPTY);
        for (number, &key) in self.keys.iter().enumerate() {
            let mut slot = hash(key) & (len - 1);
            while self.slots[slot] != EMPTY {
                slot = (slot + 1) & (len - 1);
            }
            self.slots[slot] = number as u32;
        }
    }
}

/// Multiply and fold: every bit of the key reaches the low bits. Neighbouring positions land far
/// apart, which linear probing needs.
#[inline]
fn hash([a, b, c]: VertexKey) -> usize {
    let low = (u64::from(a) | u64::from(b) << 32) ^ 0x9e37_79b9_7f4a_7c15;
    let high = (u64::from(c) << 1 | 1).wrapping_mul(0xd6e8_feb8_6659_fd93);
    let product = u128::from(low) * u128::from(high);
    let folded = (product as u64) ^ (product >> 64) as u64;
    let mixed = folded.wrapping_mul(0xff51_afd7_ed55_8ccd);
    (mixed >> 32 ^ mixed) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_keys_get_equal_numbers_in_order_of_appearance() {
        let mut welder = Welder::new();
        let key = |i: u32| [i / 7, i % 3, u32::MAX - i % 5];
        let numbers: Vec<u32> = (0..10_000).map(|i| welder.number_of(key(i))).collect();
        for i in 0..10_000 {
            assert_eq!(welder.number_of(key(i)), numbers[i as usize]);
            assert_eq!(welder.keys()[numbers[i as usize] as usize], key(i));
        }
        let mut distinct: Vec<VertexKey> = (0..10_000).map(key).collect();
        distinct.sort_unstable();
        distinct.dedup();
        assert_eq!(welder.keys().len(), distinct.len());
        assert_eq!(numbers[0], 0);
    }

    #[test]
    fn common_patterns_do_not_pile_up() {
        let patterns: [fn(u32) -> VertexKey; 4] =
            [|i| [i, u32::MAX, u32::MAX], |i| [i, i, i], |i| [0, i, u32::MAX], |i| [7, 7, i]];
        for (which, pattern) in patterns.into_iter().enumerate() {
            let slots = 1 << 16;
            let mut counts = vec![0_u32; slots];
            (0..slots as u32).for_each(|i| counts[hash(pattern(i)) & (slots - 1)] += 1);
            let fullest = counts.into_iter().max();
            assert!(fullest <= Some(16), "pattern {which}: {fullest:?}");
        }
    }
}
