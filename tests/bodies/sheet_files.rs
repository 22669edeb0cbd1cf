//! Tests sheets from mesh files, through the program: which defects are repaired and reported, and which are refused.

use crate::program::Program;
use std::fmt::Write as _;

const MATTER: &str = r#"{ law = "st-venant-kirchhoff", young = 1e5, poisson = 0.3, area_density = 0.2, thickness = 1e-3, bending = "hinge" }"#;

fn scene(path: &str, keys: &str) -> String {
    format!(
        r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.002
step = 0.001
scheme = "stormer-verlet"
[[body]]
name = "sheet"
mesh = {path:?}
material = {MATTER}
{keys}
"#
    )
}

/// A file in a temporary directory that lives as long as this value, with its path for scenes.
struct File(#[allow(dead_code, reason = "keeps the directory")] tempfile::TempDir, String);

impl File {
    fn new(name: &str, content: impl AsRef<[u8]>) -> Self {
        let directory = tempfile::TempDir::new().unwrap();
        let path = directory.path().join(name);
        std::fs::write(&path, content).unwrap();
        Self(directory, path.to_str().unwrap().to_owned())
    }

    fn check(&self, keys: &str) -> Program {
        Program::check(&scene(&self.1, keys))
    }

    /// Returns everything that the program prints and notes when it runs the scene.
    fn said(&self, keys: &str) -> String {
        let program = Program::run(&scene(&self.1, keys));
        let notes = program.report()["notes"].to_string();
        format!("{notes}{}{}", program.errors(), String::from_utf8_lossy(&program.output.stdout))
    }

    fn refused(&self, keys: &str) -> String {
        let program = self.check(keys);
        assert_eq!(program.code(), Some(2), "{}", program.errors());
        program.errors()
    }

    /// Returns the mass, from the momentum p = m g t after free fall.
    fn mass(&self, keys: &str) -> f64 {
        let history = Program::run(&scene(&self.1, keys)).history();
        let (t, pz) = (history.last("t"), history.last("pz"));
        -pz / (9.81 * t)
    }
}

/// Writes an OBJ of n × n squares on a half cylinder of arc length π in x. With `split` every face has vertices of its
/// own; with `turned` every second face is reversed.
fn obj(n: usize, split: bool, turned: bool, uv: Option<f64>) -> String {
    let mut text = String::from("# made by hand\no cloth\n");
    let (mut vertices, mut textures, mut faces) = (Vec::new(), Vec::new(), Vec::new());
    let at = |i: usize, j: usize| [i as f64 / n as f64 * std::f64::consts::PI, j as f64 / n as f64];
    let mut vertex = |i: usize, j: usize| {
        let known = (!split).then(|| vertices.iter().position(|&v| v == (i, j))).flatten();
        known.unwrap_or_else(|| {
            vertices.push((i, j));
            vertices.len() - 1
        }) + 1
    };
    for i in 0..n {
        for j in 0..n {
            for corners in [[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]] {
                let mut ids = corners.map(|(a, b)| vertex(i + a, j + b));
                if turned && (i + j) % 2 == 1 {
                    ids.swap(1, 2);
                }
                faces.push(ids);
            }
        }
    }
    for &(i, j) in &vertices {
        let [s, y] = at(i, j);
        writeln!(text, "v {} {y} {}", -s.cos(), s.sin()).unwrap();
        textures.push([s, y]);
    }
    if let Some(unit) = uv {
        for [u, v] in textures {
            writeln!(text, "vt {} {}", u / unit, v / unit).unwrap();
        }
    }
    for [a, b, c] in faces {
        match uv {
            Some(_) => writeln!(text, "f {a}/{a} {b}/{b} {c}/{c}").unwrap(),
            None => writeln!(text, "f {a} {b} {c}").unwrap(),
        }
    }
    text
}

#[test]
fn vertices_on_each_other_are_welded_and_triangles_turned_with_a_line_each() {
    let file = File::new("split.obj", obj(6, true, true, None));
    let said = file.said("");
    assert!(said.contains("167 points that lie on others were welded to them, 49 are left"), "{said}");
    assert!(said.contains("36 triangles were turned over"), "{said}");
    // Without welding, every triangle is a separate piece.
    let apart = file.said("weld = 0.0");
    assert!(!apart.contains("welded to them") && !apart.contains("turned over"), "{apart}");
    let clean = File::new("clean.obj", obj(6, false, false, None)).said("");
    assert!(!clean.contains("welded") && !clean.contains("turned"), "{clean}");
}

#[test]
fn texture_coordinates_are_the_pattern_at_rest() {
    let energies = |file: &File, keys: &str| {
        let history = Program::run(&scene(&file.1, keys)).history();
        (history.first("elastic"), file.mass(keys))
    };
    // The shape as given stores no energy. With a flat rest shape the energy is that of a half cylinder
    // of radius 1: ½ D L W κ².
    let modulus = 1e5 * 1e-9 / (12.0 * (1.0 - 0.09));
    let area = std::f64::consts::PI;
    let file = File::new("uv.obj", obj(24, true, true, Some(1.0)));
    let (as_given, _) = energies(&file, "");
    let keys = "rest = \"flat\"";
    let (flat, mass) = energies(&file, keys);
    assert!(as_given < 1e-12, "{as_given}");
    assert!((mass / (0.2 * area) - 1.0).abs() < 1e-9, "{mass}");
    // The chords of a polygon are shorter than the arcs, which adds a little membrane energy.
    let n = 24.0;
    let strain = (n * (0.5 * area / n).sin() * 2.0 / area).powi(2) - 1.0;
    let membrane = 0.5 * 1e5 / 0.91 * (0.5 * strain).powi(2) * 1e-3 * area;
    let bent = 0.5 * modulus * area;
    assert!(flat > 0.8 * (bent + membrane) && flat < 1.2 * (bent + membrane), "{flat} {bent} {membrane}");
    // Texture coordinates in other units are refused with a request for a scale; with that scale the result is equal.
    let file = File::new("unit.obj", obj(24, true, true, Some(area)));
    let message = file.refused(keys);
    assert!(message.contains("uv_scale") && message.contains("3.14"), "{message}");
    let (scaled, _) = energies(&file, &format!("rest = \"flat\"\nuv_scale = {area}"));
    assert!((scaled / flat - 1.0).abs() < 1e-6, "{scaled} {flat}");
}

/// A tube has single vertices along its seam but two texture coordinates there. Its flat rest shape is sewn at that
/// seam.
#[test]
fn a_seam_of_the_pattern_is_sewn() {
    let (around, along) = (40, 6);
    let mut text = String::new();
    for j in 0..=along {
        for i in 0..around {
            let angle = f64::from(i) / f64::from(around) * std::f64::consts::TAU;
            writeln!(text, "v {} {} {}", angle.cos(), angle.sin(), f64::from(j) / f64::from(along)).unwrap();
        }
    }
    // Texture coordinates are spaced by chords, so that nothing is stretched.
    let chord = 2.0 * (std::f64::consts::PI / f64::from(around)).sin();
    for j in 0..=along {
        for i in 0..=around {
            writeln!(text, "vt {} {}", chord * f64::from(i), f64::from(j) / f64::from(along)).unwrap();
        }
    }
    for j in 0..along {
        for i in 0..around {
            let corner = |a: i32, b: i32| {
                format!("{}/{}", (i + a) % around + (j + b) * around + 1, i + a + (j + b) * (around + 1) + 1)
            };
            let corners = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
            writeln!(text, "f {}", corners.join(" ")).unwrap();
        }
    }
    let file = File::new("tube.obj", text);
    let text = scene(&file.1, "rest = \"flat\"").replace("hinge", "shell");
    let history = Program::run(&text).history();
    let modulus = 1e5 * 1e-9 / (12.0 * (1.0 - 0.09));
    let ratio = history.first("elastic") / (0.5 * modulus * std::f64::consts::TAU);
    // Poisson's effect relaxes the curvature at the two free ends a little.
    assert!((0.95..1.005).contains(&ratio), "{ratio}");
}

#[test]
fn a_file_of_several_sheets_is_one_body_or_one_a_part() {
    let one = obj(2, false, false, None);
    let other = "o patch\nv 5 0 0\nv 6 0 0\nv 6 1 0\nv 5 1 0\nf -4 -3 -2 -1\n";
    let file = File::new("two.obj", format!("{one}{other}"));
    let area: f64 = 2.0 * (2.0 * (std::f64::consts::FRAC_PI_4).sin());
    assert!((file.mass("") / 0.2 - area - 1.0).abs() < 1e-6);
    assert!((file.mass("part = \"patch\"") / 0.2 - 1.0).abs() < 1e-9);
    let message = file.refused("part = \"flag\"");
    assert!(message.contains("no group 'flag' of surfaces; there are: cloth, patch"), "{message}");
}

#[test]
fn a_surface_group_of_a_solid_is_a_sheet_with_part() {
    let message = Program::check(&scene("MESHES/beam.msh", "")).errors();
    assert!(message.contains("volume cells") && message.contains("`part`"), "{message}");
    let program = Program::run(&scene("MESHES/beam.msh", "part = \"clamp\""));
    let mass = -program.history().last("pz") / (9.81 * 0.002);
    assert!((mass / (0.2 * 0.0625) - 1.0).abs() < 1e-9, "{mass}");
    let program = Program::run(&scene("MESHES/cloth.msh", ""));
    let mass = -program.history().last("pz") / (9.81 * 0.002);
    assert!((mass / 0.2 - 1.0).abs() < 1e-9, "{mass}");
}

/// A unit square with a square hole consists of four trapezia of two triangles each.
const POINTS: [[f64; 2]; 8] =
    [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.25, 0.25], [0.75, 0.25], [0.75, 0.75], [0.25, 0.75]];

