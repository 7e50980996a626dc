//! Numbers of pages out of the CSV files beside them: one command writes them, and a test checks
//! the pages against it.

use crate::blocks::refreshed;
use crate::csv::CsvError;
use crate::measures;
use crate::table1::Table1;
use crate::{ablation, accuracy, cost, detail, fits, pairs, panda, scenes, sets, speed, warm};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use sublevel::cli;

/// A CSV as pages show it.
enum Shown {
    Ablation(ablation::Shown),
    Speed(speed::Shown),
    Warm(warm::Shown),
    Accuracy(accuracy::Shown),
    Cost(cost::Shown),
    Fits(fits::Shown),
    Pairs(pairs::Shown),
    Panda(panda::Shown),
    Scenes(scenes::Shown),
    Sets(sets::Shown),
    Detail(detail::Shown),
    Parts(detail::PartsShown),
    Table1(Table1),
    Measures(measures::Shown),
}

impl Shown {
    fn read(name: &str, folder: &Path) -> Result<Self, String> {
        let path = folder.join(name);
        let text = cli::read(&path).map_err(|error| error.to_string())?;
        let at = |error: CsvError| format!("{}: {error}", path.display());
        match name {
            "ablation.csv" => ablation::Shown::read(&text).map(Self::Ablation),
            "speed.csv" => speed::Shown::read(&text).map(Self::Speed),
            "warm.csv" => warm::Shown::read(&text).map(Self::Warm),
            "accuracy.csv" => accuracy::Shown::read(&text).map(Self::Accuracy),
            "cost.csv" => cost::Shown::read(&text).map(Self::Cost),
            "fits.csv" => fits::Shown::read(&text).map(Self::Fits),
            "pairs.csv" => pairs::Shown::read(&text).map(Self::Pairs),
            "panda.csv" => panda::Shown::read(&text).map(Self::Panda),
            "scenes.csv" => scenes::Shown::read(&text).map(Self::Scenes),
            "sets.csv" => sets::Shown::read(&text).map(Self::Sets),
            "detail.csv" => detail::Shown::read(&text).map(Self::Detail),
            "detail-parts.csv" => detail::PartsShown::read(&text).map(Self::Parts),
            "table1.csv" => Table1::read(&text).map(Self::Table1),
            "measures.csv" => {
                let narrow = cli::read(&folder.join("measures-avx2.csv")).ok();
                measures::Shown::read(&text, narrow.as_deref()).map(Self::Measures)
            }
            _ => return Err(format!("no block is made of {name}")),
        }
        .map_err(at)
    }

    fn block(&self, name: &str) -> Option<String> {
        match self {
            Self::Ablation(shown) => shown.block(name),
            Self::Speed(shown) => shown.block(name),
            Self::Warm(shown) => shown.block(name),
            Self::Accuracy(shown) => shown.block(name),
            Self::Cost(shown) => shown.block(name),
            Self::Fits(shown) => shown.block(name),
            Self::Pairs(shown) => shown.block(name),
            Self::Panda(shown) => shown.block(name),
            Self::Scenes(shown) => shown.block(name),
            Self::Sets(shown) => shown.block(name),
            Self::Detail(shown) => shown.block(name),
            Self::Parts(shown) => shown.block(name),
            Self::Table1(shown) => shown.block(name),
            Self::Measures(shown) => shown.block(name),
        }
    }
}

/// The page with all its blocks written again from the CSV files in a folder.
///
/// # Errors
/// What is wrong, for people: a CSV that is missing or none, a block that is unknown or has no end.
pub fn written_again(page: &str, folder: &Path) -> Result<String, String> {
    let mut known: HashMap<String, Shown> = HashMap::new();
    refreshed(page, &mut |csv, name| {
        if !known.contains_key(csv) {
            known.insert(csv.to_owned(), Shown::read(csv, folder)?);
        }
        let block = known.get(csv).and_then(|shown| shown.block(name));
        block.ok_or_else(|| format!("no block of {csv} is named '{name}'"))
    })
}

/// All pages of a folder, in order of their names.
///
/// # Errors
/// What is wrong, for people.
pub fn pages(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let failed = |error: std::io::Error| format!("cannot read {}: {error}", folder.display());
    let mut pages = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if path.extension().is_some_and(|extension| extension == "md") {
            pages.push(path);
        }
    }
    pages.sort();
    Ok(pages)
}

/// The pictures that a CSV alone makes, the most telling first; none of tables without pictures.
///
/// # Errors
/// What is wrong, for people.
pub(crate) fn pictures(csv: &str, folder: &Path) -> Result<Vec<(String, String)>, String> {
    let drawn = match Shown::read(csv, folder)? {
        Shown::Speed(shown) => shown.pictures(),
        Shown::Warm(shown) => shown.pictures(),
        Shown::Accuracy(shown) => shown.pictures(),
        Shown::Cost(shown) => shown.pictures(),
        Shown::Fits(shown) => shown.pictures(),
        Shown::Pairs(shown) => shown.pictures(),
        Shown::Panda(shown) => shown.pictures(),
        Shown::Scenes(shown) => shown.pictures(),
        Shown::Sets(shown) => shown.pictures(),
        Shown::Detail(shown) => shown.pictures(),
        Shown::Parts(shown) => shown.pictures(),
        Shown::Ablation(_) | Shown::Table1(_) | Shown::Measures(_) => Ok(Vec::new()),
    };
    drawn.map_err(|error| format!("{csv}: {error}"))
}
