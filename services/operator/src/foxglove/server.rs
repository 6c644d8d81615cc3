//! Who may look: the robot's user, from this machine, with a program or a web page that is named.

use super::feed::Feed;
use super::protocol::SUBPROTOCOLS;
use super::session::converse;
use crate::Verdict;
use crate::address::Names;
use crate::connections::answer_for_ever;
use axum::Router;
use axum::extract::State;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::http::header::{HOST, ORIGIN};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use std::collections::VecDeque;
use std::io;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};
use tokio::net::TcpListener;
use tokio::sync::Notify;

/// Viewers at once; where there are more the oldest goes.
const MAX_VIEWERS: usize = 16;
/// Longest message of a viewer.
pub const MAX_MESSAGE: usize = 64 << 10;

/// Who decides about viewers.
pub trait Gate: Send + Sync + 'static {
    /// Tells `verdict`, at once or later, whether whoever is at the other end of a connection may look.
    fn admit(&self, peer: SocketAddr, own: SocketAddr, verdict: Verdict);

    /// Whether web pages from there may look. What they do is what the site wants that they are of.
    fn lets_in(&self, origin: &str) -> bool;
}

/// What a viewer is served with.
struct Desk {
    feed: Arc<Feed>,
    gate: Arc<dyn Gate>,
    session: Arc<str>,
    viewers: Mutex<VecDeque<Arc<Notify>>>,
}

/// Answers on `listener` until the process ends, or says why it cannot.
#[allow(clippy::needless_pass_by_value, reason = "what is served is this thread's from here on")]
pub fn serve(listener: std::net::TcpListener, feed: Arc<Feed>, gate: Arc<dyn Gate>) -> io::Result<()> {
    listener.set_nonblocking(true)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build()?;
    runtime.block_on(async {
        let listener = TcpListener::from_std(listener)?;
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let desk = Desk {
            feed,
            gate: Arc::clone(&gate),
            session: now.as_nanos().to_string().into(),
            viewers: Mutex::default(),
        };
        // Whatever the path: people write some.
        let pages = Router::new().fallback(view).with_state(Arc::new(desk));
        answer_for_ever(listener, pages, |peer, own, verdict| gate.admit(peer, own, verdict)).await;
        Ok(())
    })
}

async fn view(
    State(desk): State<Arc<Desk>>,
    headers: HeaderMap,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Response {
    let refusal = |status: StatusCode, why: &str| (status, format!("hilare: {why}\n")).into_response();
    let of = |name| headers.get(&name).map(|value| value.to_str().unwrap_or_default());
    let host = of(HOST).unwrap_or_default();
    if !Names::default().include(host) {
        return refusal(StatusCode::FORBIDDEN, "this is not the machine's name; use its number or localhost");
    }
    if let Some(origin) = of(ORIGIN)
        && !desk.gate.lets_in(origin)
    {
        let why = "pages of this site may not look; [operator] foxglove_origins names those that may";
        return refusal(StatusCode::FORBIDDEN, why);
    }
    let Ok(upgrade) = upgrade else {
        let how = format!(
            "a live view for Foxglove and Lichtblick; open a connection to ws://{host}/ in one of them"
        );
        return refusal(StatusCode::UPGRADE_REQUIRED, &how);
    };
    let upgrade = upgrade.protocols(SUBPROTOCOLS);
    if upgrade.selected_protocol().is_none() {
        let why = format!("this speaks the Foxglove WebSocket protocol: {}", SUBPROTOCOLS.join(" or "));
        return refusal(StatusCode::BAD_REQUEST, &why);
    }
    upgrade
        .max_message_size(MAX_MESSAGE)
        .max_frame_size(MAX_MESSAGE)
        .read_buffer_size(16 << 10)
        .write_buffer_size(0)
        .on_upgrade(move |socket| async move {
            let stay = Stay::begin(desk);
            tokio::select! {
                () = converse(socket, Arc::clone(&stay.desk.feed), Arc::clone(&stay.desk.session)) => {}
                () = stay.end.notified() => {}
            }
        })
}

/// A viewer's stay; over when it is dropped.
struct Stay {
    desk: Arc<Desk>,
    /// Told when it has to make room.
    end: Arc<Notify>,
}

impl Stay {
    fn begin(desk: Arc<Desk>) -> Self {
        let end = Arc::new(Notify::new());
        let mut viewers = desk.viewers.lock().unwrap_or_else(PoisonError::into_inner);
        if viewers.len() >= MAX_VIEWERS
            && let Some(oldest) = viewers.pop_front()
        {
            oldest.notify_one();
        }
        viewers.push_back(Arc::clone(&end));
        drop(viewers);
        Self { desk, end }
    }
}

impl Drop for Stay {
    fn drop(&mut self) {
        let mut viewers = self.desk.viewers.lock().unwrap_or_else(PoisonError::into_inner);
        viewers.retain(|end| !Arc::ptr_eq(end, &self.end));
    }
}

#[cfg(test)]
mod tests;
