//! The command line as a script uses it: JSON on standard output, one line and an exit code on
//! errors.

#![cfg(feature = "fit")]

use nalgebra::Vector3;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;
use sublevel::body::Body;

fn sublevel(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_sublevel")).args(args).output().unwrap()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Standard output as JSON, after checking that the command succeeded and said nothing else.
fn json(args: &[&str]) -> Value {
    let output = sublevel(args);
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{args:?}: {e}"))
}

/// The error line of a command that must fail without panic and without output.
fn refusal(args: &[&str]) -> String {
    let output = sublevel(args);
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(matches!(output.status.code(), Some(1 | 2)), "{args:?}: {:?} {error}", output.status);
    assert!(!error.contains("panicked"), "{error}");
    error
}

/// A cube of side 2 as OFF text.
fn cube() -> String {
    let mut text = "OFF\n8 0 0\n".to_owned();
    for corner in 0..8 {
        let sign = |bit: i32| if corner >> bit & 1 == 1 { 1.0 } else { -1.0 };
        text += &format!("{} {} {}\n", sign(0), sign(1), sign(2));
    }
    text
}

struct Fitted {
    folder: tempfile::TempDir,
    report: Value,
}

impl Fitted {
    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn body(&self) -> PathBuf {
        self.path("new/bodies/cube-d4.json")
    }
}

/// A cube fitted at degree 4, once for all tests.
fn fitted() -> &'static Fitted {
    static FITTED: OnceLock<Fitted> = OnceLock::new();
    FITTED.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let mesh = folder.path().join("cube.off");
        std::fs::write(&mesh, cube()).unwrap();
        let out = folder.path().join("new/bodies");
        let report = json(&["fit", "--json", text(&mesh), "--out", text(&out), "--degree", "4"]);
        Fitted { folder, report }
    })
}

fn keys(value: &Value) -> Vec<&str> {
    value.as_object().unwrap().keys().map(String::as_str).collect()
}

fn sorted(names: &str) -> Vec<&str> {
    let mut names: Vec<_> = names.split(' ').collect();
    names.sort_unstable();
    names
}

#[test]
fn fit_reports_and_writes_a_proven_body() {
    let fitted = fitted();
    let [row] = fitted.report.as_array().unwrap().as_slice() else { panic!("{}", fitted.report) };
    let expected = "input body degree slabs parts parts_asked shortfall covers objective refined refinement points left_out left_out_m hull_vertices volume_m3 volume_error_m3 hull_volume_m3 \
         gap_m mean_gap_m seconds status objective_value optimality_gap solver fallback proven dropped_points unused_vertices unused_dropped hull_with_unused_m3 hull_without_unused_m3";
    assert_eq!(keys(row), sorted(expected));
    assert_eq!(row["body"], text(&fitted.body()));
    assert_eq!((&row["degree"], &row["points"], &row["proven"]), (&4.into(), &8.into(), &true.into()));
    assert!((row["hull_volume_m3"].as_f64().unwrap() - 8.0).abs() < 1e-9);
    assert!((8.0..16.0).contains(&row["volume_m3"].as_f64().unwrap()));
    let (gap, mean) = (row["gap_m"].as_f64().unwrap(), row["mean_gap_m"].as_f64().unwrap());
    assert!(0.0 < mean && mean < gap && gap < 3.0_f64.sqrt() - 1.0, "{gap} {mean}");

    let file: Value = serde_json::from_str(&std::fs::read_to_string(fitted.body()).unwrap()).unwrap();
    assert_eq!((&file["format"], &file["kind"]), (&"sublevel/1".into(), &"body".into()));
    // The stored numbers mean what they say: p(L (x - c)) <= 1 at every corner.
    let number = |v: &Value| v.as_f64().unwrap();
    for corner in 0..8 {
        let x: [f64; 3] = std::array::from_fn(|i| if corner >> i & 1 == 1 { 1.0 } else { -1.0 });
        let normalization = &file["normalization"];
        let z: [f64; 3] = std::array::from_fn(|i| {
            (0..3).map(|j| number(&normalization["linear"][i][j]) * (x[j] - number(&normalization["center"][j]))).sum()
        });
        let constraint = &file["constraints"][0];
        let terms =
            constraint["exponents"].as_array().unwrap().iter().zip(constraint["coefficients"].as_array().unwrap());
        let p: f64 = terms
            .map(|(e, c)| number(c) * (0..3).map(|i| z[i].powi(e[i].as_i64().unwrap() as i32)).product::<f64>())
            .sum();
        assert!(p <= 1.0 + 1e-14 && p > 0.99, "{p}");
    }
}

#[test]
fn fits_over_smaller_cones_say_what_they_minimised() {
    let fitted = fitted();
    let (mesh, out) = (fitted.path("cube.off"), fitted.path("cones"));
    let fit = |cone: &'static str| ["fit", text(&mesh), "--out", text(&out), "--degree", "4", "--cone", cone, "--json"];
    for cone in ["sdsos", "dsos"] {
        let report = json(&fit(cone));
        assert_eq!(report[0]["objective"], format!("volume, {cone}"));
        assert_eq!((&report[0]["optimality_gap"], &report[0]["proven"]), (&Value::Null, &true.into()));
        assert!((8.0..16.0).contains(&report[0]["volume_m3"].as_f64().unwrap()), "{report}");
    }
    assert!(refusal(&fit("socp")).contains("sdsos"));
    assert!(refusal(&[&fit("dsos")[..], &["--refine"]].concat()).contains("volume itself"));
    assert!(refusal(&[&fit("dsos")[..], &["--objective", "trace-p"]].concat()).contains("volume itself"));
}

