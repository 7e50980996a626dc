//! `sublevel fit --group`.

use super::fit::{FitArgs, make_folder, progress_bar};
use super::{read_body, write_atomically};
use crate::body::Body;
use crate::fit::{EncloseOptions, Enclosure, Group, Progress, enclose_bodies, group};
use serde::Serialize;
use std::error::Error;
use std::io::{self, Write};
use std::ops::ControlFlow;
use std::time::Instant;

/// Degree unless told otherwise.
const DEGREE: usize = 4;

#[derive(Serialize)]
struct Row {
    body: String,
    /// Names of the bodies inside.
    members: Vec<String>,
    degree: usize,
    volume_m3: f64,
    /// Sum of theirs.
    members_volume_m3: f64,
    /// Proven bound of the distance of any point of the body from their convex hull; none for a body left as it is.
    gap_m: Option<f64>,
    optimality_gap: Option<f64>,
    /// What is not proven is an error.
    proven: bool,
}

/// Reads the bodies, puts them into one or several, and writes those.
pub(super) fn run(args: &FitArgs, name: &str) -> Result<(), Box<dyn Error>> {
    let start = Instant::now();
    let mut options = EncloseOptions::new(args.degree.unwrap_or(DEGREE));
    options.multiplier_degree = args.multiplier_degree.unwrap_or(options.multiplier_degree);
    options.check()?;
    crate::body::check_name(name)?;
    let bodies = args.inputs.iter().map(|path| read_body(path)).collect::<Result<Vec<_>, _>>()?;
    make_folder(&args.out)?;
    let bar = progress_bar(name);
    let mut tell = |progress: Progress| {
        bar.set_message(format!("step {}, {:.0e} from the optimum", progress.iterations, progress.gap));
        ControlFlow::Continue(())
    };
    let groups = match args.max_growth {
        Some(max_growth) => group(&bodies, max_growth, &options, &mut tell)?,
        None => {
            let enclosure = enclose_bodies(name, &bodies.iter().collect::<Vec<_>>(), &options, &mut tell)?;
            vec![Group { members: (0..bodies.len()).collect(), enclosure: Some(enclosure) }]
        }
    };
    bar.finish_and_clear();
    let several = args.max_growth.is_some();
    let rows = groups
        .iter()
        .enumerate()
        .map(|(i, group)| {
            write(args, &if several { format!("{name}-{}", i + 1) } else { name.to_owned() }, &bodies, group)
        })
        .collect::<Result<Vec<_>, _>>()?;
    let mut out = io::stdout().lock();
    if args.json {
        serde_json::to_writer_pretty(&mut out, &rows)?;
        writeln!(out)?;
    } else {
        table(&mut out, &rows)?;
        let volume = |of: &dyn Fn(&Row) -> f64| rows.iter().map(of).sum::<f64>();
        let (before, after) = (volume(&|row| row.members_volume_m3), volume(&|row| row.volume_m3));
        writeln!(
            out,
            "{} bodies of {before:.4e} m³ in {} of {after:.4e} m³, {:+.1} %, in {:.1} s",
            bodies.len(),
            rows.len(),
            100.0 * (after / before - 1.0),
            start.elapsed().as_secs_f64()
        )?;
    }
    Ok(())
}

/// Writes one body and describes it.
fn write(args: &FitArgs, name: &str, bodies: &[Body], group: &Group) -> Result<Row, Box<dyn Error>> {
    let body = group.enclosure.as_ref().map_or(&bodies[group.members[0]], |enclosure| &enclosure.body);
    let body = body.renamed(name)?;
    let file = args.out.join(format!("{name}-d{}.json", body.degree()));
    write_atomically(&file, &body.to_json())?;
    let members = group.members.iter().map(|&i| &bodies[i]);
    let of_fit = |value: fn(&Enclosure) -> f64| group.enclosure.as_ref().map(value);
    Ok(Row {
        body: file.display().to_string(),
        members: members.clone().map(|body| body.name().to_owned()).collect(),
        degree: body.degree(),
        volume_m3: body.volume().volume_m3,
        members_volume_m3: members.map(|body| body.volume().volume_m3).sum(),
        gap_m: of_fit(|enclosure| enclosure.gap.most_m),
        optimality_gap: of_fit(|enclosure| enclosure.optimality_gap),
        proven: true,
    })
}

fn table(out: &mut impl Write, rows: &[Row]) -> io::Result<()> {
    let width = rows.iter().map(|row| row.body.chars().count()).max().unwrap_or(0).max(4);
    writeln!(out, "{:width$}  degree  members    volume m³  volume:members      gap m  proven", "body")?;
    for row in rows {
        writeln!(
            out,
            "{:width$}  {:>6}  {:>7}  {:>11.4e}  {:>14.3}  {:>9}  {:>6}",
            row.body,
            row.degree,
            row.members.len(),
            row.volume_m3,
            row.volume_m3 / row.members_volume_m3,
            row.gap_m.map_or_else(|| "-".to_owned(), |gap| format!("{gap:.3e}")),
            if row.proven { "yes" } else { "no" }
        )?;
    }
    Ok(())
}
