//! One mesh written in every format and dialect that is read: the same points and triangles come
//! back.

use super::*;
use sublevel_testkit::Seeded;

/// A dialect: how a writer of a format may write.
pub(super) struct Dialect {
    pub(super) format: &'static str,
    pub(super) name: &'static str,
    /// Whether coordinates have single precision.
    is_single: bool,
    /// Whether triangles are kept, not points alone.
    pub(super) has_triangles: bool,
    write: fn(&Mesh, &mut Seeded) -> Vec<u8>,
}

/// A random number below `n`.
pub(super) fn below(random: &mut Seeded, n: usize) -> usize {
    ((random.signed().abs() * n as f64) as usize).min(n - 1)
}

/// Points of 4 to 20 corners in no special place, each used by some triangle.
pub(super) fn random_mesh(random: &mut Seeded, is_single: bool) -> Mesh {
    let count = 4 + below(random, 17);
    let size = 10_f64.powf(3.0 * random.signed());
    let coordinate = |random: &mut Seeded| {
        let value = size * random.signed();
        match below(random, 6) {
            0 => (4.0 * random.signed()).round(),
            _ if is_single => f64::from(value as f32),
            _ => value,
        }
    };
    let mut points: Vec<Vector3<f64>> = (0..count).map(|_| Vector3::from_fn(|_, _| coordinate(random))).collect();
    // STL knows vertices by their coordinates.
    points.dedup();
    let count = points.len();
    let triangles = (0..count + below(random, 30)).map(|index| {
        let first = index % count;
        let second = (first + 1 + below(random, count - 2)) % count;
        let third = (first + 1..first + count).map(|i| i % count).find(|&i| i != second).unwrap_or(0);
        [first, second, third]
    });
    let triangles = triangles.collect();
    Mesh { points, triangles }
}

/// A number as one of many programs prints it, read back the same.
fn spelled(value: f64, random: &mut Seeded) -> String {
    match below(random, 4) {
        0 => format!("{value:e}"),
        1 => format!("{value:E}"),
        2 if value.is_sign_positive() => format!("+{value}"),
        _ => format!("{value}"),
    }
}

fn coordinates(x: &Vector3<f64>, random: &mut Seeded) -> String {
    let blank = [" ", "  ", "\t", " \t "][below(random, 4)];
    [x.x, x.y, x.z].map(|value| spelled(value, random)).join(blank)
}

fn color(random: &mut Seeded, count: usize) -> String {
    (0..count).map(|_| format!(" {}", below(random, 256))).collect()
}

/// The lines with one of the three line ends, in front of them a byte-order mark or not.
fn text(lines: &[String], random: &mut Seeded) -> Vec<u8> {
    let mark = ["", "\u{feff}"][below(random, 2)];
    let end = ["\n", "\r\n", "\r"][below(random, 3)];
    let last = ["", end][below(random, 2)];
    format!("{mark}{}{last}", lines.join(end)).into_bytes()
}

fn off(mesh: &Mesh, random: &mut Seeded) -> Vec<u8> {
    let edges = ["", " 0", " 17"][below(random, 3)];
    let counts = format!("{} {}{edges}", mesh.points.len(), mesh.triangles.len());
    let mut lines = match below(random, 4) {
        0 => vec!["OFF".to_owned(), counts],
        1 => vec![format!("OFF {counts}")],
        2 => vec![counts],
        _ => vec!["# made by a program".to_owned(), "OFF # text".to_owned(), String::new(), counts],
    };
    lines.extend(mesh.points.iter().map(|x| coordinates(x, random)));
    let colors = [0, 1, 3, 4][below(random, 4)];
    lines.extend(mesh.triangles.iter().map(|[a, b, c]| format!(" 3 {a} {b} {c}{}", color(random, colors))));
    text(&lines, random)
}

fn colored_off(mesh: &Mesh, random: &mut Seeded) -> Vec<u8> {
    let (keyword, columns) = [("COFF", 4), ("COFF", 3), ("NOFF", 3), ("CNOFF", 7), ("STOFF", 2)][below(random, 5)];
    let mut lines = vec![keyword.to_owned(), format!("{} {} 0", mesh.points.len(), mesh.triangles.len())];
    lines.extend(mesh.points.iter().map(|x| coordinates(x, random) + &color(random, columns)));
    lines.extend(mesh.triangles.iter().map(|[a, b, c]| format!("3 {a} {b} {c}")));
    text(&lines, random)
}