fn trapezia() -> Vec<[usize; 4]> {
    (0..4).map(|k| [k, (k + 1) % 4, 4 + (k + 1) % 4, 4 + k]).collect()
}

fn triangles() -> Vec<[usize; 3]> {
    trapezia().iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect()
}

#[test]
fn every_format_gives_the_same_sheet_with_its_hole() {
    let list = |of: &mut dyn Iterator<Item = String>| of.collect::<Vec<_>>().join("\n");
    let xyz = list(&mut POINTS.iter().map(|[x, y]| format!("{x} {y} 0")));
    let quads = list(&mut trapezia().iter().map(|[a, b, c, d]| format!("4 {a} {b} {c} {d}")));
    let vtk = format!(
        "# vtk DataFile Version 3.0\nhole\nASCII\nDATASET POLYDATA\nPOINTS 8 double\n{xyz}\nPOLYGONS 4 20\n{quads}\n"
    );
    let connectivity = list(&mut triangles().iter().map(|[a, b, c]| format!("{a} {b} {c}")));
    let offsets = list(&mut (1..=8).map(|k| (3 * k).to_string()));
    let array = |kind: &str, name: &str, size: usize, text: &str| {
        format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{size}\" format=\"ascii\">\n{text}\n</DataArray>"
        )
    };
    let points = array("Float64", "Points", 3, &xyz);
    let nodes = array("Int64", "connectivity", 1, &connectivity) + &array("Int64", "offsets", 1, &offsets);
    let types = array("UInt8", "types", 1, &["5"; 8].join(" "));
    let vtu = format!(
        "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\"><UnstructuredGrid>\
         <Piece NumberOfPoints=\"8\" NumberOfCells=\"8\"><Points>{points}</Points><Cells>{nodes}{types}</Cells>\
         </Piece></UnstructuredGrid></VTKFile>"
    );
    let vtp = format!(
        "<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\"><PolyData>\
         <Piece NumberOfPoints=\"8\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" \
         NumberOfPolys=\"8\"><Points>{points}</Points><Polys>{nodes}</Polys></Piece></PolyData></VTKFile>"
    );
    let corner = |k: usize| format!("vertex {} {} 0", POINTS[k][0], POINTS[k][1]);
    let facets = list(&mut triangles().iter().map(|t| {
        let [a, b, c] = t.map(corner);
        format!("facet normal 0 0 1\nouter loop\n{a}\n{b}\n{c}\nendloop\nendfacet")
    }));
    let stl = format!("solid hole\n{facets}\nendsolid hole\n");
    let mut binary = vec![0_u8; 80];
    binary.extend(8_u32.to_le_bytes());
    for t in triangles() {
        let corners = t.iter().flat_map(|&k| [POINTS[k][0] as f32, POINTS[k][1] as f32, 0.0]);
        binary.extend([0.0_f32, 0.0, 1.0].into_iter().chain(corners).flat_map(f32::to_le_bytes));
        binary.extend([0, 0]);
    }
    let elements = list(
        &mut triangles()
            .iter()
            .enumerate()
            .map(|(k, [a, b, c])| format!("{} 2 2 7 1 {} {} {}", k + 1, a + 1, b + 1, c + 1)),
    );
    let nodes = list(&mut POINTS.iter().enumerate().map(|(k, [x, y])| format!("{} {x} {y} 0", k + 1)));
    let msh = format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n2 7 \"hole\"\n$EndPhysicalNames\n$Nodes\n8\n\
         {nodes}\n$EndNodes\n$Elements\n8\n{elements}\n$EndElements\n"
    );
    let faces = list(&mut trapezia().iter().map(|t| {
        let [a, b, c, d] = t.map(|k| k + 1);
        format!("f {a} {b} {c} {d}")
    }));
    let obj = format!("{}\n{faces}\n", list(&mut POINTS.iter().map(|[x, y]| format!("v {x} {y} 0"))));
    for (name, content) in [
        ("hole.vtk", vtk.into_bytes()),
        ("hole.vtu", vtu.into_bytes()),
        ("hole.vtp", vtp.into_bytes()),
        ("hole.stl", stl.into_bytes()),
        ("binary.stl", binary),
        ("hole.msh", msh.into_bytes()),
        ("hole.obj", obj.into_bytes()),
    ] {
        let mass = File::new(name, content).mass("");
        assert!((mass / (0.2 * 0.75) - 1.0).abs() < 1e-6, "{name}: {mass}");
    }
}

