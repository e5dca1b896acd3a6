//! Who is best: rates of one ray set set against those of the peers.

/// The speed of one engine.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rate {
    pub(crate) rate: f64,
    pub(crate) is_peer: bool,
    /// Whether each ray is a call of its own.
    pub(crate) is_single: bool,
}

/// Where an engine stands among the others.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Standing {
    /// Whether it is the fastest of the peers.
    pub(crate) is_best_peer: bool,
    /// Index of the fastest peer, for engines that are no peers.
    pub(crate) against: Option<usize>,
    /// Rate over that of the fastest peer.
    pub(crate) ratio: Option<f64>,
    /// Rate over that of the fastest peer that takes one ray a call.
    pub(crate) single_ratio: Option<f64>,
}

/// Compares the engines of one ray set.
pub(crate) fn standings(rates: &[Rate]) -> Vec<Standing> {
    let fastest = |counts: &dyn Fn(&Rate) -> bool| {
        let candidates = rates.iter().enumerate().filter(|(_, r)| counts(r) && r.rate > 0.0);
        // The first of equals.
        candidates.fold(None, |best: Option<(usize, f64)>, (index, r)| match best {
            Some((_, rate)) if rate >= r.rate => best,
            _ => Some((index, r.rate)),
        })
    };
    let best = fastest(&|r| r.is_peer);
    let best_single = fastest(&|r| r.is_peer && r.is_single);
    rates
        .iter()
        .enumerate()
        .map(|(index, r)| {
            if r.is_peer {
                let is_best_peer = best.is_some_and(|(best, _)| best == index);
                return Standing { is_best_peer, ..Standing::default() };
            }
            Standing {
                is_best_peer: false,
                against: best.map(|(index, _)| index),
                ratio: best.map(|(_, rate)| r.rate / rate),
                single_ratio: best_single.map(|(_, rate)| r.rate / rate),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn own(rate: f64) -> Rate {
        Rate { rate, is_peer: false, is_single: false }
    }

    fn peer(rate: f64, is_single: bool) -> Rate {
        Rate { rate, is_peer: true, is_single }
    }

    #[test]
    fn ratios_are_against_the_best_peer() {
        let rates = [own(6.0), peer(2.0, true), own(1.0), peer(4.0, false), peer(3.0, true)];
        let standings = standings(&rates);
        let best: Vec<bool> = standings.iter().map(|s| s.is_best_peer).collect();
        assert_eq!(best, [false, false, false, true, false]);
        let ratios: Vec<_> = standings.iter().map(|s| s.ratio).collect();
        assert_eq!(ratios, [Some(1.5), None, Some(0.25), None, None]);
        assert_eq!((standings[0].single_ratio, standings[0].against), (Some(2.0), Some(3)));
        assert_eq!(standings[4], Standing::default());
    }

    #[test]
    fn without_peers_there_is_no_ratio() {
        assert_eq!(standings(&[own(6.0), own(2.0)]), [Standing::default(); 2]);
        let packets_only = standings(&[own(6.0), peer(3.0, false)]);
        assert_eq!((packets_only[0].ratio, packets_only[0].single_ratio), (Some(2.0), None));
    }

    #[test]
    fn of_equals_one_is_best() {
        let standings = standings(&[peer(2.0, true), peer(2.0, true)]);
        assert!(standings[0].is_best_peer && !standings[1].is_best_peer);
    }
}
