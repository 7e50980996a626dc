//! A server on loopback in this process, with threads of its own.

use std::error::Error;
use std::net::{Ipv4Addr, SocketAddr};
use std::time::Duration;

use sublevel::client::Client;
use sublevel::service::{Config, ServeError, Server};
use tempfile::TempDir;
use tokio::runtime::{Builder, Runtime};
use tokio::sync::oneshot;
use tokio::task::JoinHandle;

/// The server, and a runtime for its clients.
pub(crate) struct Loopback {
    server: Runtime,
    clients: Runtime,
    url: String,
    stop: oneshot::Sender<()>,
    serving: JoinHandle<Result<(), ServeError>>,
    /// Deleted at the end.
    _data: TempDir,
}

impl Loopback {
    /// Starts it with an empty catalogue.
    ///
    /// # Errors
    /// When there is no folder or port for it.
    pub(crate) fn start() -> Result<Self, Box<dyn Error>> {
        let data = tempfile::Builder::new().prefix("sublevel-bench-").tempdir()?;
        let [server, clients] = [(); 2].map(|()| Builder::new_multi_thread().enable_all().build());
        let (server, clients) = (server?, clients?);
        let listen = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
        let bound =
            server.block_on(Server::bind(Config { listen, data: data.path().to_owned(), ..Config::default() }))?;
        let url = format!("http://{}", bound.local_addr());
        let (stop, stopped) = oneshot::channel::<()>();
        let serving = server.spawn(bound.run(async {
            let _ = stopped.await;
        }));
        Ok(Self { server, clients, url, stop, serving, _data: data })
    }

    /// What clients run on.
    pub(crate) fn clients(&self) -> &Runtime {
        &self.clients
    }

    /// A client with a connection of its own.
    ///
    /// # Errors
    /// When the server does not answer.
    pub(crate) fn connect(&self) -> Result<Client, Box<dyn Error>> {
        Ok(self.clients.block_on(Client::connect(&self.url))?)
    }

    /// Stops the server.
    ///
    /// # Errors
    /// When it had failed.
    pub(crate) fn stop(self) -> Result<(), Box<dyn Error>> {
        self.clients.shutdown_timeout(Duration::from_secs(1));
        let _ = self.stop.send(());
        self.server.block_on(self.serving)??;
        self.server.shutdown_timeout(Duration::from_secs(1));
        Ok(())
    }
}
