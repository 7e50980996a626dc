//! Files of settings that are read again when they change.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::watch;

/// How often the files are looked at.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// Reads files, and again when their contents have changed. What cannot be used then is logged,
/// and what was read before stays. `what` names it in the log.
///
/// # Errors
/// Files that cannot be used now.
pub(super) fn watched<T, E>(
    what: &'static str,
    files: Vec<PathBuf>,
    read: impl Fn() -> Result<T, E> + Send + 'static,
) -> Result<watch::Receiver<Arc<T>>, E>
where
    T: Send + Sync + 'static,
    E: std::error::Error + Send,
{
    // Before they are read: what changes meanwhile is read again.
    let mut known: Vec<_> = files.iter().map(|path| std::fs::read(path).ok()).collect();
    let (sender, current) = watch::channel(Arc::new(read()?));
    tokio::spawn(async move {
        let mut refused = None;
        while !sender.is_closed() {
            tokio::time::sleep(LOOK_EVERY).await;
            let mut now = Vec::new();
            for path in &files {
                now.push(tokio::fs::read(path).await.ok());
            }
            if now == known {
                continue;
            }
            match read() {
                Ok(changed) => {
                    sender.send_replace(Arc::new(changed));
                    tracing::info!("{what} have changed and are used from now on");
                    (known, refused) = (now, None);
                }
                // Tried again, since the reason may pass; said once.
                Err(_) if refused.as_ref() == Some(&now) => {}
                Err(error) => {
                    tracing::error!(%error, "{what} have changed and the earlier ones stay");
                    refused = Some(now);
                }
            }
        }
    });
    Ok(current)
}
