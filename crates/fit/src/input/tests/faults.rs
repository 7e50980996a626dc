//! Kinds of faults that other programs' files have, each in small.

use super::*;

fn reading(format: &str, bytes: impl AsRef<[u8]>, options: &ReadOptions) -> Result<Reading, String> {
    parse_mesh(bytes.as_ref(), format, Path::new("shape"), options).map_err(|error| error.to_string())
}

#[test]
fn all_solids_of_a_text_stl_are_read() {
    let one = stl_text("solid a");
    let moved = one.replace("vertex ", "vertex 1");
    let both = read("stl", format!("{one}{moved}")).unwrap();
    assert_eq!((both.points.len(), both.triangles.len()), (8, 4));
    assert_eq!(read("stl", format!("{one}solid empty\nendsolid empty\n")).unwrap().triangles.len(), 2);
    assert_fails("stl", format!("{one}more"), &["line 17", "\"more\"", "solid"]);
    assert_fails(
        "stl",
        format!("{one}{}", &moved[..moved.rfind("vertex").unwrap()]),
        &["end of file", "vertex is expected"],
    );
    assert_fails("stl", format!("{one}{}", moved.replacen("facet", "face", 1)), &["line 18", "\"face\""]);
}

#[test]
fn keywords_normals_and_blanks_of_text_stl() {
    let text = stl_text("solid a");
    assert_corners("stl", text.to_uppercase());
    assert_corners("stl", text.replace("facet", "Facet").replace("vertex", "VERTEX"));
    assert_corners("stl", format!("\u{feff}\n \t{text}"));
    assert_corners("stl", text.replace('\n', "\r"));
    assert_corners("stl", text.replace('\n', "\r\n"));
    assert_corners("stl", text.replace("outer loop\n", "outer\n\nloop "));
    for normal in ["nan nan nan", "-nan(ind) 1.#QNAN -1.#IND", "x y z", "", "1 2"] {
        assert_corners("stl", text.replace("0 0 1", normal));
    }
    assert_corners("stl", text.replace("normal 0 0 1", ""));
    assert_corners("stl", [b"solid \xe4\xff\n".as_slice(), &text.as_bytes()[8..]].concat());
    assert_fails("stl", text.replace("normal 0 0 1", "normal 0 0 1 5"), &["line 2", "\"5\"", "outer"]);
    assert_fails("stl", text.replace("endloop", "vertex 1 2 3\nendloop"), &["line 7", "endloop"]);
    assert_fails("stl", text.replace("2 0", "2,5 0"), &["\"2,5\"", "decimal points"]);
    // A damaged binary file whose free text begins with the keyword of the other variant.
    let mut binary = stl_binary(b"solid but binary");
    binary.pop();
    assert_fails("stl", binary, &["triangle count", "2 triangles"]);
}

#[test]
fn text_has_double_precision() {
    let far = 4_649_776.123_456_789;
    let vertices = format!("{far} 0 0\n1 0 0\n0 2 0\n0 0 0.1\n");
    let faces = "3 0 1 2\n";
    let header = ply_header("ascii", 4).replace("property uchar red\n", "");
    for (format, text) in [
        ("off", format!("OFF\n4 1 0\n{vertices}{faces}")),
        ("ply", format!("{header}{vertices}{faces}")),
        ("xyz", vertices.clone()),
        ("obj", vertices.lines().map(|line| format!("v {line}\n")).collect()),
        ("stl", stl_text("solid").replacen("vertex 0 0", &format!("vertex {far} 0"), 1)),
    ] {
        let points = read(format, text).unwrap().points;
        assert!(points.iter().any(|x| x.x == far), "{format}: {points:?}");
        assert!(format == "stl" || points.iter().any(|x| x.z == 0.1), "{format}: {points:?}");
    }
}

