//! `cargo xtask performance RAYS.json BUILD.json UPDATE.json PIPELINE.json`: the tables of `docs/performance.md` from the rows
//! that `rayburst bench` wrote. Text outside the markers is left alone.

use std::{fmt::Write as _, fs, path::Path};

use serde_json::Value;

const BEGIN: &str = "<!-- generated -->";
const END: &str = "<!-- end -->";
const PAGE: &str = "docs/performance.md";
const MEAN: &str = "geometric mean";

/// Reads the rows and writes the page.
pub(crate) fn run(files: &[&str]) -> Result<(), String> {
    let mut rows = Vec::new();
    for file in files {
        let text = fs::read_to_string(file).map_err(|e| format!("{file}: {e}"))?;
        let array: Vec<Value> = serde_json::from_str(&text).map_err(|e| format!("{file}: {e}"))?;
        rows.extend(array);
    }
    let old = match fs::read_to_string(PAGE) {
        Ok(text) => text,
        Err(_) if !Path::new(PAGE).exists() => format!("# Performance\n\n{BEGIN}\n{END}\n"),
        Err(e) => return Err(format!("{PAGE}: {e}")),
    };
    let page = replace(&old, &report(&rows)?)?;
    fs::create_dir_all("docs").map_err(|e| format!("docs: {e}"))?;
    fs::write(PAGE, page).map_err(|e| format!("{PAGE}: {e}"))?;
    eprintln!("{PAGE}: {} rows", rows.len());
    Ok(())
}

/// Puts the generated text between the markers.
fn replace(page: &str, generated: &str) -> Result<String, String> {
    let missing = || format!("{PAGE} lacks the lines `{BEGIN}` and `{END}`");
    let (before, rest) = page.split_once(BEGIN).ok_or_else(missing)?;
    let (_, after) = rest.split_once(END).ok_or_else(missing)?;
    Ok(format!("{before}{BEGIN}\n\n{}\n\n{END}{after}", generated.trim()))
}

fn text<'a>(row: &'a Value, key: &str) -> &'a str {
    row[key].as_str().unwrap_or_default()
}

fn number(row: &Value, key: &str) -> Option<f64> {
    row[key].as_f64()
}

fn engine(row: &Value) -> &str {
    text(row, "engine")
}

fn is_own(row: &Value) -> bool {
    engine(row).starts_with("rayburst:")
}

/// A scene's name without its folder and ending.
fn scene(row: &Value) -> String {
    let name = text(row, "scene");
    let file = name.rsplit('/').next().unwrap_or(name);
    let endings = [".gltf", ".glb", ".obj", ".ply"];
    endings.iter().find_map(|ending| file.strip_suffix(ending)).unwrap_or(file).to_owned()
}

/// The different values, in the order of their first appearance.
fn distinct<T: PartialEq>(values: impl Iterator<Item = T>) -> Vec<T> {
    let mut list = Vec::new();
    for value in values {
        if !list.contains(&value) {
            list.push(value);
        }
    }
    list
}

/// Two digits after the point, or a dash.
fn shown(value: Option<f64>) -> String {
    value.map_or_else(|| "–".into(), |v| format!("{v:.2}"))
}

fn table(out: &mut String, head: &[String], rows: &[Vec<String>], left_columns: usize) {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    out.push_str(&line(head));
    let rules: Vec<String> =
        (0..head.len()).map(|c| if c < left_columns { "---" } else { "--:" }.into()).collect();
    out.push_str(&line(&rules));
    for row in rows {
        out.push_str(&line(row));
    }
    out.push('\n');
}

/// All tables.
fn report(rows: &[Value]) -> Result<String, String> {
    let first = rows.first().ok_or("the files hold no rows")?;
    let mut out = format!(
        "Measured on {} · {} · {} hardware threads · {} · medians of {} interleaved runs.\n\n",
        text(first, "date"),
        text(first, "machine"),
        first["hardware_threads"],
        text(first, "isa"),
        first["repeats"],
    );
    for threads in distinct(rows.iter().filter_map(|row| row["threads"].as_u64())) {
        let of = |bench: &str| -> Vec<&Value> {
            let counts = |row: &&Value| row["threads"] == threads && text(row, "bench") == bench;
            rows.iter().filter(counts).collect()
        };
        let plural = if threads == 1 { "thread" } else { "threads" };
        let rays = of("rays");
        if !rays.is_empty() {
            let _ = writeln!(out, "## Rays, {threads} {plural}\n");
            ratios(&mut out, &rays);
            rates(&mut out, &rays);
        }
        let builds = of("build");
        if !builds.is_empty() {
            let _ = writeln!(out, "## Builds, {threads} {plural}\n");
            build_table(&mut out, &builds);
        }
        let updates = of("update");
        if !updates.is_empty() {
            let _ = writeln!(out, "## Updates, {threads} {plural}\n");
            update_table(&mut out, &updates);
        }
        let pipelines = of("pipeline");
        if !pipelines.is_empty() {
            let _ = writeln!(out, "## Shaders, {threads} {plural}\n");
            pipeline_table(&mut out, &pipelines);
        }
    }
    Ok(out)
}

