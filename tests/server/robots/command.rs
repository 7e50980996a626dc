//! `sublevel robot`, and `sublevel verify` of certificates of motions.

use std::path::{Path, PathBuf};

use serde_json::Value;
use sha2::{Digest, Sha256};
use sublevel::client::{CertificateQuestion, MotionsQuestion, RobotPlacement};
use sublevel::scene::query::StateVerdict;
use sublevel::store::RobotSource;
use tonic::Code;

use super::group_states::STATES;
use super::{CUBE, ODD, ODD_SRDF, SRDF, URDF, at, cell, served};
use crate::harness::{Running, run};

/// The crane with its files in a folder of its own.
struct Files {
    folder: tempfile::TempDir,
}

impl Files {
    fn new() -> Self {
        let files = Self { folder: tempfile::tempdir().expect("a directory") };
        files.write("crane.urdf", &URDF.replace("hand.stl", "hand.off"));
        files.write("crane.srdf", SRDF);
        files.write("hand.off", CUBE);
        files
    }

    fn path(&self, name: &str) -> String {
        self.folder.path().join(name).to_str().expect("text").to_owned()
    }

    fn write(&self, name: &str, text: &str) {
        let path = self.folder.path().join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        std::fs::write(path, text).expect("written");
    }

    /// Runs `sublevel robot` on a URDF of the folder and returns what it reports.
    fn load(&self, urdf: &str, more: &[&str]) -> Value {
        let (urdf, srdf, out) = (self.path(urdf), self.path("crane.srdf"), self.path("new/links"));
        let done = run(&[&["robot", &urdf, "--srdf", &srdf, "--out", &out, "--json"], more].concat());
        assert!(done.status.success(), "{more:?}: {}", String::from_utf8_lossy(&done.stderr));
        serde_json::from_slice(&done.stdout).expect("JSON")
    }

    /// The one line that it says where it must refuse, with its exit code.
    fn refusal(&self, urdf: &str, more: &[&str]) -> (String, i32) {
        self.refusal_into("refused", urdf, more)
    }

    fn refusal_into(&self, out: &str, urdf: &str, more: &[&str]) -> (String, i32) {
        let (urdf, out) = (self.path(urdf), self.path(out));
        let done = run(&[&["robot", &urdf, "--out", &out], more].concat());
        let said = String::from_utf8(done.stderr).expect("text");
        assert!(!said.contains("panicked") && done.stdout.is_empty(), "{said}");
        (said, done.status.code().expect("it ends by itself"))
    }

    /// The bodies that were written, in the order of their names.
    fn bodies(&self) -> Vec<PathBuf> {
        let folder = std::fs::read_dir(self.path("new/links")).expect("a folder");
        let mut files: Vec<_> = folder.map(|entry| entry.expect("a file").path()).collect();
        files.sort();
        files
    }
}

fn row<'a>(report: &'a Value, link: &str) -> &'a Value {
    let rows = report["links"].as_array().expect("rows");
    rows.iter().find(|row| row["link"] == link).unwrap_or_else(|| panic!("no link {link}: {report}"))
}

