//! Maps the element types of Abaqus and CalculiX to cells, and numbers their faces and edges.
//!
//! The nodes of every type here have VTK's order, so none are reordered: midpoints of 01 12 20 03 13 23 (C3D10), 01 12
//! 23 30 45 56 67 74 04 15 26 37 (C3D20), 01 12 20 34 45 53 03 14 25 (C3D15).
//!
//! Source: Abaqus Analysis User's Guide, "Solid isoparametric quadrilaterals and hexahedra" and the element library;
//! CalculiX CrunchiX User's Manual, "Element types" and `*SURFACE`.

use vi_mesh::CellKind;

/// How the elements of a type are used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Meaning {
    /// A cell of this kind.
    Cell(CellKind),
    /// No cell: a mass, a spring or a connector has no shape.
    Shapeless,
    /// The type is not known.
    Unknown,
}

/// The supported types, for messages.
pub(super) const READ: &str = "use the types C3D4 C3D5 C3D6 C3D8 C3D10 C3D15 C3D20 (solids), S3 S4 S6 S8 M3D CPS CPE \
                               (surfaces), T3D2 B31 (lines)";

/// Looks up an element type, given in upper case. Letters after the number of nodes (R, I, H, M, T …) select an
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
            4 => Some(CellKind::Tet4),
            5 => Some(CellKind::Pyramid5),
            6 => Some(CellKind::Wedge6),
            8 => Some(CellKind::Hex8),
            10 => Some(CellKind::Tet10),
            15 => Some(CellKind::Wedge15),
            20 => Some(CellKind::Hex20),
            _ => None,
        }
    } else if let Some(count) = SURFACES.iter().find_map(|family| number(family)) {
        match count {
            3 => Some(CellKind::Tri3),
            4 => Some(CellKind::Quad4),
            // STRI65 has six nodes and five degrees of freedom per node.
            6 | 65 => Some(CellKind::Tri6),
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

/// Returns for each face S1, S2 … of a solid its side in the table of cells, and its first corner.
fn faces(kind: CellKind) -> &'static [(usize, usize)] {
    match kind.linear() {
        CellKind::Tet4 => &[(3, 0), (0, 0), (1, 1), (2, 2)],
        CellKind::Pyramid5 => &[(0, 0), (1, 0), (2, 1), (3, 2), (4, 3)],
        CellKind::Wedge6 => &[(0, 0), (1, 3), (2, 0), (3, 1), (4, 2)],
        CellKind::Hex8 => &[(4, 0), (5, 4), (2, 0), (1, 1), (3, 2), (0, 3)],
        _ => &[],
    }
}

/// Returns the kind and the local nodes of side number `side` (from 0) of a cell: a face of a solid, an edge of a
/// surface. `None` if the cell has no such side.
pub(super) fn side(kind: CellKind, side: usize) -> Option<(CellKind, Vec<usize>)> {
    if kind.dimension() == 2 {
        return kind.sides().get(side).map(|side| (side.kind, side.nodes.clone()));
    }
    let &(side, first) = faces(kind).get(side)?;
    let side = &kind.sides()[side];
    let mut nodes = side.nodes.clone();
    // Rotates the corners, and the edge middles after them, to begin at the first corner.
    let start = nodes.iter().position(|&node| node == first)?;
    nodes.chunks_exact_mut(side.kind.corner_count()).for_each(|round| round.rotate_left(start));
    Some((side.kind, nodes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_behind_the_number_do_not_change_the_cell() {
        use CellKind::*;
        for (code, kind) in [
            ("C3D8R", Hex8),
            ("C3D8I", Hex8),
            ("C3D10M", Tet10),
            ("C3D10HS", Tet10),
            ("C3D20RH", Hex20),
            ("C3D15", Wedge15),
            ("S4R5", Quad4),
            ("S8R5", Quad8),
            ("STRI3", Tri3),
            ("STRI65", Tri6),
            ("CPEG4", Quad4),
            ("CPE6H", Tri6),
            ("SFM3D3", Tri3),
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

    /// The corners of S1, S2 … are those drawn in the user's guide.
    #[test]
    fn faces_are_those_of_the_guide() {
        let guide: [(CellKind, &[&[usize]]); 4] = [
            (CellKind::Tet10, &[&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[2, 0, 3]]),
            (CellKind::Pyramid5, &[&[0, 3, 2, 1], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]]),
            (CellKind::Wedge15, &[&[0, 2, 1], &[3, 4, 5], &[0, 1, 4, 3], &[1, 2, 5, 4], &[2, 0, 3, 5]]),
            (
                CellKind::Hex20,
                &[&[0, 3, 2, 1], &[4, 5, 6, 7], &[0, 1, 5, 4], &[1, 2, 6, 5], &[2, 3, 7, 6], &[3, 0, 4, 7]],
            ),
        ];
        for (kind, faces) in guide {
            for (number, corners) in faces.iter().enumerate() {
                let (face, nodes) = side(kind, number).unwrap();
                assert_eq!(nodes[..corners.len()], **corners, "{kind} S{}", number + 1);
                for (k, &middle) in nodes[corners.len()..].iter().enumerate() {
                    let [a, b] = kind.edges()[middle - kind.corner_count()];
                    let ends = face.edges()[k].map(|end| nodes[end]);
                    assert!(ends == [a, b] || ends == [b, a], "{kind} S{}", number + 1);
                }
            }
            assert!(side(kind, faces.len()).is_none());
        }
    }
}
