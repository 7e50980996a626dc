//! The count of what is lost without each stage of a search.

use super::arguments::AblationArgs;
use std::error::Error;

#[cfg(feature = "ablation")]
pub(super) fn run_ablation(args: &AblationArgs) -> Result<(), Box<dyn Error>> {
    use super::arguments::TablesArgs;
    use super::output::{bar, make_folder, show_progress, write_numbers};
    use crate::ablation::ablation;
    use std::io::{self, Write};
    use sublevel::cli::write_atomically;

    make_folder(&args.out)?;
    let bar = bar()?;
    let found = ablation(args.queries, &mut |at| show_progress(&bar, at)).ok_or("stopped")?;
    bar.finish_and_clear();
    let csv = args.out.join("ablation.csv");
    write_atomically(&csv, &found.csv())?;
    write_numbers(&TablesArgs { out: args.out.clone(), pages: Vec::new() })?;
    writeln!(io::stdout().lock(), "{}{}", found.named(), csv.display())?;
    match found.wrong() {
        0 => Ok(()),
        wrong => Err(format!("{wrong} brackets are wrong without some stage").into()),
    }
}

#[cfg(not(feature = "ablation"))]
pub(super) fn run_ablation(args: &AblationArgs) -> Result<(), Box<dyn Error>> {
    let AblationArgs { queries, out } = args;
    let command = format!(
        "cargo run --release -p sublevel-bench --features ablation -- ablation --queries {queries:e} --out {}",
        out.display()
    );
    Err(format!("stages cannot be switched off in this build; run `{command}`").into())
}