fn streamed_off(mesh: &Mesh, random: &mut Seeded) -> Vec<u8> {
    let mut words = vec!["OFF".to_owned()];
    words.extend([mesh.points.len(), mesh.triangles.len(), 0].map(|count| count.to_string()));
    words.extend(mesh.points.iter().flat_map(|x| [x.x, x.y, x.z]).map(|value| spelled(value, random)));
    words.extend(mesh.triangles.iter().flat_map(|[a, b, c]| [3, *a, *b, *c]).map(|number| number.to_string()));
    let width = 5 + below(random, 20);
    let lines: Vec<String> = words.chunks(width).map(|words| words.join(" ")).collect();
    text(&lines, random)
}

fn obj(mesh: &Mesh, random: &mut Seeded) -> Vec<u8> {
    let kind = below(random, 4);
    let backwards = below(random, 2) == 0;
    let mut lines = vec!["# by a program".to_owned(), "mtllib a.mtl".to_owned(), "o part".to_owned()];
    for x in &mesh.points {
        let weight = 2_f64.powi(below(random, 5) as i32 - 2);
        lines.push(match kind {
            0 => format!("v {}", coordinates(x, random)),
            1 => format!("v {} {weight}", coordinates(&(x * weight), random)),
            2 => format!("v {}{}", coordinates(x, random), color(random, 3)),
            _ => format!("v {}", coordinates(x, random).replacen([' ', '\t'], " \\\n ", 1)),
        });
    }
    lines.push("vn 0 0 1".to_owned());
    lines.push("s off".to_owned());
    for triangle in &mesh.triangles {
        let corner = |&corner: &usize| {
            let index = if backwards { corner as i64 - mesh.points.len() as i64 } else { corner as i64 + 1 };
            match kind {
                0 => format!("{index}"),
                1 => format!("{index}//1"),
                2 => format!("{index}/1"),
                _ => format!("{index}/1/1"),
            }
        };
        lines.push(format!("f {}", triangle.iter().map(corner).collect::<Vec<_>>().join(" ")));
    }
    text(&lines, random)
}

fn xyz(mesh: &Mesh, random: &mut Seeded) -> Vec<u8> {
    let separator = [" ", "\t", ",", ", ", ";", "; "][below(random, 6)];
    let columns = below(random, 4);
    let names: String = (0..columns).map(|i| format!("{separator}c{i}")).collect();
    let header = [
        vec![],
        vec![format!("x{separator}y{separator}z{names}")],
        vec![mesh.points.len().to_string()],
        vec!["//X,Y,Z".to_owned()],
    ];
    let mut lines = header[below(random, 4)].clone();
    for x in &mesh.points {
        let mut row = [x.x, x.y, x.z].map(|value| spelled(value, random)).to_vec();
        row.extend((0..columns).map(|_| below(random, 256).to_string()));
        lines.push(row.join(separator));
    }
    text(&lines, random)
}

fn ply_head(mesh: &Mesh, format: &str, types: [&str; 3]) -> Vec<String> {
    let [number, count, corner] = types;
    let head = format!(
        "ply|format {format} 1.0|comment by a program|obj_info none|element vertex {}|property {number} x|\
         property {number} y|property uchar flags|property {number} z|element face {}|\
         property list {count} {corner} vertex_indices|end_header",
        mesh.points.len(),
        mesh.triangles.len()
    );
    head.split('|').map(str::to_owned).collect()
}

fn ply_text(mesh: &Mesh, random: &mut Seeded) -> Vec<u8> {
    let number = ["float", "double", "float32", "float64"][below(random, 4)];
    let mut lines = ply_head(mesh, "ascii", [number, "uchar", "int"]);
    for x in &mesh.points {
        let [a, b, c] = [x.x, x.y, x.z].map(|value| spelled(value, random));
        lines.push(format!("{a} {b} 7 {c}"));
        lines.extend((below(random, 5) == 0).then(String::new));
    }
    lines.extend(mesh.triangles.iter().map(|[a, b, c]| format!("3 {a} {b} {c} ")));
    text(&lines, random)
}

