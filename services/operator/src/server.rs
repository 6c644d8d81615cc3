//! The web server: few connections, short requests, little patience.
//!
//! One thread. Whoever looks often gets the look before.
//! A request for a WebSocket becomes a [`crate::session`], of which there are [`crate::presence::MAX_PAGES`].

use crate::Source;
use crate::address::{Names, is_same_origin, same_secret};
use crate::assets::ASSETS;
use crate::connections::answer_for_ever;
use crate::message::{Answer, MAX_MESSAGE, Order};
use crate::metrics::{Format, render};
use crate::orders::{self, Desk};
use crate::presence::Presence;
use crate::robot::Robot;
use crate::session::converse;
use axum::Router;
use axum::body::Body;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::{DefaultBodyLimit, Request, State};
use axum::http::header::{
    ACCEPT, AUTHORIZATION, CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HOST, HeaderName, ORIGIN,
    REFERRER_POLICY, X_CONTENT_TYPE_OPTIONS,
};
use axum::http::{HeaderMap, HeaderValue, StatusCode, Uri};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::sync::Mutex;
use tokio::task::spawn_blocking;
use tokio::time::{Instant, timeout};

/// Most bytes of a request's body.
const BODY_BYTES: usize = 1 << 10;
/// Age of a look that does for one more reader.
const FRESH: Duration = Duration::from_millis(200);
/// Time a look may take.
const LOOK: Duration = Duration::from_secs(4);
/// What a page is told for which there is no room.
const FULL: (StatusCode, &str) =
    (StatusCode::SERVICE_UNAVAILABLE, "hilare: too many pages drive; close one\n");
/// What the page may do in a browser: nothing but what comes from here. A map comes as `data:`.
const POLICY: &str = "default-src 'self'; img-src 'self' data:; connect-src 'self'; object-src 'none'; \
    frame-ancestors 'none'; base-uri 'none'; form-action 'self'";

