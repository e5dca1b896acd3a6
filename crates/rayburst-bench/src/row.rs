//! One measured figure.

use serde::Serialize;

use crate::machine::Machine;

/// The scene of rows that sum up all scenes.
pub const GEOMETRIC_MEAN: &str = "geometric mean";

/// A row of a benchmark's JSON array; fields that a benchmark does not have are left out.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Row {
    /// Which benchmark: `rays`, `build`, `update`, `pipeline` or `frame`.
    pub bench: &'static str,
    /// Name of the scene, or `geometric mean`.
    pub scene: String,
    /// Triangles in the scene.
    #[serde(skip_serializing_if = "is_zero")]
    pub triangles: usize,
    /// Which rays.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ray_set: Option<&'static str>,
    /// What was measured: `rayburst:PRESET:MODE`, `embree:QUALITY:WIDTH`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub engine: Option<String>,
    /// What built it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub builder: Option<&'static str>,
    /// What moves, and how.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub case: Option<&'static str>,
    /// How its structure is kept: `refit`, `rebuild:PRESET`, `update`, …
    #[serde(skip_serializing_if = "Option::is_none")]
    pub policy: Option<String>,
    /// Instances in the scene.
    #[serde(skip_serializing_if = "is_zero")]
    pub instances: usize,
    /// How frames are made: `hybrid` or `realtime-path`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mode: Option<&'static str>,
    /// The size that is rendered, as a part of the frame's along each side.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub render_scale: Option<f32>,
    /// What takes the noise out of frames, or `none`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub denoiser: Option<&'static str>,
    /// Which pass of a frame, or `frame` for all of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pass: Option<&'static str>,
    /// Rays of the pass in a frame, over the pixels of the size that is rendered; the mean.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rays_per_pixel: Option<f64>,
    /// Frames of a run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frames: Option<usize>,
    /// Those that built anew.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rebuilds: Option<usize>,
    /// The longest frame, milliseconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub longest: Option<f64>,
    /// Threads that worked.
    pub threads: usize,
    /// Median of the repeats.
    pub value: f64,
    /// Unit of `value`, `min` and `max`.
    pub unit: &'static str,
    /// `value` over that of the best peer in the same run; absent for peers and without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ratio: Option<f64>,
    /// What figures this is the ratio of: in means their unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ratio_of: Option<&'static str>,
    /// The peer that `ratio` is against.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub peer: Option<String>,
    /// `value` over that of the best peer that takes one ray a call.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub single_ratio: Option<f64>,
    /// Whether this is the fastest peer on these rays.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub best_peer: bool,
    /// Number of timed runs.
    pub repeats: usize,
    /// Slowest run; of a mean, the smallest ratio.
    pub min: f64,
    /// Fastest run; of a mean, the largest ratio.
    pub max: f64,
    /// Rays in the set.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rays: Option<usize>,
    /// Rays that hit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hits: Option<usize>,
    /// Nodes that a ray visits, on average.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nodes: Option<f64>,
    /// Leaves that a ray visits, on average.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leaves: Option<f64>,
    /// The share of all visits of nodes that were of a bundle of rays.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub packet_share: Option<f64>,
    /// Rays on their way at a visit, in flight or in its bundle, on average.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub in_flight: Option<f64>,
    /// Expected cost of a random ray by the surface area heuristic.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sah_cost: Option<f32>,
    /// Inner nodes on the longest path from the root.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub depth: Option<usize>,
    /// Scenes in a mean.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scenes: Option<usize>,
    /// Where and when.
    #[serde(flatten)]
    pub machine: Machine,
}

fn is_zero(number: &usize) -> bool {
    *number == 0
}