#[test]
fn a_gap_chooses_the_coarsest_body_and_a_ladder_has_them_all() {
    let fitted = fitted();
    let (mesh, out) = (fitted.path("cube.off"), fitted.path("rungs"));
    let fit = |more: &[&str]| json(&[&["fit", "--json", text(&mesh), "--out", text(&out)], more].concat());
    // The ball around a cube of side 2 reaches √3 - 1 beyond its faces; three slabs leave nothing
    // but the cube.
    for (gap, name, slabs) in [("800mm", "cube-ball.json", 0), ("1e-3", "cube-d2-s3.json", 3)] {
        let report = fit(&["--max-gap", gap]);
        let [row] = report.as_array().unwrap().as_slice() else { panic!("{report}") };
        assert_eq!((row["body"].as_str().unwrap(), &row["slabs"]), (text(&out.join(name)), &slabs.into()));
        json(&["verify", "--json", text(&out.join(name)), "--points", text(&mesh)]);
    }
    let report = fit(&["--ladder", "--degree", "4"]);
    let names: Vec<_> = report.as_array().unwrap().iter().map(|row| row["body"].as_str().unwrap().to_owned()).collect();
    assert_eq!(names, ["cube-ball.json", "cube-d2.json", "cube-d4.json"].map(|name| text(&out.join(name)).to_owned()));
    let gap = |k: usize| report[k]["gap_m"].as_f64().unwrap();
    assert!((gap(0) - (3.0_f64.sqrt() - 1.0)).abs() < 0.02 && gap(2) < gap(1), "{report}");

    let message = refusal(&["fit", text(&mesh), "--out", text(&out), "--max-gap", "1nm"]);
    assert!(message.contains("--max-gap") && message.contains("5mm"), "{message}");
    let message = refusal(&["fit", text(&mesh), "--out", text(&out), "--max-gap", "1e-9", "--degree", "2"]);
    assert!(message.contains("max gap") && message.contains("slab(s)"), "{message}");
    let message = refusal(&["fit", text(&mesh), "--out", text(&out), "--slabs", "16"]);
    assert!(message.contains("slabs: 16"), "{message}");

    // A note that a point of the body refutes is not passed on.
    let body = out.join("cube-d4.json");
    let mut value: Value = serde_json::from_str(&std::fs::read_to_string(&body).unwrap()).unwrap();
    value["gap_m"] = 1e-3.into();
    std::fs::write(&body, value.to_string()).unwrap();
    assert!(refusal(&["verify", text(&body), "--points", text(&mesh)]).contains("gap_m"));
}

/// A closed mesh like the letter L as OFF text, its arms 1 m long, 0.2 m thick, 0.3 m deep.
fn letter() -> String {
    let outline = [[0.0, 0.0], [1.0, 0.0], [1.0, 0.2], [0.2, 0.2], [0.2, 1.0], [0.0, 1.0]];
    let mut text = "OFF\n12 10 0\n".to_owned();
    for z in [0.0, 0.3] {
        text.extend(outline.iter().map(|[x, y]| format!("{x} {y} {z}\n")));
    }
    text += "4 3 2 1 0\n4 5 4 3 0\n4 6 7 8 9\n4 6 9 10 11\n";
    text.extend((0..6).map(|i| (i, (i + 1) % 6)).map(|(i, next)| format!("4 {i} {next} {} {}\n", next + 6, i + 6)));
    text
}

#[test]
fn compounds_are_fitted_verified_shown_and_measured() {
    let fitted = fitted();
    let (mesh, out) = (fitted.path("letter.off"), fitted.path("compounds"));
    std::fs::write(&mesh, letter()).unwrap();
    let fit = |more: &[&str]| json(&[&["fit", "--json", text(&mesh), "--out", text(&out)], more].concat());
    let report = fit(&["--degree", "4", "--parts", "2"]);
    let [row] = report.as_array().unwrap().as_slice() else { panic!("{report}") };
    let compound = out.join("letter-d4-p2.json");
    assert_eq!((&row["parts"], &row["covers"], &row["proven"]), (&2.into(), &"interior".into(), &true.into()));
    assert_eq!((row["body"].as_str().unwrap(), &row["mean_gap_m"]), (text(&compound), &Value::Null));
    let single = fit(&["--degree", "4"]);
    // The parts are as long as the letter, so that their gaps are not much smaller.
    for (key, share) in [("gap_m", 1.0), ("volume_m3", 0.6)] {
        assert!(row[key].as_f64().unwrap() < share * single[0][key].as_f64().unwrap(), "{key}: {row} {single}");
    }
    // A gap that no single smooth body of that degree keeps.
    let gap = format!("{}", 1.0001 * row["gap_m"].as_f64().unwrap());
    let elsewhere = fitted.path("chosen");
    let chosen = json(&["fit", "--json", text(&mesh), "--out", text(&elsewhere), "--degree", "4", "--max-gap", &gap]);
    assert!(chosen[0]["parts"].as_u64().unwrap() > 1 && chosen[0]["slabs"] == 0, "{chosen}");

    let verified = json(&["verify", "--json", text(&compound), "--points", text(&mesh)]);
    assert_eq!((&verified["covers"], &verified["gap_m"]), (&"interior".into(), &row["gap_m"]));
    assert!(verified["max_value"].as_f64().unwrap() <= 1.0);
    assert_eq!(json(&["verify", "--json", text(&compound)])["contains_all_points_proven"], Value::Null);
    let larger = sublevel(&["verify", text(&compound), "--points", text(&mesh), "--scale", "1.01"]);
    let message = String::from_utf8_lossy(&larger.stderr).into_owned();
    assert!(larger.status.code() == Some(1) && message.contains("does not hold its piece"), "{message}");
    // A note that is not true of the mesh is refused.
    let stored = std::fs::read_to_string(&compound).unwrap();
    let changed = fitted.path("changed-compound.json");
    std::fs::write(&changed, stored.replace("\"interior\"", "\"surface_only\"")).unwrap();
    assert!(refusal(&["verify", text(&changed), "--points", text(&mesh)]).contains("covering.proven"));

    let (surface, picture) = (fitted.path("letter.obj"), fitted.path("letter.svg"));
    let shown = json(&["show", text(&compound), "--json", "--mesh", text(&surface), "--svg", text(&picture)]);
    assert_eq!((&shown["kind"], shown["parts"].as_array().unwrap().len()), (&"compound".into(), 2));
    assert_eq!((&shown["volume_m3"], &shown["gap_m"]), (&row["volume_m3"], &row["gap_m"]));
    assert!(std::fs::read_to_string(&surface).unwrap().lines().filter(|line| line.starts_with('v')).count() > 5000);
    assert!(sublevel(&["show", text(&compound)]).status.success());

    // A ball in the angle of the letter: clear of the compound, within the single body.
    let ball = fitted.path("ball.xyz");
    let points = (0..200).map(|k| {
        let (z, angle) = (f64::from(k) / 99.5 - 1.0, f64::from(k) * 2.4);
        let ring = (1.0 - z * z).max(0.0).sqrt();
        format!("{} {} {}\n", 0.05 * ring * angle.cos(), 0.05 * ring * angle.sin(), 0.05 * z)
    });
    std::fs::write(&ball, points.collect::<String>()).unwrap();
    json(&["fit", "--json", text(&ball), "--out", text(&out), "--degree", "2"]);
    let ball = out.join("ball-d2.json");
    let measure =
        |body: &Path| json(&["measure", text(body), text(&ball), "--json", "--pose", "0.55,0.55,0.15,0,0,0,1"]);
    let apart = measure(&compound);
    assert!(apart["distance_m"].as_f64().unwrap() > 0.02 && apart["status"] == "converged", "{apart}");
    assert_eq!(measure(&out.join("letter-d4.json"))["distance_m"], 0.0);

    // Servers store compounds, too; what is missing is the server.
    assert!(refusal(&["push", text(&compound), "--server", "http://127.0.0.1:9"]).contains("sublevel serve"));
    let message = refusal(&["fit", text(&ball.with_file_name("nothing.xyz")), "--out", text(&out), "--parts", "2"]);
    assert!(message.contains("check the path"), "{message}");
    let message = refusal(&["fit", text(&fitted.path("ball.xyz")), "--out", text(&out), "--parts", "2"]);
    assert!(message.contains("no triangles"), "{message}");
    let message = refusal(&["fit", text(&mesh), "--out", text(&out), "--parts", "0"]);
    assert!(message.contains("parts: 0"), "{message}");
    let message = refusal(&["fit", text(&mesh), "--out", text(&out), "--parts", "2", "--max-gap", "1cm"]);
    assert!(message.contains("--max-gap"), "{message}");
}