/// For each of Rayburst's engines, ratios by scene and ray set.
fn ratios(out: &mut String, rows: &[&Value]) {
    let sets = distinct(rows.iter().map(|row| text(row, "ray_set")));
    for name in distinct(rows.iter().filter(|row| is_own(row)).map(|row| engine(row))) {
        let own: Vec<&&Value> = rows.iter().filter(|row| engine(row) == name).collect();
        // Single calls are compared with single calls.
        let (key, against) = if name.ends_with(":call") {
            ("single_ratio", "the fastest peer that takes one ray a call")
        } else {
            ("ratio", "the fastest peer on the same rays")
        };
        let value = |row: &Value| match text(row, "scene") {
            MEAN if key == "ratio" => number(row, "value"),
            _ => number(row, key),
        };
        if own.iter().all(|row| value(row).is_none()) {
            continue;
        }
        let _ = writeln!(out, "`{name}` over {against}:\n");
        let mut head = vec!["scene".to_owned()];
        head.extend(sets.iter().map(|set| set.replace('_', " ")));
        let mut lines: Vec<Vec<String>> = distinct(own.iter().map(|row| text(row, "scene")))
            .into_iter()
            .map(|place| {
                let here: Vec<&&&Value> =
                    own.iter().filter(|row| text(row, "scene") == place).collect();
                let title = if place == MEAN { format!("**{MEAN}**") } else { scene(here[0]) };
                let cell = |set: &&str| {
                    let found = here.iter().find(|row| text(row, "ray_set") == *set);
                    let value = shown(found.and_then(|row| value(row)));
                    if place == MEAN { format!("**{value}**") } else { value }
                };
                std::iter::once(title).chain(sets.iter().map(cell)).collect()
            })
            .collect();
        if own.iter().any(|row| text(row, "scene") == MEAN) {
            let least = |set: &&str| {
                let of_set = own
                    .iter()
                    .filter(|row| text(row, "ray_set") == *set && text(row, "scene") != MEAN);
                shown(of_set.filter_map(|row| value(row)).reduce(f64::min))
            };
            lines.push(std::iter::once("least".to_owned()).chain(sets.iter().map(least)).collect());
        }
        table(out, &head, &lines, 1);
    }
}

/// Mrays/s of Rayburst's engines and of the fastest peer, by scene and ray set.
fn rates(out: &mut String, rows: &[&Value]) {
    out.push_str("Mrays/s:\n\n");
    let measured: Vec<&&Value> = rows.iter().filter(|row| text(row, "scene") != MEAN).collect();
    let own = distinct(measured.iter().filter(|row| is_own(row)).map(|row| engine(row)));
    let mut head = vec!["scene".to_owned(), "rays".to_owned(), "fastest peer".to_owned()];
    head.push("its rate".into());
    head.extend(own.iter().map(|name| format!("`{name}`")));
    let places = distinct(measured.iter().map(|row| (text(row, "scene"), text(row, "ray_set"))));
    let lines: Vec<Vec<String>> = places
        .into_iter()
        .map(|place| {
            let here: Vec<&&&Value> = measured
                .iter()
                .filter(|row| (text(row, "scene"), text(row, "ray_set")) == place)
                .collect();
            let best = here.iter().find(|row| row["best_peer"] == true);
            let mut line = vec![scene(here[0]), place.1.replace('_', " ")];
            line.push(best.map_or_else(|| "–".into(), |row| format!("`{}`", engine(row))));
            line.push(shown(best.and_then(|row| number(row, "value"))));
            line.extend(own.iter().map(|name| {
                let found = here.iter().find(|row| engine(row) == *name);
                shown(found.and_then(|row| number(row, "value")))
            }));
            line
        })
        .collect();
    table(out, &head, &lines, 3);
}