#[test]
fn what_cannot_be_a_sheet_is_refused_with_the_element() {
    let head = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n";
    for (content, words) in [
        ("v 0.5 0 0\nf 1 2 3\nf 1 2 5\n", "1 of 2 triangles have no area (first: element 1"),
        ("f 1 2 3\nf 2 4 3\nf 2 3 4\n", "elements 1 and 2 have the same corners"),
        ("v 0.2 0.3 0\nf 1 2 3\nf 1 2 5\n", "element 0 is folded flat onto its neighbour"),
        ("l 1 2\n", "no"),
    ] {
        let message = File::new("bad.obj", format!("{head}{content}")).refused("");
        assert!(message.contains(words), "{message}");
    }
    let file = File::new("good.obj", format!("{head}f 1 2 3\nf 2 4 3\n"));
    for (keys, words) in [
        ("weld = -1.0", "must be zero or positive"),
        ("uv_scale = 2.0", "rest = \"flat\""),
        ("rest = \"rolled\"", "rolled"),
    ] {
        let program = file.check(keys);
        assert!(program.code() == Some(2) && program.errors().contains(words), "{}", program.errors());
    }
    let program = Program::check(&scene(&file.1, "").replace("thickness = 1e-3", "thickness = 0.0"));
    assert!(program.errors().contains("thickness of a sheet must be positive"), "{}", program.errors());
}

/// Three triangles at one edge are reported, and the scene runs.
#[test]
fn a_book_runs() {
    let book = "v 0 0 0\nv 0 1 0\nv 1 0.5 0\nv -0.5 0.5 0.8\nv -0.5 0.5 -0.8\nf 1 2 3\nf 1 2 4\nf 1 2 5\n";
    let said = File::new("book.obj", book).said("");
    assert!(said.contains("more than two triangles meet at 1 edges"), "{said}");
}

/// A density per volume and one per area give the same mass if they differ by the factor thickness.
#[test]
fn matter_is_given_per_volume_or_per_area() {
    let file = File::new("sheet.obj", obj(4, false, false, None));
    let per_volume = Program::run(&scene(&file.1, "").replace("area_density = 0.2", "density = 200.0"));
    let per_area = Program::run(&scene(&file.1, ""));
    let pz = |program: &Program| program.history().last("pz");
    assert!((pz(&per_volume) / pz(&per_area) - 1.0).abs() < 1e-12);
}
