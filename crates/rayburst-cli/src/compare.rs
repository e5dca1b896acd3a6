//! `rayburst compare`.

use std::path::Path;

use rayburst::image::{
    PictureFormat,
    metrics::{Metric, StoredAs, compare},
    read_picture, write_png,
};
use serde_json::{Map, Value, json};

use crate::{
    args::verbs::CompareArgs,
    error::{CliError, Result, shown},
    output::{self, Format},
    terminal,
};

/// What is measured of pictures of 8 bits and of linear ones, unless told otherwise.
const USUAL_SRGB: [Metric; 4] = [Metric::Flip, Metric::Rmse, Metric::Psnr, Metric::Ssim];
const USUAL_LINEAR: [Metric; 5] =
    [Metric::HdrFlip, Metric::Rmse, Metric::RelMse, Metric::Psnr, Metric::Ssim];

/// Measures how far B is from A.
pub(crate) fn run(args: &CompareArgs) -> Result<()> {
    if let Some(path) = &args.heatmap {
        if Format::of(path)? != Format::Png {
            return Err(CliError::usage(format!("a heat map is a .png, not {}", path.display())));
        }
        output::check_writable(path)?;
    }
    let (a, b) = (read_picture(&args.a)?, read_picture(&args.b)?);
    let stored = match (stored_as(&args.a), stored_as(&args.b)) {
        (StoredAs::Srgb, StoredAs::Srgb) => StoredAs::Srgb,
        (StoredAs::Linear, StoredAs::Linear) => StoredAs::Linear,
        _ => {
            terminal::note("one picture is linear and one is not: linear values are compared");
            StoredAs::Linear
        }
    };
    let usual: &[Metric] = if stored == StoredAs::Srgb { &USUAL_SRGB } else { &USUAL_LINEAR };
    let metrics = args.metric.as_ref().map_or(usual, |list| &list.0);
    let mut object = Map::new();
    object.insert("a".into(), json!(shown(&args.a).display().to_string()));
    object.insert("b".into(), json!(shown(&args.b).display().to_string()));
    object.insert("size".into(), json!([a.width, a.height]));
    let mut lines = Vec::new();
    for (index, &metric) in metrics.iter().enumerate() {
        let result = compare(metric, &a, &b, stored)?;
        if let (0, Some(path)) = (index, &args.heatmap) {
            write_png(path, &result.heat_map())?;
            terminal::say(format!("{}: heat map of {}", path.display(), metric.name()));
        }
        lines.push(format!("{:9} {:.6}", metric.name(), result.value));
        // An infinite ratio (equal pictures) is null.
        object.insert(metric.name().into(), json!(result.value));
    }
    if args.json {
        return terminal::result(Value::from(object).to_string());
    }
    lines.iter().try_for_each(terminal::result)
}

fn stored_as(path: &Path) -> StoredAs {
    use PictureFormat::{Exr, Hdr, Pfm};
    match PictureFormat::from_path(path) {
        Some(Exr | Hdr | Pfm) => StoredAs::Linear,
        _ => StoredAs::Srgb,
    }
}
