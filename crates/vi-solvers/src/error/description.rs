//! Parts of the messages of errors.

/// Describes a place, m.
pub(super) fn in_metres([x, y, z]: &[f64; 3]) -> String {
    format!("({x:.4}, {y:.4}, {z:.4}) m")
}

/// Describes the lowest eigenvalue of the last equilibrium, if it is known, 1/s²; zero if it is round-off.
pub(super) fn explain_lowest(lowest: &Option<f64>) -> String {
    match lowest {
        Some(0.0) => "; bodies can move there without deforming: for example, they slide or spin where they touch without friction. Hold \
                      them (`[[fix]]`), or set `contact.friction`"
            .to_owned(),
        Some(lowest) => format!(
            "; the lowest eigenvalue of the last equilibrium is {lowest:e} 1/s²: if it has decreased towards \
             zero, this is a limit point, which an arc-length search can pass"
        ),
        None => String::new(),
    }
}

/// Describes how far bodies move.
pub(super) fn distance(extents: f64) -> String {
    match extents.is_finite() {
        true => format!("{extents:.1} times their extent without coming to rest"),
        false => "freely along an axis along which their loads do not balance".to_owned(),
    }
}
