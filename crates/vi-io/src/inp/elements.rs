//! The element types of Abaqus and CalculiX: which cell each is, and the numbers of its faces and edges.
//!
//! The nodes of every type here stand in VTK's order, so that none is reordered: midpoints of 01 12 20 03 13 23
//! (C3D10), 01 12 23 30 45 56 67 74 04 15 26 37 (C3D20), 01 12 20 34 45 53 03 14 25 (C3D15).
//!
//! Source: Abaqus Analysis User's Guide, "Solid isoparametric quadrilaterals and hexahedra" and the element library;
//! CalculiX CrunchiX User's Manual, "Element types" and `*SURFACE`.

use crate::cell::CellKind;

/// Use of the elements of a type.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Meaning {
    /// A cell of this kind.
    Cell(CellKind),
    /// Nothing: a mass, a spring or a connector has no shape.
    Shapeless,
    /// The type is not known.
    Unknown,
}

/// The types that are read, for messages.
pub(super) const READ: &str = "use the types C3D4 C3D5 C3D6 C3D8 C3D10 C3D15 C3D20 (solids), S3 S4 S6 S8 M3D CPS CPE \
                               (surfaces), T3D2 B31 (lines)";

/// Looks up an element type, given in upper case. Letters behind the number of nodes (R, I, H, M, T …) choose an
/// integration rule or a formulation and do not change the cell.
pub(super) fn meaning(code: &str) -> Meaning {
    const SHAPELESS: [&str; 8] = ["MASS", "ROTARYI", "SPRING", "DASHPOT", "CONN", "DCOUP", "GAP", "DIST"];
    const SURFACES: [&str; 9] = ["STRI", "SFM3D", "M3D", "R3D", "CPS", "CPEG", "CPE", "DS", "S"];
    const LINES: [&str; 4] = ["T3D", "T2D", "R2D", "B"];
    if SHAPELESS.iter().any(|name| code.starts_with(name)) {
        return Meaning::Shapeless;
    }
    let number = |family: &str| {
        let rest = code.strip_prefix(family)?;
        let digits = rest.len() - rest.trim_start_matches(|c: char| c.is_ascii_digit()).len();
        rest[..digits].parse::<u32>().ok()
    };
    let kind = if let Some(count) = number("C3D").or_else(|| number("DC3D")) {
        match count {
            4 => Some(CellKind::Tetra4),
            5 => Some(CellKind::Pyramid5),
            6 => Some(CellKind::Wedge6),
            8 => Some(CellKind::Hexahedron8),
            10 => Some(CellKind::Tetra10),
            15 => Some(CellKind::Wedge15),
            20 => Some(CellKind::Hexahedron20),
            _ => None,
        }
    } else if let Some(count) = SURFACES.iter().find_map(|family| number(family)) {
        match count {
            3 => Some(CellKind::Triangle3),
            4 => Some(CellKind::Quad4),
            // STRI65 has six nodes and five degrees of freedom at each.
            6 | 65 => Some(CellKind::Triangle6),
            8 => Some(CellKind::Quad8),
            9 => Some(CellKind::Quad9),
            _ => None,
        }
    } else {
        match LINES.iter().find_map(|family| number(family)) {
            // A beam's first digit is the dimension of space, its second the order.
            Some(2 | 21 | 23 | 31 | 33) => Some(CellKind::Line2),
            Some(3 | 22 | 32) => Some(CellKind::Line3),
            _ => None,
        }
    };
    kind.map_or(Meaning::Unknown, Meaning::Cell)
}

/// Corners of the faces S1, S2 … of a solid, outward.
fn faces(kind: CellKind) -> &'static [&'static [usize]] {
    match kind {
        CellKind::Tetra4 | CellKind::Tetra10 => &[&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[2, 0, 3]],
        CellKind::Pyramid5 => &[&[0, 3, 2, 1], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]],
        CellKind::Wedge6 | CellKind::Wedge15 => {
            &[&[0, 2, 1], &[3, 4, 5], &[0, 1, 4, 3], &[1, 2, 5, 4], &[2, 0, 3, 5]]
        }
        CellKind::Hexahedron8 | CellKind::Hexahedron20 => {
            &[&[0, 3, 2, 1], &[4, 5, 6, 7], &[0, 1, 5, 4], &[1, 2, 6, 5], &[2, 3, 7, 6], &[3, 0, 4, 7]]
        }
        _ => &[],
    }
}

