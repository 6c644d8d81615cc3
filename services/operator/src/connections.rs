//! Connections of a web server: few, short before they become a WebSocket, and each judged before it is listened to.
//!
//! A connection carries one request and lives for [`CONNECTION`] at most; where there are more than
//! [`MAX_CONNECTIONS`] the oldest goes, so a newcomer always gets in.

use crate::Verdict;
use axum::Router;
use axum::http::StatusCode;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::collections::VecDeque;
use std::net::SocketAddr;
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::oneshot;
use tokio::task::AbortHandle;
use tokio::time::timeout;

/// Connections at once, but for WebSockets.
pub const MAX_CONNECTIONS: usize = 32;
/// Longest life of a connection.
const CONNECTION: Duration = Duration::from_secs(10);
/// Time for the whole of a request's head.
const HEAD: Duration = Duration::from_secs(5);
/// Most bytes of a request's head.
const HEAD_BYTES: usize = 16 << 10;
/// Most lines of it.
const HEAD_LINES: usize = 64;
/// Rest after an accept that failed, for want of descriptors.
const OUT_OF_DESCRIPTORS: Duration = Duration::from_millis(50);

/// Answers by `pages` whoever `admit` lets in. Never ends.
pub async fn answer_for_ever(
    listener: TcpListener,
    pages: Router,
    admit: impl Fn(SocketAddr, SocketAddr, Verdict),
) {
    let closed = Router::new()
        .fallback(|| async { (StatusCode::FORBIDDEN, "hilare: this robot is another user's\n") });
    let mut connections: VecDeque<AbortHandle> = VecDeque::new();
    loop {
        let Ok((stream, peer)) = listener.accept().await else {
            // The oldest may have what is wanting.
            connections.pop_front().inspect(AbortHandle::abort);
            tokio::time::sleep(OUT_OF_DESCRIPTORS).await;
            continue;
        };
        let (verdict, admitted) = oneshot::channel();
        if let Ok(own) = stream.local_addr() {
            let tell = move |admitted| {
                // A connection may be gone by then.
                let _ = verdict.send(admitted);
            };
            admit(peer, own, Box::new(tell));
        }
        connections.retain(|connection| !connection.is_finished());
        if connections.len() >= MAX_CONNECTIONS {
            connections.pop_front().inspect(AbortHandle::abort);
        }
        let answer = answer(stream, admitted, [&closed, &pages].map(Router::clone));
        connections.push_back(tokio::spawn(answer).abort_handle());
    }
}

/// One request and its answer; by the second of the pages, if it is admitted.
async fn answer(stream: TcpStream, admitted: oneshot::Receiver<bool>, [closed, pages]: [Router; 2]) {
    let admitted = matches!(timeout(HEAD, admitted).await, Ok(Ok(true)));
    let pages = if admitted { pages } else { closed };
    let _ = stream.set_nodelay(true);
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new())
        .keep_alive(false)
        .header_read_timeout(HEAD)
        .max_buf_size(HEAD_BYTES)
        .max_headers(HEAD_LINES);
    let connection = http.serve_connection(TokioIo::new(stream), TowerToHyperService::new(pages));
    // Whatever becomes of it: there is nobody to tell.
    let _ = timeout(CONNECTION, connection.with_upgrades()).await;
}
