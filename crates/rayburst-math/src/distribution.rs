//! Tabulated distributions: sampling in proportion to a list or a grid of weights.

use glam::Vec2;

/// A piecewise-constant density over [0, 1) or a choice among `n` items, by inversion.
#[derive(Clone, Debug, Default)]
pub struct Distribution1d {
    /// `cdf[i]` is the probability of an item below `i`; `n + 1` entries, last exactly 1.
    cdf: Vec<f32>,
    /// Where to begin to search for numbers from `k/n` on, so that a few steps are enough (Chen, Asau: "On
    /// Generating Random Variates from an Empirical Distribution", AIIE Transactions 1974).
    guide: Vec<u32>,
    total: f32,
}

impl Distribution1d {
    /// From weights; negative and non-finite ones count as zero. All-zero weights give a
    /// distribution whose [`Distribution1d::total`] is 0 and that chooses evenly.
    pub fn new(weights: &[f32]) -> Self {
        let clean = |w: f32| if w.is_finite() && w > 0.0 { f64::from(w) } else { 0.0 };
        let total: f64 = weights.iter().map(|&w| clean(w)).sum();
        let n = weights.len();
        let mut cdf = Vec::with_capacity(n + 1);
        let mut sum = 0.0f64;
        cdf.push(0.0);
        for (i, &w) in weights.iter().enumerate() {
            sum += clean(w);
            let p = if total > 0.0 { sum / total } else { (i + 1) as f64 / n as f64 };
            cdf.push(p as f32);
        }
        if let Some(last) = cdf.last_mut().filter(|_| n > 0) {
            *last = 1.0;
        }
        let mut item = 0;
        let guide = (0..n).map(|k| {
            let from = k as f32 / n as f32;
            while item + 1 < n && cdf[item + 1] <= from {
                item += 1;
            }
            item as u32
        });
        Self { guide: guide.collect(), cdf, total: total as f32 }
    }

    /// Number of items.
    pub fn len(&self) -> usize {
        self.cdf.len().saturating_sub(1)
    }

    /// Whether there is nothing to choose from.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Sum of the weights.
    pub fn total(&self) -> f32 {
        self.total
    }

    /// Probability of item `i`.
    #[inline]
    pub fn probability(&self, i: usize) -> f32 {
        self.cdf[i + 1] - self.cdf[i]
    }

    /// An item chosen by `u` in [0, 1), its probability, and `u` stretched over the item so that it
    /// can be used again. Never returns an item of probability zero. `None` when empty.
    #[inline]
    pub fn sample(&self, u: f32) -> Option<(usize, f32, f32)> {
        if self.is_empty() {
            return None;
        }
        let last = self.len() - 1;
        let mut i = self.guide[((u * self.guide.len() as f32) as usize).min(last)] as usize;
        // The last item that begins at or below `u`.
        while i < last && self.cdf[i + 1] <= u {
            i += 1;
        }
        while i > 0 && self.cdf[i] > u {
            i -= 1;
        }
        let p = self.probability(i);
        let rest = if p > 0.0 { ((u - self.cdf[i]) / p).clamp(0.0, 1.0 - f32::EPSILON) } else { u };
        Some((i, p, rest))
    }
}

/// A piecewise-constant density over the unit square: rows (`y`) first, then columns (`x`).
#[derive(Clone, Debug, Default)]
pub struct Distribution2d {
    rows: Distribution1d,
    columns: Vec<Distribution1d>,
    width: usize,
}

impl Distribution2d {
    /// From row-major weights, `width` a row; `weights.len()` must be a multiple of `width > 0`.
    pub fn new(weights: &[f32], width: usize) -> Self {
        assert!(width > 0 && weights.len().is_multiple_of(width), "ragged weights");
        let columns: Vec<_> = weights.chunks_exact(width).map(Distribution1d::new).collect();
        let sums: Vec<f32> = columns.iter().map(Distribution1d::total).collect();
        Self { rows: Distribution1d::new(&sums), columns, width }
    }

    /// Sum of the weights.
    pub fn total(&self) -> f32 {
        self.rows.total()
    }