#[test]
fn decimal_commas_are_never_guessed() {
    let remedy = ["line 1", "decimal points"];
    for line in ["1,125 2,125 3,125", "1,5;2,5;3,5", "1,5, 2,5, 3,5", "1,5\t2,5\t3,5", "1,5 2 3", "1 2 3,5", "1; 2, 3"]
    {
        assert_fails("xyz", format!("{line}\n0 0 0\n"), &remedy);
    }
    assert_fails("obj", "v 1,125 2,125 3,125", &remedy);
    assert_fails("off", "OFF 1 0 0\n1,125 2,125 3,125", &["line 2", "decimal points"]);
    assert_fails("xyz", "1,,2\n", &["line 1", "empty column"]);
}

#[test]
fn headers_of_point_clouds() {
    let rows = "0 0 0\n1 0 0\n0 2 0\n0 0 .5\n";
    for header in
        ["x y z\n", "X,Y,Z\n", "//X Y Z\n", "4\n", "4\nx y z\n", "x y z\n4\n", "\n\n# count\n4\n", "\u{feff}x y z\r\n"]
    {
        assert_corners("xyz", format!("{header}{rows}"));
    }
    assert_fails("xyz", format!("5\n{rows}"), &["line 1", "5 points are announced, and 4 follow"]);
    assert_fails("xyz", format!("x y z\nx y z\n{rows}"), &["line 2", "\"x\""]);
    assert_fails("xyz", format!("x 0 0\n{rows}"), &["line 1", "\"x\""]);
    assert_fails("xyz", format!("{rows}0 0\n"), &["line 5", "2 coordinates"]);
    assert_fails("xyz", format!("{rows}0 0 0 1\n"), &["line 5", "4 columns", "3"]);
    assert_fails("xyz", "", &["there are no points"]);
}

#[test]
fn vertices_of_wavefront() {
    assert_corners("obj", "v 0 0 0 2\nv 2 0 0 2\nv 0 4 0 2\nv 0 0 1 2");
    assert_corners("obj", "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 2 0 0 0 0\nv 0 0 .5 .1 .2 .3");
    assert_corners("obj", "v 0 0 0 1\nv 1 0 0 1\nv 0 2 0 1.0\nv 0 0 .5 1");
    assert_fails("obj", "v 0 0 0 0", &["line 1", "infinity"]);
    assert_fails("obj", "v 0 0 0 inf", &["line 1", "not finite"]);
    assert_fails("obj", "v 0 0 0\nv 1 0 0 2", &["line 2", "weight"]);
    assert_fails("obj", "v 0 0 0 2\nv 1 0 0", &["line 2", "weight"]);
    assert_fails("obj", "v 0 0 0 .5 .5 .5\nv 1 0 0", &["line 2", "3 numbers", "6"]);
    assert_fails("obj", "v 0 0 0 1 1\n", &["line 1", "5 numbers"]);
}

#[test]
fn lines_of_wavefront() {
    let vertices = "v 0 0 0\nv 1 \\\n 0 0\nv 0 2 0\nv 0 0 .5\n";
    assert_corners("obj", vertices);
    let mesh = read("obj", format!("{vertices}f 1 2 \\\r\n 3 # a\nfo 1 2 4\n")).unwrap();
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 1, 3]]);
    assert_corners("obj", [b"# \xe4\xff\ng \xff\nusemtl \xfe\n".as_slice(), vertices.as_bytes()].concat());
    assert_fails("obj", format!("{vertices}surf 0 1"), &["line 6", "\"surf\"", "polygons"]);
    assert_fails("obj", format!("{vertices}w 0 1"), &["line 6", "\"w\"", "keyword"]);
    for cut in
        ["f 1 2", "f 1", "f", "f 1/1/1 2/2/2 3/3/", "f 1/1/1 2/2/2 3/3", "f 1//1 2//1 3//", "f 1 2 3/", "f 1/1/1/1 2 3"]
    {
        assert_fails("obj", format!("{vertices}{cut}"), &["line 6"]);
    }
    assert_fails("obj", format!("{vertices}f 1/a 2/1 3/1"), &["line 6", "\"a\""]);
    assert_fails("obj", format!("{vertices}f -9223372036854775808 1 2"), &["line 6", "no vertex"]);
}