fn ply_bytes(mesh: &Mesh, random: &mut Seeded, is_single: bool) -> Vec<u8> {
    let big = below(random, 2) == 0;
    let format = if big { "binary_big_endian" } else { "binary_little_endian" };
    let end = ["\n", "\r\n", "\r"][below(random, 3)];
    let head = ply_head(mesh, format, [if is_single { "float" } else { "double" }, "uint8", "uint16"]);
    let mut bytes = (head.join(end) + end).into_bytes();
    let mut push = |little: &[u8]| {
        let mut little = little.to_vec();
        if big {
            little.reverse();
        }
        bytes.extend(little);
    };
    for x in &mesh.points {
        for (axis, value) in x.iter().enumerate() {
            if is_single {
                push(&(*value as f32).to_le_bytes());
            } else {
                push(&value.to_le_bytes());
            }
            if axis == 1 {
                push(&[7]);
            }
        }
    }
    for triangle in &mesh.triangles {
        push(&[3]);
        triangle.iter().for_each(|&corner| push(&(corner as u16).to_le_bytes()));
    }
    bytes
}

fn stl_words(mesh: &Mesh, random: &mut Seeded) -> Vec<u8> {
    let case: fn(&str) -> String = [|word: &str| word.to_owned(), |word: &str| word.to_uppercase()][below(random, 2)];
    let solids = 1 + below(random, 2);
    let mut lines = vec![String::new(); below(random, 2)];
    for triangles in mesh.triangles.chunks(mesh.triangles.len().div_ceil(solids)) {
        let name = ["", " part", " a long name"][below(random, 3)];
        lines.push(format!("{}{name}", case("solid")));
        for triangle in triangles {
            let normal = ["0 0 1", "nan nan nan", "-nan(ind) -1.#IND 0"][below(random, 3)];
            lines.push(format!(" {} {normal}", case("facet normal")));
            lines.push(format!("  {}", case("outer loop")));
            for &corner in triangle {
                lines.push(format!("    {} {}", case("vertex"), coordinates(&mesh.points[corner], random)));
            }
            lines.push(format!("  {}", case("endloop")));
            lines.push(format!(" {}", case("endfacet")));
        }
        lines.push(format!("{}{name}", case("endsolid")));
    }
    text(&lines, random)
}

fn stl_bytes(mesh: &Mesh, random: &mut Seeded) -> Vec<u8> {
    let mut bytes = [&b"made by a program"[..], b"solid part"][below(random, 2)].to_vec();
    bytes.resize(80, 0);
    bytes.extend((mesh.triangles.len() as u32).to_le_bytes());
    for triangle in &mesh.triangles {
        bytes.extend([0xff; 12]);
        for value in triangle.iter().flat_map(|&corner| mesh.points[corner].iter().copied().collect::<Vec<_>>()) {
            bytes.extend((value as f32).to_le_bytes());
        }
        bytes.extend([0, 0]);
    }
    bytes
}