#[test]
fn outliers_are_trimmed_and_sheets_thickened() {
    let folder = tempfile::tempdir().unwrap();
    let (scan, sheet, out) =
        (folder.path().join("scan.xyz"), folder.path().join("sheet.xyz"), folder.path().join("out"));
    let mut lines = String::new();
    let mut plane = String::new();
    for k in 0..400 {
        let (u, v) = ((f64::from(k) * 0.618_034).fract(), (f64::from(k) * 0.754_878).fract());
        let (height, angle) = (2.0 * u - 1.0, std::f64::consts::TAU * v);
        let ring = (1.0 - height * height).sqrt();
        lines += &format!("{} {} {height}\n", ring * angle.cos(), ring * angle.sin());
        plane += &format!("{u} {v} 0\n");
    }
    let half = folder.path().join("half.xyz");
    std::fs::write(&half, lines.lines().take(200).map(|line| line.to_owned() + "\n").collect::<String>()).unwrap();
    std::fs::write(&scan, lines + "9 9 9\n").unwrap();
    std::fs::write(&sheet, plane).unwrap();
    let fit = |input: &Path, more: &[&str]| {
        let common = ["fit", "--json", text(input), "--out", text(&out), "--degree", "4"];
        let output = sublevel(&[&common[..], more].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let report: Value = serde_json::from_slice(&output.stdout).unwrap();
        (report[0].clone(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (row, message) = fit(&scan, &["--trim", "0.0025"]);
    assert_eq!((&row["left_out"], &row["points"]), (&1.into(), &400.into()));
    assert!(
        (row["left_out_m"].as_f64().unwrap() - (243.0_f64.sqrt() - 1.0)).abs() < 0.1 && message.contains("1 of 401"),
        "{row}"
    );
    assert!(row["volume_m3"].as_f64().unwrap() < 4.4, "{row}");
    let row_gap = row["gap_m"].as_f64().unwrap();

    let message = refusal(&["fit", text(&sheet), "--out", text(&out)]);
    assert!(message.contains("coplanar") && message.contains("--min-thickness"), "{message}");
    let (row, _) = fit(&sheet, &["--min-thickness", "1cm"]);
    assert!((row["hull_volume_m3"].as_f64().unwrap() / 0.01 - 1.0).abs() < 0.1, "{row}");
    json(&["verify", "--json", text(&out.join("sheet-d4.json")), "--points", text(&sheet)]);
    // Against points that are not those it was fitted to, a body's gap is bounded again, not
    // refuted.
    let verified = json(&["verify", "--json", text(&out.join("scan-d4.json")), "--points", text(&half)]);
    assert!(verified["gap_m"].as_f64().unwrap() > row_gap, "{verified}");
    let message = refusal(&["fit", text(&scan), "--out", text(&out), "--trim", "0.9"]);
    assert!(message.contains("trim: 0.9"), "{message}");
}

#[test]
fn certify_proves_polynomials_from_elsewhere() {
    let folder = tempfile::tempdir().unwrap();
    let (input, out) = (folder.path().join("quartic.json"), folder.path().join("body.json"));
    let certify = |content: &str| {
        std::fs::write(&input, content).unwrap();
        sublevel(&["certify", "--json", text(&input), "--out", text(&out)])
    };
    let quartic = r#"{"constraints": [{"exponents": [[4,0,0], [0,4,0], [0,0,2], [1,1,0]], "coefficients": [1.0, 1.0, 4.0, 0.0]}]}"#;
    let output = certify(quartic);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&report["degree"], &report["proven"]), (&4.into(), &true.into()));
    // What it wrote is proven from its numbers alone, and certified again to the same set.
    json(&["verify", "--json", text(&out)]);
    let again = json(&["certify", "--json", text(&out), "--out", text(&folder.path().join("again.json"))]);
    assert_eq!(again["id"], report["id"]);
    for (bad, expected) in [
        ("{", "not polynomials"),
        (r#"{"constraints": []}"#, "constraints"),
        (r#"{"normalisation": {}, "constraints": []}"#, "normalisation"),
        (r#"{"constraints": [{"exponents": [[2,0,0]], "coefficients": []}]}"#, "constraints[0]: coefficients"),
        (r#"{"constraints": [{"exponents": [[3,0,0]], "coefficients": [1.0]}]}"#, "degree 3"),
        (r#"{"constraints": [{"exponents": [[2,0,0]], "coefficients": [1.0]}]}"#, "not proven bounded"),
        (
            r#"{"constraints": [{"exponents": [[4,0,0], [2,0,0], [0,2,0], [0,0,2]], "coefficients": [1.0, -2.0, 1.0, 1.0]}]}"#,
            "not sos-convex",
        ),
    ] {
        let output = certify(bad);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(1) && error.contains(expected), "{bad}: {error}");
    }
}

#[test]
fn verify_proves_and_refuses() {
    let fitted = fitted();
    let (body, mesh) = (fitted.body(), fitted.path("cube.off"));
    let plain = json(&["verify", "--json", text(&body)]);
    assert_eq!(
        keys(&plain),
        sorted("sos_convex_proven contains_all_points_proven max_value contains_sets_proven degree gap_m")
    );
    assert_eq!(plain["contains_all_points_proven"], Value::Null);
    let full = json(&["verify", "--json", text(&body), "--points", text(&mesh)]);
    assert_eq!((&full["sos_convex_proven"], &full["contains_all_points_proven"]), (&true.into(), &true.into()));
    assert!(full["max_value"].as_f64().unwrap() <= 1.0);
    assert_eq!(full["gap_m"], fitted.report[0]["gap_m"]);

    let output = sublevel(&["verify", "--json", text(&body), "--points", text(&mesh), "--scale", "1.01"]);
    let outside: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((output.status.code(), &outside["contains_all_points_proven"]), (Some(1), &false.into()));

    let stored = std::fs::read_to_string(&body).unwrap();
    let mut value: Value = serde_json::from_str(&stored).unwrap();
    value["constraints"][0]["coefficients"][3] = 0.5.into();
    let changed = fitted.path("changed.json");
    std::fs::write(&changed, value.to_string()).unwrap();
    let output = sublevel(&["verify", "--json", text(&changed)]);
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((output.status.code(), &report["sos_convex_proven"]), (Some(1), &false.into()));
    assert!(refusal(&["show", text(&changed)]).contains("id does not follow"));
    std::fs::write(&changed, &stored[..stored.len() / 2]).unwrap();
    let refused = refusal(&["measure", text(&changed), text(&body)]);
    assert!(refused.contains("is no file of a body") && refused.contains("sublevel fit"), "{refused}");
}

#[test]
fn narrower_vectors_prove_the_same() {
    let fitted = fitted();
    let body = fitted.body();
    let measure = |simd: Option<&str>| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_sublevel"));
        command.args(["measure", text(&body), text(&body), "--json", "--pose", "4,1,0.5,0,0,0.6,0.8"]);
        match simd {
            Some(value) => command.env("SUBLEVEL_SIMD", value),
            None => command.env_remove("SUBLEVEL_SIMD"),
        };
        let output = command.output().unwrap();
        assert!(output.status.success(), "{output:?}");
        serde_json::from_slice::<Value>(&output.stdout).unwrap()
    };
    let usual = measure(None);
    let bound = |answer: &Value, key: &str| answer[key].as_f64().unwrap();
    for simd in ["avx2", "baseline"] {
        let narrow = measure(Some(simd));
        assert_eq!(narrow["status"], "converged", "{simd}");
        for key in ["distance", "level_ab", "level_ba"] {
            let unit = if key == "distance" { "_m" } else { "" };
            let [lower, upper] = ["lower", "upper"].map(|end| format!("{key}_{end}{unit}"));
            let meet =
                bound(&narrow, &lower) <= bound(&usual, &upper) && bound(&usual, &lower) <= bound(&narrow, &upper);
            assert!(meet, "{simd}, {key}: {narrow} against {usual}");
        }
    }
    // Fused multiplications and additions round once where plain ones round twice.
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
        assert_ne!(measure(Some("baseline")), usual);
    }
    assert_eq!(measure(Some("no such thing")), usual);
}

#[test]
fn measure_prints_one_line_a_pose() {
    let fitted = fitted();
    let (body, poses) = (fitted.body(), fitted.path("poses.txt"));
    let file: Value = serde_json::from_str(&std::fs::read_to_string(&body).unwrap()).unwrap();
    let reach = file["bounding_box"]["max_m"][0].as_f64().unwrap();
    std::fs::write(&poses, "1 0 0 0 1 0 0 0 1 5 0 0\n1 0 0 0 1 0 0 0 1 5.01 0 0\n\n1 0 0 0 1 0 0 0 1 0.5 0 0\n")
        .unwrap();
    let output = sublevel(&["measure", text(&body), text(&body), "--poses", text(&poses), "--json"]);
    let lines: Vec<Value> =
        std::str::from_utf8(&output.stdout).unwrap().lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    assert_eq!(lines.len(), 3);
    let expected = "status distance_m distance_lower_m distance_upper_m hulls_distance_upper_m level_ab level_ab_lower \
                    level_ab_upper level_ba level_ba_lower level_ba_upper witness_a witness_b normal iterations";
    let expected = expected.split_whitespace().collect::<Vec<_>>().join(" ");
    assert_eq!(keys(&lines[0]), sorted(&expected));
    assert!(lines.iter().all(|line| line["status"] == "converged"));
    let d = lines[0]["distance_m"].as_f64().unwrap();
    assert!((d - (5.0 - 2.0 * reach)).abs() < 1e-8, "{d} against {}", 5.0 - 2.0 * reach);
    // The cubes themselves are 3 m apart.
    let bound = |key: &str| lines[0][key].as_f64().unwrap();
    assert!(bound("distance_lower_m") <= 3.0 && bound("hulls_distance_upper_m") >= 3.0, "{}", lines[0]);
    // From B to A: B stands at +x.
    assert!(lines[0]["normal"][0].as_f64().unwrap() < -0.999);
    assert_eq!((&lines[2]["distance_m"], &lines[2]["normal"]), (&0.0.into(), &Value::Null));
    assert_eq!(lines[2]["witness_a"], lines[2]["witness_b"]);

    let one = json(&["measure", text(&body), text(&body), "--json", "--pose", "-5,0,0,0,0,0,1"]);
    assert!((one["distance_m"].as_f64().unwrap() - d).abs() < 1e-8);
    let times = json(&["measure", text(&body), text(&body), "--poses", text(&poses), "--time"]);
    assert_eq!(keys(&times), ["distance", "level"]);
    for (measure, fields) in [("distance", "queries cold_ns warm_ns batch_ns"), ("level", "queries cold_ns warm_ns")] {
        assert_eq!(keys(&times[measure]), sorted(fields));
        assert_eq!(times[measure]["queries"], 3);
        assert!(times[measure]["cold_ns"].as_f64().unwrap() > 0.0);
    }
}

#[test]
fn show_describes_and_draws() {
    let fitted = fitted();
    let (body, mesh, picture) = (fitted.body(), fitted.path("surface.obj"), fitted.path("cube.svg"));
    let shown = json(&["show", text(&body), "--json", "--mesh", text(&mesh), "--svg", text(&picture)]);
    assert_eq!(shown["degree"], 4);
    assert!(shown["min_value"].as_f64().unwrap() < 1.0);
    assert!(std::fs::read_to_string(&picture).unwrap().starts_with("<svg"));
    // The exported surface can be fitted again, inside the body it came from.
    let again = json(&["fit", "--json", text(&mesh), "--out", text(&fitted.path("again")), "--degree", "2"]);
    let inscribed = again[0]["hull_volume_m3"].as_f64().unwrap();
    let volume = shown["volume_m3"].as_f64().unwrap();
    assert!(inscribed <= volume && inscribed > 0.99 * volume, "{inscribed} of {volume}");
}

#[test]
fn bad_input_is_refused_in_one_line() {
    let fitted = fitted();
    let (body, out) = (fitted.body(), fitted.path("refused"));
    let write = |name: &str, content: &str| {
        let path = fitted.path(name);
        std::fs::write(&path, content).unwrap();
        path
    };
    let files = [
        (write("nan.xyz", "0 0 0\n1 0 0\n0 1 nan\n0 0 1\n"), "not all finite"),
        (write("three.xyz", "0 0 0\n1 0 0\n0 1 0\n"), "at least 4"),
        (write("flat.xyz", "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0.5 0.5 0\n"), "coplanar"),
        (write("short.off", "OFF\n8 6 0\n0 0 0\n1 1 1\n"), "truncated"),
        (write("mesh.blend", "x"), "is not known"),
        (fitted.path("missing.off"), "check the path"),
    ];
    for (path, reason) in &files {
        let error = refusal(&["fit", text(path), "--out", text(&out)]);
        assert!(error.contains(reason) && error.trim_end().lines().count() == 1, "{error}");
        assert!(error.contains(path.file_name().unwrap().to_str().unwrap()), "{error}");
    }
    let cube = fitted.path("cube.off");
    for degree in ["3", "10", "0"] {
        assert!(refusal(&["fit", text(&cube), "--out", text(&out), "--degree", degree]).contains("2, 4, 6, 8"));
    }
    assert!(refusal(&["fit", text(&cube), text(&cube), "--out", text(&out)]).contains("would both become"));
    assert!(refusal(&["fit", text(&cube), "--out", text(&out), "--scale", "0"]).contains("scale"));
    assert_eq!(std::fs::read_dir(&out).map_or(0, Iterator::count), 0, "nothing is stored");

    let pose = |text_: &str| refusal(&["measure", text(&body), text(&body), "--pose", text_]);
    assert!(pose("0,0,0,0,0,0,1.1").contains("deviates by 1.000e-1"));
    assert!(pose("0,0,0,0,0,1").contains("6 numbers; give"));
    assert!(pose("inf,0,0,0,0,0,1").contains("not finite"));
    let accuracy = refusal(&["measure", text(&body), text(&body), "--accuracy", "0"]);
    assert!(accuracy.contains("--accuracy"), "{accuracy}");
}

/// Three quarters of a ring as OFF text, with its triangles.
fn ring() -> String {
    let (along, around) = (40, 12);
    let mut text = format!("OFF\n{} {} 0\n", along * around, 2 * (along - 1) * around);
    for i in 0..along {
        for j in 0..around {
            let (a, b) =
                (4.7 * f64::from(i) / f64::from(along), std::f64::consts::TAU * f64::from(j) / f64::from(around));
            let r = 1.0 + 0.3 * b.cos();
            text += &format!("{} {} {}\n", r * a.cos(), r * a.sin(), 0.3 * b.sin());
        }
    }
    for i in 0..along - 1 {
        for j in 0..around {
            let at = |i: i32, j: i32| i * around + j % around;
            text += &format!("3 {} {} {}\n", at(i, j), at(i + 1, j), at(i, j + 1));
            text += &format!("3 {} {} {}\n", at(i, j + 1), at(i + 1, j), at(i + 1, j + 1));
        }
    }
    text
}

#[test]
fn sets_that_need_not_be_convex_are_distinguished_from_bodies() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = folder.path().join("ring.off");
    std::fs::write(&mesh, ring()).unwrap();
    let mesh = text(&mesh);
    let out = text(folder.path());
    let fit =
        |more: &[&str]| json(&[&["fit", mesh, "--out", out, "--degree", "4", "--json"], more].concat())[0].clone();
    let convex = fit(&[]);
    let relaxed = fit(&["--relax-convexity", "10"]);
    let free = fit(&["--relax-convexity", "inf"]);
    let moment = fit(&["--objective", "inverse-moment"]);
    let volume = |row: &Value| row["volume_m3"].as_f64().unwrap();
    assert!(volume(&free) < volume(&relaxed) && volume(&relaxed) < volume(&convex));
    for (row, name, c) in [
        (&relaxed, "ring-d4-c10.json", Some(10.0)),
        (&free, "ring-d4-cinf.json", None),
        (&moment, "ring-d4-im.json", None),
    ] {
        assert_eq!(
            keys(row),
            sorted(
                "input body kind degree objective relax_convexity points left_out left_out_m hull_vertices volume_m3 volume_error_m3 \
             hull_volume_m3 points_only coverage objective_value optimality_gap solver fallback seconds status proven \
             dropped_points unused_vertices unused_dropped hull_with_unused_m3 hull_without_unused_m3"
            )
        );
        assert!(row["body"].as_str().unwrap().ends_with(name), "{row}");
        assert_eq!((row["points_only"].as_bool(), row["kind"].as_str()), (Some(true), Some("sos-body")));
        assert_eq!((row["relax_convexity"].as_f64(), row["coverage"]["triangles"].as_u64()), (c, Some(936)));
    }
    assert_eq!(moment["objective"], "inverse-moment");

    let file = folder.path().join("ring-d4-c10.json");
    let file = text(&file);
    let shown = json(&["show", file, "--json"]);
    assert_eq!((&shown["kind"], &shown["points_only"]), (&"sos-body".into(), &true.into()));
    assert_eq!(shown["coverage"], relaxed["coverage"]);
    let verified = json(&["verify", file, "--points", mesh, "--json"]);
    assert_eq!((&verified["sos_proven"], &verified["contains_all_points_proven"]), (&true.into(), &true.into()));
    assert_eq!(verified["coverage"], relaxed["coverage"]);
    // A file that claims more than it holds, and one that claims more convexity.
    let changed = |change: &dyn Fn(&mut Value)| {
        let mut value: Value = serde_json::from_str(&std::fs::read_to_string(file).unwrap()).unwrap();
        change(&mut value);
        let path = folder.path().join("changed.json");
        std::fs::write(&path, value.to_string()).unwrap();
        path
    };
    // A triangle across the hole; with c |u|^4 there is none, as that has no curvature where u is
    // 0.
    let bridged = folder.path().join("bridged.off");
    std::fs::write(&bridged, ring().replacen("936", "937", 1) + "3 0 160 320\n").unwrap();
    let free = folder.path().join("ring-d4-cinf.json");
    assert!(refusal(&["verify", text(&free), "--points", text(&bridged)]).contains("uncovered triangles"));
    let straighter = changed(&|file| file["relaxation"]["c"] = 1.0.into());
    assert!(refusal(&["verify", text(&straighter)]).contains("relaxation"));

    // The smallest body around it is convex, and proven to contain all of it.
    let convexified = json(&["fit", file, "--group", "hull", "--out", out, "--json"])[0].clone();
    assert_eq!(convexified["members"], serde_json::json!(["ring"]));
    assert!(volume(&convexified) > volume(&relaxed));
    let hull = folder.path().join("hull-d4.json");
    let verdict = json(&["verify", text(&hull), "--contains", file, "--json"]);
    assert_eq!(verdict["contains_sets_proven"], serde_json::json!([true]));
    let there = ["fit", file, "--group", "hull", "--out", out, "--server", "http://127.0.0.1:9"];
    assert!(refusal(&there).contains("sublevel serve"));

    // Where convexity is needed it is refused for what it is.
    let body = folder.path().join("ring-d4.json");
    assert!(refusal(&["measure", text(&body), file, "--time"]).contains("fit --group"));
    assert!(refusal(&["show", file, "--svg", text(&folder.path().join("x.svg"))]).contains("sos-body"));
    for more in [
        &["--refine"][..],
        &["--slabs", "2"],
        &["--ladder"],
        &["--max-gap", "1cm"],
        &["--parts", "2"],
        &["--cone", "dsos"],
    ] {
        for set in [["--relax-convexity", "1"], ["--objective", "inverse-moment"]] {
            let refused = refusal(&[&["fit", mesh, "--out", out], &set[..], more].concat());
            assert!(refused.contains("convex bodies") && refused.contains(&format!("{}: ", set[0])), "{refused}");
        }
    }
    assert!(refusal(&["fit", mesh, "--out", out, "--relax-convexity", "-1"]).contains("--relax-convexity: -1"));
    assert!(
        refusal(&["fit", mesh, "--out", out, "--relax-convexity", "1", "--objective", "trace-h"]).contains("logdet-p")
    );
    for (one, other) in [("--max-gap=1cm", "--ladder"), ("--parts=2", "--ladder"), ("--parts=2", "--trim=0.1")] {
        let refused = refusal(&["fit", mesh, "--out", out, one, other]);
        assert!(refused.contains("cannot be used") && refused.contains(other.split('=').next().unwrap()), "{refused}");
    }
    let both = ["fit", mesh, "--out", out, "--relax-convexity", "1", "--objective", "inverse-moment"];
    assert!(refusal(&both).contains("leave one of the two out"));
}

#[test]
fn bodies_are_grouped_into_one_that_is_proven_to_contain_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    // Balls of radius 1/2 about (0, 0, 0), (1.2, 0, 0) and (9, 0, 0).
    let balls: Vec<PathBuf> = [("near", 0.0), ("next", 1.2), ("far", 9.0)]
        .into_iter()
        .map(|(name, x)| {
            let (input, body) = (path(&format!("{name}-polynomial.json")), path(&format!("{name}.json")));
            let constraint = r#"{"exponents": [[2,0,0], [0,2,0], [0,0,2]], "coefficients": [4.0, 4.0, 4.0]}"#;
            let linear = "[[1,0,0],[0,1,0],[0,0,1]]";
            let content = format!(
                r#"{{"normalization": {{"center": [{x}, 0, 0], "linear": {linear}}}, "constraints": [{constraint}]}}"#
            );
            std::fs::write(&input, content).unwrap();
            json(&["certify", text(&input), "--out", text(&body), "--name", name, "--json"]);
            body
        })
        .collect();
    let [near, next, far] = [0, 1, 2].map(|i| text(&balls[i]));
    let out = path("grouped");
    let fit = |inputs: &[&str], options: &[&str]| {
        json(&[&["fit"], inputs, &["--json", "--out", text(&out), "--group"], options].concat())
    };

    let report = fit(&[near, next], &["pair"]);
    assert_eq!(report[0]["degree"], 4);
    assert_eq!(report[0]["members"], serde_json::json!(["near", "next"]));
    let pair = out.join("pair-d4.json");
    let verdict = json(&["verify", text(&pair), "--json", "--contains", near, next]);
    assert_eq!(verdict["contains_sets_proven"], serde_json::json!([true, true]));
    // The far one is not inside, and a proof that was changed proves nothing.
    assert!(refusal(&["verify", text(&pair), "--contains", far]).contains("does not contain the set"));
    let content = std::fs::read_to_string(&pair).unwrap();
    let changed = path("changed.json");
    std::fs::write(&changed, content.replacen("\"multipliers\":[[[", "\"multipliers\":[[[9", 1)).unwrap();
    assert!(refusal(&["verify", text(&changed), "--contains", near]).contains("not proven"));

    let report = fit(&[near, next, far], &["some", "--degree", "6", "--max-growth", "0.9"]);
    assert_eq!(report.as_array().unwrap().len(), 2);
    assert_eq!(report[1]["members"], serde_json::json!(["far"]));
    assert!(out.join("some-1-d6.json").exists() && out.join("some-2-d2.json").exists());

    for (arguments, reason) in [
        (&["pair", "--multiplier-degree", "3"][..], "one of 0, 2, 4"),
        (&["pair", "--degree", "5"], "2, 4, 6, 8"),
        (&["pair", "--max-growth", "0"], "not positive"),
        (&["pair", "--ladder"], "cannot be used"),
    ] {
        let error = refusal(&[&["fit", near, next, "--out", text(&out), "--group"], arguments].concat());
        assert!(error.contains(reason), "{error}");
    }
}

#[test]
fn primitives_are_written_exactly_and_refused_by_argument() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("text").to_owned();
    let made = |args: &[&str]| {
        let done = sublevel(args);
        assert!(done.status.success(), "{args:?}: {}", String::from_utf8_lossy(&done.stderr));
    };
    let (table, can, floor) = (path("table.json"), path("can.json"), path("floor.json"));
    made(&["primitive", "box", "--half-extents", "0.5,0.3,0.02", "--out", &table, "--name", "table"]);
    made(&["primitive", "cylinder", "--radius", "0.05", "--half-height", "0.1", "--out", &can]);
    made(&["primitive", "half-space", "--normal", "0,0,2", "--offset", "0", "--out", &floor]);
    let limb = path("limb.json");
    made(&["primitive", "capsule", "--radius", "0.05", "--half-height", "0.2", "--out", &limb]);
    let capsule: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&limb).unwrap()).unwrap();
    assert_eq!((capsule["kind"].as_str(), capsule["half_height_m"].as_f64()), (Some("capsule"), Some(0.2)));
    made(&["primitive", "ball", "--radius", "1", "--out", &path("ball.json")]);
    made(&["primitive", "ellipsoid", "--half-axes", "1,2,3", "--out", &path("egg.json")]);
    let apart = json(&["measure", &table, &can, "--json", "--pose", "0,0,1,0,0,0,1"]);
    assert!((apart["distance_m"].as_f64().unwrap() - 0.88).abs() < 1e-8, "{apart}");
    let half_space: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&floor).unwrap()).unwrap();
    assert_eq!((half_space["kind"].as_str(), half_space["normal"][2].as_f64()), (Some("half-space"), Some(1.0)));
    for (args, word) in [
        (vec!["primitive", "box", "--half-extents", "0.5,-0.3,0.02", "--out", &table], "--half-extents"),
        (vec!["primitive", "ball", "--radius", "nan", "--out", &table], "--radius"),
        (vec!["primitive", "cylinder", "--radius", "0", "--half-height", "1", "--out", &table], "--radius"),
        (vec!["primitive", "half-space", "--normal", "0,0,0", "--offset", "0", "--out", &table], "--normal"),
        (vec!["primitive", "capsule", "--radius", "-1", "--half-height", "1", "--out", &table], "--radius"),
        (vec!["primitive", "capsule", "--radius", "1", "--half-height", "nan", "--out", &table], "--half-height"),
    ] {
        assert!(refusal(&args).contains(word), "{args:?}: {}", refusal(&args));
    }
}

