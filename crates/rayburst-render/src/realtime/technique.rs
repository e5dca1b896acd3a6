//! Which of two ways an effect is made, from measured time ("use raster when faster, else rays to amaze").

use super::settings::{Quality, Technique};

/// Frames after which the way that was slower is tried again.
const RETRY: u32 = 64;

/// Times of both ways of an effect.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Chooser {
    /// Running means, seconds.
    seconds: [Option<f64>; 2],
    age: u32,
}

impl Chooser {
    /// The way for the next frame: what is asked for, or what was faster lately. `exact` says whether
    /// rasterising is as good as rays.
    pub(crate) fn choose(&self, asked: Technique, quality: Quality, exact: bool) -> Technique {
        match asked {
            Technique::Auto if !exact && quality == Quality::Exact => Technique::Rays,
            Technique::Auto => match self.seconds {
                [None, _] => Technique::Raster,
                [_, None] => Technique::Rays,
                [Some(raster), Some(rays)] => {
                    let raster_is_faster = raster < rays;
                    if raster_is_faster != (self.age >= RETRY) {
                        Technique::Raster
                    } else {
                        Technique::Rays
                    }
                }
            },
            other => other,
        }
    }

    /// Learns what a way took.
    pub(crate) fn note(&mut self, technique: Technique, seconds: f64) {
        let slot = usize::from(technique == Technique::Rays);
        let is_slower = self.seconds[1 - slot].is_some_and(|other| other < seconds);
        self.age = if is_slower { 0 } else { self.age.saturating_add(1) };
        let mean = self.seconds[slot].map_or(seconds, |before| 0.8 * before + 0.2 * seconds);
        self.seconds[slot] = Some(mean);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn choose(chooser: &Chooser) -> Technique {
        chooser.choose(Technique::Auto, Quality::Exact, true)
    }

    #[test]
    fn the_faster_way_is_taken_once_both_are_known_and_the_other_retried() {
        let mut chooser = Chooser::default();
        assert_eq!(choose(&chooser), Technique::Raster);
        chooser.note(Technique::Raster, 2.0);
        assert_eq!(choose(&chooser), Technique::Rays);
        chooser.note(Technique::Rays, 5.0);
        let mut retried = 0;
        for _ in 0..200 {
            let way = choose(&chooser);
            retried += u32::from(way == Technique::Rays);
            chooser.note(way, if way == Technique::Raster { 2.0 } else { 5.0 });
        }
        assert!((2..=4).contains(&retried), "{retried}");
        // Rasterising becomes slow: rays from then on.
        for _ in 0..20 {
            let way = choose(&chooser);
            chooser.note(way, if way == Technique::Raster { 20.0 } else { 5.0 });
        }
        assert_eq!(choose(&chooser), Technique::Rays);
    }

    #[test]
    fn what_is_asked_for_is_done_and_worse_ways_are_not_taken_unasked() {
        let mut chooser = Chooser::default();
        chooser.note(Technique::Raster, 1.0);
        chooser.note(Technique::Rays, 2.0);
        for way in [Technique::Raster, Technique::Rays] {
            assert_eq!(chooser.choose(way, Quality::Exact, false), way);
        }
        let auto = |quality| chooser.choose(Technique::Auto, quality, false);
        assert_eq!(auto(Quality::Exact), Technique::Rays);
        assert_eq!(auto(Quality::Fast), Technique::Raster);
    }
}
