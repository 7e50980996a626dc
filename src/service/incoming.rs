//! Connections as they come in: so many at once, and only from clients that say something.
//!
//! A socket costs a file descriptor whether or not its client ever speaks. Each waits in a task of
//! its own for the first bytes of HTTP/2, so that a mute client is not valid the others, and is
//! dropped when they do not come.

use std::io;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc};
use tokio::task::JoinHandle;
use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::ServerConfig;
use tokio_rustls::server::TlsStream;
use tokio_stream::Stream;
use tonic::transport::server::{Connected, TcpConnectInfo};

use super::limits::{ACCEPT_PAUSE, PREFACE_TIMEOUT, PREFACE_TIMEOUT_CROWDED};
use super::metrics::{Metrics, Open};
use super::tls::Current;

/// What every HTTP/2 client sends first.
const PREFACE: &[u8] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";

/// Connections whose clients have begun to speak.
#[derive(Debug)]
pub(super) struct Incoming {
    speaking: mpsc::Receiver<Connection>,
    accepting: JoinHandle<()>,
}

/// A socket with its place among the open ones, of which the preface was read.
#[derive(Debug)]
pub(super) struct Connection {
    stream: Transport,
    /// Bytes of the preface that are still to be read again.
    preface: &'static [u8],
    _place: OwnedSemaphorePermit,
    _open: Open,
}

/// What bytes come through.
#[derive(Debug)]
enum Transport {
    Plain(TcpStream),
    Encrypted(Box<TlsStream<TcpStream>>),
}

impl Incoming {
    /// Begins to accept so many connections at once, encrypted where there are certificates; ends
    /// when dropped.
    pub(super) fn new(listener: TcpListener, connections: usize, tls: Option<Current>, metrics: Metrics) -> Self {
        let (spoke, speaking) = mpsc::channel(1);
        Self { speaking, accepting: tokio::spawn(accept(listener, (connections, tls, metrics), spoke)) }
    }
}

impl Drop for Incoming {
    fn drop(&mut self) {
        self.accepting.abort();
    }
}

async fn accept(
    listener: TcpListener,
    (connections, tls, metrics): (usize, Option<Current>, Metrics),
    spoke: mpsc::Sender<Connection>,
) {
    let places = Arc::new(Semaphore::new(connections));
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
        let crowded = places.available_permits() < connections / 2;
        let patience = if crowded { PREFACE_TIMEOUT_CROWDED } else { PREFACE_TIMEOUT };
        let (spoke, tls) = (spoke.clone(), tls.as_ref().map(|tls| tls.borrow().clone()));
        let open = metrics.connected();
        tokio::spawn(async move {
            match tokio::time::timeout(patience, greeted(stream, tls)).await {
                Ok(Ok(stream)) => {
                    let connection = Connection { stream, preface: PREFACE, _place: place, _open: open };
                    // Fails when the server is stopping; then the socket is closed.
                    let _ = spoke.send(connection).await;
                }
                Ok(Err(error)) => tracing::debug!(%error, "a connection that does not speak HTTP/2 is closed"),
                Err(_) => tracing::debug!("a connection that did not begin to speak HTTP/2 is closed"),
            }
        });
    }
}

/// Encrypts where there are certificates, and reads the whole preface, since nobody asks a client
/// for a sign of life before it is there.
async fn greeted(stream: TcpStream, tls: Option<Arc<ServerConfig>>) -> io::Result<Transport> {
    let mut stream = match tls {
        None => Transport::Plain(stream),
        Some(config) => Transport::Encrypted(Box::new(TlsAcceptor::from(config).accept(stream).await?)),
    };
    let mut first = [0; PREFACE.len()];
    let mut count = 0;
    while count < PREFACE.len() {
        let read = match &mut stream {
            Transport::Plain(stream) => stream.read(&mut first[count..]).await?,
            Transport::Encrypted(stream) => stream.read(&mut first[count..]).await?,
        };
        count += read;
        if read == 0 || first[..count] != PREFACE[..count] {
            return Err(io::ErrorKind::InvalidData.into());
        }
    }
    Ok(stream)
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
        match &self.stream {
            Transport::Plain(stream) => stream.connect_info(),
            Transport::Encrypted(stream) => stream.get_ref().0.connect_info(),
        }
    }
}

impl AsyncRead for Connection {
    fn poll_read(mut self: Pin<&mut Self>, context: &mut Context<'_>, to: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        if !self.preface.is_empty() {
            let (now, later) = self.preface.split_at(self.preface.len().min(to.remaining()));
            to.put_slice(now);
            self.preface = later;
            return Poll::Ready(Ok(()));
        }
        match &mut self.stream {
            Transport::Plain(stream) => Pin::new(stream).poll_read(context, to),
            Transport::Encrypted(stream) => Pin::new(stream).poll_read(context, to),
        }
    }
}

impl AsyncWrite for Connection {
    fn poll_write(mut self: Pin<&mut Self>, context: &mut Context<'_>, from: &[u8]) -> Poll<io::Result<usize>> {
        match &mut self.stream {
            Transport::Plain(stream) => Pin::new(stream).poll_write(context, from),
            Transport::Encrypted(stream) => Pin::new(stream).poll_write(context, from),
        }
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        match &mut self.stream {
            Transport::Plain(stream) => Pin::new(stream).poll_flush(context),
            Transport::Encrypted(stream) => Pin::new(stream).poll_flush(context),
        }
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        match &mut self.stream {
            Transport::Plain(stream) => Pin::new(stream).poll_shutdown(context),
            Transport::Encrypted(stream) => Pin::new(stream).poll_shutdown(context),
        }
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        from: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        match &mut self.stream {
            Transport::Plain(stream) => Pin::new(stream).poll_write_vectored(context, from),
            Transport::Encrypted(stream) => Pin::new(stream).poll_write_vectored(context, from),
        }
    }

    fn is_write_vectored(&self) -> bool {
        match &self.stream {
            Transport::Plain(stream) => stream.is_write_vectored(),
            Transport::Encrypted(stream) => stream.is_write_vectored(),
        }
    }
}