    /// A point of the unit square and its density with respect to area.
    #[inline]
    pub fn sample(&self, u: Vec2) -> Option<(Vec2, f32)> {
        let (row, p_row, rest_y) = self.rows.sample(u.y)?;
        let (column, p_column, rest_x) = self.columns[row].sample(u.x)?;
        let (w, h) = (self.width as f32, self.columns.len() as f32);
        let p = Vec2::new((column as f32 + rest_x) / w, (row as f32 + rest_y) / h);
        Some((p.min(Vec2::splat(1.0 - f32::EPSILON)), p_row * p_column * w * h))
    }

    /// Density at a point of the unit square.
    #[inline]
    pub fn pdf(&self, p: Vec2) -> f32 {
        let h = self.columns.len();
        if h == 0 {
            return 0.0;
        }
        let row = ((p.y * h as f32) as usize).min(h - 1);
        let column = ((p.x * self.width as f32) as usize).min(self.width - 1);
        self.rows.probability(row) * self.columns[row].probability(column) * (self.width * h) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hash::Rng;

    #[test]
    fn items_come_in_proportion_and_zeros_never() {
        let d = Distribution1d::new(&[0.0, 1.0, 0.0, 3.0, f32::NAN, 0.0]);
        let mut rng = Rng::new(4);
        let mut n = [0u32; 6];
        for _ in 0..100_000 {
            let (i, p, rest) = d.sample(rng.f32()).unwrap();
            assert!((0.0..1.0).contains(&rest));
            assert_eq!(p, [0.0, 0.25, 0.0, 0.75, 0.0, 0.0][i]);
            n[i] += 1;
        }
        assert_eq!(n[0] + n[2] + n[4] + n[5], 0);
        assert!((f64::from(n[1]) - 25_000.0).abs() < 5.0 * 137.0);
        assert!(Distribution1d::new(&[]).sample(0.5).is_none());
        assert_eq!(Distribution1d::new(&[0.0, 0.0]).sample(0.75).unwrap().0, 1);
        assert_eq!(d.sample(1.0 - f32::EPSILON).unwrap().0, 3);
    }

    #[test]
    fn the_guide_finds_what_a_search_finds() {
        let mut rng = Rng::new(6);
        for n in [1usize, 2, 7, 100, 3000] {
            let weights: Vec<f32> =
                (0..n).map(|_| if rng.f32() < 0.3 { 0.0 } else { rng.f32().powi(8) }).collect();
            let d = Distribution1d::new(&weights);
            let edges = d.cdf.iter().flat_map(|&c| [c.next_down(), c, c.next_up()]);
            let others = (0..5000).map(|_| rng.f32());
            for u in edges.chain(others).filter(|u| (0.0..1.0).contains(u)).collect::<Vec<_>>() {
                let searched = (d.cdf.partition_point(|&c| c <= u) - 1).min(n - 1);
                assert_eq!(d.sample(u).unwrap().0, searched, "{u} of {n}");
            }
        }
    }

    #[test]
    fn the_square_is_sampled_by_its_density() {
        let weights = [1.0, 2.0, 3.0, 0.0, 4.0, 6.0];
        let d = Distribution2d::new(&weights, 3);
        let mut rng = Rng::new(5);
        let mut bins = [0u32; 6];
        let mut mean = 0.0f64;
        const N: u32 = 100_000;
        for _ in 0..N {
            let (p, pdf) = d.sample(rng.vec2()).unwrap();
            assert!((pdf - d.pdf(p)).abs() < 1e-4);
            bins[(p.y * 2.0) as usize * 3 + (p.x * 3.0) as usize] += 1;
            mean += 1.0 / f64::from(pdf);
        }
        for (b, w) in bins.iter().zip(weights) {
            let e = f64::from(N) * f64::from(w) / 16.0;
            assert!((f64::from(*b) - e).abs() <= 5.0 * e.sqrt());
        }
        // The expected reciprocal density is the area of the support.
        assert!((mean / f64::from(N) - 5.0 / 6.0).abs() < 0.01);
    }
}
