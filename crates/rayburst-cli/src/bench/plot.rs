//! The bars of `--plot`: for each scene and ray set (or preset) this engine beside the best peer.

use rayburst::{glam::Vec2, image::Rgb8Image};
use rayburst_bench::{Row, row::GEOMETRIC_MEAN};

use crate::{
    error::Result,
    figure::canvas::{Anchor, Canvas, Ink, Pen, Style, ink},
};

/// Two bars beside one another.
#[derive(Clone, Debug, PartialEq)]
struct Group {
    /// What is compared.
    label: String,
    own: Option<Bar>,
    peer: Option<Bar>,
}

#[derive(Clone, Debug, PartialEq)]
struct Bar {
    engine: String,
    value: f64,
}

/// The groups of one scene.
#[derive(Clone, Debug, PartialEq)]
struct Panel {
    title: String,
    groups: Vec<Group>,
}

/// Sizes in points.
const PANEL: Vec2 = Vec2::new(640.0, 260.0);
const MARGIN: f32 = 24.0;
const HEAD: f32 = 92.0;
const OWN_INK: Ink = ink::BLUE;
const PEER_INK: Ink = ink::YELLOW;

/// Draws the rows' scenes, two beside one another.
pub(crate) fn draw(rows: &[Row]) -> Result<Rgb8Image> {
    let panels = panels(rows);
    let columns = panels.len().clamp(1, 2);
    let lines = panels.len().div_ceil(columns).max(1);
    let width = 2.0 * MARGIN + columns as f32 * PANEL.x;
    let height = HEAD + lines as f32 * PANEL.y + MARGIN;
    let mut canvas = Canvas::new(width as u32, height as u32)?;
    if let Some(first) = rows.first() {
        head(&mut canvas, first);
    }
    for (index, panel) in panels.iter().enumerate() {
        let place = Vec2::new((index % columns) as f32, (index / columns) as f32);
        draw_panel(&mut canvas, Vec2::new(MARGIN, HEAD) + place * PANEL, panel);
    }
    Ok(canvas.into_image())
}

fn head(canvas: &mut Canvas, row: &Row) {
    let machine = &row.machine;
    let threads = if row.threads == 1 { "thread" } else { "threads" };
    let (what, own, peer) = match row.bench {
        "rays" => ("Rays", "Rayburst, its fastest way", "the best peer"),
        _ => ("Builds", "Rayburst, by preset", "the peer's build of the same kind"),
    };
    canvas.heading(
        &format!("{what}, {}, {} {threads}", row.unit, row.threads),
        &format!("{} · {} · {}", machine.machine, machine.isa, machine.date),
    );
    let mut at = Vec2::new(MARGIN, 74.0);
    for (ink, text, width) in [(OWN_INK, own, 200.0), (PEER_INK, peer, 0.0)] {
        rectangle(canvas, at - Vec2::new(0.0, 9.0), Vec2::splat(10.0), ink);
        let place = at + Vec2::new(16.0, 0.0);
        canvas.text(place, text, 12.0, ink::BLACK, Anchor::Start, Style::Plain);
        at.x += width;
    }
}

/// What is drawn: of each scene and ray set the best peer and the fastest of this engine's ways; of
/// builds each preset beside its peer; of means the best of this engine's beside 1.
fn panels(rows: &[Row]) -> Vec<Panel> {
    let mut panels: Vec<Panel> = Vec::new();
    let drawn = |row: &&Row| row.unit != "B/tri" && row.ratio_of != Some("B/tri");
    for row in rows.iter().filter(drawn) {
        let engine = row.engine.clone().unwrap_or_default();
        let is_own = engine.starts_with("rayburst:");
        let label = match row.ray_set {
            Some(set) => set.replace('_', " "),
            // Builds: the preset.
            None if is_own => engine.trim_start_matches("rayburst:").to_owned(),
            None => continue,
        };
        let is_mean = row.scene == GEOMETRIC_MEAN;
        let title =
            super::short_name(&row.scene).to_owned() + if is_mean { " of the ratios" } else { "" };
        let panel = match panels.iter_mut().position(|panel| panel.title == title) {
            Some(index) => &mut panels[index],
            None => {
                panels.push(Panel { title, groups: Vec::new() });
                let last = panels.len() - 1;
                &mut panels[last]
            }
        };
        let group = match panel.groups.iter().position(|group| group.label == label) {
            Some(index) => &mut panel.groups[index],
            None => {
                panel.groups.push(Group { label, own: None, peer: None });
                let last = panel.groups.len() - 1;
                &mut panel.groups[last]
            }
        };
        let bar = Bar { engine, value: row.value };
        if is_own {
            if group.own.as_ref().is_none_or(|own| own.value < bar.value) {
                group.own = Some(bar);
            }
        } else if row.best_peer {
            group.peer = Some(bar);
        }
        if is_mean {
            group.peer = Some(Bar { engine: String::new(), value: 1.0 });
        } else if row.bench == "build" {
            let peer = row.peer.as_ref().and_then(|name| {
                let same = |r: &&Row| {
                    r.scene == row.scene && r.unit == row.unit && r.engine.as_ref() == Some(name)
                };
                rows.iter().find(same)
            });
            group.peer = peer.map(|peer| Bar {
                engine: peer.engine.clone().unwrap_or_default(),
                value: peer.value,
            });
        }
    }
    panels
}