/// Speed, memory and quality of builds.
fn build_table(out: &mut String, rows: &[&Value]) {
    let head = ["scene", "engine", "builder", "Mtri/s", "ratio", "B/tri", "SAH cost", "depth"];
    let head = head.map(str::to_owned);
    let mut lines = Vec::new();
    for row in rows.iter().filter(|row| text(row, "unit") == "Mtri/s") {
        let same = |other: &&&Value| {
            let key =
                |r: &Value| [text(r, "scene"), engine(r), text(r, "builder")].map(str::to_owned);
            text(other, "unit") == "B/tri" && key(other) == key(row)
        };
        let bytes = rows.iter().find(same).and_then(|row| number(row, "value"));
        lines.push(vec![
            scene(row),
            format!("`{}`", engine(row)),
            text(row, "builder").to_owned(),
            shown(number(row, "value")),
            shown(number(row, "ratio")),
            bytes.map_or_else(|| "–".into(), |b| format!("{b:.0}")),
            shown(number(row, "sah_cost")),
            row["depth"].as_u64().map_or_else(|| "–".into(), |d| d.to_string()),
        ]);
    }
    for row in rows.iter().filter(|row| text(row, "scene") == MEAN) {
        let what = text(row, "ratio_of");
        let value = format!("**{}**", shown(number(row, "value")));
        let mut line = vec![String::new(); head.len()];
        line[0] = format!("**{MEAN}**, {what}");
        line[1] = format!("`{}`", engine(row));
        line[2] = text(row, "builder").to_owned();
        line[4] = value;
        lines.push(line);
    }
    table(out, &head, &lines, 3);
}

/// What moves, how its structure is kept, and what that takes.
fn update_table(out: &mut String, rows: &[&Value]) {
    let head = ["case", "scene", "policy", "figure", "", "least", "most", "builds"];
    let head = head.map(str::to_owned);
    let line = |row: &&Value| {
        let unit = match (text(row, "ratio_of"), text(row, "peer")) {
            ("speed", peer) => format!("times as fast as `{peer}`"),
            ("", _) => text(row, "unit").to_owned(),
            (what, peer) => format!("of the {what} of `{peer}`"),
        };
        let count = match row["instances"].as_u64() {
            Some(count) => format!("{}, {count} instances", scene(row)),
            None => scene(row),
        };
        vec![
            text(row, "case").to_owned(),
            count,
            format!("`{}`", text(row, "policy")),
            shown(number(row, "value")),
            unit,
            shown(number(row, "min")),
            shown(number(row, "max")),
            row["rebuilds"].as_u64().map_or_else(String::new, |n| n.to_string()),
        ]
    };
    let lines: Vec<Vec<String>> = rows.iter().map(line).collect();
    table(out, &head, &lines, 3);
}

