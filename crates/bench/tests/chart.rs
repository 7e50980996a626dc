//! The reports of `sublevel-bench`, as a reader gets them.

use std::path::Path;
use std::process::{Command, Output};
use sublevel_testkit::data;

/// Rows with volumes known independently for human, chair, hand, vase and octopus, and how far
/// above them an answer may be: exact geometry either way, fits only above.
const KNOWN: [(&str, [f64; 5], f64); 6] = [
    ("convex hull", [0.2936, 0.6558, 0.3627, 0.9088, 0.4993], 5e-4),
    ("smallest ball", [3.730, 3.742, 3.848, 3.912, 4.096], 1e-3),
    ("axis-aligned box", [0.697, 1.009, 1.222, 2.048, 1.645], 1e-3),
    ("smallest oriented box", [0.588, 0.998, 0.806, 1.726, 1.277], 1e-3),
    ("sos-convex 2, logdet-p", [0.5894, 1.8425, 0.8530, 1.2252, 1.3558], 3e-3),
    ("sos-convex 4, logdet-p", [0.4553, 1.2200, 0.5453, 1.1186, 0.8971], 3e-3),
];

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn the_quick_table_holds_the_known_volumes() {
    let out = tempfile::tempdir().expect("a folder can be made");
    let output = Command::new(env!("CARGO_BIN_EXE_sublevel-bench"))
        .args(["table1", "--quick", "--meshes"])
        .arg(data("psb"))
        .arg("--out")
        .arg(out.path())
        .output()
        .expect("the program starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let read = |name: &str| std::fs::read_to_string(out.path().join(name)).expect("the file is written");
    let csv = read("table1.csv");
    for (row, volumes, above) in KNOWN {
        let line = format!("\"{row}\",");
        let found: Vec<f64> =
            csv.lines().filter_map(|text| text.strip_prefix(&line)?.split(',').nth(1)?.parse().ok()).collect();
        assert_eq!(found.len(), volumes.len(), "{row}: {found:?}");
        for (volume, known) in found.into_iter().zip(volumes) {
            assert!((-2e-3..=above).contains(&(volume / known - 1.0)), "{row}: {volume} m³ where {known} are known");
        }
    }
    let report = read("table1.md");
    for name in ["table1.svg", "table1-degrees.svg", "table1-gram.svg", "table1-convexity.svg", "table1-levels.svg"] {
        assert!(report.contains(name), "{name} is not in the report");
        let picture = read(name);
        assert!(picture.starts_with("<svg") && !picture.contains("NaN"), "{name}");
    }
}

#[test]
fn missing_meshes_are_reported() {
    let out = tempfile::tempdir().expect("a folder can be made");
    let folder = out.path().to_str().expect("a plain name");
    let output = Command::new(env!("CARGO_BIN_EXE_sublevel-bench"))
        .args(["table1", "--meshes", folder, "--out", folder])
        .output()
        .expect("the program starts");
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{error}");
    assert!(error.contains("10.off") && error.contains("Princeton"), "{error}");
}

/// `sublevel-bench FIGURE --quick` with fits kept for the next run.
fn quick(figure: &str, data: &Path, out: &Path) -> Output {
    let fits = Path::new(env!("CARGO_TARGET_TMPDIR")).join("chart-fits");
    Command::new(env!("CARGO_BIN_EXE_sublevel-bench"))
        .args([figure, "--quick", "--data"])
        .arg(data)
        .arg("--fits")
        .arg(fits)
        .arg("--out")
        .arg(out)
        .env_remove("SUBLEVEL_COAL")
        .env_remove("SUBLEVEL_COAL_PANDA")
        .output()
        .expect("the program starts")
}

/// The files of a quick figure: report and table as text; every picture that the report shows is
/// looked at.
fn made(figure: &str) -> (String, String) {
    let out = tempfile::tempdir().expect("a folder can be made");
    made_in(out.path(), figure)
}

/// The same with the files left in a folder.
fn made_in(out: &Path, figure: &str) -> (String, String) {
    let output = quick(figure, &data(""), out);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let read = |name: &str| std::fs::read_to_string(out.join(name)).expect("the file is written");
    let report = read(&format!("{figure}.md"));
    let shown: Vec<&str> = report.split("](").skip(1).filter_map(|rest| rest.split(')').next()).collect();
    assert!(shown.len() >= 2, "{shown:?}");
    for name in shown {
        let picture = read(name);
        assert!(picture.starts_with("<svg") && !picture.contains("NaN"), "{name}");
    }
    assert!(report.contains(&format!("`sublevel-bench {figure} --data DIR --quick`")), "the command is printed");
    (report, read(&format!("{figure}.csv")))
}

/// Pictures and tables are made again from the CSV files alone, and come out the same.
#[test]
fn charts_are_redrawn_from_their_numbers() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs");
    let out = tempfile::tempdir().expect("a folder can be made");
    for figure in ["speed", "pairs", "warm", "accuracy", "cost", "detail", "panda"] {
        let names = [format!("{figure}.csv"), format!("{figure}.md"), "detail-parts.csv".to_owned()];
        for name in names {
            std::fs::copy(docs.join(&name), out.path().join(&name)).expect("a file of docs/");
        }
        let output = Command::new(env!("CARGO_BIN_EXE_sublevel-bench"))
            .args([figure, "--redraw", "--out"])
            .arg(out.path())
            .output()
            .expect("the program starts");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
    let mut pictures = 0;
    for entry in std::fs::read_dir(out.path()).expect("the folder is there") {
        let path = entry.expect("an entry").path();
        let committed = docs.join(path.file_name().expect("a file has a name"));
        let [new, old] = [&path, &committed].map(|path| std::fs::read_to_string(path).expect("a text"));
        assert!(new == old, "{} differs from what is committed: run it with --redraw --out docs", path.display());
        pictures += usize::from(path.extension().is_some_and(|extension| extension == "svg"));
    }
    assert!(pictures >= 30, "{pictures} pictures");
}

#[test]
fn what_cannot_be_redrawn_is_refused() {
    let out = tempfile::tempdir().expect("a folder can be made");
    let run = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_sublevel-bench"));
        let output = command.args(arguments).current_dir(out.path()).output().expect("the program starts");
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    std::fs::write(out.path().join("warm.csv"), "a,b\n1,2\n").expect("a file can be written");
    for (arguments, code, word) in [
        (&["speed", "--redraw", "--out", "."][..], 1, "speed.csv"),
        (&["warm", "--redraw", "--out", "."], 1, "no column"),
        (&["speed", "--redraw", "--quick"], 2, "cannot be used"),
        (&["speed", "--redraw", "--data", "."], 2, "cannot be used"),
        (&["panda", "--redraw", "--json"], 2, "cannot be used"),
        (&["panda", "--redraw", "--problems", "own.json"], 2, "cannot be used"),
        (&["tables", "--out", ".", "absent.md"], 1, "absent.md"),
    ] {
        let (found, error) = run(arguments);
        assert!(found == Some(code) && error.contains(word), "{arguments:?}: {found:?} {error}");
    }
}

/// Lines of a table whose first cells are these, as the numbers of a column; NaN where there is
/// none.
fn column(csv: &str, first: &str, name: &str) -> Vec<f64> {
    let heads: Vec<&str> = csv.lines().next().expect("a head").split(',').collect();
    let from_the_end = heads.len() - heads.iter().position(|head| *head == name).expect("a column of that name");
    // Names in front may contain commas.
    let cell = |line: &str| line.rsplit(',').nth(from_the_end - 1)?.parse().ok();
    csv.lines().filter(|line| line.starts_with(first)).map(|line| cell(line).unwrap_or(f64::NAN)).collect()
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn the_quick_chart_of_speed_holds_what_is_known() {
    let (report, csv) = made("speed");
    for pair in ["chair-human", "mug-table"] {
        let of = |name: &str, head: &str| {
            let found = column(&csv, &format!("{pair},\"{name}\","), head);
            assert_eq!(found.len(), 1, "{pair}, {name}");
            found[0]
        };
        // Closer and closer.
        let names = ["ball", "ellipsoid", "degree 4", "degree 6", "degree 6, refined"];
        let errors = names.map(|name| of(name, "hull_error_mean"));
        assert!(errors.windows(2).all(|pair| pair[1] < pair[0]), "{pair}: {errors:?}");
        assert!(of("hull, 64 vertices, parry", "hull_error_mean") < of("hull, 32 vertices, parry", "hull_error_mean"));
        // All contain the hull, so that none is farther than it; the exact hull contains the mesh.
        for name in names.into_iter().chain([
            "axis-aligned box",
            "oriented box",
            "cylinder",
            "capsule",
            "degree 4, 4 slabs",
            "hull, 32 vertices, parry",
        ]) {
            assert!(of(name, "hull_error_min") > -1e-7, "{pair}, {name}");
        }
        for name in ["hull, parry", "compound of 4, degree 4", "cover of 32 balls"] {
            assert!(of(name, "mesh_error_min") > -1e-7, "{pair}, {name}");
        }
        assert!(of("oriented box", "hull_error_mean") == of("oriented box, parry", "hull_error_mean"));
    }
    for name in ["failed", "wrong"] {
        assert!(column(&csv, "", name).iter().skip(1).all(|count| *count == 0.0), "{name}: {csv}");
    }
    let judged = ["hold everywhere", "Where the figures are missed"];
    assert!(judged.iter().any(|words| report.contains(words)), "no verdict");
    for words in ["Pareto front of the means over all pairs", "Pareto front against hulls: with a hint hull, "] {
        assert!(report.contains(words), "{words}: {report}");
    }
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn the_quick_chart_of_pairs_has_every_pair_once() {
    let (report, csv) = made("pairs");
    let kinds = ["ball", "degree 4", "box", "capsule", "half-space"];
    for (i, a) in kinds.iter().enumerate() {
        for b in kinds[i..].iter().filter(|_| *a != "half-space") {
            for (who, questions) in [
                ("sublevel", &["cold", "warm", "near", "near-distance", "apart"][..]),
                ("parry", &["cold", "near", "apart"]),
            ] {
                for question in questions {
                    let [times, queries, failed] = ["ns", "queries", "failed"]
                        .map(|head| column(&csv, &format!("{a},{b},{who},{question},"), head));
                    assert!(times.len() == 1 && times[0] > 0.0, "{a}, {b}, {who}, {question}: {times:?}");
                    assert_eq!((queries[0], failed[0]), (64.0, 0.0), "{a}, {b}, {who}, {question}");
                }
            }
        }
    }
    assert!(report.contains("coal did not take part"), "no word of coal");
    assert!(!csv.contains("half-space,half-space,"), "two half-spaces have no distance");
    // 14 pairs, 5 questions, 64 poses.
    assert!(report.contains("Of 4480 of our answers 0 are wider"), "answers are counted");
    assert!(report.contains("longer than the distance by more than"), "decisions are held against distances");
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn the_quick_chart_of_the_panda_keeps_what_is_free() {
    let (report, csv) = made("panda");
    let tables: Vec<&str> = csv.split("\n\n").collect();
    let [states, motions, links, meshes, srdf] = &tables[..] else { panic!("{} tables", tables.len()) };
    let of = |table: &str, name: &str, head: &str| column(table, &format!("all,\"{name}\","), head);
    let kept = |name: &str| of(states, name, "kept")[0] / of(states, name, "known")[0];
    assert!(kept("ellipsoids") < kept("degree 4") && kept("degree 6") > 0.95, "{csv}");
    assert_eq!(of(states, "ladder 2-4-6", "kept"), of(states, "degree 6", "kept"));
    // By poses of the links as well as by joint values, of each representation and family.
    let given = column(states, "", "given_us");
    assert!(given.len() > 9 && given.iter().skip(1).all(|us| *us > 0.0), "{states}");
    assert!(report.contains("| poses given µs | of coal |"), "the table of states shows them");
    let gaps = column(links, "\"within 2 cm\",", "gap_m");
    assert!(gaps.len() == 11 && gaps.iter().all(|gap| (0.0..=0.02).contains(gap)), "{links}");
    for name in ["degree 4", "degree 6", "two parts of degree 6 refined", "degree 6 refined, as by default"] {
        let [free, samples, contacts] = ["free", "samples", "contacts"].map(|head| of(motions, name, head));
        assert_eq!((free.len(), samples.len()), (3, 3), "{name}");
        assert!(free.iter().zip(&samples).all(|(free, samples)| *free > 0.0 && *samples == 100.0 * free), "{name}");
        assert_eq!(contacts, [0.0; 3], "{name}");
    }
    let count = |table: &str, row: &str, head: &str| column(table, &format!("\"{row}\","), head)[0];
    assert_eq!(meshes.lines().count(), 1 + 9, "{meshes}");
    for row in meshes.lines().skip(1) {
        let name = row.split('"').nth(1).expect("a name");
        let [free, alone, met] = ["free", "free_self", "contacts"].map(|head| count(meshes, name, head));
        assert!(free >= alone && free > 0.0 && met > 0.0, "{row}");
        let missed = count(meshes, name, "missed");
        assert!(missed == 0.0 || name == "spheres of the URDF", "{row}: spheres alone leave parts of the links bare");
    }
    // Looked at for one representation, whatever the number of problems.
    assert_eq!(srdf.lines().count(), 1 + 1, "{srdf}");
    let found = ["pairs", "never", "proven"].map(|head| count(srdf, "degree 6 refined, as by default", head));
    assert!(found == [55.0, 23.0, 22.0] && srdf.contains(",panda_link2 and panda_link6,"), "{srdf}");
    assert!(report.contains("Coal took no part"), "no word of coal");
}

/// Two problems of the data, under a name of their own, are all that is measured.
#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn the_panda_takes_other_problems_and_prints_json() {
    let out = tempfile::tempdir().expect("a folder can be made");
    let text = std::fs::read_to_string(data("panda/panda_problems.json")).expect("problems");
    let mut file: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let problems = file["problems"].as_array_mut().expect("a list");
    problems.truncate(2);
    problems.iter_mut().for_each(|problem| problem["set"] = "mine".into());
    let own = out.path().join("own.json");
    std::fs::write(&own, file.to_string()).expect("a file can be written");
    let run = |problems: &Path| {
        let fits = Path::new(env!("CARGO_TARGET_TMPDIR")).join("chart-fits");
        let mut command = Command::new(env!("CARGO_BIN_EXE_sublevel-bench"));
        command.args(["panda", "--quick", "--json", "--data"]).arg(data("")).arg("--problems").arg(problems);
        command.arg("--fits").arg(fits).arg("--out").arg(out.path()).env_remove("SUBLEVEL_COAL_PANDA");
        command.output().expect("the program starts")
    };
    let output = run(&own);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one JSON object");
    assert_eq!(found["quick"], true);
    for table in ["states", "motions"] {
        let rows = found[table].as_array().expect("rows");
        let of = |family: &str| rows.iter().filter(|row| row["family"] == family).count();
        assert!(of("mine") > 8 && of("mine") == of("all") && 2 * of("all") == rows.len(), "{table}: {}", rows.len());
    }
    let states = found["states"].as_array().expect("rows");
    assert!(states.iter().all(|row| row["known"] == 4 && row["contacts"].is_null()), "coal took no part");
    assert!(states.iter().all(|row| row["given_us"].as_f64().is_some_and(|us| us > 0.0)), "{states:?}");
    let summary = found["summary"].as_array().expect("figures");
    let is_of_coal = |figure: &&serde_json::Value| figure["what"].as_str().is_some_and(|what| what.contains("of coal"));
    assert!(summary.iter().filter(is_of_coal).all(|figure| figure["value"].is_null()), "{summary:?}");
    assert!(summary.iter().filter(|figure| figure["value"].is_number()).count() > 10, "{summary:?}");
    for what in
        ["the same with self-collision, of the one before", "CheckStates over gRPC in batches of 1 000, of in process"]
    {
        let found: Vec<_> = summary.iter().filter(|figure| figure["what"] == what).collect();
        assert!(found.len() == 1 && found[0]["value"].is_number(), "{what}: {summary:?}");
    }
    assert!(found["links"].as_array().expect("rows").len() > 80 && found["machine"]["cores"].is_number());
    let meshes = found["meshes"].as_array().expect("rows");
    assert_eq!(meshes.len(), 9, "{meshes:?}");
    for row in meshes {
        // 20 states of each problem.
        assert_eq!(row["states"], 40, "{row}");
        assert!(row["missed"] == 0 || row["representation"] == "spheres of the URDF", "{row}");
    }
    let srdf = found["srdf"].as_array().expect("rows");
    assert_eq!(srdf.len(), 1, "{srdf:?}");
    assert_eq!(srdf[0]["representation"], "degree 6 refined, as by default");
    for (count, expected) in [("pairs", 55), ("never", 23), ("proven", 22)] {
        assert_eq!(srdf[0][count], expected, "{count}: {srdf:?}");
    }
    assert!(srdf[0]["wrong"] == "panda_link2 and panda_link6" && srdf[0]["is_certain"] == true, "{srdf:?}");
    assert!(out.path().join("panda-families.svg").is_file(), "the report is written, too");

    std::fs::write(&own, r#"{"problems": []}"#).expect("a file can be written");
    for (problems, words) in [(own, "holds no problems"), (out.path().join("absent.json"), "absent.json")] {
        let output = run(&problems);
        let error = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(1) && error.contains(words), "{error}");
        assert!(output.stdout.is_empty(), "nothing but JSON is printed");
    }
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn the_quick_chart_of_warm_starts_counts_iterations() {
    let (report, csv) = made("warm");
    let steps = csv.split("\n\n").next().expect("the first table");
    for degree in [4, 6] {
        let of = |step: &str, head: &str| column(steps, &format!("chair-human,\"degree {degree}\",{step},"), head)[0];
        assert!(of("0.0001", "warm_iterations") < of("0.3", "warm_iterations"), "hints are worth less from afar");
        assert!(of("0.01", "warm_iterations") < of("0.01", "cold_iterations"), "hints are worth something");
        assert!(of("teleport", "warm_most") <= 40.0);
    }
    for name in ["failed", "contradictions"] {
        assert!(column(steps, "chair-human", name).iter().all(|count| *count == 0.0), "{name}: {csv}");
    }
    let passage = csv.split("\n\n").nth(1).expect("the second table");
    assert!(!passage.contains("true"), "no position has a wrong answer");
    let levels = column(passage, "", "chair_human");
    let (least, most) = levels.iter().skip(1).fold((f64::INFINITY, 0.0_f64), |(l, m), v| (l.min(*v), m.max(*v)));
    assert!(least < 1.0 && most > 100.0, "through contact: {least} {most}");
    assert!(report.contains("150 ms") && report.contains("10 ms"), "the paper's times");
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn the_quick_chart_of_detail_settles_more_on_every_rung() {
    let out = tempfile::tempdir().expect("a folder can be made");
    let (report, csv) = made_in(out.path(), "detail");
    let parts = std::fs::read_to_string(out.path().join("detail-parts.csv")).expect("the file is written");
    // Convex parts: ours are never larger than those of the search that competes in it, and leave
    // nothing out.
    for object in ["shelf", "tube", "mug"] {
        let of = |by: &str, head: &str| column(&parts, &format!("{object},4,{by},"), head);
        let [ours, gain] = ["ours", "by gain alone"].map(|by| of(by, "volume_m3"));
        assert!(ours.len() == 1 && gain.len() == 1, "{object}: {parts}");
        assert!(ours[0] > 0.0 && ours[0] <= gain[0] * (1.0 + 1e-9), "{object}: {ours:?} {gain:?}");
        assert_eq!(of("ours", "left_out_m"), [0.0], "{object}");
        for by in ["ours", "by gain alone", "V-HACD 64", "V-HACD 128"] {
            assert!(report.contains(&format!("| {object} | 4 | {by} | ")), "{object}, {by}: {report}");
            assert!(of(by, "parts").iter().all(|made| (1.0..=4.0).contains(made)), "{object}, {by}");
        }
    }
    assert!(report.contains("The better of V-HACD's two answers has less volume than ours in "), "no verdict");
    assert!(report.contains("detail-parts.svg"));
    for pair in ["chair-human", "mug-table"] {
        let rungs = ["ball", "ellipsoid", "degree 4", "degree 6"];
        let of = |rung: &str, head: &str| column(&csv, &format!("{pair},{rung},"), head);
        let errors = rungs.map(|rung| of(rung, "error_mean")[0]);
        assert!(errors.windows(2).all(|pair| pair[1] < pair[0]) && errors[3] > 0.0, "{errors:?}");
        let settled = |rung: &str| of(rung, "yes").iter().sum::<f64>() + of(rung, "no").iter().sum::<f64>();
        assert!(settled("degree 6") > settled("ball"));
        for rung in rungs {
            assert_eq!(of(rung, "gap").len(), 10, "a line for each threshold");
            assert!(of(rung, "gap")[0] > of(rung, "error_max")[0], "{pair}, {rung}: the gap bounds the error");
            for name in ["failed", "wrong", "contradicted"] {
                assert!(of(rung, name).iter().all(|count| *count == 0.0), "{pair}, {rung}, {name}");
            }
            let last = [of(rung, "yes"), of(rung, "no")].map(|parts| parts[9]);
            assert!(last[0] + last[1] > 0.8, "{pair}, {rung}: far questions are easy, {last:?}");
        }
    }
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn the_quick_chart_of_accuracy_ends_at_the_floor() {
    let (report, csv) = made("accuracy");
    for case in ["chair-human-d4", "flat-faces-d8"] {
        let of = |method: &str, head: &str| column(&csv, &format!("{case},{method},"), head);
        for method in ["cold", "warm"] {
            let (tolerances, widths) = (of(method, "setting"), of(method, "width_max"));
            assert_eq!(tolerances.len(), 10, "{case}, {method}");
            for ((tolerance, width), short) in tolerances.iter().zip(&widths).zip(of(method, "short")) {
                assert!(width <= tolerance || short > 0.0, "{case}, {method}: {width} at {tolerance}");
                assert!(*tolerance < 1e-9 || short == 0.0, "{case}, {method}: {short} short at {tolerance}");
            }
            assert!(of(method, "error_max").iter().zip(&widths).all(|(error, width)| error <= width));
            assert!(of(method, "off").iter().all(|off| *off == 0.0), "{case}, {method}");
        }
        // Other methods come to the same distances.
        let best = |method: &str| of(method, "error_median").into_iter().fold(f64::INFINITY, f64::min);
        assert!(best("newton-before") < 1e-6, "{case}: {}", best("newton-before"));
        assert!(best("slsqp") < 1e-5, "{case}: {}", best("slsqp"));
        assert!(best("hulls-parry") < 1e-2 && best("hulls-parry") > 1e-9, "{case}: {}", best("hulls-parry"));
        if report.contains("clarabel 0") {
            assert!(best("level0-clarabel") < 1e-5, "{case}: {}", best("level0-clarabel"));
        }
    }
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn the_quick_chart_of_cost_states_exponents() {
    let (report, csv) = made("cost");
    let of = |curve: &str, head: &str| column(&csv, curve, head);
    for (curve, points) in [
        ("degree,\"cold\",ns", 3),
        ("body,\"made of its numbers\",ns", 3),
        ("body,\"read from its file\",ns", 3),
        ("body,\"table of heights read as text\",ns", 3),
        ("constraints,\"warm\",ns", 4),
        ("parts,\"warm\",ns", 2),
        ("batch,\"a batch\",ns", 4),
        ("message,\"a message\",ns", 3),
        ("fit-degree,\"fit\",ns", 3),
        ("fit-points,\"on chair\",ns", 3),
        ("fit-points,\"all on their hull\",ns", 3),
    ] {
        let costs = of(curve, "cost");
        assert!(costs.len() >= points && costs.iter().all(|cost| *cost > 0.0), "{curve}: {costs:?}");
        assert!(of(curve, "exponent").iter().all(|exponent| exponent.is_finite()), "{curve}");
    }
    // Memory is decided by Linux; files and places are reported everywhere.
    assert_eq!(of("batch,\"poses and answers\",bytes", "exponent")[0], 1.0);
    let files = of("degree,\"as a file\",bytes", "cost");
    assert!(files.windows(2).all(|pair| pair[0] < pair[1]), "{files:?}");
    // A table of heights has one size, and as text more than twice that.
    let [table, text] =
        ["", " as text"].map(|as_text| of(&format!("body,\"table of heights{as_text}\",bytes"), "cost"));
    assert!(table.len() == 3 && table.iter().all(|bytes| *bytes == table[0] && *bytes > 1000.0), "{table:?}");
    assert!(text.iter().zip(&table).all(|(text, table)| text > &(2.0 * table)), "{text:?}");
    assert!(report.contains("| exponent |"));
}

/// `sublevel-bench stability` with these arguments, of our methods.
fn stability(arguments: &[&str], out: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_sublevel-bench"))
        .args(["stability", "--quick", "--methods", "cold,warm,batch", "--out"])
        .arg(out)
        .args(arguments)
        .output()
        .expect("the program starts")
}

/// The committed table is the guard: no family may fail more often than there.
#[test]
fn no_family_of_the_stability_table_is_lost() {
    let out = tempfile::tempdir().expect("a folder can be made");
    let committed = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/stability.csv");
    let output = stability(&["--guard", committed], out.path());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let csv = std::fs::read_to_string(out.path().join("stability.csv")).expect("the table is written");
    let families: std::collections::BTreeSet<&str> =
        csv.lines().skip(1).filter_map(|line| line.split(',').next()).collect();
    assert_eq!(families.len(), 46, "{csv}");
    let cases: f64 = column(&csv, "", "cases").into_iter().filter(|cases| cases.is_finite()).sum();
    assert!(cases > 2000.0, "{cases} cases");
    let report = std::fs::read_to_string(out.path().join("stability.md")).expect("the report is written");
    assert!(report.contains("| 13 | parallel flats") && report.contains("pass (40)"), "{report}");
}

#[test]
fn stability_refuses_what_it_can_not_use_with_a_remedy() {
    let out = tempfile::tempdir().expect("a folder can be made");
    let other = out.path().join("other.csv");
    std::fs::write(&other, "a,b\n1,2\n").expect("a file can be written");
    let run = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_sublevel-bench"));
        let output = command.args(["stability"]).args(arguments).current_dir(out.path()).output();
        let output = output.expect("the program starts");
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    for (arguments, code, word) in [
        (&["--methods", "someone"][..], 2, "none of cold, warm"),
        (&["--replay", "17/cold/1"], 2, "FAMILY/METHOD/SEED"),
        (&["--replay", "13/cold/1", "--quick"], 2, "cannot be used"),
        (&["--guard", "absent.csv"], 1, "absent.csv"),
        (&["--quick", "--methods", "coal", "--guard", "other.csv"], 1, "line 1"),
    ] {
        let (found, error) = run(arguments);
        assert!(found == Some(code) && error.contains(word), "{arguments:?}: {found:?} {error}");
    }
    let (code, error) = run(&["--replay", "13/cold/1"]);
    assert_eq!(code, Some(0), "{error}");
}

#[test]
fn charts_refuse_what_they_can_not_use_with_a_remedy() {
    let out = tempfile::tempdir().expect("a folder can be made");
    let file = out.path().join("file");
    std::fs::write(&file, "").expect("a file can be written");
    let folder = out.path();
    for figure in ["speed", "warm", "detail", "accuracy", "cost"] {
        let fails = |output: Output, code: i32, words: &[&str]| {
            let error = String::from_utf8_lossy(&output.stderr).into_owned();
            assert_eq!(output.status.code(), Some(code), "{figure}: {error}");
            assert!(words.iter().all(|word| error.contains(word)), "{figure}: {error}");
        };
        fails(quick(figure, folder, folder), 1, &["psb/101.off", "--data"]);
        fails(quick(figure, folder, &file), 1, &["--out"]);
        let chart = |arguments: &[&str], coal: Option<&Path>| {
            let mut command = Command::new(env!("CARGO_BIN_EXE_sublevel-bench"));
            command.args([figure]).args(arguments).current_dir(folder).env_remove("SUBLEVEL_COAL");
            coal.into_iter().for_each(|coal| {
                command.env("SUBLEVEL_COAL", coal);
            });
            command.output().expect("the program starts")
        };
        fails(chart(&[], None), 2, &["--data"]);
        fails(chart(&["--data", ".", "--fits", "file"], None), 1, &["file", "another folder"]);
        if !["detail", "cost"].contains(&figure) {
            fails(chart(&["--data", "."], Some(Path::new("absent"))), 1, &["SUBLEVEL_COAL", "absent"]);
        }
    }
}
