//! `rayburst scenes`.

use rayburst::scene::builtin;
use serde_json::json;

use crate::{args::verbs::ScenesArgs, error::Result, terminal};

/// Lists the built-in scenes.
pub(crate) fn run(args: &ScenesArgs) -> Result<()> {
    if args.json {
        let all: Vec<_> = builtin::list()
            .iter()
            .map(|s| {
                let parameters: Vec<_> = s
                    .parameters
                    .iter()
                    .map(|p| json!({ "name": p.name, "meaning": p.meaning }))
                    .collect();
                json!({
                    "name": s.name,
                    "summary": s.summary,
                    "figure": s.figure,
                    "size": [s.size.0, s.size.1],
                    "parameters": parameters,
                })
            })
            .collect();
        return terminal::result(serde_json::Value::from(all).to_string());
    }
    let width = builtin::list().iter().map(|s| s.name.len()).max().unwrap_or(0);
    for scene in builtin::list() {
        let figure = scene.figure.map_or(String::new(), |f| format!("Fig. {f}"));
        terminal::result(format!("{:width$}  {figure:10}  {}", scene.name, scene.summary))?;
        for parameter in scene.parameters {
            terminal::result(format!("{:width$}  {:10}    {parameter}", "", ""))?;
        }
    }
    Ok(())
}
