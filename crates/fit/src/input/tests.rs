use super::*;
use nalgebra::Vector3;

mod collada;
mod damage;
mod dialects;
mod faults;

const CORNERS: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 0.5]];

fn read(extension: &str, bytes: impl AsRef<[u8]>) -> Result<Mesh, String> {
    let read = parse_mesh(bytes.as_ref(), extension, Path::new("shape"), &ReadOptions::default());
    read.map(|reading| reading.mesh).map_err(|error| error.to_string())
}

fn assert_corners(extension: &str, bytes: impl AsRef<[u8]>) {
    let Mesh { points, .. } = read(extension, bytes).unwrap();
    assert_eq!(points.len(), 4);
    for corner in CORNERS {
        assert!(points.contains(&Vector3::from(corner)), "{extension}: {corner:?} is missing from {points:?}");
    }
}

fn assert_fails(extension: &str, bytes: impl AsRef<[u8]>, parts: &[&str]) {
    let error = read(extension, bytes).expect_err("a broken file must not be read");
    assert!(error.starts_with("shape"), "{error}");
    assert!(!error.contains('\n'), "{error}");
    for part in parts {
        assert!(error.contains(part), "{error:?} does not say {part:?}");
    }
}

#[test]
fn off_in_its_variants() {
    let body = "0 0 0\n1 0 0\n0 2 0 # tip\n\n0 0 0.5\n3 0 1 2\n";
    assert_corners("off", format!("OFF\n4 1 0\n{body}"));
    assert_corners("off", format!("# made by hand\nOFF 4 1 0\n{body}"));
    assert_corners("off", format!("OFF4 1 0\r\n{}", body.replace('\n', "\r\n")));
    assert_corners("off", format!("4 1\n{body}"));
    assert_corners("off", "COFF\n4 0 0\n0 0 0 255 0 0 1\n1 0 0 255 0 0 1\n0 2 0 1 1 1 1\n0 0 .5 1 1 1 1");
}

#[test]
fn broken_off() {
    assert_fails("off", "", &["end of file"]);
    assert_fails("off", "OFF\n", &["end of file"]);
    assert_fails("off", "OFF\nmany 1 0\n", &["line 2", "counts"]);
    assert_fails("off", "OFF\n4 1 0\n0 0 0\n1 0 0\n", &["vertex 2 (counted from 0) of 4"]);
    assert_fails("off", "OFF\n18446744073709551615 1 0\n0 0 0\n", &["vertex 1 (counted from 0)"]);
    assert_fails("off", "OFF\n4 2 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 1 2\n", &["face 1 (counted from 0) of 2"]);
    assert_fails("off", "OFF\n4 0 0\n0 0 0\n1 0\n0 1 0\n0 0 1\n", &["line 4", "2 coordinates"]);
    assert_fails("off", "OFF\n4 0 0\n0 0 0\n1 x 0\n0 1 0\n0 0 1\n", &["line 4", "\"x\""]);
    assert_fails("off", "OFF\n4 0 0\n0 0 0\n1 nan 0\n0 1 0\n0 0 1\n", &["vertex 1", "NaN"]);
    assert_fails("off", "OFF\n4 0 0\n0 0 0\n1 0 0\n0 1e999 0\n0 0 1\n", &["vertex 2", "inf"]);
    assert_fails("off", "OFF\n0 0 0\n", &["there are no points"]);
    assert_fails("off", "OFF BINARY\n\0\0", &["not supported", "as text"]);
    assert_fails("off", b"OFF\n4 0 0\n\xff\xfe 0 0", &["line 3", "is not a number"]);
    assert_fails("off", b"\xff\xfeO\0F\0F\0", &["UTF-16", "UTF-8"]);
}

#[test]
fn obj_takes_every_vertex() {
    assert_corners(
        "obj",
        "# cube\nmtllib a.mtl\no a\nv 0 0 0\nv 1 0 0\nvn 0 0 1\nvt 0 0\nv 0 2 0\nf 1/1/1 2/1/1 3/1/1\no b\nv 0 0 .5",
    );
    assert_fails("obj", "v 0 0 0\nv 1 0\n", &["line 2", "2 coordinates"]);
    assert_fails("obj", "v 0 0 0\nv 1 0 0\nv 0 inf 0\nv 0 0 1", &["vertex 2"]);
}

#[test]
fn xyz_with_any_separator() {
    assert_corners("xyz", "# cloud\n0 0 0\n1,0,0\n0; 2; 0\n0\t0\t0.5\n");
    assert_corners("xyz", "0 0 0 a\n1 0 0 b\n0 2 0 c\n0 0 .5 d");
    assert_corners("xyz", "0, 0, 0,\n1, 0, 0,\n0, 2, 0,\n0, 0, .5,\n");
}