/// The geometric means over scenes of Rayburst's ratios, for each ray set or builder and engine, in
/// the order in which they first appear; none if there is only one scene.
pub fn geometric_means(rows: &[Row]) -> Vec<Row> {
    let same = |a: &Row, b: &Row| {
        (a.bench, a.ray_set, &a.engine, a.builder, a.threads, a.unit)
            == (b.bench, b.ray_set, &b.engine, b.builder, b.threads, b.unit)
    };
    let mut means: Vec<Row> = Vec::new();
    let rated: Vec<&Row> = rows.iter().filter(|row| row.ratio.is_some()).collect();
    for (index, first) in rated.iter().enumerate() {
        if rated[..index].iter().any(|earlier| same(earlier, first)) {
            continue;
        }
        let group: Vec<&Row> = rated.iter().filter(|row| same(row, first)).copied().collect();
        if group.len() < 2 {
            continue;
        }
        let ratios: Vec<f64> = group.iter().filter_map(|row| row.ratio).collect();
        let single: Vec<f64> = group.iter().filter_map(|row| row.single_ratio).collect();
        means.push(Row {
            bench: first.bench,
            scene: GEOMETRIC_MEAN.into(),
            ray_set: first.ray_set,
            engine: first.engine.clone(),
            builder: first.builder,
            threads: first.threads,
            value: geometric_mean(&ratios),
            unit: "ratio",
            ratio_of: Some(first.unit),
            single_ratio: (single.len() == group.len()).then(|| geometric_mean(&single)),
            repeats: first.repeats,
            min: ratios.iter().copied().fold(f64::INFINITY, f64::min),
            max: ratios.iter().copied().fold(0.0, f64::max),
            scenes: Some(group.len()),
            machine: first.machine.clone(),
            ..Row::default()
        });
    }
    means
}

/// The geometric mean of positive numbers; 1 of none.
fn geometric_mean(values: &[f64]) -> f64 {
    let sum: f64 = values.iter().map(|value| value.ln()).sum();
    (sum / values.len().max(1) as f64).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(scene: &str, set: &'static str, engine: &str, ratio: Option<f64>) -> Row {
        Row {
            bench: "rays",
            scene: scene.into(),
            triangles: 12,
            ray_set: Some(set),
            engine: Some(engine.into()),
            threads: 1,
            value: 5.0,
            unit: "Mrays/s",
            ratio,
            single_ratio: ratio.map(|r| 2.0 * r),
            repeats: 5,
            ..Row::default()
        }
    }

    #[test]
    fn means_are_per_set_and_engine() {
        let rows = [
            row("a", "ao", "rayburst:fast:auto", Some(2.0)),
            row("a", "ao", "embree:high:1", None),
            row("a", "primary", "rayburst:fast:auto", Some(3.0)),
            row("b", "ao", "rayburst:fast:auto", Some(0.5)),
            row("b", "ao", "embree:high:1", None),
            row("c", "ao", "rayburst:fast:auto", Some(8.0)),
        ];
        let means = geometric_means(&rows);
        assert_eq!(means.len(), 1, "primary has one scene, peers have no ratio");
        let mean = &means[0];
        assert_eq!((mean.scene.as_str(), mean.unit), ("geometric mean", "ratio"));
        assert_eq!(mean.ratio_of, Some("Mrays/s"));
        assert!((mean.value - 2.0).abs() < 1e-12);
        assert!((mean.single_ratio.unwrap() - 4.0).abs() < 1e-12);
        assert_eq!((mean.min, mean.max, mean.scenes), (0.5, 8.0, Some(3)));
        assert!(geometric_means(&rows[..3]).is_empty());
    }

    #[test]
    fn rows_are_flat_and_leave_out_what_they_lack() {
        let mut full = row("a", "ao", "embree:high:1", None);
        full.best_peer = true;
        full.machine.machine = "a CPU".into();
        let json = serde_json::to_value(&full).unwrap();
        assert_eq!(json["best_peer"], true);
        assert_eq!(json["machine"], "a CPU");
        assert_eq!(json["unit"], "Mrays/s");
        for absent in ["ratio", "single_ratio", "peer", "builder", "sah_cost", "scenes"] {
            assert!(json.get(absent).is_none(), "{absent}");
        }
        let own = serde_json::to_value(row("a", "ao", "rayburst:fast:auto", Some(2.0))).unwrap();
        assert_eq!(own["ratio"], 2.0);
        assert!(own.get("best_peer").is_none());
        assert!(json.as_object().unwrap().values().all(|v| !v.is_object() && !v.is_array()));
    }
}