#[test]
fn hierarchy_brackets_sets_that_need_not_be_convex() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("ring.off"), ring()).unwrap();
    let out = text(folder.path());
    json(&["fit", text(&path("ring.off")), "--out", out, "--degree", "4", "--relax-convexity", "inf", "--json"]);
    let ball = Body::ball("ball", Vector3::zeros(), 0.5).unwrap();
    std::fs::write(path("ball.json"), ball.to_json()).unwrap();
    let (ring, ball) = (path("ring-d4-cinf.json"), path("ball.json"));
    let (ring, ball) = (text(&ring), text(&ball));

    // Two balls, whose distance is known.
    let exact = json(&["hierarchy", ball, ball, "--pose", "0,3,4", "--json"]);
    let fields = "lower upper is_exact level point_a_m point_b_m iterations seconds";
    assert_eq!(keys(&exact), sorted(fields));
    let number = |line: &Value, key: &str| line[key].as_f64().unwrap();
    let (lower, upper) = (number(&exact, "lower"), number(&exact, "upper"));
    assert!(lower <= 4.0 && 4.0 <= upper && upper - lower < 1e-5, "{exact}");
    assert_eq!((&exact["is_exact"], &exact["level"]), (&true.into(), &0.into()));
    assert!((exact["point_a_m"][1].as_f64().unwrap() - 0.3).abs() < 1e-3, "{exact}");
    // The polynomial of a ball of 0.5 m at 4.5 m.
    let level = json(&["hierarchy", ball, ball, "--pose", "0,3,4", "--measure", "level-distance", "--json"]);
    assert!((number(&level, "lower") - 81.0).abs() < 1e-3 && level["is_exact"] == true, "{level}");

    // One pose a line, at a level of choice; the bound rises with the level.
    let poses = path("poses.txt");
    std::fs::write(&poses, "1 0 0 0 1 0 0 0 1 0 0 3\n\n1 0 0 0 1 0 0 0 1 4 0 0\n").unwrap();
    let brackets = |level: &str| -> Vec<Value> {
        let output = sublevel(&["hierarchy", ring, ball, "--poses", text(&poses), "--level", level, "--json"]);
        assert!(output.status.success() && output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
        let lines = String::from_utf8(output.stdout).unwrap();
        lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    };
    let (first, next) = (brackets("0"), brackets("1"));
    assert_eq!((first.len(), next.len()), (2, 2));
    for (first, next) in first.iter().zip(&next) {
        let highest = number(first, "upper").min(number(next, "upper"));
        assert!(0.0 < number(next, "lower") && number(next, "lower") <= highest, "{first} {next}");
        assert!(number(first, "lower") <= number(next, "lower") + 1e-4, "{first} {next}");
        assert_eq!((&first["level"], &next["level"]), (&0.into(), &1.into()));
    }
    let table = String::from_utf8(sublevel(&["hierarchy", ball, ball, "--pose", "3,0,0"]).stdout).unwrap();
    let rows: Vec<Vec<&str>> = table.lines().map(|line| line.split_whitespace().collect()).collect();
    assert_eq!((rows.len(), rows[0][0], rows[1][0], rows[1][3], rows[1][4]), (2, "pose", "1", "yes", "0"), "{table}");

    assert!(refusal(&["hierarchy", ball, "missing.json"]).contains("check the path"));
    assert!(refusal(&["hierarchy", ball, text(&poses)]).contains("poses.txt"));
    let refused = refusal(&["hierarchy", ring, ball, "--level", "3"]);
    assert!(refused.contains("between 0 and 2") && refused.lines().count() == 1, "{refused}");
    let octic = Body::superellipsoid("octic", Vector3::zeros(), Vector3::repeat(1.0), 8).unwrap();
    std::fs::write(path("octic.json"), octic.to_json()).unwrap();
    let octic = path("octic.json");
    let turned = "3,0,0,0.2,0.4,0.4,0.8";
    let refused = refusal(&["hierarchy", text(&octic), text(&octic), "--pose", turned, "--level", "2"]);
    assert!(refused.contains("octic.json") && refused.contains("10820 entries"), "{refused}");
    assert!(refusal(&["hierarchy", ball, ball, "--pose", "1,2"]).contains("2 numbers"));
}

