//! Connections as they come in: so many at once, and only from clients that say something.
//!
//! A socket costs a file descriptor whether or not its client ever speaks. Each waits in a task of
//! its own for the first bytes of HTTP/2, so that a mute client does not hold up the others, and is
//! dropped when they do not come.

use std::io;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc};
use tokio::task::JoinHandle;
use tokio_stream::Stream;
use tonic::transport::server::{Connected, TcpConnectInfo};

use super::limits::{ACCEPT_PAUSE, MAX_CONNECTIONS, PREFACE_TIMEOUT, PREFACE_TIMEOUT_CROWDED};

/// What every HTTP/2 client sends first.
const PREFACE: &[u8] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";

/// Connections whose clients have begun to speak.
#[derive(Debug)]
pub(super) struct Incoming {
    speaking: mpsc::Receiver<Connection>,
    accepting: JoinHandle<()>,
}

/// A socket, and its place among the open ones.
#[derive(Debug)]
pub(super) struct Connection {
    stream: TcpStream,
    _place: OwnedSemaphorePermit,
}

impl Incoming {
    /// Begins to accept; ends when dropped.
    pub(super) fn new(listener: TcpListener) -> Self {
        let (spoke, speaking) = mpsc::channel(1);
        Self { speaking, accepting: tokio::spawn(accept(listener, spoke)) }
    }
}

impl Drop for Incoming {
    fn drop(&mut self) {
        self.accepting.abort();
    }
}

async fn accept(listener: TcpListener, spoke: mpsc::Sender<Connection>) {
    let places = Arc::new(Semaphore::new(MAX_CONNECTIONS));
    let mut failing = false;
    // The semaphore is never closed. While all places are taken, clients queue in the system.
    while let Ok(place) = places.clone().acquire_owned().await {
        let stream = match listener.accept().await {
            Ok((stream, _)) => stream,
            Err(error) => {
                // Most often out of file descriptors: trying again at once would take a core and
                // fail again.
                if !failing {
                    tracing::warn!(%error, "cannot accept connections; trying again until it works");
                }
                failing = true;
                tokio::time::sleep(ACCEPT_PAUSE).await;
                continue;
            }
        };
        failing = false;
        if let Err(error) = stream.set_nodelay(true) {
            tracing::debug!(%error, "a connection without TCP_NODELAY");
        }
        let crowded = places.available_permits() < MAX_CONNECTIONS / 2;
        let patience = if crowded { PREFACE_TIMEOUT_CROWDED } else { PREFACE_TIMEOUT };
        let spoke = spoke.clone();
        tokio::spawn(async move {
            if let Ok(true) = tokio::time::timeout(patience, speaks(&stream)).await {
                // Fails when the server is stopping; then the socket is closed.
                let _ = spoke.send(Connection { stream, _place: place }).await;
            } else {
                tracing::debug!("a connection that did not begin to speak HTTP/2 is closed");
            }
        });
    }
}

/// Waits for the whole preface, since nobody asks a client for a sign of life before it is there.
async fn speaks(stream: &TcpStream) -> bool {
    let mut first = [0; PREFACE.len()];
    loop {
        match stream.peek(&mut first).await {
            Ok(0) | Err(_) => return false,
            Ok(count) if first[..count] != PREFACE[..count] => return false,
            Ok(count) if count == PREFACE.len() => return true,
            // Peeking returns at once as long as there is a byte.
            Ok(_) => tokio::time::sleep(Duration::from_millis(20)).await,
        }
    }
}

impl Stream for Incoming {
    type Item = io::Result<Connection>;

    fn poll_next(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        self.speaking.poll_recv(context).map(|connection| connection.map(Ok))
    }
}

impl Connected for Connection {
    type ConnectInfo = TcpConnectInfo;

    fn connect_info(&self) -> Self::ConnectInfo {
        self.stream.connect_info()
    }
}

impl AsyncRead for Connection {
    fn poll_read(mut self: Pin<&mut Self>, context: &mut Context<'_>, to: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_read(context, to)
    }
}

impl AsyncWrite for Connection {
    fn poll_write(mut self: Pin<&mut Self>, context: &mut Context<'_>, from: &[u8]) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write(context, from)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        from: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write_vectored(context, from)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }
}
