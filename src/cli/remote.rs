//! Jobs of a server, from a shell.

use crate::client::{Client, ClientError, ClientOptions};
use std::time::Duration;

/// How long the server may take to read what is sent: meshes and large bodies take it a while.
const PATIENCE: Duration = Duration::from_secs(120);

/// Connects to a server that is to work on something.
pub(super) async fn connect(url: &str) -> Result<Client, ClientError> {
    let options = ClientOptions { patience: PATIENCE, ..ClientOptions::from_environment() };
    Client::connect_with(url, &options).await
}

/// Ends when Ctrl-C is pressed.
pub(super) async fn interrupted() {
    // Without signals nobody can cancel, and the job ends by itself.
    if tokio::signal::ctrl_c().await.is_err() {
        std::future::pending::<()>().await;
    }
}
