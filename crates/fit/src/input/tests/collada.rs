//! COLLADA: units, nodes, primitives, and what is refused.

use super::*;

const SOURCE: &str = "<source id=\"p\"><float_array id=\"a\" count=\"12\">0 0 0 1 0 0 <!-- tip --> 0 2 0 0 0 .5</float_array>\
<technique_common><accessor source=\"#a\" count=\"4\" stride=\"3\"><param name=\"X\"/><param name=\"Y\"/><param name=\"Z\"/>\
</accessor></technique_common></source><vertices id=\"v\"><input semantic=\"POSITION\" source=\"#p\"/></vertices>";

const INPUT: &str = "<input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/>";

const TRIANGLES: &str =
    "<triangles count=\"2\"><input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/><p>0 1 2 0 1 3</p></triangles>";

/// A file of one geometry, `g`, and the nodes of its scene; without nodes it has no scene.
fn file(asset: &str, primitives: &str, nodes: &str) -> String {
    let scene = format!(
        "<library_visual_scenes><visual_scene id=\"s\">{nodes}</visual_scene></library_visual_scenes>\
         <scene><instance_visual_scene url=\"#s\"/></scene>"
    );
    format!(
        "<?xml version=\"1.0\"?><COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\"><asset>{asset}</asset>\
         <library_geometries><geometry id=\"g\"><mesh>{SOURCE}{primitives}</mesh></geometry></library_geometries>{}\
         </COLLADA>",
        if nodes.is_empty() { "" } else { &scene }
    )
}

