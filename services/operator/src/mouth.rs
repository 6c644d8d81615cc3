//! How a WebSocket is spoken to, whoever is at its other end.

use axum::extract::ws::{CloseFrame, Message, WebSocket, close_code};
use futures_util::SinkExt;
use futures_util::stream::SplitSink;
use std::time::{Duration, Instant};
use tokio::time::{sleep, timeout};

/// Time the other end has to take a message.
const PATIENCE: Duration = Duration::from_secs(5);
/// Time between two pings: whoever is gone is noticed.
const PING: Duration = Duration::from_secs(3);
/// Time in which the other end, which is still sending, may hear why it is not listened to any more.
const LAST_WORD: Duration = Duration::from_millis(500);

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

    /// Ends it because of a message of more than `most` bytes.
    pub async fn too_big(&mut self, most: usize) {
        let reason = format!("a message has at most {most} bytes").into();
        let close = CloseFrame { code: close_code::SIZE, reason };
        if self.say(Message::Close(Some(close))).await.is_some() {
            sleep(LAST_WORD).await;
        }
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

/// Whether it cannot be heard because it is too long. tungstenite's own error is inside, a crate that is not named here.
pub fn is_too_big(unheard: &axum::Error) -> bool {
    unheard.to_string().contains("Message too long")
}