#[test]
fn a_robot_is_fitted_within_its_gap_and_kept() {
    let files = Files::new();
    let report = files.load("crane.urdf", &["--max-gap", "1cm"]);
    assert_eq!((&report["robot"], &report["width"], &report["frames"]), (&"crane".into(), &2.into(), &1.into()));
    let joint = |name: &str, lower: f64, upper: f64| serde_json::json!({"name": name, "lower": lower, "upper": upper});
    assert_eq!(report["joints"], serde_json::json!([joint("lift", -2.0, 2.0), joint("slide", 0.0, 0.2)]));
    // Of six pairs three are neighbours, and the SRDF disables one.
    assert_eq!((&report["checked_pairs"], &report["allowed_pairs"]), (&2.into(), &4.into()));
    assert_eq!((&report["groups"], &report["created"]), (&serde_json::json!(["all"]), &Value::Null));
    // A capsule that is not in the middle of its link is two balls and a cylinder.
    for (link, parts) in [("post", 1), ("arm", 3), ("finger", 1)] {
        let row = row(&report, link);
        assert_eq!((&row["degree"], &row["parts"]), (&2.into(), &parts.into()), "{row}");
        assert_eq!((&row["source"], row["gap_m"].as_f64()), (&"exact".into(), Some(0.0)), "{row}");
    }
    let hand = row(&report, "hand");
    assert_eq!(hand["source"], "fitted");
    let gap = hand["gap_m"].as_f64().expect("a gap");
    assert!((0.0..=0.01).contains(&gap), "{hand}");
    assert!([2, 4, 6, 8].contains(&hand["degree"].as_u64().expect("a degree")) && hand["parts"] == 1, "{hand}");
    // What is written contains the mesh, reaches no farther, and is what the report says.
    let [body] = &files.bodies()[..] else { panic!("one link has a mesh: {:?}", files.bodies()) };
    let name = body.file_name().expect("a name").to_string_lossy().into_owned();
    assert!(name.starts_with("hand-") && name.len() == "hand-123456789abc.json".len(), "{name}");
    let before = std::fs::read_to_string(body).expect("a file");
    let file: Value = serde_json::from_str(&before).expect("JSON");
    assert_eq!(file["id"], hand["body"]);
    let proven = run(&["verify", body.to_str().expect("text"), "--points", &files.path("hand.off"), "--json"]);
    let proven: Value = serde_json::from_slice(&proven.stdout).expect("JSON");
    assert_eq!(proven["contains_all_points_proven"], true, "{proven}");
    assert!(proven["gap_m"].as_f64().is_some_and(|proven| proven <= gap * (1.0 + 1e-6)), "{proven}");

    // Another run takes the file as it is.
    let again = files.load("crane.urdf", &["--max-gap", "1cm"]);
    assert_eq!(row(&again, "hand")["source"], "kept");
    let same = ["id", "joints", "checked_pairs"].iter().all(|field| again[*field] == report[*field]);
    assert!(same && row(&again, "hand")["body"] == hand["body"], "{again}");
    assert_eq!(std::fs::read_to_string(body).expect("a file"), before);
    let (urdf, out) = (files.path("crane.urdf"), files.path("new/links"));
    let table = run(&["robot", &urdf, "--out", &out, "--max-gap", "0.01"]);
    let table = String::from_utf8(table.stdout).expect("text");
    let line = table.lines().find(|line| line.starts_with("hand ")).expect("a row");
    assert!(line.ends_with("kept") && table.contains("4 links with geometry, 1 frame, 2 joint values"), "{table}");
    // The SRDF is part of what a robot is.
    assert!(table.contains("3 may touch") && !table.contains(report["id"].as_str().expect("text")), "{table}");

    // A file that was damaged meanwhile is not taken for one.
    std::fs::write(body, &before[..before.len() / 2]).expect("written");
    let (said, code) = files.refusal_into("new/links", "crane.urdf", &["--max-gap", "1cm"]);
    assert!(code == 1 && said.contains("link \"hand\"") && said.contains(&name), "{code} {said}");
    std::fs::write(body, &before).expect("written");

    // Another gap, a degree and another mesh are fitted again, and nothing is written over.
    let finer = format!("{}", 0.5 * gap);
    let fine = files.load("crane.urdf", &["--max-gap", &finer]);
    let hand = row(&fine, "hand");
    assert!(hand["source"] == "fitted" && hand["gap_m"].as_f64().expect("a gap") <= 0.5 * gap, "{hand}");
    assert_ne!(fine["id"], report["id"]);
    let coarse = files.load("crane.urdf", &["--degree", "2"]);
    let hand = row(&coarse, "hand");
    assert_eq!((&hand["source"], &hand["degree"], &hand["parts"]), (&"fitted".into(), &2.into(), &1.into()));
    // The ellipsoid of least volume around a cube of edge 0.1 is its ball of radius 0.05 √3.
    assert!((hand["gap_m"].as_f64().expect("a gap") - 0.05 * (3.0_f64.sqrt() - 1.0)).abs() < 1e-4, "{hand}");
    // Where nothing is asked for.
    let plain = files.load("crane.urdf", &[]);
    let hand = row(&plain, "hand");
    assert_eq!((&hand["source"], &hand["degree"], &hand["parts"]), (&"fitted".into(), &6.into(), &1.into()));
    files.write("hand.off", &CUBE.replace("0.1", "0.2"));
    assert_eq!(row(&files.load("crane.urdf", &["--max-gap", "1cm"]), "hand")["source"], "fitted");
    assert_eq!(files.bodies().len(), 5);
    assert_eq!(std::fs::read_to_string(body).expect("a file"), before);
}