#[test]
fn text_ply_with_blank_lines_and_any_line_end() {
    let text = format!("{}0 0 0 1\n1 0 0 1\n\n0 2 0 1\n0 0 .5 1\n3 0 1 2\n", ply_header("ascii", 4));
    for end in ["\n", "\r\n", "\r", "\n\n"] {
        assert_corners("ply", text.replace("end_header\n", "end_header\n\n").replace('\n', end));
    }
    assert_corners("ply", [&text.as_bytes()[..4], b"comment \xe4\xff\n", &text.as_bytes()[4..]].concat());
    assert_fails("ply", format!("{text}1 2 3\n"), &["line 18", "fewer rows"]);
    assert_fails("ply", text.replace("0 2 0 1", "0 2 0 1 7"), &["line 15", "\"7\""]);
    assert_fails("ply", text.replace("0 2 0 1", "0 2 0"), &["line 15", "fewer numbers"]);
    let mut binary = ply_binary(false);
    binary.push(7);
    assert_fails("ply", binary, &["end of file", "1 bytes come after"]);
}

#[test]
fn other_elements_and_strips_of_ply() {
    let header = |rest: &str| format!("ply\nformat ascii 1.0\n{rest}end_header\n");
    let vertex = "element vertex 4\nproperty int x\nproperty short y\nproperty float z\n";
    let rows = "0 0 0\n1 0 0\n0 2 0\n0 0 .5\n";
    let strips = format!("{vertex}element tristrips 1\nproperty list int int vertex_indices\n");
    let mesh = read("ply", header(&strips) + rows + "8 0 1 2 3 -1 0 1 3\n").unwrap();
    assert_eq!(mesh.triangles, [[0, 1, 2], [2, 1, 3], [0, 1, 3]]);
    let edges = format!("element edge 2\nproperty int a\nproperty list uchar float b\n{vertex}");
    assert_corners("ply", header(&edges) + "1 0\n1 2 .5 .5\n" + rows);
    let grid = format!("{vertex}element range_grid 1\nproperty list uchar int vertex_indices\n");
    assert_corners("ply", header(&grid) + rows + "1 0\n");
    for (element, reason) in [
        ("element face 1\nproperty list uchar float vertex_indices\n", "no integers"),
        ("element face 1\nproperty int flags\n", "vertex_indices"),
        ("element vertex 4\n", "twice"),
        ("property float x\nproperty float x\n", "twice"),
        ("property list float int a\n", "no integer"),
        ("property half a\n", "\"half\""),
        ("shape vertex\n", "no line of a header"),
        ("element face many\n", "no count"),
        ("element trifans 1\nproperty list int int vertex_indices\n", "only face and tristrips"),
        ("element face 1\nproperty list int int vertex_indices\nproperty list int int vertex_index\n", "twice"),
    ] {
        assert_fails("ply", header(&format!("{vertex}{element}")) + rows + "1\n", &[reason]);
    }
    assert_fails("ply", "ply\nformat ascii 2.0\nend_header\n", &["line 2"]);
    assert_fails("ply", "ply\nproperty int x\nend_header\n", &["line 2", "before the first element"]);
    assert_fails("ply", "ply\nelement vertex 0\nend_header\n", &["format"]);
}