/// A round number of steps that reaches a value: the step, and how many.
fn steps(most: f64) -> (f64, usize) {
    let power = 10f64.powf((most.max(1e-9) / 4.0).log10().floor());
    let step = [1.0, 2.0, 2.5, 5.0, 10.0].map(|m| m * power);
    let step = step.into_iter().find(|step| most / step <= 4.0).unwrap_or(10.0 * power);
    (step, (most / step).ceil().max(1.0) as usize)
}

/// How many digits after the point tell the steps apart and exactly.
fn decimals(step: f64) -> usize {
    let whole = |digits: &usize| {
        let scaled = step * 10f64.powi(*digits as i32);
        scaled > 0.5 && (scaled - scaled.round()).abs() < 1e-6
    };
    (0..12).find(whole).unwrap_or(12)
}

fn draw_panel(canvas: &mut Canvas, corner: Vec2, panel: &Panel) {
    let (left, right) = (corner.x + 34.0, corner.x + PANEL.x - 14.0);
    let (top, bottom) = (corner.y + 46.0, corner.y + PANEL.y - 44.0);
    let at = Vec2::new(corner.x, corner.y + 18.0);
    canvas.text(at, &panel.title, 14.0, ink::BLACK, Anchor::Start, Style::Bold);
    let bars = panel.groups.iter().flat_map(|g| [&g.own, &g.peer]).flatten();
    let (step, count) = steps(bars.map(|bar| bar.value).fold(0.0, f64::max));
    let top_value = step * count as f64;
    let height = |value: f64| bottom - (value / top_value) as f32 * (bottom - top);
    let decimals = decimals(step);
    for i in 0..=count {
        let value = step * i as f64;
        let y = height(value);
        let line = if i == 0 { ink::BLACK } else { [222, 226, 230, 255] };
        canvas.line(Vec2::new(left, y), Vec2::new(right, y), Pen::new(line, 0.8));
        let text = format!("{value:.decimals$}");
        let at = Vec2::new(left - 6.0, y + 3.5);
        canvas.text(at, &text, 10.0, ink::GREY, Anchor::End, Style::Plain);
    }
    let pitch = (right - left) / panel.groups.len().max(1) as f32;
    let bar = (0.3 * pitch).min(34.0);
    for (index, group) in panel.groups.iter().enumerate() {
        let middle = left + (index as f32 + 0.5) * pitch;
        let shift = if group.peer.is_some() { 0.0 } else { 0.5 * bar };
        for (found, x, ink) in
            [(&group.own, middle - bar + shift, OWN_INK), (&group.peer, middle, PEER_INK)]
        {
            let Some(found) = found else { continue };
            let y = height(found.value);
            rectangle(canvas, Vec2::new(x, y), Vec2::new(bar - 1.0, bottom - y), ink);
        }
        below_and_above(canvas, group, middle, height, bottom);
    }
}

/// The group's name and engines under it, the ratio over it.
fn below_and_above(
    canvas: &mut Canvas,
    group: &Group,
    middle: f32,
    height: impl Fn(f64) -> f32,
    bottom: f32,
) {
    let mut put = |y: f32, text: &str, size: f32, ink: Ink, style: Style| {
        canvas.text(Vec2::new(middle, y), text, size, ink, Anchor::Middle, style);
    };
    put(bottom + 14.0, &group.label, 10.0, ink::BLACK, Style::Plain);
    // Without the engine's name, which the colours tell.
    let short = |bar: &Bar| bar.engine.split_once(':').map_or("", |(_, rest)| rest).to_owned();
    if let Some(own) = group.own.as_ref().filter(|own| short(own) != group.label) {
        put(bottom + 26.0, &short(own), 8.0, OWN_INK, Style::Plain);
    }
    if let Some(peer) = &group.peer {
        put(bottom + 37.0, &short(peer), 8.0, [150, 105, 0, 255], Style::Plain);
    }
    if let (Some(own), Some(peer)) = (&group.own, &group.peer) {
        let top = height(own.value.max(peer.value));
        put(top - 5.0, &format!("{:.2}×", own.value / peer.value), 10.5, ink::BLACK, Style::Bold);
    }
}

