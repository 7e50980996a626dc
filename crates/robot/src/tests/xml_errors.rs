//! Texts that are refused before their elements are read.

use crate::{DescriptionError, read_srdf, read_urdf};

fn refused(text: &str) -> DescriptionError {
    read_urdf(text).expect_err("refused")
}

fn check(text: &str, line: u32, path: &str, says: &str) {
    let error = refused(text);
    assert_eq!((error.line, error.path.as_str()), (line, path), "{error}");
    assert!(error.to_string().contains(says), "{error}");
}

#[test]
fn what_is_no_robot() {
    check("", 1, "file", "not well-formed XML");
    check("<robot>\n<link></robot>", 2, "file", "not well-formed XML");
    check("<?xml version=\"1.0\"?>\n<urdf/>", 2, "urdf", "\"urdf\", not \"robot\"");
    check("<sdf version=\"1.6\"/>", 1, "sdf", "convert the SDF file");
    check("<robot name=\"r\"><q:link/></robot>", 1, "file", "the prefix \"q\" is not declared");
}

#[test]
fn xacro() {
    let remedy = "run xacro first: xacro file.xacro > file.urdf";
    let robot =
        |inside: &str| format!("<robot name=\"r\" xmlns:xacro=\"http://www.ros.org/wiki/xacro\">\n{inside}</robot>");
    check(&robot("<xacro:arm/>"), 2, "robot/arm", remedy);
    check(&robot("<link name=\"a\"><xacro:if value=\"1\"/></link>"), 2, "robot/link[a]/if", remedy);
    check(&robot("<link name=\"${prefix}a\"/>"), 2, "robot/link[${prefix}a]", remedy);
    check(&robot("<link name=\"$(arg x)\"/>"), 2, "robot/link[$(arg x)]", remedy);
    check("<robot name=\"r\">\n<xacro:arm/></robot>", 2, "file", remedy);
    check("<robot name=\"r\">\n<include filename=\"a\"/></robot>", 2, "robot/include", remedy);
    assert!(read_urdf(&robot("<link name=\"a\"/>")).is_ok(), "a declaration is no harm");
}

#[test]
fn entities() {
    let text = "<?xml version=\"1.0\"?>\n  <!DOCTYPE robot [<!ENTITY a \"aaaa\">]>\n<robot name=\"&a;\"/>";
    let error = refused(text);
    assert_eq!((error.line, error.column, error.path.as_str()), (2, 3, "file"));
    assert!(error.to_string().contains("document type declaration"), "{error}");
}

#[test]
fn sizes() {
    let long = format!("<robot name=\"r\">{}</robot>", " ".repeat(16 << 20));
    check(&long, 1, "file", "at most 16777216 (16 MiB)");
    let attributes: String = (0..257).map(|index| format!(" a{index}='>'")).collect();
    check(&format!("<!-- < --><robot>\n<link{attributes}/></robot>"), 2, "file", "more than 256 attributes");
    let prefixes: String = (0..257).map(|index| format!("<a xmlns:p{index}=\"u\"/>\n")).collect();
    check(&format!("<robot>{prefixes}</robot>"), 257, "file", "more than 256 namespaces");
    let many = format!("<robot name=\"r\">{}</robot>", "<a/>".repeat(1_000_001));
    check(&many, 1, "file", "more than 1000000 elements");
}

#[test]
fn deep_nesting_is_an_error_or_passed_over() {
    let depth = 100_000;
    let text = format!("<robot name=\"r\"><link name=\"a\"/>{}{}</robot>", "<a>".repeat(depth), "</a>".repeat(depth));
    if let Err(error) = read_urdf(&text) {
        assert_eq!(error.path, "file");
    }
    let inner = format!("<robot name=\"r\">{}<b c=\"${{x}}\"/>{}</robot>", "<a>".repeat(200), "</a>".repeat(200));
    assert!(refused(&inner).path.len() < 100);
}

#[test]
fn an_srdf_has_the_same_limits() {
    let robot = read_urdf("<robot name=\"r\"><link name=\"a\"/></robot>").expect("a robot");
    let error = read_srdf("<robot name=\"r\">\n<group name=\"${a}\"/></robot>", &robot).expect_err("refused");
    assert_eq!((error.line, error.path.as_str()), (2, "robot/group[${a}]"));
}

#[test]
fn errors_show_the_start_of_a_long_attribute() {
    let (long, shown) = ("x".repeat(10_000), "x".repeat(80));
    let origin = |attribute: &str| {
        let inside = format!("<geometry><sphere radius=\"1\"/></geometry><origin {attribute}/>");
        format!("<robot name=\"r\"><link name=\"a\"><collision>{inside}</collision></link></robot>")
    };
    for (value, says) in [("0", "an origin has no attribute \""), ("${y}", "/origin: ")] {
        let error = refused(&origin(&format!("{long}=\"{value}\""))).to_string();
        assert!(error.contains(&format!("{says}{shown}...")) && error.len() < 500, "{error}");
    }
}
