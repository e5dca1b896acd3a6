//! What is done, in memory and in a file.

use std::{collections::BTreeMap, fmt::Write, fs, path::Path};

use super::{DESCRIBED, Outcome, Plan, Task, describe};

/// Which tasks are done and what they found.
#[derive(Clone, Debug)]
pub struct Progress {
    /// What the tasks are: a file of other tasks is of no use.
    header: String,
    tasks: usize,
    done: BTreeMap<usize, Outcome>,
}

impl Progress {
    /// Nothing is done.
    pub fn new(tasks: &[Task<'_>], plan: &Plan) -> Self {
        let all = tasks.iter().map(describe).collect::<String>();
        let hash = all.bytes().fold(0xCBF2_9CE4_8422_2325u64, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01B3)
        });
        let Plan { rays, seed } = plan;
        let header = format!("leaks 1: {rays} rays, seed {seed}, tasks {hash:016x}");
        Self { header, tasks: tasks.len(), done: BTreeMap::new() }
    }

    /// Goes on from a file, if it is there; an error if it is of another run.
    pub fn resume(mut self, path: &Path) -> Result<Self, String> {
        if !path.exists() {
            return Ok(self);
        }
        let at = path.display();
        let text = fs::read_to_string(path).map_err(|e| format!("cannot read {at}: {e}"))?;
        let mut lines = text.lines();
        let header = lines.next().unwrap_or_default();
        if header != self.header {
            return Err(format!(
                "{at} is of another run ('{header}', not '{}'); start without --resume",
                self.header
            ));
        }
        for (number, line) in lines.enumerate() {
            let bad =
                || format!("{at}, line {}: not a task or a leak; delete the file", number + 2);
            if let Some(leak) = line.strip_prefix("leak ") {
                let (task, leak) = leak.split_once(' ').ok_or_else(bad)?;
                let task = task.parse().map_err(|_| bad())?;
                self.done.entry(task).or_default().described.push(leak.to_owned());
                continue;
            }
            let numbers: Result<Vec<u64>, _> = line.split(' ').map(str::parse).collect();
            let [task, rays, leaks] = numbers.map_err(|_| bad())?[..] else {
                return Err(bad());
            };
            let outcome = self.done.entry(task as usize).or_default();
            (outcome.rays, outcome.leaks) = (rays, leaks);
        }
        Ok(self)
    }

    /// Writes the file aside, then renames it.
    pub fn save(&self, path: &Path) -> Result<(), String> {
        let mut text = format!("{}\n", self.header);
        for (task, outcome) in &self.done {
            let _ = writeln!(text, "{task} {} {}", outcome.rays, outcome.leaks);
            for leak in &outcome.described {
                let _ = writeln!(text, "leak {task} {leak}");
            }
        }
        let aside = path.with_extension("tmp");
        fs::write(&aside, text)
            .and_then(|()| fs::rename(&aside, path))
            .map_err(|e| format!("cannot write {}: {e}", path.display()))
    }

    /// Notes what a task found.
    pub fn note(&mut self, task: usize, outcome: Outcome) {
        self.done.insert(task, outcome);
    }

    /// Whether a task is done.
    pub fn is_done(&self, task: usize) -> bool {
        self.done.contains_key(&task)
    }

    /// Tasks that are done, and all.
    pub fn tasks(&self) -> (usize, usize) {
        (self.done.len(), self.tasks)
    }

    /// Rays traced so far.
    pub fn rays(&self) -> u64 {
        self.done.values().map(|outcome| outcome.rays).sum()
    }

    /// Rays that left.
    pub fn leaks(&self) -> u64 {
        self.done.values().map(|outcome| outcome.leaks).sum()
    }

    /// Rays that left in one task.
    pub fn leaks_of(&self, task: usize) -> u64 {
        self.done.get(&task).map_or(0, |outcome| outcome.leaks)
    }

    /// The first leaks.
    pub fn described(&self) -> Vec<&str> {
        let all = self.done.values().flat_map(|outcome| &outcome.described);
        all.take(DESCRIBED).map(String::as_str).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        leaks::{run, run_task, tasks},
        meshes::{ClosedScene, grid_box},
    };

    #[test]
    fn an_interrupted_run_goes_on_and_finds_the_same() {
        let mut mesh = grid_box([2; 3]);
        mesh.indices.pop();
        let scenes = [ClosedScene { name: "box with a hole".into(), mesh, instances: vec![] }];
        let tasks = tasks(&scenes);
        let plan = Plan { rays: 50_000, seed: 3 };
        let folder = std::env::temp_dir().join(format!("rayburst-leaks-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let path = folder.join("progress.txt");
        let begin = Progress::new(&tasks, &plan);
        let part = run(&tasks, &plan, begin.clone(), &|progress| {
            progress.save(&path)?;
            Ok(progress.tasks().0 < 5)
        });
        let resumed = begin.clone().resume(&path).unwrap();
        assert_eq!(resumed.tasks(), part.unwrap().tasks());
        assert!(resumed.tasks().0 < tasks.len() && resumed.is_done(0));
        let end = run(&tasks, &plan, resumed, &|_| Ok(true)).unwrap();
        let whole = run(&tasks, &plan, begin, &|_| Ok(true)).unwrap();
        assert_eq!((end.rays(), end.leaks()), (whole.rays(), whole.leaks()));
        assert_eq!(end.described(), whole.described());
        let again = run_task(&tasks[7], tasks.len(), &plan).unwrap();
        assert_eq!(again.leaks, end.leaks_of(7));
        let other = Plan { seed: 4, ..plan };
        assert!(Progress::new(&tasks, &other).resume(&path).unwrap_err().contains("another run"));
        fs::write(&path, format!("{}\n1 2\n", Progress::new(&tasks, &plan).header)).unwrap();
        let broken = Progress::new(&tasks, &plan).resume(&path).unwrap_err();
        assert!(broken.contains("line 2"), "{broken}");
        fs::remove_dir_all(&folder).unwrap();
    }
}