fn rectangle(canvas: &mut Canvas, corner: Vec2, size: Vec2, ink: Ink) {
    let far = corner + size;
    let corners = [corner, Vec2::new(far.x, corner.y), far, Vec2::new(corner.x, far.y)];
    canvas.polygon(&corners, ink, None);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(set: &'static str, engine: &str, value: f64, best_peer: bool) -> Row {
        Row {
            bench: "rays",
            scene: "a/sponza.gltf".into(),
            ray_set: Some(set),
            engine: Some(engine.into()),
            value,
            unit: "Mrays/s",
            threads: 1,
            best_peer,
            ..Row::default()
        }
    }

    #[test]
    fn the_fastest_way_stands_beside_the_best_peer() {
        let rows = [
            row("ao", "rayburst:fast:auto", 3.0, false),
            row("ao", "rayburst:fast:call", 2.0, false),
            row("ao", "embree:medium:1", 1.0, false),
            row("ao", "embree:high:1", 1.5, true),
            row("second_bounce", "rayburst:fast:auto", 4.0, false),
        ];
        let bar = |engine: &str, value| Some(Bar { engine: engine.into(), value });
        let group = |label: &str, own, peer| Group { label: label.into(), own, peer };
        let expected = Panel {
            title: "sponza".into(),
            groups: vec![
                group("ao", bar("rayburst:fast:auto", 3.0), bar("embree:high:1", 1.5)),
                group("second bounce", bar("rayburst:fast:auto", 4.0), None),
            ],
        };
        assert_eq!(panels(&rows), [expected]);
    }

    #[test]
    fn builds_stand_beside_their_peer() {
        let build = |engine: &str, unit, value, peer: Option<&str>| Row {
            bench: "build",
            ray_set: None,
            unit,
            peer: peer.map(str::to_owned),
            ..row("", engine, value, false)
        };
        let rows = [
            build("rayburst:fast", "Mtri/s", 9.0, Some("embree:low")),
            build("rayburst:fast", "B/tri", 70.0, Some("embree:low")),
            build("embree:low", "Mtri/s", 6.0, None),
            build("embree:high", "Mtri/s", 0.5, None),
        ];
        let panels = panels(&rows);
        assert_eq!((panels.len(), panels[0].groups.len()), (1, 1));
        let group = &panels[0].groups[0];
        assert_eq!(group.label, "fast");
        assert_eq!(group.own.as_ref().map(|bar| bar.value), Some(9.0));
        assert_eq!(group.peer.as_ref().map(|bar| bar.value), Some(6.0));
    }

    #[test]
    fn means_stand_beside_one() {
        let mean = |engine: &str, value, of| Row {
            scene: GEOMETRIC_MEAN.into(),
            unit: "ratio",
            ratio_of: Some(of),
            ..row("ao", engine, value, false)
        };
        let rows = [
            mean("rayburst:fast:auto", 1.25, "Mrays/s"),
            mean("rayburst:fast:call", 1.0, "Mrays/s"),
            mean("rayburst:fast", 3.0, "B/tri"),
        ];
        let panels = panels(&rows);
        assert_eq!((panels.len(), panels[0].title.as_str()), (1, "geometric mean of the ratios"));
        let values = [&panels[0].groups[0].own, &panels[0].groups[0].peer]
            .map(|bar| bar.as_ref().map(|bar| bar.value));
        assert_eq!(values, [Some(1.25), Some(1.0)]);
    }

    #[test]
    fn axes_are_round() {
        assert_eq!(steps(21.3), (10.0, 3));
        assert_eq!(steps(8.0), (2.0, 4));
        assert_eq!(steps(9.0), (2.5, 4));
        let (step, count) = steps(0.37);
        assert!((step - 0.1).abs() < 1e-12 && count == 4);
        assert!(steps(0.0).1 >= 1);
        assert_eq!([25.0, 2.5, 0.25, 0.1, 0.02].map(decimals), [0, 1, 2, 1, 2]);
    }

    #[test]
    fn bars_are_as_high_as_their_values() {
        let rows =
            [row("ao", "rayburst:fast:auto", 4.0, false), row("ao", "embree:high:1", 2.0, true)];
        let picture = draw(&rows).unwrap();
        let count = |ink: Ink| picture.data.chunks(3).filter(|p| **p == ink[..3]).count() as f32;
        let legend = 400.0;
        let (own, peer) = (count(OWN_INK) - legend, count(PEER_INK) - legend);
        assert!((own / peer - 2.0).abs() < 0.1, "{own} {peer}");
    }
}