/// Ends of the edges whose midpoints follow the corners.
fn middles(kind: CellKind) -> &'static [[usize; 2]] {
    match kind {
        CellKind::Tetra10 => &[[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]],
        CellKind::Wedge15 => &[[0, 1], [1, 2], [2, 0], [3, 4], [4, 5], [5, 3], [0, 3], [1, 4], [2, 5]],
        CellKind::Hexahedron20 => {
            &[[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]]
        }
        CellKind::Triangle6 => &[[0, 1], [1, 2], [2, 0]],
        CellKind::Quad8 | CellKind::Quad9 => &[[0, 1], [1, 2], [2, 3], [3, 0]],
        _ => &[],
    }
}

/// Number of corners of a surface cell.
fn corner_count(kind: CellKind) -> usize {
    match kind {
        CellKind::Triangle3 | CellKind::Triangle6 => 3,
        _ => 4,
    }
}

/// Kind and local nodes of side number `side` (from 0) of a cell: a face of a solid, an edge of a surface. None where
/// the cell has no such side.
pub(super) fn side(kind: CellKind, side: usize) -> Option<(CellKind, Vec<usize>)> {
    let (mut nodes, first_middle) = match kind.dimension() {
        3 => {
            let most = faces(kind).iter().flat_map(|corners| corners.iter()).max()?;
            (faces(kind).get(side)?.to_vec(), most + 1)
        }
        2 => {
            let corners = corner_count(kind);
            (vec![side, (side + 1) % corners], (side < corners).then_some(corners)?)
        }
        _ => return None,
    };
    let corners = nodes.clone();
    let ends = if corners.len() == 2 { 1 } else { corners.len() };
    for k in 0..ends {
        let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
        let middle = middles(kind).iter().position(|&[p, q]| (p, q) == (a, b) || (p, q) == (b, a));
        nodes.extend(middle.map(|middle| first_middle + middle));
    }
    let kind = match (corners.len(), nodes.len()) {
        (2, 2) => CellKind::Line2,
        (2, _) => CellKind::Line3,
        (3, 3) => CellKind::Triangle3,
        (3, _) => CellKind::Triangle6,
        (_, 4) => CellKind::Quad4,
        _ => CellKind::Quad8,
    };
    Some((kind, nodes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_behind_the_number_do_not_change_the_cell() {
        use CellKind::*;
        for (code, kind) in [
            ("C3D8R", Hexahedron8),
            ("C3D8I", Hexahedron8),
            ("C3D10M", Tetra10),
            ("C3D10HS", Tetra10),
            ("C3D20RH", Hexahedron20),
            ("C3D15", Wedge15),
            ("S4R5", Quad4),
            ("S8R5", Quad8),
            ("STRI3", Triangle3),
            ("STRI65", Triangle6),
            ("CPEG4", Quad4),
            ("CPE6H", Triangle6),
            ("SFM3D3", Triangle3),
            ("T3D2", Line2),
            ("B31H", Line2),
            ("B32OS", Line3),
        ] {
            assert_eq!(meaning(code), Meaning::Cell(kind), "{code}");
        }
        for code in ["MASS", "SPRINGA", "CONN3D2", "DASHPOT1"] {
            assert_eq!(meaning(code), Meaning::Shapeless, "{code}");
        }
        for code in ["CAX4", "C3D27", "C3D", "SC8R", "S5", "", "AC3D8"] {
            assert_eq!(meaning(code), Meaning::Unknown, "{code}");
        }
    }

    #[test]
    fn every_edge_of_a_solid_is_in_two_faces_that_run_along_it_in_both_senses() {
        use CellKind::*;
        for kind in [Tetra4, Tetra10, Pyramid5, Wedge6, Wedge15, Hexahedron8, Hexahedron20] {
            let mut edges = Vec::new();
            for corners in faces(kind) {
                edges.extend((0..corners.len()).map(|k| (corners[k], corners[(k + 1) % corners.len()])));
            }
            for &(a, b) in &edges {
                assert_eq!(edges.iter().filter(|&&edge| edge == (a, b)).count(), 1, "{kind:?}");
                assert_eq!(edges.iter().filter(|&&edge| edge == (b, a)).count(), 1, "{kind:?}");
            }
        }
    }
}
