//! A proxy between clients and a server that writes down the questions that pass.

use std::convert::Infallible;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::net::SocketAddr;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll};
use std::time::Instant;

use axum::Router;
use axum::body::{Body as AxumBody, to_bytes};
use bytes::Bytes;
use tokio::net::TcpListener;
use tokio_stream::wrappers::TcpListenerStream;
use tonic::body::Body;
use tonic::codegen::{BoxFuture, Service, http};
use tonic::service::Routes;
use tonic::transport::Channel;
use tonic::{Code, Status};

use super::recording::{QUESTIONS, RecordedCall};

/// Longest message that is recorded, bytes: more than a server takes.
const LONGEST: usize = 16 << 20;

/// Bytes before a message: whether it is compressed, and its length.
const PREFIX: usize = 5;

/// A proxy that listens and does not answer yet.
#[derive(Debug)]
pub struct Recorder {
    listener: TcpListener,
    proxy: Proxy,
}

#[derive(Clone, Debug)]
struct Proxy {
    server: Channel,
    written: Arc<Written>,
}

#[derive(Debug)]
struct Written {
    begun: Instant,
    file: Mutex<BufWriter<File>>,
    calls: AtomicU64,
}

impl Recorder {
    /// Listens, and writes into a file what passes to a server.
    ///
    /// # Errors
    /// When the address cannot be listened on.
    pub async fn new(listen: SocketAddr, server: Channel, file: File) -> io::Result<Self> {
        let listener = TcpListener::bind(listen).await?;
        let file = Mutex::new(BufWriter::new(file));
        let written = Arc::new(Written { begun: Instant::now(), file, calls: AtomicU64::new(0) });
        Ok(Self { listener, proxy: Proxy { server, written } })
    }

    /// Where it listens.
    ///
    /// # Errors
    /// When the system does not say.
    pub fn local_addr(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }

    /// Passes calls on until `stop`; returns how many were written.
    ///
    /// # Errors
    /// When the transport gives up, or the file cannot be written.
    pub async fn run(self, stop: impl Future<Output = ()>) -> io::Result<u64> {
        let written = self.proxy.written.clone();
        let routes = Routes::from(Router::new().fallback_service(self.proxy));
        let serving = tonic::transport::Server::builder()
            .add_routes(routes)
            .serve_with_incoming(TcpListenerStream::new(self.listener));
        tokio::select! {
            served = serving => served.map_err(io::Error::other)?,
            () = stop => {}
        }
        written.file.lock().unwrap_or_else(PoisonError::into_inner).flush()?;
        Ok(written.calls.load(Ordering::Relaxed))
    }
}

impl Written {
    fn put(&self, call: &str, at: Instant, body: &Bytes) -> io::Result<()> {
        // One that is compressed cannot be sent again as it is; none of our clients compress.
        if body.len() < PREFIX || body[0] != 0 {
            return Ok(());
        }
        let at_s = (at - self.begun).as_secs_f64();
        let recorded = RecordedCall { at_s, call: call.to_owned(), message: body.slice(PREFIX..) };
        self.file.lock().unwrap_or_else(PoisonError::into_inner).write_all(recorded.line().as_bytes())?;
        self.calls.fetch_add(1, Ordering::Relaxed);
        Ok(())
    }
}

impl Service<http::Request<AxumBody>> for Proxy {
    type Response = http::Response<AxumBody>;
    type Error = Infallible;
    type Future = BoxFuture<Self::Response, Infallible>;

    fn poll_ready(&mut self, _: &mut Context<'_>) -> Poll<Result<(), Infallible>> {
        Poll::Ready(Ok(()))
    }

    fn call(&mut self, request: http::Request<AxumBody>) -> Self::Future {
        let (proxy, at) = (self.clone(), Instant::now());
        Box::pin(async move {
            let answered = proxy.pass(request, at).await;
            Ok(answered.unwrap_or_else(Status::into_http).map(AxumBody::new))
        })
    }
}

impl Proxy {
    async fn pass(mut self, request: http::Request<AxumBody>, at: Instant) -> Result<http::Response<Body>, Status> {
        let call = request.uri().path().strip_prefix("/sublevel.v1.").map(ToOwned::to_owned);
        let question = call.filter(|call| QUESTIONS.contains(&call.as_str()));
        let (head, body) = request.into_parts();
        let body = match question {
            Some(call) => {
                let whole = to_bytes(body, LONGEST).await;
                let whole = whole.map_err(|error| Status::new(Code::OutOfRange, error.to_string()))?;
                let written = self.written.put(&call, at, &whole);
                written.map_err(|error| Status::new(Code::Internal, format!("the recording: {error}")))?;
                Body::new(AxumBody::from(whole))
            }
            None => Body::new(body),
        };
        let unreachable = |error: tonic::transport::Error| Status::new(Code::Unavailable, error.to_string());
        std::future::poll_fn(|context| self.server.poll_ready(context)).await.map_err(unreachable)?;
        self.server.call(http::Request::from_parts(head, body)).await.map_err(unreachable)
    }
}