#[test]
fn measure_takes_sos_bodies_capsules_and_half_spaces() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| text(&folder.path().join(name)).to_owned();
    std::fs::write(path("ring.off"), ring()).unwrap();
    let out = text(folder.path());
    json(&["fit", &path("ring.off"), "--out", out, "--degree", "4", "--relax-convexity", "inf", "--json"]);
    let (ring, limb, floor) = (path("ring-d4-cinf.json"), path("limb.json"), path("floor.json"));
    for primitive in [
        &["ball", "--radius", "0.5", "--out", &path("ball.json")][..],
        &["ball", "--radius", "0.05", "--out", &path("bead.json")],
        &["capsule", "--radius", "0.05", "--half-height", "0.2", "--out", &limb],
        &["half-space", "--normal", "0,0,1", "--offset", "0", "--out", &floor],
    ] {
        assert!(sublevel(&[&["primitive"], primitive].concat()).status.success(), "{primitive:?}");
    }
    let (ball, bead) = (path("ball.json"), path("bead.json"));
    let measure = |a: &str, b: &str, pose: &str, more: &[&str]| {
        json(&[&["measure", a, b, "--json", "--pose", pose], more].concat())
    };
    let number = |line: &Value, key: &str| line[key].as_f64().unwrap_or_else(|| panic!("{key}: {line}"));

    // A set that is not convex: brackets as wide as asked for, that meet those of the hierarchy.
    let apart = measure(&ring, &ball, "0,0,3", &[]);
    let fields = "status overlap distance_m distance_lower_m distance_upper_m level_ab level_ab_lower level_ab_upper \
                  level_ba level_ba_lower level_ba_upper witness_a witness_b normal iterations";
    assert_eq!(keys(&apart), sorted(&fields.split_whitespace().collect::<Vec<_>>().join(" ")));
    assert_eq!((&apart["status"], &apart["overlap"]), (&"converged".into(), &"no".into()));
    let fine = measure(&ring, &ball, "0,0,3", &["--accuracy", "1e-5"]);
    for (line, accuracy) in [(&apart, 1e-3), (&fine, 1e-5)] {
        for (measured, lower, upper) in [
            ("distance", "distance_lower_m", "distance_upper_m"),
            ("level-distance", "level_ab_lower", "level_ab_upper"),
        ] {
            let exact =
                json(&["hierarchy", &ring, &ball, "--pose", "0,0,3", "--measure", measured, "--level", "1", "--json"]);
            let (lower, upper) = (number(line, lower), number(line, upper));
            assert!(lower <= number(&exact, "upper") && number(&exact, "lower") <= upper, "{line} {exact}");
            // Relative to the smaller of the two, a ball of 0.5 m, and to a level above 1.
            let scale = if measured == "distance" { 0.5 } else { upper };
            assert!(lower > 0.5 && upper - lower <= 1.1 * accuracy * scale, "{line}");
        }
    }
    // From B to A, between the points.
    let point = |line: &Value, key: &str| Vector3::from_fn(|axis, _| line[key][axis].as_f64().unwrap());
    let (a, b) = (point(&fine, "witness_a"), point(&fine, "witness_b"));
    assert!(((a - b).norm() - number(&fine, "distance_m")).abs() < 1e-6, "{fine}");
    assert!((point(&fine, "normal") - (a - b).normalize()).norm() < 1e-6, "{fine}");
    // The middle of the ring is free, which its hull is not.
    let inside = measure(&ring, &bead, "0,0,0", &[]);
    assert!(inside["overlap"] == "no" && number(&inside, "distance_lower_m") > 0.1, "{inside}");
    let body = json(&["fit", &path("ring.off"), "--out", out, "--degree", "4", "--json"])[0]["body"].clone();
    assert_eq!(number(&measure(body.as_str().unwrap(), &bead, "0,0,0", &[]), "distance_m"), 0.0);
    // In contact there is no normal; the other way round the levels change places.
    let met = measure(&ring, &bead, "1,0.2,0", &[]);
    assert_eq!((&met["overlap"], &met["distance_upper_m"], &met["normal"]), (&"yes".into(), &0.0.into(), &Value::Null));
    let turned = measure(&ball, &ring, "0,0,-3", &[]);
    assert!((number(&turned, "level_ba") - number(&apart, "level_ab")).abs() < 0.01 * number(&apart, "level_ab"));

    // Capsules and floors: exact distances, no levels. A stands at the origin.
    for (a, b, pose, distance) in [
        (&limb, &ball, "0.8,0,0.1", 0.25),
        (&ball, &limb, "0,0,1", 1.0 - 0.5 - 0.25),
        (&limb, &limb, "0,0.3,0.1", 0.2),
        (&floor, &ball, "3,4,0.75", 0.25),
        (&limb, &floor, "0,0,-0.5", 0.25),
        (&floor, &ball, "0,0,0.25", 0.0),
    ] {
        let line = measure(a, b, pose, &[]);
        let (lower, upper) = (number(&line, "distance_lower_m"), number(&line, "distance_upper_m"));
        assert!(lower <= distance + 1e-12 && distance <= upper + 1e-12 && upper - lower < 1e-8, "{pose}: {line}");
        assert_eq!(line["overlap"], if distance > 0.0 { "no" } else { "yes" }, "{pose}: {line}");
        assert!(
            line["level_ab"].is_null() && line["level_ba_lower"].is_null() && line["status"] == "converged",
            "{line}"
        );
    }
    // A set above a floor, and tables with a row a pose.
    let above = measure(&floor, &ring, "0,0,2", &[]);
    assert!(above["overlap"] == "no" && number(&above, "distance_lower_m") > 1.4, "{above}");
    let poses = path("poses.txt");
    std::fs::write(&poses, "1 0 0 0 1 0 0 0 1 0 0 1\n\n1 0 0 0 1 0 0 0 1 0.1 0 0\n").unwrap();
    let table = String::from_utf8(sublevel(&["measure", &limb, &ball, "--poses", &poses]).stdout).unwrap();
    let rows: Vec<Vec<&str>> = table.lines().map(|line| line.split_whitespace().collect()).collect();
    assert_eq!((rows.len(), rows[0].contains(&"overlap")), (3, true), "{table}");
    assert_eq!((rows[1][3], rows[2][3], rows[2][4]), ("no", "yes", "-"), "{table}");

    // What has no distance is refused with what has one.
    for (args, words) in [
        (&["measure", &floor, &floor][..], ["half-spaces", "measure a body"]),
        (&["measure", &limb, &ring], ["capsule and an sos-body", "sublevel primitive"]),
        (&["measure", &ring, &limb, "--json"], ["limb.json", "fit --group"]),
        (&["measure", &limb, &ball, "--time"], ["--time", "leave it out"]),
        (&["measure", &ring, &ball, "--accuracy", "0"], ["--accuracy", "above 0"]),
        (&["measure", &ring, &path("ring.off")], ["ring.off", "body"]),
    ] {
        let refused = refusal(args);
        assert!(words.iter().all(|word| refused.contains(word)) && refused.lines().count() == 1, "{args:?}: {refused}");
    }
}