#[test]
fn states_of_groups_are_listed() {
    let files = Files::new();
    files.write("crane.srdf", STATES);
    let report = files.load("crane.urdf", &["--degree", "2"]);
    let joint = |name: &str, value: f64| serde_json::json!({"name": name, "values": [value]});
    let expected = serde_json::json!([
        {"name": "home", "group": "all", "joints": [joint("lift", -1.25), joint("slide", 0.125)]},
        {"name": "reach", "group": "all", "joints": [joint("lift", 1.5), joint("slide", 0.1)]},
        {"name": "home", "group": "tip", "joints": [joint("slide", 0.2)]},
        {"name": "home", "group": "base", "joints": []},
    ]);
    assert_eq!(report["group_states"], expected);
    let (urdf, srdf, out) = (files.path("crane.urdf"), files.path("crane.srdf"), files.path("new/links"));
    let table = run(&["robot", &urdf, "--srdf", &srdf, "--out", &out, "--degree", "2"]);
    let table = String::from_utf8(table.stdout).expect("text");
    let states: Vec<&str> = table.lines().filter(|line| line.starts_with("state ")).collect();
    let expected = [
        "state home of group all: lift -1.25, slide 0.125",
        "state reach of group all: lift 1.5, slide 0.1",
        "state home of group tip: slide 0.2",
        "state home of group base: no joint with values of its own",
    ];
    assert_eq!(states, expected, "{table}");
}

#[test]
fn packages_are_found_where_they_are_said_to_be() {
    let files = Files::new();
    files.write("packaged.urdf", &URDF.replace("hand.stl", "package://tools/meshes/hand.off"));
    files.write("elsewhere/tools/meshes/hand.off", CUBE);
    let expected = files.load("crane.urdf", &["--degree", "2"]);
    let package = format!("tools={}", files.path("elsewhere/tools"));
    let search = files.path("elsewhere");
    for place in [["--package", &package], ["--search", &search]] {
        let found = files.load("packaged.urdf", &[&["--degree", "2"][..], &place].concat());
        // The same mesh under another name.
        assert_eq!(row(&found, "hand")["body"], row(&expected, "hand")["body"]);
        assert_eq!(row(&found, "hand")["source"], "kept");
    }
}

#[test]
fn what_is_odd_in_an_srdf_is_noted() {
    let files = Files::new();
    files.write("odd.srdf", ODD_SRDF);
    let (urdf, out) = (files.path("crane.urdf"), files.path("new/links"));
    let robot = |srdf: &str, more: &[&str]| {
        let done = run(&[&["robot", &urdf, "--srdf", srdf, "--out", &out, "--degree", "2"], more].concat());
        let [written, said] = [done.stdout, done.stderr].map(|bytes| String::from_utf8(bytes).expect("text"));
        assert!(done.status.success(), "{said}");
        (written, said)
    };
    let odd = files.path("odd.srdf");
    let notes: String = ODD.iter().map(|warning| format!("note: {odd}: {warning}\n")).collect();
    let (report, said) = robot(&odd, &["--json"]);
    let report: Value = serde_json::from_str(&report).expect("JSON");
    assert_eq!((&report["warnings"], said), (&serde_json::json!(ODD), notes.clone()));
    // The table comes without them, on its own stream.
    let (table, said) = robot(&odd, &[]);
    assert!(table.contains("4 links with geometry") && !table.contains("note"), "{table}");
    assert_eq!(said, notes);
    let (report, said) = robot(&files.path("crane.srdf"), &["--json"]);
    let report: Value = serde_json::from_str(&report).expect("JSON");
    assert_eq!((&report["warnings"], said.as_str()), (&serde_json::json!([]), ""));
}