fn ply_header(format: &str, count: usize) -> String {
    format!(
        "ply\nformat {format} 1.0\ncomment test\nelement vertex {count}\nproperty float x\nproperty double y\n\
         property float z\nproperty uchar red\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
    )
}

fn ply_binary(big: bool) -> Vec<u8> {
    let mut bytes = ply_header(if big { "binary_big_endian" } else { "binary_little_endian" }, 4).into_bytes();
    for [x, y, z] in CORNERS {
        let (x, z) = (x as f32, z as f32);
        if big {
            bytes.extend(x.to_be_bytes().iter().chain(&y.to_be_bytes()).chain(&z.to_be_bytes()));
        } else {
            bytes.extend(x.to_le_bytes().iter().chain(&y.to_le_bytes()).chain(&z.to_le_bytes()));
        }
        bytes.push(7);
    }
    bytes.push(3);
    for corner in TRIANGLES[0] {
        let corner = corner as i32;
        bytes.extend(if big { corner.to_be_bytes() } else { corner.to_le_bytes() });
    }
    bytes
}

#[test]
fn ply_text_and_binary() {
    assert_corners("ply", format!("{}0 0 0 1\n1 0 0 1\n0 2 0 1\n0 0 0.5 1\n3 0 1 2\n", ply_header("ascii", 4)));
    assert_corners("ply", ply_binary(false));
    assert_corners("ply", ply_binary(true));
}

#[test]
fn broken_ply() {
    assert_fails("ply", "", &["header"]);
    assert_fails("ply", "ply\nformat ascii 1.0\n", &["header"]);
    assert_fails("ply", ply_header("ascii", usize::MAX), &["element \"vertex\"", "do not fit"]);
    assert_fails("ply", format!("{}0 0 0 1\n1 0 0 1\n", ply_header("ascii", 4)), &["element \"vertex\""]);
    let binary = ply_binary(false);
    assert_fails("ply", &binary[..binary.len() - 40], &["element \"vertex\""]);
    assert_fails(
        "ply",
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nend_header\n1\n1\n1\n1\n",
        &["x, y and z"],
    );
    assert_fails("ply", "ply\nformat ascii 1.0\nelement face 0\nproperty float x\nend_header\n", &["no element"]);
    assert_fails(
        "ply",
        "ply\nformat binary_little_endian 1.0\nelement nothing 1000000000\nend_header\n",
        &["element \"nothing\""],
    );
}

const TRIANGLES: [[usize; 3]; 2] = [[0, 1, 2], [0, 1, 3]];

fn stl_text(first: &str) -> String {
    let mut text = format!("{first}\n");
    for triangle in TRIANGLES {
        text += "facet normal 0 0 1\n outer loop\n";
        for [x, y, z] in triangle.map(|i| CORNERS[i]) {
            text += &format!("  vertex {x} {y} {z:e}\n");
        }
        text += " endloop\nendfacet\n";
    }
    text + "endsolid\n"
}

fn stl_binary(header: &[u8]) -> Vec<u8> {
    let mut bytes = header.to_vec();
    bytes.resize(80, b' ');
    bytes.extend(2_u32.to_le_bytes());
    for triangle in TRIANGLES {
        bytes.extend([0; 12]);
        for value in triangle.iter().flat_map(|&i| CORNERS[i]) {
            bytes.extend((value as f32).to_le_bytes());
        }
        bytes.extend([0; 2]);
    }
    bytes
}

#[test]
fn stl_text_and_binary() {
    assert_corners("stl", stl_text("solid thing"));
    assert_corners("stl", stl_text("solid"));
    assert_corners("stl", stl_text("solid "));
    assert_corners("stl", stl_binary(b"made by nobody"));
    assert_corners("stl", stl_binary(b"solid but binary"));
}

#[test]
fn broken_stl() {
    assert_fails("stl", "", &["too few"]);
    let binary = stl_binary(b"");
    assert_fails("stl", &binary[..binary.len() - 3], &["triangle count", "184 bytes, not 181"]);
    let mut lying = binary;
    lying[80..84].fill(0xff);
    assert_fails("stl", &lying, &["triangle count"]);
    let text = stl_text("solid thing");
    assert_fails("stl", &text[..text.len() / 2], &["end of file", "endsolid"]);
    let mut nan = stl_binary(b"");
    nan[96..100].copy_from_slice(&f32::NAN.to_le_bytes());
    assert_fails("stl", &nan, &["vertex 0", "NaN"]);
}

/// The corners of each triangle, by coordinates.
fn triangles(extension: &str, bytes: impl AsRef<[u8]>) -> Vec<[[f64; 3]; 3]> {
    let Mesh { points, triangles } = read(extension, bytes).unwrap();
    triangles.iter().map(|corners| corners.map(|i| points[i].into())).collect()
}

