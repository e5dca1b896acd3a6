//! JSON objects read strictly: every problem is told with its place, and a name that is not known
//! with the nearest that is.

use std::path::Path;

use glam::Vec3;
use serde_json::{Map, Value};

use crate::import::ImportError;

/// An object and where it is in the file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fields<'a> {
    path: &'a Path,
    place: &'a str,
    object: &'a Map<String, Value>,
}

impl<'a> Fields<'a> {
    /// Checks that `value` is an object with no other fields than the known ones.
    pub(super) fn new(
        path: &'a Path,
        place: &'a str,
        value: &'a Value,
        known: &[&str],
    ) -> Result<Self, ImportError> {
        let fail = |reason: String| Err(ImportError::malformed(path, place, reason));
        let Value::Object(object) = value else {
            return fail(format!("must be an object, not {}", kind_of(value)));
        };
        if let Some(unknown) = object.keys().find(|key| !known.contains(&key.as_str())) {
            let nearest = nearest(unknown, known);
            return fail(format!(
                "unknown field '{unknown}', did you mean '{nearest}'? Known fields: {}",
                known.join(", ")
            ));
        }
        Ok(Self { path, place, object })
    }

    /// The value of a field; `null` counts as missing.
    pub(super) fn get(&self, name: &str) -> Option<&'a Value> {
        self.object.get(name).filter(|value| !value.is_null())
    }

    /// An error about a field.
    pub(super) fn error<T>(&self, name: &str, reason: impl Into<String>) -> Result<T, ImportError> {
        Err(ImportError::malformed(self.path, self.place_of(name), reason))
    }

    /// An error for a value of the wrong kind.
    pub(super) fn wrong<T>(&self, name: &str, expected: &str) -> Result<T, ImportError> {
        let found = self.get(name).map_or("nothing", kind_of);
        self.error(name, format!("must be {expected}, not {found}"))
    }

    /// Where a field is, as a path from the root.
    pub(super) fn place_of(&self, name: &str) -> String {
        let is_root = self.place == super::ROOT;
        if is_root { name.to_owned() } else { format!("{}.{name}", self.place) }
    }

    /// A finite number.
    pub(super) fn number(&self, name: &str) -> Result<Option<f32>, ImportError> {
        match self.get(name) {
            None => Ok(None),
            Some(value) => match value.as_f64().map(|x| x as f32) {
                Some(number) if number.is_finite() => Ok(Some(number)),
                _ => self.wrong(name, "a number within ±3.4e38"),
            },
        }
    }

    /// A number that satisfies a condition, which `expected` puts into words.
    pub(super) fn number_where(
        &self,
        name: &str,
        expected: &str,
        holds: impl Fn(f32) -> bool,
    ) -> Result<Option<f32>, ImportError> {
        match self.number(name)? {
            Some(number) if !holds(number) => {
                self.error(name, format!("must be {expected}, not {number}"))
            }
            number => Ok(number),
        }
    }

    /// Three finite numbers.
    pub(super) fn vector(&self, name: &str) -> Result<Option<Vec3>, ImportError> {
        let Some(value) = self.get(name) else { return Ok(None) };
        let numbers: Option<Vec<f32>> = value
            .as_array()
            .map(|items| items.iter().filter_map(Value::as_f64).map(|x| x as f32).collect());
        match (numbers.as_deref(), value.as_array().map(Vec::len)) {
            (Some(&[x, y, z]), Some(3)) if Vec3::new(x, y, z).is_finite() => {
                Ok(Some(Vec3::new(x, y, z)))
            }
            _ => self.wrong(name, "three finite numbers, like [0, 1, 0]"),
        }
    }

    /// A vector that has a direction, as a unit vector.
    pub(super) fn direction(&self, name: &str) -> Result<Option<Vec3>, ImportError> {
        match self.vector(name)? {
            None => Ok(None),
            Some(vector) if vector == Vec3::ZERO => self.error(name, "must not be zero"),
            Some(vector) => Ok(Some(crate::normals::unit_or(vector, Vec3::Y))),
        }
    }

    /// A text.
    pub(super) fn text(&self, name: &str) -> Result<Option<&'a str>, ImportError> {
        match self.get(name) {
            None => Ok(None),
            Some(Value::String(text)) => Ok(Some(text)),
            Some(_) => self.wrong(name, "a text"),
        }
    }

    /// The items of a list, with their places.
    pub(super) fn list(&self, name: &str) -> Result<Vec<(String, &'a Value)>, ImportError> {
        match self.get(name) {
            None => Ok(Vec::new()),
            Some(Value::Array(items)) => {
                let place = |i: usize| format!("{}[{i}]", self.place_of(name));
                Ok(items.iter().enumerate().map(|(i, item)| (place(i), item)).collect())
            }
            Some(_) => self.wrong(name, "a list"),
        }
    }

    /// The error for a field that must be there.
    pub(super) fn required<T>(&self, name: &str, value: Option<T>) -> Result<T, ImportError> {
        match value {
            Some(value) => Ok(value),
            None => self.error(name, "is missing"),
        }
    }
}

fn kind_of(value: &Value) -> &'static str {
    match value {
        Value::Null => "null",
        Value::Bool(_) => "true or false",
        Value::Number(_) => "a number out of range",
        Value::String(_) => "a text",
        Value::Array(_) => "this list",
        Value::Object(_) => "an object",
    }
}

/// The known name with the fewest edits (Levenshtein, 1966) from a given one.
pub(super) fn nearest<'k>(given: &str, known: &[&'k str]) -> &'k str {
    let given: Vec<char> = given.chars().take(64).flat_map(char::to_lowercase).collect();
    let edits = |name: &&&str| {
        let name: Vec<char> = name.chars().collect();
        let mut row: Vec<usize> = (0..=name.len()).collect();
        for (i, a) in given.iter().enumerate() {
            let mut diagonal = std::mem::replace(&mut row[0], i + 1);
            for (j, b) in name.iter().enumerate() {
                let replaced = diagonal + usize::from(a != b);
                diagonal = row[j + 1];
                row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
            }
        }
        row[name.len()]
    };
    known.iter().min_by_key(edits).copied().unwrap_or("")
}
