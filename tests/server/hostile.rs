//! Clients that send what no client library sends: floods of resets, bombs of headers, connections
//! of which one end is gone. Each loses its own connection, others are answered, memory stays.

use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use crate::harness::{PATIENCE, Running, command};

/// Kinds of frames of HTTP/2 (RFC 9113, section 6).
const HEADERS: u8 = 1;
const RESET: u8 = 3;
const SETTINGS: u8 = 4;
const GOAWAY: u8 = 7;
const CONTINUATION: u8 = 9;

const ACKNOWLEDGED: u8 = 1;
const END_HEADERS: u8 = 4;

fn frame(kind: u8, flags: u8, stream: u32, payload: &[u8]) -> Vec<u8> {
    let length = u32::try_from(payload.len()).expect("short").to_be_bytes();
    let head = [&length[1..], &[kind, flags], &stream.to_be_bytes()].concat();
    [head, payload.to_vec()].concat()
}

/// A header that is written out, neither indexed nor compressed (RFC 7541, section 6.2.2).
fn literal(name: &str, value: &str) -> Vec<u8> {
    [&[0][..], &text(name), &text(value)].concat()
}

/// A text with its length before it (RFC 7541, sections 5.1 and 5.2).
fn text(text: &str) -> Vec<u8> {
    let mut length = Vec::new();
    match text.len() {
        short @ ..127 => length.push(short as u8),
        long => {
            length.push(127);
            let mut rest = long - 127;
            while rest >= 128 {
                length.push((rest % 128) as u8 | 128);
                rest /= 128;
            }
            length.push(rest as u8);
        }
    }
    [length, text.as_bytes().to_vec()].concat()
}

/// The headers of a call of this service.
fn call() -> Vec<u8> {
    [
        literal(":method", "POST"),
        literal(":scheme", "http"),
        literal(":path", "/sublevel.v1.SceneService/ListScenes"),
        literal(":authority", "server"),
        literal("content-type", "application/grpc"),
        literal("te", "trailers"),
    ]
    .concat()
}

/// A connection on which both sides have said their settings.
fn greeted(server: &Running) -> TcpStream {
    let mut stream = TcpStream::connect(server.addr).expect("connected");
    stream.set_read_timeout(Some(PATIENCE)).expect("set");
    stream.write_all(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n").expect("sent");
    stream.write_all(&frame(SETTINGS, 0, 0, &[])).expect("sent");
    loop {
        let (kind, flags, _) = next(&mut stream).expect("settings");
        if (kind, flags & ACKNOWLEDGED) == (SETTINGS, 0) {
            break;
        }
    }
    stream.write_all(&frame(SETTINGS, ACKNOWLEDGED, 0, &[])).expect("sent");
    stream
}

/// The next frame; none at the end of the connection.
fn next(stream: &mut TcpStream) -> Option<(u8, u8, Vec<u8>)> {
    let mut head = [0; 9];
    stream.read_exact(&mut head).ok()?;
    let mut payload = vec![0; u32::from_be_bytes([0, head[0], head[1], head[2]]) as usize];
    stream.read_exact(&mut payload).ok()?;
    Some((head[3], head[4], payload))
}

/// Reads to the end of the connection; whether the server has said why it ends it.
fn ended(stream: &mut TcpStream) -> bool {
    let (mut said, begun) = (false, Instant::now());
    while let Some((kind, _, payload)) = next(stream) {
        // Last stream, then the code: 0 is an orderly end.
        said |= kind == GOAWAY && payload[4..8] != [0; 4];
    }
    assert!(begun.elapsed() < PATIENCE, "the connection stays open");
    said
}

/// Others are answered, and the memory is that of a server with nothing to do.
async fn is_well(server: &Running, before_mib: u64) {
    let client = server.client().await;
    assert!(client.list_scenes().await.expect("an answer").is_empty());
    let peak = server.peak_memory_mib();
    assert!(peak < before_mib + 64, "{before_mib} MiB before, {peak} MiB after");
}

/// CVE-2023-44487: each call costs the client nothing, since it takes it back at once.
#[tokio::test(flavor = "multi_thread")]
async fn a_flood_of_resets_ends_its_connection() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let before = server.peak_memory_mib();
    let mut stream = greeted(&server);
    let call = call();
    let mut sent = 0;
    'flood: for first in (1..400_000).step_by(2000) {
        let streams = (first..first + 2000).step_by(2);
        let burst = streams.flat_map(|id| [frame(HEADERS, END_HEADERS, id, &call), frame(RESET, 0, id, &[0, 0, 0, 8])]);
        if stream.write_all(&burst.collect::<Vec<_>>().concat()).is_err() {
            break 'flood;
        }
        sent += 1000;
    }
    println!("{sent} calls were taken back before the connection was closed");
    assert!(sent < 200_000, "it was never closed");
    ended(&mut stream);
    is_well(&server, before).await;
}