#[test]
fn faces_become_triangles() {
    let vertices = "0 0 0\n1 0 0\n0 2 0\n0 0 0.5\n";
    let lines = |prefix: &str| vertices.lines().map(|line| format!("{prefix}{line}\n")).collect::<String>();
    let fan = TRIANGLES.map(|corners| corners.map(|i| CORNERS[i]));
    let [a, b, c, d] = CORNERS;
    let quad = vec![[a, b, c], [a, c, d]];
    assert_eq!(triangles("off", format!("OFF\n4 2 0\n{vertices}3 0 1 2 255 0 0\n3 0 1 3 0 255 0\n")), fan);
    assert_eq!(triangles("off", format!("OFF\n4 1 0\n{vertices}4 0 1 2 3\n")), quad);
    assert_eq!(triangles("obj", format!("{}f 1/1/1 2/1/1 3/1/1\nf 1//7 2//7 4//7\nl 1 2\n", lines("v "))), fan);
    assert_eq!(triangles("obj", format!("{}f -4 -3 -2 -1\n", lines("v "))), quad);
    assert_eq!(triangles("stl", stl_text("solid thing")), fan);
    assert_eq!(triangles("stl", stl_binary(b"")), fan);
    assert_eq!(triangles("ply", ply_binary(false)), fan[..1]);
    assert_eq!(triangles("ply", ply_binary(true)), fan[..1]);
    let ply = format!("{}0 0 0 1\n1 0 0 1\n0 2 0 1\n0 0 0.5 1\n4 0 1 2 3\n", ply_header("ascii", 4));
    assert_eq!(triangles("ply", ply), quad);
    assert_eq!(triangles("xyz", vertices), Vec::<[[f64; 3]; 3]>::new());
    // Fewer than three corners bound nothing.
    assert!(triangles("off", format!("OFF\n4 2 0\n{vertices}2 0 1\n0\n")).is_empty());
}

#[test]
fn faces_of_missing_vertices() {
    let vertices = "0 0 0\n1 0 0\n0 2 0\n0 0 0.5\n";
    let lines = |prefix: &str| vertices.lines().map(|line| format!("{prefix}{line}\n")).collect::<String>();
    assert_fails("off", format!("OFF\n4 1 0\n{vertices}3 0 1 4\n"), &["line 7", "vertex 4"]);
    assert_fails("off", format!("OFF\n4 1 0\n{vertices}3 0 1\n"), &["line 7", "2 corners"]);
    assert_fails("off", format!("OFF\n4 1 0\n{vertices}3 0 1 -1\n"), &["line 7", "\"-1\""]);
    assert_fails("obj", format!("{}f 1 2 5\n", lines("v ")), &["line 5", "vertex 4"]);
    assert_fails("obj", format!("{}f 1 2 0\n", lines("v ")), &["line 5", "no vertex 0"]);
    assert_fails("obj", format!("{}f -5 2 3\n", lines("v ")), &["line 5", "no vertex -5"]);
    assert_fails("obj", format!("{}f a b c\n", lines("v ")), &["line 5", "\"a\""]);
    let ply = |face: &str| format!("{}0 0 0 1\n1 0 0 1\n0 2 0 1\n0 0 0.5 1\n{face}\n", ply_header("ascii", 4));
    assert_fails("ply", ply("3 0 1 4"), &["line 16", "vertex 4"]);
    assert_fails("ply", ply("3 0 1 -1"), &["line 16", "-1"]);
    let mut truncated = ply_binary(false);
    truncated.truncate(truncated.len() - 2);
    assert_fails("ply", truncated, &["element \"face\""]);
}

#[test]
fn files_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cloud.XYZ");
    std::fs::write(&path, "0 0 0\n1000 0 0\n0 1000 0\n0 0 1000\n").unwrap();
    let read = |path: &Path, scale: f64| {
        let options = ReadOptions { scale: Scale::uniform(scale).unwrap(), ..ReadOptions::default() };
        read_mesh(path, &options).map(|reading| reading.mesh.points)
    };
    assert_eq!(read(&path, 0.001).unwrap()[1], Vector3::x());
    assert!(matches!(read(&path, 1e308), Err(ReadError::NotFinite { vertex: 1, .. })));
    let missing = read(&folder.path().join("absent.off"), 1.0).unwrap_err();
    assert!(missing.to_string().contains("absent.off") && missing.to_string().contains("check the path"), "{missing}");
    for name in ["shape.step", "shape"] {
        let error = read(Path::new(name), 1.0).unwrap_err();
        assert!(error.to_string().contains(".off, .obj, .ply, .stl"), "{error}");
    }
    assert!(matches!(read(folder.path(), 1.0), Err(ReadError::UnknownFormat { .. })));
}
