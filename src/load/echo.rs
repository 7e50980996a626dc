//! A server that answers each call at once with as many bytes as were recorded: what remains of the
//! time of a call is the transport's. Encrypted, it takes a key and a certificate of its own.

use std::collections::VecDeque;
use std::convert::Infallible;
use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::pin::Pin;
use std::task::{Context, Poll};

use bytes::{BufMut, Bytes, BytesMut};
use http_body::{Body as HttpBody, Frame, SizeHint};
use tokio::net::TcpListener;
use tokio::task::JoinHandle;
use tokio_stream::wrappers::TcpListenerStream;
use tonic::Status;
use tonic::body::Body;
use tonic::codegen::{BoxFuture, Service, http};
use tonic::server::NamedService;
use tonic::transport::{Identity, ServerTlsConfig};

/// What a client may send before it is read, bytes: as much as to the server.
const WINDOW_BYTES: u32 = 1 << 20;

/// An echo server that runs until it is dropped.
#[derive(Debug)]
pub struct Echo {
    addr: SocketAddr,
    certificate: Option<String>,
    serving: JoinHandle<()>,
}

impl Echo {
    /// Where it is.
    pub fn addr(&self) -> SocketAddr {
        self.addr
    }

    /// Its certificate, PEM, where it is encrypted.
    pub fn certificate(&self) -> Option<&str> {
        self.certificate.as_deref()
    }
}

impl Drop for Echo {
    fn drop(&mut self) {
        self.serving.abort();
    }
}

/// Starts a server on loopback that answers every call of QueryService with a message of so many
/// bytes, when it has read the call. Encrypted like a server with certificates: TLS by the same
/// library, with a new key.
///
/// # Errors
/// When there is no port for it, or no key.
pub async fn echo(answer_bytes: usize, encrypted: bool) -> io::Result<Echo> {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await?;
    let addr = listener.local_addr()?;
    let mut answer = BytesMut::with_capacity(answer_bytes + 16);
    // A field that no message has, so that it is skipped: its tag, its length, its bytes.
    let filler = vec![0x5a; answer_bytes.saturating_sub(8)];
    let mut message = Vec::new();
    prost::encoding::bytes::encode(4095, &filler, &mut message);
    answer.put_u8(0);
    answer.put_u32(u32::try_from(message.len()).unwrap_or(u32::MAX));
    answer.extend_from_slice(&message);
    let service = EchoService { answer: answer.freeze() };
    let mut server = tonic::transport::Server::builder()
        .initial_stream_window_size(WINDOW_BYTES)
        .initial_connection_window_size(2 * WINDOW_BYTES);
    let mut certificate = None;
    if encrypted {
        let own = rcgen::generate_simple_self_signed([addr.ip().to_string()]).map_err(io::Error::other)?;
        let identity = Identity::from_pem(own.cert.pem(), own.signing_key.serialize_pem());
        server = server.tls_config(ServerTlsConfig::new().identity(identity)).map_err(io::Error::other)?;
        certificate = Some(own.cert.pem());
    }
    let serving = tokio::spawn(async move {
        let served = server.add_service(service).serve_with_incoming(TcpListenerStream::new(listener));
        // Ended by dropping it.
        let _ = served.await;
    });
    Ok(Echo { addr, certificate, serving })
}

#[derive(Clone, Debug)]
struct EchoService {
    answer: Bytes,
}

impl NamedService for EchoService {
    const NAME: &'static str = "sublevel.v1.QueryService";
}

impl Service<http::Request<Body>> for EchoService {
    type Response = http::Response<Body>;
    type Error = Infallible;
    type Future = BoxFuture<Self::Response, Infallible>;

    fn poll_ready(&mut self, _: &mut Context<'_>) -> Poll<Result<(), Infallible>> {
        Poll::Ready(Ok(()))
    }

    fn call(&mut self, request: http::Request<Body>) -> Self::Future {
        let answer = self.answer.clone();
        Box::pin(async move {
            let mut body = request.into_body();
            // Read whole, as a server does.
            while std::future::poll_fn(|context| Pin::new(&mut body).poll_frame(context)).await.is_some() {}
            let mut trailers = http::HeaderMap::new();
            trailers.insert("grpc-status", http::HeaderValue::from_static("0"));
            let frames = VecDeque::from([Frame::data(answer), Frame::trailers(trailers)]);
            let mut response = http::Response::new(Body::new(Frames(frames)));
            let kind = http::HeaderValue::from_static("application/grpc");
            response.headers_mut().insert(http::header::CONTENT_TYPE, kind);
            Ok(response)
        })
    }
}

/// A body whose frames are there already.
struct Frames(VecDeque<Frame<Bytes>>);

impl HttpBody for Frames {
    type Data = Bytes;
    type Error = Status;

    fn poll_frame(mut self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, Status>>> {
        Poll::Ready(self.0.pop_front().map(Ok))
    }

    fn is_end_stream(&self) -> bool {
        self.0.is_empty()
    }

    fn size_hint(&self) -> SizeHint {
        SizeHint::default()
    }
}