#[test]
fn off_is_a_stream_of_numbers() {
    assert_corners("off", "OFF 4 1 0 0 0 0 1 0 0 0 2 0 0 0 0.5 3 0 1 2");
    assert_corners("off", "OFF\n4\n1\n0\n0 0\n0 1 0 0 0 2\n0 0 0 .5\n3 0\n1 2\n");
    assert_corners("off", "COFF 4 0 0 0 0 0 255 0 0 1 1 0 0 255 0 0 1 0 2 0 1 1 1 1 0 0 .5 1 1 1 1");
    assert_corners("off", "NOFF 4 0 0 0 0 0 0 0 1 1 0 0 0 0 1 0 2 0 0 0 1 0 0 .5 0 0 1");
    let rows = "0 0 0\n1 0 0\n0 2 0\n0 0 .5\n";
    for (counts, place) in [("3 1 0", "line 6"), ("5 1 0", "line 7"), ("4 0 0", "line 7"), ("4 2 0", "end of file")] {
        assert_fails("off", format!("OFF\n{counts}\n{rows}3 0 1 2\n"), &[place]);
    }
    assert_fails("off", format!("OFF\n4 1 0\n{rows}3 0 1 2\n3 0 1 2\n"), &["line 8", "comes after"]);
    assert_fails("off", "OFF 4 1 0 0 0 0 1 0 0 0 2 0 0 0 0.5 3 0 1 2 9", &["\"9\"", "after the last face"]);
    assert_fails("off", "OFF 4 1 0 0 0 0 1 0 0 0 2 0 0 0 0.5 3 0 1", &["face 0", "not complete"]);
    assert_fails("off", "OFF\n4 0 0\n0 0 0 1\n1 0 0 1\n0 2 0 1\n0 0 .5\n", &["line 6", "3 numbers", "4"]);
    assert_fails("off", format!("OFF\n4 1 0\n{rows}3 0 1 2 255 0\n"), &["line 7", "no color"]);
    assert_fails("off", "nOFF 4\n4 0 0\n", &["not supported"]);
}

#[test]
fn points_that_are_not_finite_are_left_out_on_demand() {
    let cloud = "0 0 0\nnan nan nan\n1 0 0\n0 2 0\n-nan(ind) 1 1\n0 0 .5\n1 1.#INF 0\n";
    let drop = ReadOptions { drop_nan: true, ..ReadOptions::default() };
    assert_fails("xyz", cloud, &["vertex 1", "NaN", "--drop-nan"]);
    let Reading { mesh, remarks } = reading("xyz", cloud, &drop).unwrap();
    assert_eq!((mesh.points.len(), remarks.dropped_points), (4, 3));
    assert!(remarks.sentences(&mesh)[0].contains("3 points"), "{remarks:?}");
    // Faces go with their points, and the others keep theirs.
    let mesh = "v 0 0 0\nv nan 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 .5\nf 1 2 3\nf 1 3 4\nf 3 4 5\n";
    let Reading { mesh, remarks } = reading("obj", mesh, &drop).unwrap();
    assert_eq!((mesh.triangles, remarks.dropped_faces), (vec![[0, 1, 2], [1, 2, 3]], 1));
    let none = reading("xyz", "nan 0 0\nnan 0 0\n", &drop).unwrap_err();
    assert!(none.contains("no points left but 2"), "{none}");
}

#[test]
fn scales_mirror() {
    let mirrored = ReadOptions { scale: "1,-1,2".parse().unwrap(), ..ReadOptions::default() };
    let text = "v 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 .5\nf 1 2 3\n";
    let mesh = reading("obj", text, &mirrored).unwrap().mesh;
    assert_eq!(mesh.points[2..], [Vector3::new(0.0, -2.0, 0.0), Vector3::new(0.0, 0.0, 1.0)]);
    assert_eq!(mesh.triangles, [[0, 2, 1]]);
}