/// Headers without an end (CVE-2024-27316), and few bytes that stand for many (RFC 7541, 7.3).
#[tokio::test(flavor = "multi_thread")]
async fn a_bomb_of_headers_is_not_unpacked() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let before = server.peak_memory_mib();

    let mut endless = greeted(&server);
    endless.write_all(&frame(HEADERS, 0, 1, &call())).expect("sent");
    let more = frame(CONTINUATION, 0, 1, &literal("x", &"y".repeat(16_000)));
    let mut pieces = 0;
    while pieces < 10_000 && endless.write_all(&more).is_ok() {
        pieces += 1;
    }
    println!("{pieces} pieces of 16 kB were sent before the connection was closed");
    assert!(pieces < 10_000, "it was never closed");
    ended(&mut endless);

    // An entry of 3 kB in the table (section 6.2.1), and 10 000 references to it (6.1).
    let mut packed = greeted(&server);
    let entry = [&[0x40][..], &text("bomb"), &text(&"b".repeat(3000))].concat();
    let bomb = [call(), entry, vec![0x80 | 62; 10_000]].concat();
    packed.write_all(&frame(HEADERS, END_HEADERS, 1, &bomb)).expect("sent");
    packed.write_all(&frame(HEADERS, END_HEADERS, 3, &bomb)).expect("sent");
    packed.shutdown(std::net::Shutdown::Write).expect("shut");
    ended(&mut packed);
    is_well(&server, before).await;
}

/// A client whose machine is gone answers no sign of life; one that waits does, and stays.
#[tokio::test(flavor = "multi_thread")]
async fn a_connection_whose_other_end_is_gone_is_closed() {
    let dir = tempfile::tempdir().expect("a directory");
    let settings = dir.path().join("server.toml");
    std::fs::write(&settings, "[limits]\nkeepalive_s = 1\nkeepalive_timeout_s = 0.5\n").expect("written");
    let mut serve = command(&dir.path().join("data"));
    serve.arg("--config").arg(&settings);
    let server = Running::spawn(serve);
    let waiting = server.client().await;
    let mut gone = greeted(&server);
    // It reads, so that the sign is seen, and says nothing.
    let (mut asked, begun) = (false, Instant::now());
    while let Some((kind, flags, _)) = next(&mut gone) {
        // A ping (section 6.7).
        asked |= (kind, flags & ACKNOWLEDGED) == (6, 0);
    }
    assert!(asked && begun.elapsed() < PATIENCE);
    assert!(begun.elapsed() > Duration::from_millis(900), "before it was asked: {:?}", begun.elapsed());
    match gone.write_all(&frame(SETTINGS, 0, 0, &[])).and_then(|()| gone.read(&mut [0; 1])) {
        Ok(count) => assert_eq!(count, 0),
        Err(error) => assert!(matches!(error.kind(), ErrorKind::BrokenPipe | ErrorKind::ConnectionReset), "{error}"),
    }
    assert!(waiting.list_scenes().await.expect("its connection is open").is_empty());
}
