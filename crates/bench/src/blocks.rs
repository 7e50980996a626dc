//! Marked blocks of a page: the numbers of a CSV, which are written again from it and never by
//! hand.
//!
//! A block stands between two comments that a reader does not see:
//!
//! ```text
//! <!-- from speed.csv: verdicts -->
//! | pair | ...
//! <!-- end -->
//! ```

/// Closes a block.
const END: &str = "<!-- end -->";

/// A block as it stands in a page.
pub(crate) fn block(csv: &str, name: &str, content: &str) -> String {
    format!("<!-- from {csv}: {name} -->\n{content}{END}\n")
}

/// The page with all blocks written again; `content` makes that of a CSV's block.
pub(crate) fn refreshed(
    page: &str,
    content: &mut dyn FnMut(&str, &str) -> Result<String, String>,
) -> Result<String, String> {
    let mut new = String::new();
    let mut lines = page.lines().zip(1..);
    while let Some((line, number)) = lines.next() {
        let Some((csv, name)) = opened(line) else {
            new.push_str(line);
            new.push('\n');
            continue;
        };
        new.push_str(&block(csv, name, &content(csv, name)?));
        if !lines.by_ref().any(|(line, _)| line == END) {
            return Err(format!("line {number}: the block '{name}' of {csv} has no end; add {END}"));
        }
    }
    Ok(new)
}

/// The CSV and the name of the block that this line opens.
pub(crate) fn opened(line: &str) -> Option<(&str, &str)> {
    line.strip_prefix("<!-- from ")?.strip_suffix(" -->")?.split_once(": ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_written_again_and_the_rest_stays() {
        let page = "# Title\n\n<!-- from a.csv: first -->\nold\n\nolder\n<!-- end -->\ntext\n";
        let mut asked = Vec::new();
        let new = refreshed(page, &mut |csv, name| {
            asked.push(format!("{csv} {name}"));
            Ok("new\n".into())
        });
        assert_eq!(new.unwrap(), "# Title\n\n<!-- from a.csv: first -->\nnew\n<!-- end -->\ntext\n");
        assert_eq!(asked, ["a.csv first"]);
        assert_eq!(refreshed("text\n", &mut |_, _| Err("unasked".into())).unwrap(), "text\n");
    }

    #[test]
    fn a_block_needs_an_end_and_a_maker() {
        let open = "text\n<!-- from a.csv: first -->\nold\n";
        let error = refreshed(open, &mut |_, _| Ok(String::new())).unwrap_err();
        assert!(error.starts_with("line 2: the block 'first' of a.csv has no end"), "{error}");
        assert!(refreshed(&format!("{open}{END}\n"), &mut |_, _| Err("no such block".into())).is_err());
    }
}