#[test]
fn refusals_say_what_to_do() {
    let files = Files::new();
    files.write("missing.urdf", &URDF.replace("hand.stl", "meshes/foot.stl"));
    files.write("packaged.urdf", &URDF.replace("hand.stl", "package://tools/meshes/hand.off"));
    let xacro = URDF.replace("<robot name", "<robot xmlns:xacro=\"http://www.ros.org/wiki/xacro\" name");
    files.write("macro.urdf", &xacro.replace("</robot>", "<xacro:arm/></robot>"));
    files.write("expression.urdf", &URDF.replace("radius=\"0.05\"", "radius=\"${thick}\""));
    files.write("broken.urdf", &URDF.replace("<child link=\"hand\"/>", "<child link=\"hands\"/>"));
    files.write("broken.srdf", &SRDF.replace("</robot>", ""));
    files.write("bad.urdf", &URDF.replace("hand.stl", "bad.off"));
    files.write("bad.off", "OFF\n3 0 0\n0 0 0\n1 0 0\n");
    let (srdf, url) = (files.path("broken.srdf"), "http://127.0.0.1:1");
    let cases: [(&str, &[&str], &[&str]); 10] = [
        ("missing.urdf", &[], &["link \"hand\"", "meshes/foot.stl", "correct the path"]),
        ("packaged.urdf", &[], &["link \"hand\"", "--package tools=DIR", "--search DIR"]),
        ("packaged.urdf", &["--package", "tools=nowhere"], &["nowhere/meshes/hand.off", "--package tools=DIR"]),
        ("macro.urdf", &[], &["macro.urdf", "line ", "run xacro first"]),
        ("expression.urdf", &[], &["${thick}", "line ", "run xacro first"]),
        ("broken.urdf", &[], &["broken.urdf", "hands", "line "]),
        ("nothing.urdf", &[], &["nothing.urdf", "check the path"]),
        ("crane.urdf", &["--srdf", &srdf], &["broken.srdf", "line "]),
        ("bad.urdf", &[], &["link \"hand\"", "bad.off"]),
        ("crane.urdf", &["--degree", "2", "--server", url], &[url, "sublevel serve"]),
    ];
    for (urdf, more, words) in cases {
        let (said, code) = files.refusal(urdf, more);
        assert_eq!(code, 1, "{urdf} {more:?}: {said}");
        assert!(words.iter().all(|word| said.contains(word)), "{urdf} {more:?}: {said}");
        assert_eq!(said.trim_end().lines().count(), 1, "{said}");
    }
    let cases: [(&[&str], &str); 4] = [
        (&["--degree", "3"], "--degree"),
        (&["--max-gap", "0"], "not a positive length"),
        (&["--package", "tools"], "NAME=DIR"),
        (&["--degree", "4", "--max-gap", "1cm"], "cannot be used with"),
    ];
    for (more, word) in cases {
        let (said, code) = files.refusal("crane.urdf", more);
        assert!(matches!(code, 1 | 2) && said.contains(word), "{more:?}: {code} {said}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_is_loaded_into_a_server() {
    let files = Files::new();
    let server = Running::start(&files.folder.path().join("data"));
    let client = server.client().await;
    let url = server.url();
    let report = files.load("crane.urdf", &["--max-gap", "1cm", "--server", &url]);
    assert_eq!(report["created"], true);
    let id = report["id"].as_str().expect("text").parse().expect("an id");
    let robot = client.robot(&id).await.expect("it is there");
    assert_eq!((robot.id, &*robot.name), (id, "crane"));
    let names: Vec<_> = robot.joints.iter().map(|joint| joint.name.to_string()).collect();
    assert_eq!(names, ["lift", "slide"]);
    for link in ["post", "arm", "hand", "finger"] {
        let (here, there) = (row(&report, link), robot.links.iter().find(|of| &*of.name == link).expect("a link"));
        assert_eq!(there.body.map(|body| body.to_string()).as_deref(), here["body"].as_str(), "{link}");
        assert_eq!(there.gap_m, here["gap_m"].as_f64(), "{link}");
    }
    // The same as by hand.
    let hand = row(&report, "hand")["body"].as_str().expect("text").parse().expect("an id");
    let urdf = std::fs::read_to_string(files.path("crane.urdf")).expect("a file");
    let source = RobotSource { urdf, srdf: SRDF.into(), bodies: [("hand".into(), hand)].into() };
    let by_hand = client.load_robot(&source).await.expect("loaded");
    assert_eq!((by_hand.id, by_hand.created), (id, false));
    let again = files.load("crane.urdf", &["--max-gap", "1cm", "--server", &url]);
    assert_eq!((&again["created"], &row(&again, "hand")["source"]), (&false.into(), &"kept".into()));
    assert_eq!(client.list_robots().await.expect("listed").len(), 1);
}

#[test]
fn pairs_of_links_are_held_against_the_srdf() {
    let files = Files::new();
    let pair = |report: &Value, links: [&str; 2]| {
        let pairs = report["pairs"]["pairs"].as_array().expect("pairs");
        assert_eq!(pairs.len(), 6, "four links with geometry");
        pairs.iter().find(|pair| pair["links"] == serde_json::json!(links)).expect("a pair").clone()
    };
    let right = files.load("crane.urdf", &["--degree", "4", "--pairs"]);
    let never = pair(&right, ["post", "hand"]);
    assert_eq!((&never["class"], &never["srdf_reason"]), (&"never".into(), &"Never".into()), "{never}");
    assert_eq!(pair(&right, ["post", "arm"])["class"], "adjacent");
    // A taller post, into which the arm swings: the SRDF is wrong about its hand.
    let tall = URDF.replace("hand.stl", "hand.off").replace("0.2 0.2 0.4", "0.2 0.2 1.8");
    files.write("tall.urdf", &tall.replace("lower=\"-2\" upper=\"2\"", "lower=\"-3.1\" upper=\"3.1\""));
    let wrong = files.load("tall.urdf", &["--degree", "4", "--pairs"]);
    let collides = pair(&wrong, ["post", "hand"]);
    assert_eq!((&collides["class"], &collides["is_certain"]), (&"collides".into(), &true.into()), "{collides}");
    let witness: Vec<f64> = serde_json::from_value(collides["witness"].clone()).expect("values");
    assert!(witness[0].abs() > 2.5 && witness[0].abs() <= 3.1, "the arm points downwards: {witness:?}");
    let (urdf, srdf, out) = (files.path("tall.urdf"), files.path("crane.srdf"), files.path("new/links"));
    let table = run(&["robot", &urdf, "--srdf", &srdf, "--out", &out, "--degree", "4", "--pairs"]);
    let table = String::from_utf8(table.stdout).expect("text");
    let line = table.lines().find(|line| line.starts_with("the SRDF leaves out post and hand")).expect("a line");
    assert!(line.contains("so do the hulls") && line.contains("lift "), "{line}");
    assert!(table.contains("SRDF, Never: 1 pair, 0 proven, 0 neighbours, 1 can touch"), "{table}");
}

/// The parts of a certificate as it is written: claim, path, records.
fn parts(text: &str) -> [&str; 3] {
    let claim = text.find("\"claim\":").expect("a claim") + "\"claim\":".len();
    let path = text.rfind(",\"path\":").expect("a path");
    let records = text.rfind(",\"records\":").expect("records");
    let digest = text.rfind(",\"digest\":").expect("a digest");
    [&text[claim..path], &text[path + ",\"path\":".len()..records], &text[records + ",\"records\":".len()..digest]]
}

/// A certificate of these parts with a digest that fits, as anybody can make it.
fn signed(format: &str, [claim, path, records]: [&str; 3]) -> String {
    let hash =
        |text: &str| -> String { Sha256::digest(text.as_bytes()).iter().map(|byte| format!("{byte:02x}")).collect() };
    let digest = hash(&format!("[\"{format}\",\"{}\",{path},{records}]", hash(claim)));
    format!(
        "{{\"format\":\"{format}\",\"claim\":{claim},\"path\":{path},\"records\":{records},\"digest\":\"{digest}\"}}"
    )
}

/// Runs `sublevel verify` on a text: whether it succeeds, and what it writes and says.
fn verified(dir: &Path, text: &str, more: &[&str]) -> (Option<i32>, String, String) {
    let file = dir.join("certificate.json");
    std::fs::write(&file, text).expect("written");
    let done = run(&[&["verify", file.to_str().expect("text")], more].concat());
    let [out, said] = [done.stdout, done.stderr].map(|bytes| String::from_utf8(bytes).expect("text"));
    assert!(!said.contains("panicked"), "{said}");
    (done.status.code(), out, said)
}

#[tokio::test(flavor = "multi_thread")]
async fn certificates_of_motions_are_verified() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, _clients, robot) = served(&dir.path().join("data")).await;
    cell(&client, &robot).await;
    let path = [[0.0, 0.0], [-1.0, 0.1], [-1.5, 0.0]];
    let question = MotionsQuestion::of_robot("one", []).with_path(path.iter().map(|point| &point[..]));
    let mut question = question.with_certificates().with_margin(0.01);
    question.request_mut().clearance_accuracy_m = Some(1e-3);
    let found = client.check_motions("cell", question).await.expect("answered");
    assert_eq!(found.motions[0].verdict, StateVerdict::Free);
    let text = found.motions[0].certificate.clone().expect("a certificate");
    let proof = client.verify_motion(CertificateQuestion::new(text.clone())).await.expect("answered").proof;
    let proof = proof.expect("it holds");
    // Alone, without server or scene.
    let (code, out, said) = verified(dir.path(), &text, &[]);
    assert_eq!((code, said.as_str()), (Some(0), ""));
    assert!(out.contains("proven free over all of its path of 2 segments"), "{out}");
    let pairs = format!("by {} configurations", proof.configurations);
    assert!(out.contains("pairs keep at least 0.") && out.contains(&pairs), "{out}");
    let (code, out, _) = verified(dir.path(), &text, &["--json"]);
    let report: Value = serde_json::from_str(&out).expect("JSON");
    let expected = serde_json::json!({
        "free_proven": true, "clearance_lower_m": proof.clearance_lower_m, "margin_m": 0.01,
        "configurations": proof.configurations,
    });
    assert_eq!((code, report), (Some(0), expected));

    // What was changed is no certificate any more.
    let is_refused = |text: &str, reason: &str| {
        let (code, out, said) = verified(dir.path(), text, &["--json"]);
        assert_eq!(code, Some(1), "{said}");
        assert!(said.contains("certificate.json: ") && said.contains(reason), "{said}");
        assert_eq!(said.trim_end().lines().count(), 1, "{said}");
        let report: Value = serde_json::from_str(&out).expect("JSON");
        assert_eq!((&report["free_proven"], &report["clearance_lower_m"]), (&false.into(), &Value::Null));
        assert_eq!(verified(dir.path(), text, &[]).1, "", "nothing is claimed");
    };
    let format = "sublevel motion certificate 2";
    let [claim, path, records] = parts(&text);
    let changed = |part: &str, from: &str, to: &str| {
        assert!(part.contains(from), "{part}");
        part.replacen(from, to, 1)
    };
    is_refused(&text.replacen("\"margin_m\":0.01", "\"margin_m\":0.02", 1), "digest");
    is_refused(&text.replacen("-1.5", "-1.6", 1), "digest");
    is_refused(&text[..text.len() - 2], "no motion certificate: EOF");
    is_refused(&text[..text.len() / 2], "no motion certificate: EOF");
    is_refused(&text.replacen("\"path\"", "path", 1), "no motion certificate");
    is_refused(&text.replacen("certificate 2", "certificate 1", 1), "format");
    // With a digest that fits, by somebody who knows how: now the proof itself has to hold.
    assert_eq!(signed(format, [claim, path, records]), text);
    let last = records.rfind(",{\"interval\":").expect("records");
    let less = format!("{}]", &records[..last]);
    is_refused(&signed(format, [claim, path, &less]), "not proven to keep apart on all of segment 1");
    is_refused(&signed(format, [claim, path, "[]"]), "more pairs count than there are records");
    let wider = changed(claim, "\"margin_m\":0.01", "\"margin_m\":0.5");
    is_refused(&signed(format, [&wider, path, records]), "does not prove that its pair keeps apart");
    let farther = changed(path, "-1.5", "1.5");
    is_refused(&signed(format, [claim, &farther, records]), "does not prove that its pair keeps apart");
    let beyond = changed(path, "-1.5", "-2.5");
    is_refused(&signed(format, [claim, &beyond, records]), "limits");
    let (before, normal) = records.split_once("\"normal\":[").expect("a normal");
    let (_, after) = normal.split_once(',').expect("three numbers");
    let turned = format!("{before}\"normal\":[0.123,{after}");
    is_refused(&signed(format, [claim, path, &turned]), "records[0]");
    // A server says the same.
    for (text, reason) in [
        (text.replacen("-1.5", "-1.6", 1), "digest"),
        (text[..text.len() / 2].to_owned(), "no motion certificate: EOF"),
        (signed(format, [claim, path, &less]), "not proven to keep apart on all of segment 1"),
        (signed(format, [claim, path, "[]"]), "more pairs count than there are records"),
        (signed(format, [&wider, path, records]), "does not prove that its pair keeps apart"),
        (signed(format, [claim, &farther, records]), "does not prove that its pair keeps apart"),
        (signed(format, [claim, &beyond, records]), "limits"),
        (signed(format, [claim, path, &turned]), "records[0]"),
    ] {
        let said = match client.verify_motion(CertificateQuestion::new(text)).await {
            Ok(checked) => checked.proof.expect_err(reason),
            Err(error) => {
                let expected = (Some(Code::InvalidArgument), Some("certificate"));
                assert_eq!((error.code(), error.field().as_deref()), expected, "{error}");
                error.to_string()
            }
        };
        assert!(said.contains(reason), "{said}");
    }
    // What is claimed about less is true as well: a smaller margin.
    let narrower = changed(claim, "\"margin_m\":0.01", "\"margin_m\":0.005");
    let (code, out, said) = verified(dir.path(), &signed(format, [&narrower, path, records]), &["--json"]);
    let report: Value = serde_json::from_str(&out).expect("JSON");
    assert_eq!((code, &report["margin_m"]), (Some(0), &0.005.into()), "{said}");
    // What is about bodies only is refused.
    let (code, _, said) = verified(dir.path(), &text, &["--contains", "body.json"]);
    assert!(code == Some(1) && said.contains("leave them out"), "{code:?} {said}");
}

