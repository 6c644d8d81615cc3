//! How a WebSocket is spoken to, whoever is at its other end.

use axum::extract::ws::{Message, WebSocket};
use futures_util::SinkExt;
use futures_util::stream::SplitSink;
use std::time::{Duration, Instant};
use tokio::time::timeout;

/// Time the other end has to take a message.
const PATIENCE: Duration = Duration::from_secs(5);
/// Time between two pings: whoever is gone is noticed.
const PING: Duration = Duration::from_secs(3);

/// What is said to the other end.
pub struct Mouth {
    sink: SplitSink<WebSocket, Message>,
    pinged: Instant,
}

impl Mouth {
    /// Of a WebSocket.
    pub fn new(sink: SplitSink<WebSocket, Message>) -> Self {
        Self { sink, pinged: Instant::now() }
    }

    /// `None` if the other end does not take it.
    pub async fn say(&mut self, message: Message) -> Option<()> {
        timeout(PATIENCE, self.sink.send(message)).await.ok()?.ok()
    }

    /// Pings if it is time to; `None` as with [`Self::say`].
    pub async fn ping(&mut self) -> Option<()> {
        if self.pinged.elapsed() < PING {
            return Some(());
        }
        self.pinged = Instant::now();
        self.say(Message::Ping(Vec::new().into())).await
    }
}
