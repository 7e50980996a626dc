//! Files that were cut, repeated in part or changed: the same points, or an error; never fewer
//! points in silence.

use super::dialects::{DIALECTS, Dialect, below, places};
use super::*;
use sublevel_testkit::Seeded;

const SEEDS: u64 = 300;

/// Files of the formats with counts, terminators or a fixed size, and what may be done to each.
fn each(mut check: impl FnMut(&str, &Dialect, &Mesh, &[u8], &mut Seeded)) {
    for seed in 0..SEEDS {
        for dialect in DIALECTS.iter().filter(|dialect| !["obj", "xyz"].contains(&dialect.format)) {
            let mut random = Seeded(seed);
            let (mesh, bytes) = dialect.sample(&mut random);
            let what = format!("{} ({}), seed {seed}", dialect.format, dialect.name);
            check(&what, dialect, &mesh, &bytes, &mut random);
        }
    }
}

/// Whether the text of an STL file ends behind a solid: what is missing then, nothing shows.
fn ends_behind_a_solid(dialect: &Dialect, bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(bytes).to_lowercase();
    let last = text.rfind("endsolid").map_or("facet", |at| &text[at..]);
    dialect.format == "stl" && !last.contains("facet")
}

fn holds(what: &str, bytes: &[u8], found: Result<Mesh, String>, is_fine: impl Fn(&Mesh) -> bool) {
    match found {
        Ok(found) => assert!(is_fine(&found), "{what}: {found:?}\n{}", String::from_utf8_lossy(bytes)),
        Err(error) => {
            assert!(error.starts_with("shape") && error.contains(':') && !error.contains('\n'), "{what}: {error}");
        }
    }
}

#[test]
fn cut_files_are_errors() {
    each(|what, dialect, mesh, bytes, random| {
        for _ in 0..20 {
            let cut = &bytes[..below(random, bytes.len())];
            if ends_behind_a_solid(dialect, cut) {
                continue;
            }
            let all = places(&mesh.points);
            holds(what, cut, read(dialect.format, cut), |found| places(&found.points) == all);
        }
    });
}

#[test]
fn repeated_lines_are_errors() {
    each(|what, dialect, mesh, bytes, random| {
        let lines: Vec<&[u8]> = bytes.split_inclusive(|byte| *byte == b'\n' || *byte == b'\r').collect();
        for _ in 0..20 {
            let first = below(random, lines.len());
            let last = (first + 1 + below(random, 3)).min(lines.len());
            let repeated = [&lines[..last], &lines[first..]].concat().concat();
            let all = places(&mesh.points);
            holds(what, &repeated, read(dialect.format, &repeated), |found| places(&found.points) == all);
        }
    });
}

#[test]
fn changed_bytes_lose_no_points() {
    each(|what, dialect, mesh, bytes, random| {
        for _ in 0..40 {
            let mut changed = bytes.to_vec();
            let (at, count) = (below(random, bytes.len()), below(random, 4));
            match below(random, 3) {
                0 => changed[at] = below(random, 256) as u8,
                1 => changed[at] = b"0123456789 \n\r.-+eE#/,;x"[below(random, 23)],
                _ => {
                    let again = changed[at..(at + count).min(bytes.len())].to_vec();
                    changed.splice(at..at, again);
                }
            }
            holds(what, &changed, read(dialect.format, &changed), |found| found.points.len() >= mesh.points.len());
        }
    });
}

#[test]
fn lines_that_lost_their_end_are_errors() {
    for seed in 0..SEEDS {
        for dialect in DIALECTS.iter().filter(|dialect| ["obj", "xyz"].contains(&dialect.format)) {
            let mut random = Seeded(seed);
            let (mesh, bytes) = dialect.sample(&mut random);
            let text = String::from_utf8(bytes).unwrap().replace("\\\n", " ").replace(['\r', '\u{feff}'], "\n");
            let lines: Vec<&str> = text.lines().filter(|line| !line.is_empty()).collect();
            let number = below(&mut random, lines.len());
            let line = lines[number].trim_end();
            let is_vertex = dialect.format == "xyz" || line.starts_with("v ");
            if !is_vertex && !line.starts_with("f ") || line.len() < 5 || line.contains('X') || line.contains('x') {
                continue;
            }
            // Cut where at least one field is gone, in the middle of the file or at its end.
            let Some(cut) = line.rfind([' ', '\t', ',', ';']) else { continue };
            let cut = &line[..1 + below(&mut random, cut)];
            let mut all = lines.clone();
            all[number] = cut;
            let middle = all.join("\n");
            let end = all[..=number].join("\n");
            // Of a single row nothing says how many columns it had.
            let texts = if number > 1 { vec![middle, end] } else { vec![middle] };
            for text in texts {
                // A colour that is gone altogether leaves the point as it is.
                let all = places(&mesh.points);
                if let Ok(found) = read(dialect.format, &text) {
                    let lost = found.points.iter().any(|x| !all.contains(&x.add_scalar(0.0).into()));
                    assert!(!lost && dialect.format == "obj" && cut.starts_with('v'), "seed {seed}: {cut:?}\n{text}");
                }
            }
        }
    }
}

/// A cube whose faces are quads, of random size, in the formats that have counts.
fn quads(random: &mut Seeded) -> [(&'static str, String); 2] {
    let size = 1.0 + random.signed().abs();
    let corner = |i: usize| format!("{} {} {}\n", size * (i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2 & 1) as f64);
    let vertices: String = (0..8).map(corner).collect();
    // A face that lost its count would have a proper one still.
    let faces = "4 4 6 2 0\n4 6 2 0 4\n4 1 3 7 5\n4 0 1 5 4\n4 2 6 7 3\n4 0 2 3 1\n4 4 5 7 6\n";
    let header = "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n\
                  element face 7\nproperty list uchar int vertex_indices\nend_header\n";
    [("off", format!("OFF\n8 7 0\n{vertices}{faces}")), ("ply", format!("{header}{vertices}{faces}"))]
}

#[test]
fn rows_that_lost_or_won_a_field_are_errors() {
    for seed in 0..20 {
        for (format, text) in quads(&mut Seeded(seed)) {
            assert_eq!(read(format, &text).unwrap().points.len(), 8);
            let lines: Vec<&str> = text.lines().collect();
            let first = lines.len() - 15;
            for number in first..lines.len() {
                let fields: Vec<&str> = lines[number].split(' ').collect();
                for field in 0..fields.len() {
                    let mut lost = fields.clone();
                    lost.remove(field);
                    let mut twice = fields.clone();
                    twice.insert(field, fields[field]);
                    for row in [lost.join(" "), twice.join(" ")] {
                        let mut changed = lines.clone();
                        changed[number] = &row;
                        let found = read(format, changed.join("\n"));
                        // A number more behind the corners of OFF is a colour.
                        let is_color = format == "off" && number >= first + 8 && found.is_ok();
                        let all = places(&read(format, &text).unwrap().points);
                        assert!(
                            found.is_err() || is_color && places(&found.unwrap().points) == all,
                            "{format}: {row:?}"
                        );
                    }
                }
            }
        }
    }
}