/// Who gets in.
#[derive(Clone, Debug, Default)]
pub struct Rules {
    /// What everybody has to know who wants more than the page's files, if anything.
    pub token: Option<String>,
    /// The names of this machine.
    pub names: Names,
    /// The robot stops when the last page that commanded is lost.
    pub stop_when_lost: bool,
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

/// What the answers come from.
struct Desks {
    source: Arc<dyn Source>,
    looks: Looks,
    desk: Arc<Desk>,
    presence: Arc<Presence>,
}

/// Answers on `listener` until the process ends, or says why it cannot.
pub fn serve(listener: std::net::TcpListener, source: Arc<dyn Source>, rules: Rules) -> io::Result<()> {
    listener.set_nonblocking(true)?;
    let mut runtime = tokio::runtime::Builder::new_current_thread();
    let runtime = runtime
        .enable_io()
        .enable_time()
        // One for looks that nobody waits for any more.
        .max_blocking_threads(2 + orders::THREADS)
        .thread_stack_size(1 << 20);
    runtime.build()?.block_on(async {
        let listener = TcpListener::from_std(listener)?;
        let door = Arc::clone(&source);
        let desks = Desks {
            looks: Looks { source: Arc::clone(&source), last: Mutex::new(None) },
            desk: Arc::new(Desk::new(Arc::clone(&source))),
            presence: Arc::default(),
            source,
        };
        if rules.stop_when_lost {
            let presence = Arc::clone(&desks.presence);
            tokio::spawn(presence.stop_when_lost(Arc::clone(&door), Arc::clone(&desks.desk)));
        }
        let pages = pages(Arc::new(desks), Arc::new(rules));
        answer_for_ever(listener, pages, |peer, own, verdict| door.admit(peer, own, verdict)).await;
        Ok(())
    })
}

fn pages(desks: Arc<Desks>, rules: Arc<Rules>) -> Router {
    let mut router = Router::new();
    for asset in ASSETS {
        router = router.route(asset.path, get(|| async { ([(CONTENT_TYPE, asset.kind)], asset.bytes) }));
    }
    router
        .route("/metrics", get(metrics))
        .route("/ws", get(socket))
        .route("/api/entry", get(entry))
        .route("/api/stop", post(|state, headers, body| order(Order::Stop, state, headers, body)))
        .route("/api/estop", post(|state, headers, body| order(Order::Estop, state, headers, body)))
        .with_state(desks)
        .layer(DefaultBodyLimit::max(BODY_BYTES))
        .layer(from_fn_with_state(rules, guard))
}

/// Nobody comes by another name, from another site or without what has to be known; nothing is kept or taken for
/// something else.
async fn guard(State(rules): State<Arc<Rules>>, request: Request<Body>, next: Next) -> Response {
    let mut response = match refusal(&rules, request.headers(), request.uri()) {
        None => next.run(request).await,
        Some((status, why)) => (status, format!("hilare: {why}\n")).into_response(),
    };
    let headers = response.headers_mut();
    let mut say = |name: HeaderName, value| headers.insert(name, HeaderValue::from_static(value));
    say(CACHE_CONTROL, "no-store");
    say(X_CONTENT_TYPE_OPTIONS, "nosniff");
    say(REFERRER_POLICY, "no-referrer");
    say(CONTENT_SECURITY_POLICY, POLICY);
    response
}

/// Why a request is not listened to, if so.
fn refusal(rules: &Rules, headers: &HeaderMap, uri: &Uri) -> Option<(StatusCode, &'static str)> {
    let text = |value: &HeaderValue| value.to_str().map(str::to_owned).unwrap_or_default();
    let all = |name| headers.get_all(name).iter().map(text).collect::<Vec<String>>();
    let host = match &all(HOST)[..] {
        [host] if rules.names.include(host) => host.clone(),
        _ => return Some((StatusCode::FORBIDDEN, "ask for localhost or 127.0.0.1")),
    };
    if uri.authority().is_some_and(|authority| !rules.names.include(authority.as_str())) {
        return Some((StatusCode::FORBIDDEN, "ask for localhost or 127.0.0.1"));
    }
    if ASSETS.iter().any(|asset| asset.path == uri.path()) {
        return None;
    }
    // Programs send none; browsers do whenever another site could be at work.
    if !all(ORIGIN).iter().all(|origin| is_same_origin(origin, &host)) {
        return Some((StatusCode::FORBIDDEN, "no other site speaks to the robot"));
    }
    let wanted = rules.token.as_deref()?;
    let said = all(AUTHORIZATION);
    let said = said.iter().find_map(|said| said.strip_prefix("Bearer "));
    let asked = uri.query().unwrap_or_default().split('&').find_map(|pair| pair.strip_prefix("token="));
    let known = said.or(asked).is_some_and(|token| same_secret(token, wanted));
    (!known).then_some((
        StatusCode::UNAUTHORIZED,
        "the token is wanted: open the address that hilare status shows",
    ))
}

async fn metrics(State(desks): State<Arc<Desks>>, request: Request<Body>) -> Response {
    let accept = request.headers().get(ACCEPT).and_then(|accept| accept.to_str().ok()).unwrap_or_default();
    let format = Format::accepted(accept);
    match desks.looks.fresh().await {
        Ok(robot) => ([(CONTENT_TYPE, format.content_type())], render(&robot, format)).into_response(),
        Err(why) => (StatusCode::SERVICE_UNAVAILABLE, format!("hilare: {why}\n")).into_response(),
    }
}

/// Whether a page would be let in: of a WebSocket that is refused a browser does not say why.
async fn entry(State(desks): State<Arc<Desks>>) -> Response {
    if desks.presence.has_room() { StatusCode::NO_CONTENT.into_response() } else { FULL.into_response() }
}

async fn socket(State(desks): State<Arc<Desks>>, upgrade: WebSocketUpgrade) -> Response {
    let Some(visit) = desks.presence.enter() else {
        return FULL.into_response();
    };
    upgrade
        .max_message_size(MAX_MESSAGE)
        .max_frame_size(MAX_MESSAGE)
        .read_buffer_size(16 << 10)
        .write_buffer_size(0)
        .on_upgrade(move |socket| converse(socket, Arc::clone(&desks.source), Arc::clone(&desks.desk), visit))
}

/// A stop beside the WebSocket, for a page whose socket hangs.
async fn order(order: Order, State(desks): State<Arc<Desks>>, headers: HeaderMap, body: String) -> Response {
    let json = HeaderValue::from_static("application/json");
    let is_json = headers.get(CONTENT_TYPE).is_some_and(|kind| kind.as_bytes().starts_with(json.as_bytes()));
    // What a form of another site can send is no JSON.
    let (status, answer) = if is_json && body.trim() == "{}" {
        let answer = desks.desk.carry_out(order, Arc::new(AtomicBool::new(false))).await;
        (if answer.ok { StatusCode::OK } else { StatusCode::SERVICE_UNAVAILABLE }, answer)
    } else {
        (StatusCode::BAD_REQUEST, Answer::refused("an order is {} as application/json"))
    };
    (status, [(CONTENT_TYPE, json)], answer.frame(None)).into_response()
}

#[cfg(test)]
mod tests;