#[test]
fn vertices_of_no_triangle_are_reported_with_their_cost() {
    let cube: String = (0..8).map(|i| format!("v {} {} {}\n", i & 1, i >> 1 & 1, i >> 2 & 1)).collect();
    let faces = "f 1 2 3\nf 4 5 6\nf 6 7 8\n";
    assert_eq!(reading("obj", format!("{cube}{faces}"), &ReadOptions::default()).unwrap().remarks, Remarks::default());
    let stray = format!("{cube}v 0 0 10\n{faces}");
    let Reading { mesh, remarks } = reading("obj", &stray, &ReadOptions::default()).unwrap();
    let unused = remarks.unused.clone().unwrap();
    assert_eq!((mesh.points.len(), mesh.used_points(), unused.points.len()), (9, 8, 1));
    // A pyramid of height 9 on the unit cube.
    let cost = unused.cost(&mesh);
    assert!((cost.hull_with_m3.unwrap() - 4.0).abs() < 1e-9 && (cost.hull_without_m3.unwrap() - 1.0).abs() < 1e-9);
    assert!(
        remarks.sentences(&mesh)[0].contains("1 of 9 vertices")
            && remarks.sentences(&mesh)[0].contains("--drop-unused")
    );
    let drop = ReadOptions { drop_unused: true, ..ReadOptions::default() };
    let Reading { mesh, remarks } = reading("obj", &stray, &drop).unwrap();
    assert!(mesh.points.len() == 8 && remarks.unused.as_ref().is_some_and(|unused| unused.dropped));
    assert_eq!(remarks.unused.as_ref().unwrap().cost(&mesh), cost);
    assert!(remarks.sentences(&mesh)[0].contains("1 of 9 vertices"), "{:?}", remarks.sentences(&mesh));
    assert_eq!(mesh.triangles[1], [3, 4, 5]);
    let first = format!("v 0 0 .5\n{cube}f 2 3 4\nf 5 6 7\nf 7 8 9\n");
    let free = reading("obj", &first, &drop).unwrap();
    assert_eq!(free.mesh.triangles, [[0, 1, 2], [3, 4, 5], [5, 6, 7]], "corners move with the vertices");
    let inner = reading("obj", format!("{cube}v .5 .5 .5\n{faces}"), &ReadOptions::default()).unwrap();
    assert!(inner.remarks.sentences(&inner.mesh)[0].contains("cost nothing"));
}

#[test]
fn pointers_of_git_lfs_are_named_in_every_format() {
    let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 684\n";
    for format in FORMATS {
        assert_fails(format, format!("\u{feff}{pointer}"), &["Git LFS pointer"]);
        assert_fails(format, pointer, &["Git LFS pointer", "git lfs pull"]);
    }
}

#[test]
fn concave_faces_stay_inside_their_outline() {
    let outline = "0 0 0\n3 0 0\n3 1 0\n1 1 0\n1 3 0\n0 3 0\n";
    let area = |mesh: &Mesh| -> f64 {
        let area = |t: &[usize; 3]| {
            let [a, b, c] = t.map(|corner| mesh.points[corner]);
            0.5 * (b - a).cross(&(c - a)).z
        };
        assert!(mesh.triangles.iter().all(|t| area(t) > 0.0), "{mesh:?}");
        mesh.triangles.iter().map(area).sum()
    };
    let lines = |prefix: &str| outline.lines().map(|line| format!("{prefix}{line}\n")).collect::<String>();
    let header = ply_header("ascii", 6).replace("property uchar red\n", "");
    for (format, text) in [
        ("obj", format!("{}f 4 5 6 1 2 3\n", lines("v "))),
        ("off", format!("OFF\n6 1 0\n{outline}6 3 4 5 0 1 2\n")),
        ("ply", format!("{header}{outline}6 3 4 5 0 1 2\n")),
    ] {
        let mesh = read(format, text).unwrap();
        assert!((area(&mesh) - 5.0).abs() < 1e-12 && mesh.triangles.len() == 4, "{format}");
    }
    let bow = reading("obj", "v 0 0 0\nv 2 2 0\nv 2 0 0\nv 0 3 0\nf 1 2 3 4\n", &ReadOptions::default()).unwrap();
    assert!(bow.remarks.sentences(&bow.mesh)[0].contains("cross themselves"), "{:?}", bow.remarks);
}