/// One link with geometry, which turns on its spot.
const LONE: &str = r#"<robot name="lone">
  <link name="foot"/>
  <link name="head"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <joint name="turn" type="continuous"><parent link="foot"/><child link="head"/><axis xyz="0 1 0"/></joint>
</robot>"#;

#[tokio::test(flavor = "multi_thread")]
async fn what_is_counted_once_is_singular() {
    let dir = tempfile::tempdir().expect("a directory");
    let (urdf, out) = (dir.path().join("lone.urdf"), dir.path().join("links"));
    std::fs::write(&urdf, LONE).expect("written");
    let table = run(&["robot", urdf.to_str().expect("text"), "--out", out.to_str().expect("text")]);
    let table = String::from_utf8(table.stdout).expect("text");
    let line = "robot lone: 1 link with geometry, 1 frame, 1 joint value; 0 pairs of links are checked, 0 may touch";
    assert!(table.lines().any(|found| found == line), "{table}");
    let server = Running::start(&dir.path().join("data"));
    let client = server.client().await;
    let source = RobotSource { urdf: LONE.into(), ..RobotSource::default() };
    let robot = client.load_robot(&source).await.expect("loaded");
    client.create_scene("room").await.expect("made");
    client.place_robot("room", &RobotPlacement::new("one", &robot)).await.expect("placed");
    let ball = client.create_ball("ball", 0.05).await.expect("a ball");
    client.put_objects("room", [("ball", &ball, at(1.0, 0.0, 0.0))]).await.expect("placed");
    let question = MotionsQuestion::of_robot("one", []).with_path([&[0.0][..], &[0.1]]).with_certificates();
    let found = client.check_motions("room", question).await.expect("answered");
    let certificate = found.motions[0].certificate.clone().expect("a certificate");
    let (code, said, _) = verified(dir.path(), &certificate, &[]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("all of its path of 1 segment\n1 pair keeps at least 0.8"), "{said}");
    assert!(said.ends_with(" m, by 1 configuration\n"), "{said}");
}