fn pipeline_table(out: &mut String, rows: &[&Value]) {
    let head = ["scene", "form", "Mrays/s", "of", "ratio"].map(str::to_owned);
    let line = |row: &&Value| {
        let (peer, ratio) = (text(row, "peer"), number(row, "ratio"));
        let engine = format!("`{}`", engine(row));
        let peer = if peer.is_empty() { String::new() } else { format!("`{peer}`") };
        vec![scene(row), engine, shown(number(row, "value")), peer, shown(ratio)]
    };
    let lines: Vec<Vec<String>> = rows.iter().map(line).collect();
    table(out, &head, &lines, 2);
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn rows() -> Vec<Value> {
        let machine = |mut row: Value| {
            for (key, value) in [
                ("machine", json!("Some CPU")),
                ("hardware_threads", json!(2)),
                ("isa", json!("avx2")),
                ("date", json!("2026-01-31")),
                ("repeats", json!(5)),
                ("threads", json!(1)),
            ] {
                row[key] = value;
            }
            row
        };
        let rays = |scene: &str, engine: &str, value: f64| {
            machine(json!({"bench": "rays", "scene": scene, "ray_set": "diffuse_shuffled",
                           "engine": engine, "value": value, "unit": "Mrays/s"}))
        };
        let with = |mut row: Value, key: &str, value: Value| {
            row[key] = value;
            row
        };
        let own = |scene: &str, value: f64, ratio: f64| {
            with(rays(scene, "rayburst:fast:auto", value), "ratio", json!(ratio))
        };
        vec![
            own("a/sponza.gltf", 6.0, 2.0),
            with(rays("a/sponza.gltf", "rayburst:fast:call", 2.0), "single_ratio", json!(0.8)),
            with(rays("a/sponza.gltf", "embree:high:1", 3.0), "best_peer", json!(true)),
            rays("a/sponza.gltf", "embree:medium:1", 2.5),
            own("city", 1.0, 0.5),
            with(rays("city", "embree:medium:1", 2.0), "best_peer", json!(true)),
            with(rays(MEAN, "rayburst:fast:auto", 1.0), "unit", json!("ratio")),
            machine(json!({"bench": "build", "scene": "city", "engine": "rayburst:fast",
                "builder": "binned-sah", "value": 12.5, "unit": "Mtri/s", "ratio": 1.25,
                "sah_cost": 30.125, "depth": 9})),
            machine(json!({"bench": "build", "scene": "city", "engine": "rayburst:fast",
                "builder": "binned-sah", "value": 71.4, "unit": "B/tri"})),
            machine(json!({"bench": "build", "scene": "city", "engine": "embree:low",
                "builder": "morton", "value": 10.0, "unit": "Mtri/s"})),
            machine(json!({"bench": "build", "scene": MEAN, "engine": "rayburst:fast",
                "builder": "binned-sah", "value": 1.1, "unit": "ratio", "ratio_of": "Mtri/s"})),
            machine(
                json!({"bench": "update", "case": "twist", "scene": "column", "policy": "refit",
                "value": 1.25, "unit": "ms", "min": 1.0, "max": 2.0, "rebuilds": 4}),
            ),
            machine(json!({"bench": "update", "case": "instances", "scene": "balls",
                "instances": 9, "policy": "update:fast", "value": 3.0, "unit": "ratio",
                "ratio_of": "speed", "peer": "rebuild:fast", "min": 2.5, "max": 3.5})),
            machine(json!({"bench": "pipeline", "scene": "a/sponza.gltf", "engine": "query",
                "value": 2.0, "unit": "Mrays/s"})),
            machine(json!({"bench": "pipeline", "scene": "a/sponza.gltf", "engine": "portable",
                "value": 4.0, "unit": "Mrays/s", "ratio": 2.0, "peer": "query"})),
        ]
    }

    const GOLDEN: &str = "\
Measured on 2026-01-31 · Some CPU · 2 hardware threads · avx2 · medians of 5 interleaved runs.

## Rays, 1 thread

`rayburst:fast:auto` over the fastest peer on the same rays:

| scene | diffuse shuffled |
| --- | --: |
| sponza | 2.00 |
| city | 0.50 |
| **geometric mean** | **1.00** |
| least | 0.50 |

`rayburst:fast:call` over the fastest peer that takes one ray a call:

| scene | diffuse shuffled |
| --- | --: |
| sponza | 0.80 |

Mrays/s:

| scene | rays | fastest peer | its rate | `rayburst:fast:auto` | `rayburst:fast:call` |
| --- | --- | --- | --: | --: | --: |
| sponza | diffuse shuffled | `embree:high:1` | 3.00 | 6.00 | 2.00 |
| city | diffuse shuffled | `embree:medium:1` | 2.00 | 1.00 | – |

## Builds, 1 thread

| scene | engine | builder | Mtri/s | ratio | B/tri | SAH cost | depth |
| --- | --- | --- | --: | --: | --: | --: | --: |
| city | `rayburst:fast` | binned-sah | 12.50 | 1.25 | 71 | 30.12 | 9 |
| city | `embree:low` | morton | 10.00 | – | – | – | – |
| **geometric mean**, Mtri/s | `rayburst:fast` | binned-sah |  | **1.10** |  |  |  |

## Updates, 1 thread

| case | scene | policy | figure |  | least | most | builds |
| --- | --- | --- | --: | --: | --: | --: | --: |
| twist | column | `refit` | 1.25 | ms | 1.00 | 2.00 | 4 |
| instances | balls, 9 instances | `update:fast` | 3.00 | times as fast as `rebuild:fast` | 2.50 | 3.50 |  |

## Shaders, 1 thread

| scene | form | Mrays/s | of | ratio |
| --- | --- | --: | --: | --: |
| sponza | `query` | 2.00 |  | – |
| sponza | `portable` | 4.00 | `query` | 2.00 |

";

    #[test]
    fn tables_are_as_written() {
        assert_eq!(report(&rows()).unwrap(), GOLDEN);
        assert!(report(&[]).is_err());
    }

    #[test]
    fn what_is_written_by_hand_survives() {
        let page = format!("# Performance\n\nBefore.\n\n{BEGIN}\nold\n{END}\n\n## By hand\n");
        let new = replace(&page, "new\n\n").unwrap();
        assert_eq!(
            new,
            format!("# Performance\n\nBefore.\n\n{BEGIN}\n\nnew\n\n{END}\n\n## By hand\n")
        );
        assert_eq!(replace(&new, "new").unwrap(), new);
        assert!(replace("# Performance\n", "new").is_err());
        assert!(replace(&format!("{END} {BEGIN}"), "new").is_err());
    }
}