#[test]
fn a_row_of_off_that_lost_a_number_is_an_error() {
    let cube = "OFF\n8 6 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n1 0 1\n1 1 1\n0 1 1\n4 3 2 1 0\n4 4 5 6 7\n4 0 1 5 4\n\
                4 1 2 6 5\n4 2 3 7 6\n4 3 0 4 7\n";
    assert_eq!(read("off", cube).unwrap().points.len(), 8);
    assert_fails("off", cube.replacen("1 1 0\n", "1 1\n", 1), &["line 5", "2 coordinates"]);
    assert_fails("off", cube.replacen("1 1 0\n", "1 1 #0\n", 1), &["line 5", "2 coordinates"]);
    assert_fails("off", cube.replacen("1 1 0\n", "1 1 0 ", 1), &["line 5", "6 numbers"]);
    for line in 2..16 {
        let mut lines: Vec<&str> = cube.lines().collect();
        let cut = lines[line].rsplit_once(' ').unwrap().0.to_owned();
        lines[line] = &cut;
        let error = read("off", lines.join("\n")).unwrap_err();
        assert!(error.contains(&format!("line {}", line + 1)), "{error}");
    }
}

#[test]
fn names_of_columns_say_where_coordinates_are() {
    let rows = "7 0 0 0\n7 1 0 0\n7 0 2 0\n7 0 0 .5\n";
    for names in
        ["id x y z\n", "# id x y z\n", "//id X Y Z\n", "\"intensity\" \"Points:0\" \"Points:1\" \"Points:2\"\n"]
    {
        assert_corners("xyz", format!("{names}{rows}"));
    }
    assert_corners("xyz", "z,y,x\n0,0,0\n0,0,1\n0,2,0\n.5,0,0\n");
    assert_fails("xyz", "x y z\n1 0 0 0\n2 1 0 0\n", &["line 2", "4 columns", "3"]);
    assert_fails("xyz", "1,125000,2,125000,3,125000\n4,000000,5,500000,6,250000\n", &["decimal commas"]);
    assert_eq!(read("xyz", "1,2,3,255,0,0\n1.5,2,3,255,0,0\n").unwrap().points.len(), 2);
    for names in ["range azimuth elevation\n", "r g b\n", "x y\n", "x x y z\n", "OFF\n"] {
        assert_fails("xyz", format!("{names}0 0 0\n"), &["line 1", "names"]);
    }
}

#[test]
fn comments_and_names_of_wavefront_are_not_continued() {
    let vertices = "v 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 .5\n";
    for first in ["# C:\\models\\\n", "usemtl C:\\t\\\n", "g a\\\n", "o b\\\n"] {
        assert_corners("obj", format!("{first}{vertices}"));
    }
    let mesh = read("obj", format!("{vertices}usemtl C:\\t\\\nf 1 2 3\n")).unwrap();
    assert_eq!(mesh.triangles, [[0, 1, 2]]);
}

#[test]
fn facets_in_the_line_of_a_name_are_refused() {
    let text = stl_text("solid a");
    assert_corners("stl", stl_text("solid facet clamp"));
    assert_fails("stl", text.replace('\n', " "), &["line 1", "facet", "line end"]);
    assert_fails("stl", format!("{} solid b facet normal 0 0 1", text.trim_end()), &["facet", "line end"]);
}

#[test]
fn elements_of_collada_with_one_id_are_refused() {
    let file = "<COLLADA><library_geometries><geometry id=\"g\"/><geometry id=\"g\"/></library_geometries>\
                <library_visual_scenes><visual_scene id=\"s\"><node><instance_geometry url=\"#g\"/></node></visual_scene>\
                </library_visual_scenes></COLLADA>";
    assert_fails("dae", file, &["instance_geometry", "several elements"]);
}
