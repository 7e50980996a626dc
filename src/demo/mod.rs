//! The whole job on shapes the program makes itself: a chair and a human figure become certified
//! bodies, a server keeps them, and a client sweeps the chair through the human and asks for
//! distances at every step.

mod error;
mod fits;
mod plots;
mod sweep;
mod table;

use crate::fit::shapes;
pub use error::DemoError;
use error::write;
use std::io::Write;
use std::path::Path;

/// Runs the demo: prints its tables to `text`, writes bodies, meshes, numbers and plots into the
/// folder `out`.
///
/// # Errors
/// The first step that fails; files written before it stay.
pub fn run(out: &Path, text: &mut impl Write) -> Result<(), DemoError> {
    std::fs::create_dir_all(out).map_err(|source| DemoError::File { path: out.into(), source })?;
    let objects = [("chair", shapes::chair()), ("human", shapes::human())];

    writeln!(text, "Two shapes become certified convex bodies:\n")?;
    fits::print_head(text)?;
    let mut files = Vec::new();
    let mut fitted = Vec::new();
    for (name, shape) in &objects {
        files.push(write(&out.join(format!("{name}.off")), &shape.to_off())?);
        for degree in [2, 4, 6] {
            let fit = fits::fit(name, shape, degree, out)?;
            fits::print_row(text, &fit)?;
            files.push(fit.file.clone());
            fitted.push(fit);
        }
    }
    writeln!(
        text,
        "\nhull: convex hull of the shape; no convex body that contains the shape is smaller.\n\
         proven: the written file alone proves its body convex, bounded and around every point of the shape.\n"
    )?;

    // The last of each shape's bodies, the tightest, takes part in the sweep.
    let tightest = |name: &str| fitted.iter().rfind(|fit| fit.name == name);
    let (Some(chair), Some(human)) = (tightest("chair"), tightest("human")) else { return Ok(()) };
    let sweep = sweep::run(&chair.file, &human.file)?;
    table::print(text, &sweep)?;

    files.push(write(&out.join("sweep.csv"), &table::csv(&sweep))?);
    files.push(write(&out.join("level-distance.svg"), &plots::level_distances(&sweep)?)?);
    let posed = [(&objects[0].1, &chair.body), (&objects[1].1, &human.body)];
    files.push(write(&out.join("silhouettes.svg"), &plots::silhouettes(&sweep, posed))?);
    writeln!(text, "\nWritten:")?;
    for file in files {
        writeln!(text, "  {}", file.display())?;
    }
    Ok(())
}
