//! The columns of history.csv for a scene: each has a unique name, which needs no quotes.

use std::collections::HashMap;

use super::{Problem, Scene};

/// Energies, J; linear momentum, kg m/s; angular momentum about the origin, kg m²/s.
const CONSERVED: [&str; 11] =
    ["t", "kinetic", "elastic", "gravity", "total", "px", "py", "pz", "lx", "ly", "lz"];
/// Newton iterations and substeps since the previous row.
const WORK: [&str; 2] = ["newton_iterations", "substeps"];
/// Energy of conservative loads other than weight, J.
const LOAD: &str = "load";
/// For scenes with contact: its energy and the energy dissipated so far by friction and by contact damping (≤ 0), J;
/// the number of pairs, and the smallest gap, m.
const CONTACT: [&str; 5] = ["contact", "friction", "contact_damping", "pairs", "smallest_gap"];
/// For a node probe: position and displacement, m.
const PROBE: [&str; 6] = ["x", "y", "z", "ux", "uy", "uz"];
/// For a rigid body: its centre, m, and its orientation.
const RIGID: [&str; 7] = ["x", "y", "z", "qw", "qx", "qy", "qz"];
/// For a node probe: estimated |error| of its displacement, m, and the observed order.
const ESTIMATE: [&str; 4] = ["ex", "ey", "ez", "order"];
/// The load factor, if a path of equilibria determines it.
const LOAD_FACTOR: &str = "load_factor";

/// A column with the key of the scene that names it; without a key if every history has it.
struct Column {
    name: String,
    key: Option<String>,
}

/// Returns the names of all columns, in order.
pub(crate) fn history_columns(scene: &Scene, has_loads: bool) -> Vec<String> {
    columns(scene, has_loads).into_iter().map(|column| column.name).collect()
}

fn columns(scene: &Scene, has_loads: bool) -> Vec<Column> {
    let fixed = |names: &[&str]| -> Vec<Column> {
        names.iter().map(|&name| Column { name: name.to_owned(), key: None }).collect()
    };
    let of_probes = |parts: &[&str]| -> Vec<Column> {
        let probes = scene.probes.iter().enumerate().filter(|(_, probe)| probe.is_node());
        probes.flat_map(|(i, probe)| headed(&probe.name, &format!("probe[{i}].name"), parts)).collect()
    };
    let mut columns = fixed(&CONSERVED);
    columns.extend(of_probes(&PROBE));
    columns.extend(fixed(&WORK));
    if has_loads {
        columns.extend(fixed(&[LOAD]));
    }
    if scene.contact.is_some() {
        columns.extend(fixed(&CONTACT));
    }
    for (i, rigid) in scene.rigids.iter().enumerate() {
        columns.extend(headed(&rigid.name, &format!("rigid[{i}].name"), &RIGID));
    }
    for (i, probe) in scene.probes.iter().enumerate() {
        let key = Some(format!("probe[{i}].name"));
        columns.extend(probe.columns().into_iter().map(|name| Column { name, key: key.clone() }));
    }
    if scene.time.estimate {
        columns.extend(of_probes(&ESTIMATE));
    }
    if scene.statics.as_ref().is_some_and(|statics| statics.follows_path()) {
        columns.extend(fixed(&[LOAD_FACTOR]));
    }
    columns
}

fn headed(name: &str, key: &str, parts: &[&str]) -> Vec<Column> {
    parts.iter().map(|part| Column { name: format!("{name}.{part}"), key: Some(key.to_owned()) }).collect()
}

/// Returns problems for names that cannot head a column and for equal names of columns; for each key only the first.
pub(super) fn problems(scene: &Scene) -> Vec<Problem> {
    let mut problems: Vec<Problem> = Vec::new();
    let mut owners: HashMap<String, Option<String>> = HashMap::new();
    for Column { name, key } in columns(scene, true) {
        let wrong = if name.starts_with('.') || name.contains([',', '"']) {
            Some("must be a word without commas or quotes: it heads columns of history.csv".to_owned())
        } else {
            owners.get(&name).map(|other| {
                let other = other.as_deref().unwrap_or("every history");
                format!("heads a column `{name}` of history.csv, and so does {other}; choose another name")
            })
        };
        if let (Some(key), Some(message)) = (&key, wrong)
            && problems.last().is_none_or(|last| last.key != *key)
        {
            problems.push(Problem::new(key, message));
        }
        owners.entry(name).or_insert(key);
    }
    problems
}