fn collada(mesh: &Mesh, random: &mut Seeded) -> Vec<u8> {
    let points: Vec<String> = mesh.points.iter().map(|x| coordinates(x, random)).collect();
    let corners: Vec<String> = mesh.triangles.iter().flatten().map(|corner| format!("{corner} 0")).collect();
    let (open, close) = match below(random, 2) {
        0 => (format!("<triangles count=\"{}\">", mesh.triangles.len()), "</triangles>"),
        _ => {
            let count = mesh.triangles.len();
            (format!("<polylist count=\"{count}\"><vcount>{}</vcount>", "3 ".repeat(count)), "</polylist>")
        }
    };
    let (open, before) = open.split_at(open.find('>').unwrap_or(0) + 1);
    let scene = [
        String::new(),
        "<library_visual_scenes><visual_scene id=\"s\"><node><matrix>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</matrix>\
         <instance_geometry url=\"#g\"/></node></visual_scene></library_visual_scenes>\
         <scene><instance_visual_scene url=\"#s\"/></scene>"
            .to_owned(),
    ];
    format!(
        "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" \
         version=\"1.4.1\">\n<asset><unit name=\"meter\" meter=\"1\"/><up_axis>Z_UP</up_axis></asset>\n\
         <library_geometries><geometry id=\"g\"><mesh>\n<source id=\"p\"><float_array id=\"a\" count=\"{}\">\n{}\n\
         </float_array><technique_common><accessor source=\"#a\" count=\"{}\" stride=\"3\">\n\
         <param name=\"X\" type=\"float\"/><param name=\"Y\" type=\"float\"/><param name=\"Z\" type=\"float\"/>\n\
         </accessor></technique_common></source>\n<vertices id=\"v\"><input semantic=\"POSITION\" source=\"#p\"/>\
         </vertices>\n{open}<input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/>\
         <input semantic=\"NORMAL\" source=\"#n\" offset=\"1\"/>{before}<p>{}</p>{close}\n</mesh></geometry>\
         </library_geometries>\n{}</COLLADA>\n",
        3 * mesh.points.len(),
        points.join("\n"),
        mesh.points.len(),
        corners.join(" "),
        scene[below(random, 2)],
    )
    .into_bytes()
}

/// All dialects.
pub(super) const DIALECTS: [Dialect; 11] = [
    Dialect { format: "off", name: "lines", is_single: false, has_triangles: true, write: off },
    Dialect { format: "off", name: "more columns", is_single: false, has_triangles: true, write: colored_off },
    Dialect { format: "off", name: "a stream", is_single: false, has_triangles: true, write: streamed_off },
    Dialect { format: "obj", name: "text", is_single: false, has_triangles: true, write: obj },
    Dialect { format: "xyz", name: "text", is_single: false, has_triangles: false, write: xyz },
    Dialect { format: "ply", name: "text", is_single: false, has_triangles: true, write: ply_text },
    Dialect {
        format: "ply",
        name: "binary",
        is_single: false,
        has_triangles: true,
        write: |mesh, random| ply_bytes(mesh, random, false),
    },
    Dialect {
        format: "ply",
        name: "binary, single",
        is_single: true,
        has_triangles: true,
        write: |mesh, random| ply_bytes(mesh, random, true),
    },
    Dialect { format: "stl", name: "text", is_single: false, has_triangles: true, write: stl_words },
    Dialect { format: "stl", name: "binary", is_single: true, has_triangles: true, write: stl_bytes },
    Dialect { format: "dae", name: "text", is_single: false, has_triangles: true, write: collada },
];

impl Dialect {
    /// A random mesh, and how a program of this dialect writes it.
    pub(super) fn sample(&self, random: &mut Seeded) -> (Mesh, Vec<u8>) {
        let mesh = random_mesh(random, self.is_single);
        let bytes = (self.write)(&mesh, random);
        (mesh, bytes)
    }
}

/// The coordinates of points, sorted: which points there are, whatever their order.
pub(super) fn places(points: &[Vector3<f64>]) -> Vec<[f64; 3]> {
    let mut places: Vec<[f64; 3]> = points.iter().map(|x| (x.add_scalar(0.0)).into()).collect();
    places.sort_by(|a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
    places
}

#[test]
fn the_same_mesh_comes_back_from_every_dialect() {
    for seed in 0..400 {
        for dialect in &DIALECTS {
            let mut random = Seeded(seed);
            let (mesh, bytes) = dialect.sample(&mut random);
            let what = format!("{} ({}), seed {seed}", dialect.format, dialect.name);
            let found = read(dialect.format, &bytes)
                .unwrap_or_else(|error| panic!("{what}: {error}\n{}", String::from_utf8_lossy(&bytes)));
            assert_eq!(places(&found.points), places(&mesh.points), "{what}");
            let corners = |mesh: &Mesh| -> Vec<[[f64; 3]; 3]> {
                let place = |corner: usize| mesh.points[corner].add_scalar(0.0).into();
                mesh.triangles.iter().map(|triangle| triangle.map(place)).collect()
            };
            if dialect.has_triangles {
                assert_eq!(corners(&found), corners(&mesh), "{what}");
            }
        }
    }
}
