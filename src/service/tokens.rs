//! Tokens that clients show, and what they may do with them. The file contains hashes only, and is
//! read again when it changes.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use subtle::ConstantTimeEq;
use tokio::sync::watch;

use super::watched_files::watched;

/// What a token allows; each role includes those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Questions, and reading what is stored.
    Read,
    /// Changes of bodies, scenes and jobs.
    Write,
    /// What concerns the whole server, such as backups.
    Admin,
}

/// Tokens by their hashes.
#[derive(Debug, Default)]
pub(super) struct Tokens(Vec<Token>);

#[derive(Debug)]
struct Token {
    name: String,
    role: Role,
    hash: [u8; 32],
}

/// Why tokens cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TokensError {
    /// The file cannot be read.
    #[error("{}: {source}; name the file of tokens, or make one with `sublevel token`", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// It says something else.
    #[error("{}: {why}; each entry is as `sublevel token` prints it", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// The reason.
        why: String,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TokensFile {
    #[serde(default)]
    token: Vec<TokenEntry>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct TokenEntry {
    name: String,
    role: Role,
    sha256: String,
}

/// A new token, as its user shows it, and its entry of the file.
///
/// # Errors
/// When the system has no random numbers.
pub(crate) fn new_entry(name: &str, role: Role) -> Result<(String, String), String> {
    let mut random = [0; 32];
    let source = tokio_rustls::rustls::crypto::ring::default_provider().secure_random;
    source.fill(&mut random).map_err(|_| "the system has no random numbers".to_owned())?;
    Ok(entry(name, role, &random))
}

fn entry(name: &str, role: Role, random: &[u8; 32]) -> (String, String) {
    let token = hex(random);
    let entry = TokenEntry { name: name.into(), role, sha256: hex(&Sha256::digest(token.as_bytes()).into()) };
    // Strings only: it can be written.
    (token, format!("[[token]]\n{}", toml::to_string(&entry).unwrap_or_default()))
}

impl Tokens {
    /// Reads the file.
    ///
    /// # Errors
    /// A file that cannot be read, and the first entry that is none.
    pub(super) fn read(path: &Path) -> Result<Self, TokensError> {
        let text =
            std::fs::read_to_string(path).map_err(|source| TokensError::File { path: path.to_owned(), source })?;
        Self::parse(&text).map_err(|why| TokensError::Content { path: path.to_owned(), why })
    }

    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let file: TokensFile = toml::from_str(text).map_err(|error| toml_error(text, &error))?;
        let mut tokens: Vec<Token> = Vec::new();
        for (index, TokenEntry { name, role, sha256 }) in file.token.into_iter().enumerate() {
            let hash = unhex(&sha256)
                .ok_or_else(|| format!("token {index} (\"{name}\"): sha256 is not 64 hexadecimal digits"))?;
            if name.is_empty() {
                return Err(format!("token {index} has an empty name"));
            }
            if tokens.iter().any(|other| other.name == name) {
                return Err(format!("token {index}: the name \"{name}\" is there twice"));
            }
            tokens.push(Token { name, role, hash });
        }
        Ok(Self(tokens))
    }

    /// Whose token this is. Takes as long whether and whichever it is.
    pub(super) fn find(&self, shown: &[u8]) -> Option<(&str, Role)> {
        let hash: [u8; 32] = Sha256::digest(shown).into();
        let mut found = None;
        for token in &self.0 {
            if bool::from(token.hash.ct_eq(&hash)) {
                found = Some((token.name.as_str(), token.role));
            }
        }
        found
    }
}

/// What is wrong with a file, and in which line, without the line: it may contain what is secret.
fn toml_error(text: &str, error: &toml::de::Error) -> String {
    let message = Some(error.message()).filter(|message| !message.is_empty()).unwrap_or("something is missing");
    match error.span().and_then(|span| text.get(..span.start)) {
        Some(before) => format!("line {}: {message}", before.matches('\n').count() + 1),
        None => message.to_owned(),
    }
}

/// Reads the tokens, and again when the file has changed. What cannot be used then is logged, and
/// the earlier tokens stay.
///
/// # Errors
/// A file that cannot be used at the start.
pub(super) fn tokens(path: PathBuf) -> Result<watch::Receiver<Arc<Tokens>>, TokensError> {
    watched("tokens", vec![path.clone()], move || Tokens::read(&path))
}

/// A hash in lowercase hexadecimal digits.
pub(crate) fn hex(bytes: &[u8; 32]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn unhex(text: &str) -> Option<[u8; 32]> {
    let digits = text.as_bytes();
    if digits.len() != 64 || !digits.iter().all(u8::is_ascii_hexdigit) {
        return None;
    }
    let mut bytes = [0; 32];
    for (byte, pair) in bytes.iter_mut().zip(text.as_bytes().chunks(2)) {
        *byte = u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok()?;
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_token_is_found_by_what_its_user_shows() {
        let (reader, of_reader) = entry("planner", Role::Read, &[7; 32]);
        let (admin, of_admin) = entry("ops", Role::Admin, &[8; 32]);
        let tokens = Tokens::parse(&format!("{of_reader}\n{of_admin}")).expect("tokens");
        assert!(!of_reader.contains(&reader) && reader.len() == 64);
        assert_eq!(tokens.find(reader.as_bytes()), Some(("planner", Role::Read)));
        assert_eq!(tokens.find(admin.as_bytes()), Some(("ops", Role::Admin)));
        for wrong in ["", "x", &reader[1..], &reader.replace('7', "9")] {
            assert_eq!(tokens.find(wrong.as_bytes()), None, "{wrong}");
        }
        assert!(Tokens::parse("").expect("no tokens").find(b"").is_none());
    }

    #[test]
    fn what_is_no_entry_is_refused_with_its_place() {
        let (_, good) = entry("a", Role::Write, &[1; 32]);
        for (text, word) in [
            (format!("{good}{good}"), "twice"),
            (good.replace("write", "root"), "root"),
            (good.replace("sha256 = \"", "sha256 = \"z"), "64 hexadecimal"),
            (good.replace("name = \"a\"", "name = \"\""), "empty name"),
            (format!("{good}more = 1\n"), "more"),
            ("token = 3".into(), "invalid type"),
        ] {
            let why = Tokens::parse(&text).expect_err(&text);
            assert!(why.contains(word), "{text}: {why}");
        }
    }
}