fn shown(nodes: &str) -> Mesh {
    let text = file("", TRIANGLES, nodes);
    read("dae", &text).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

#[test]
fn geometries_and_their_unit() {
    assert_corners("dae", file("", TRIANGLES, ""));
    let inches =
        read("dae", file("<unit name=\"inch\" meter=\"0.0254\"/><up_axis>Y_UP</up_axis>", TRIANGLES, "")).unwrap();
    assert_eq!(inches.points[2], Vector3::new(0.0, 2.0 * 0.0254, 0.0));
    let twice = ReadOptions { scale: "2,-2,2".parse().unwrap(), ..ReadOptions::default() };
    let text = file("<unit meter=\"0.5\"/>", TRIANGLES, "");
    let mesh = parse_mesh(text.as_bytes(), "dae", Path::new("shape"), &twice).unwrap().mesh;
    assert_eq!(mesh.points[2], Vector3::new(0.0, -2.0, 0.0));
    assert_eq!(mesh.triangles[0], [0, 2, 1]);
    let latin = file("<contributor><author>J\u{f6}rg</author></contributor>", TRIANGLES, "");
    let latin: Vec<u8> = latin.chars().map(|c| if c == '\u{f6}' { 0xf6 } else { c as u8 }).collect();
    assert_corners("dae", latin);
}

#[test]
fn nodes_place_geometries() {
    let shown_at = |steps: &str, x: [f64; 3]| {
        let mesh = shown(&format!("<node>{steps}<instance_geometry url=\"#g\"/></node>"));
        assert!((mesh.points[1] - Vector3::from(x)).norm() < 1e-15, "{steps}: {:?}", mesh.points[1]);
        mesh
    };
    shown_at("", [1.0, 0.0, 0.0]);
    shown_at("<translate>1 2 3</translate>", [2.0, 2.0, 3.0]);
    // The last step is applied first.
    shown_at("<translate>1 2 3</translate><rotate>0 0 1 90</rotate><scale>2 1 1</scale>", [1.0, 4.0, 3.0]);
    shown_at("<rotate>0 0 2 90</rotate><translate>1 2 3</translate>", [-2.0, 2.0, 3.0]);
    shown_at("<matrix>0 -1 0 5 1 0 0 6 0 0 1 7 0 0 0 1</matrix>", [5.0, 7.0, 7.0]);
    shown_at("<rotate>0 0 0 0</rotate>", [1.0, 0.0, 0.0]);
    // A mirror turns triangles, so that they are passed the same way seen from outside.
    let mirrored = shown_at("<scale>-1 1 1</scale>", [-1.0, 0.0, 0.0]);
    assert_eq!(mirrored.triangles[0], [2, 1, 0]);
    // Nodes within nodes, and the same geometry twice.
    let inner = "<node id=\"n\"><translate>0 0 1</translate><instance_geometry url=\"#g\"/></node>";
    let mesh =
        shown(&format!("<node><translate>1 0 0</translate>{inner}</node><node><instance_node url=\"#n\"/></node>"));
    assert_eq!((mesh.points.len(), mesh.triangles.len()), (8, 4));
    assert_eq!((mesh.points[0], mesh.points[4]), (Vector3::new(1.0, 0.0, 1.0), Vector3::new(0.0, 0.0, 1.0)));
    assert_eq!(mesh.triangles[2], [4, 5, 6]);
}

#[test]
fn primitives_of_all_kinds() {
    let made =
        |primitives: &str| read("dae", file("", primitives, "")).unwrap_or_else(|error| panic!("{error}")).triangles;
    assert_eq!(made(TRIANGLES), [[0, 1, 2], [0, 1, 3]]);
    let normal = "<input semantic=\"NORMAL\" source=\"#n\" offset=\"1\"/>";
    for (primitive, triangles) in [
        (
            format!(
                "<polylist count=\"2\">{INPUT}{normal}<vcount>4 3</vcount><p>0 9 1 9 2 9 3 9 0 9 1 9 3 9</p></polylist>"
            ),
            3,
        ),
        (format!("<polygons count=\"2\">{INPUT}<p>0 1 2</p><p>0 1 2 3</p></polygons>"), 3),
        (format!("<trifans count=\"1\">{INPUT}<p>0 1 2 3</p></trifans>"), 2),
        (format!("<tristrips count=\"1\">{INPUT}<p>0 1 2 3</p></tristrips>"), 2),
        (format!("<triangles count=\"0\">{INPUT}</triangles>"), 0),
        (format!("<lines count=\"1\">{INPUT}<p>0 1</p></lines>{TRIANGLES}"), 2),
    ] {
        assert_eq!(made(&primitive).len(), triangles, "{primitive}");
    }
    assert_eq!(made(&format!("<tristrips count=\"1\">{INPUT}<p>0 1 2 3</p></tristrips>")), [[0, 1, 2], [2, 1, 3]]);
    let holed = "<float_array id=\"a\" count=\"24\">0 0 0 4 0 0 4 4 0 0 4 0 1 1 0 1 3 0 3 3 0 3 1 0</float_array>";
    let text = file("", &format!("<polygons count=\"1\">{INPUT}<ph><p>0 1 2 3</p><h>4 5 6 7</h></ph></polygons>"), "");
    let first = text.find("<float_array").unwrap();
    let last = text.find("</float_array>").unwrap() + "</float_array>".len();
    let text =
        format!("{}{holed}{}", &text[..first], &text[last..]).replace("count=\"4\" stride", "count=\"8\" stride");
    let mesh = read("dae", text).unwrap();
    let area =
        |t: &[usize; 3]| (mesh.points[t[1]] - mesh.points[t[0]]).cross(&(mesh.points[t[2]] - mesh.points[t[0]])).norm();
    assert!((mesh.triangles.iter().map(area).sum::<f64>() - 24.0).abs() < 1e-12, "{:?}", mesh.triangles);
}

#[test]
fn broken_collada() {
    let good = file("", TRIANGLES, "<node id=\"n\"><instance_geometry url=\"#g\"/></node>");
    assert_corners("dae", &good);
    for (from, to, parts) in [
        ("</COLLADA>", "", &["no XML", "line"][..]),
        ("COLLADA", "collada", &["outermost element"]),
        ("count=\"12\"", "count=\"15\"", &["float_array", "15 numbers are announced, and 12"]),
        ("count=\"4\"", "count=\"5\"", &["accessor", "5 points"]),
        ("stride=\"3\"", "stride=\"2\"", &["accessor", "X, Y and Z"]),
        ("name=\"Z\"", "name=\"W\"", &["accessor", "X, Y and Z"]),
        ("count=\"2\"", "count=\"3\"", &["triangles", "3 primitives are announced, and 2"]),
        ("0 1 3</p>", "0 1</p>", &["not complete"]),
        ("0 1 3</p>", "0 1 4</p>", &["element p", "vertex 4"]),
        ("0 1 3</p>", "0 1 -3</p>", &["element p", "-3"]),
        ("0 2 0", "0 2,5 0", &["float_array", "decimal points"]),
        ("source=\"#a\"", "source=\"#b\"", &["\"#b\"", "no element"]),
        ("url=\"#g\"", "url=\"other.dae#g\"", &["other.dae"]),
        ("instance_geometry url", "instance_geometri url", &["no such element"]),
        ("<instance_geometry url=\"#g\"/>", "", &["shows no mesh"]),
        (
            "<instance_geometry url=\"#g\"/>",
            "<instance_controller url=\"#g\"/>",
            &["instance_controller", "deformation"],
        ),
        ("<instance_geometry url=\"#g\"/>", "<instance_node url=\"#n\"/>", &["nested deeper than 64", "itself"]),
        ("<instance_geometry", "<lookat>1 2 3</lookat><instance_geometry", &["lookat", "matrices"]),
        ("<instance_geometry", "<translate>1 2</translate><instance_geometry", &["translate", "2 numbers"]),
        ("<mesh>", "<convex_mesh/><mesx>", &["no XML"]),
        ("<asset>", "<asset><unit meter=\"-1\"/>", &["meter"]),
        ("semantic=\"POSITION\"", "semantic=\"POSITIO\"", &["POSITION"]),
        ("semantic=\"VERTEX\" source=\"#v\"", "semantic=\"VERTEX\" source=\"#p\"", &["VERTEX"]),
        ("<?xml version=\"1.0\"?>", "<!DOCTYPE a [<!ENTITY b \"c\">]>", &["no XML", "DTD"]),
    ] {
        let text = good.replacen(from, to, if from == "COLLADA" { 9 } else { 1 });
        assert_ne!(text, good, "{from}");
        assert_fails("dae", &text, parts);
    }
    // What takes the parser long is refused first.
    let many: String = (0..100).map(|i| format!(" xmlns:a{i}=\"b\"")).collect();
    assert_fails("dae", format!("<COLLADA{many}/>"), &["namespaces"]);
    assert_fails("dae", format!("<COLLADA {}/>", "a=\"b\" ".repeat(2000)), &["4096 bytes"]);
    // The content of a file is quoted in part.
    let long = format!("<COLLADA><{0}></{0}b></COLLADA>", "x".repeat(3000));
    assert!(read("dae", long).unwrap_err().len() < 400);
    // Nodes that instance nodes, twice each, twenty levels deep.
    let level = |i: usize| format!("<node id=\"n{i}\">{0}{0}</node>", format!("<instance_node url=\"#n{}\"/>", i + 1));
    let nodes: String = (0..30).map(level).collect();
    let many = file("", TRIANGLES, &format!("{nodes}<node id=\"n30\"><instance_geometry url=\"#g\"/></node>"));
    assert_fails("dae", many, &["100000"]);
}
