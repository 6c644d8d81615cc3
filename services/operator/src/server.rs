//! The web server: few connections, short requests, little patience.
//!
//! One thread. A connection carries one request and lives for [`CONNECTION`] at most; where there are more than
//! [`MAX_CONNECTIONS`] the oldest goes, so a newcomer always gets in. Whoever looks often gets the look before.

use crate::address::is_own_name;
use crate::metrics::{Format, render};
use crate::robot::Robot;
use axum::Router;
use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::header::{ACCEPT, CACHE_CONTROL, CONTENT_TYPE, HOST, X_CONTENT_TYPE_OPTIONS};
use axum::http::{HeaderValue, StatusCode};
use axum::middleware::{Next, from_fn};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::collections::VecDeque;
use std::io;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Mutex;
use tokio::task::{AbortHandle, spawn_blocking};
use tokio::time::timeout;

/// Connections at once.
const MAX_CONNECTIONS: usize = 32;
/// Longest life of a connection.
const CONNECTION: Duration = Duration::from_secs(10);
/// Time for the whole of a request's head.
const HEAD: Duration = Duration::from_secs(5);
/// Most bytes of a request's head.
const HEAD_BYTES: usize = 16 << 10;
/// Most lines of it.
const HEAD_LINES: usize = 64;
/// Age of a look that does for one more reader.
const FRESH: Duration = Duration::from_millis(200);
/// Time a look may take.
const LOOK: Duration = Duration::from_secs(4);
/// Rest after an accept that failed, for want of descriptors.
const OUT_OF_DESCRIPTORS: Duration = Duration::from_millis(50);

/// Where a robot's state comes from.
pub trait Source: Send + Sync + 'static {
    /// A look at the robot, or why there is none. May block for seconds.
    fn look(&self) -> Result<Robot, String>;
}

/// Looks for all readers.
struct Looks {
    source: Arc<dyn Source>,
    last: Mutex<Option<(Instant, Arc<Robot>)>>,
}

impl Looks {
    /// A look that is fresh; readers that come meanwhile wait for it.
    async fn fresh(&self) -> Result<Arc<Robot>, String> {
        let mut last = self.last.lock().await;
        if let Some((when, robot)) = &*last
            && when.elapsed() < FRESH
        {
            return Ok(Arc::clone(robot));
        }
        let source = Arc::clone(&self.source);
        let look = timeout(LOOK, spawn_blocking(move || source.look())).await;
        let robot = look.map_err(|_| "launch does not answer")?.map_err(|_| "the look failed")??;
        let robot = Arc::new(robot);
        *last = Some((Instant::now(), Arc::clone(&robot)));
        Ok(robot)
    }
}

/// Answers on `listener` until the process ends, or says why it cannot.
pub fn serve(listener: std::net::TcpListener, source: Arc<dyn Source>) -> io::Result<()> {
    listener.set_nonblocking(true)?;
    let mut runtime = tokio::runtime::Builder::new_current_thread();
    let runtime = runtime.enable_io().enable_time().max_blocking_threads(2).thread_stack_size(256 << 10);
    runtime.build()?.block_on(async {
        let listener = TcpListener::from_std(listener)?;
        let pages = pages(Arc::new(Looks { source, last: Mutex::new(None) }));
        let mut connections: VecDeque<AbortHandle> = VecDeque::new();
        loop {
            let Ok((stream, _)) = listener.accept().await else {
                // The oldest may have what is wanting.
                connections.pop_front().inspect(AbortHandle::abort);
                tokio::time::sleep(OUT_OF_DESCRIPTORS).await;
                continue;
            };
            connections.retain(|connection| !connection.is_finished());
            if connections.len() >= MAX_CONNECTIONS {
                connections.pop_front().inspect(AbortHandle::abort);
            }
            connections.push_back(tokio::spawn(converse(stream, pages.clone())).abort_handle());
        }
    })
}

/// One request and its answer.
async fn converse(stream: TcpStream, pages: Router) {
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new())
        .keep_alive(false)
        .header_read_timeout(HEAD)
        .max_buf_size(HEAD_BYTES)
        .max_headers(HEAD_LINES);
    let connection = http.serve_connection(TokioIo::new(stream), TowerToHyperService::new(pages));
    // Whatever becomes of it: there is nobody to tell.
    let _ = timeout(CONNECTION, connection).await;
}

fn pages(looks: Arc<Looks>) -> Router {
    let front = "hilare: /metrics is for Prometheus\n";
    Router::new()
        .route("/", get(move || async move { front }))
        .route("/metrics", get(metrics))
        .with_state(looks)
        .layer(from_fn(guard))
}

/// Nobody comes by another name, and nothing is kept or taken for something else.
async fn guard(request: Request<Body>, next: Next) -> Response {
    let text = |value: &HeaderValue| value.to_str().map(str::to_owned).unwrap_or_default();
    let hosts: Vec<String> = request.headers().get_all(HOST).iter().map(text).collect();
    let named = request.uri().authority().is_none_or(|authority| is_own_name(authority.as_str()));
    let mut response = match &hosts[..] {
        [host] if is_own_name(host) && named => next.run(request).await,
        _ => (StatusCode::FORBIDDEN, "hilare: ask for localhost or 127.0.0.1\n").into_response(),
    };
    let headers = response.headers_mut();
    headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    headers.insert(X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    response
}

async fn metrics(State(looks): State<Arc<Looks>>, request: Request<Body>) -> Response {
    let accept = request.headers().get(ACCEPT).and_then(|accept| accept.to_str().ok()).unwrap_or_default();
    let format = Format::accepted(accept);
    match looks.fresh().await {
        Ok(robot) => ([(CONTENT_TYPE, format.content_type())], render(&robot, format)).into_response(),
        Err(why) => (StatusCode::SERVICE_UNAVAILABLE, format!("hilare: {why}\n")).into_response(),
    }
}

#[cfg(test)]
mod tests;
