//! Names that users type: an unknown one lists the known ones and the nearest.

/// The message for a name that is not known.
pub(crate) fn unknown(kind: &str, given: &str, known: &[&str]) -> String {
    let nearest = nearest(given, known).map_or(String::new(), |n| format!(", did you mean '{n}'?"));
    format!("unknown {kind} '{given}'{nearest} (known: {})", known.join(", "))
}

/// The known name that is most like the given one, if any is alike.
pub(crate) fn nearest<'a>(given: &str, known: &[&'a str]) -> Option<&'a str> {
    let given = given.to_lowercase();
    known
        .iter()
        .map(|name| (distance(&given, &name.to_lowercase()), *name))
        .min_by_key(|&(d, _)| d)
        .filter(|&(d, name)| d <= 1 + name.chars().count().max(given.chars().count()) / 3)
        .map(|(_, name)| name)
}

/// Edits (insert, delete, replace, swap neighbours) from one name to the other (Damerau 1964, in the
/// restricted form of optimal string alignment).
fn distance(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    let mut rows = vec![vec![0usize; b.len() + 1]; a.len() + 1];
    for (i, row) in rows.iter_mut().enumerate() {
        row[0] = i;
    }
    rows[0] = (0..=b.len()).collect();
    for i in 1..=a.len() {
        for j in 1..=b.len() {
            let replace = rows[i - 1][j - 1] + usize::from(a[i - 1] != b[j - 1]);
            let mut best = replace.min(rows[i - 1][j] + 1).min(rows[i][j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                best = best.min(rows[i - 2][j - 2] + 1);
            }
            rows[i][j] = best;
        }
    }
    rows[a.len()][b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_name_is_found() {
        let known = ["path", "direct", "whitted", "ao"];
        assert_eq!(nearest("pth", &known), Some("path"));
        assert_eq!(nearest("WHITED", &known), Some("whitted"));
        assert_eq!(nearest("ditrect", &known), Some("direct"));
        assert_eq!(nearest("photon-mapping", &known), None);
        assert_eq!(
            unknown("integrator", "paht", &known),
            "unknown integrator 'paht', did you mean 'path'? (known: path, direct, whitted, ao)"
        );
    }
}
