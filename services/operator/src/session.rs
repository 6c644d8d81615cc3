//! A page's WebSocket: it is told what changes as fast as it takes it, and its orders are passed on.

use crate::Source;
use crate::live::Seen;
use crate::message::{Answer, MAX_MESSAGE, Order};
use crate::mouth::{Mouth, is_too_big};
use crate::orders::{Desk, Rate};
use crate::presence::Visit;
use axum::extract::ws::{Message, Utf8Bytes, WebSocket};
use futures_util::StreamExt;
use futures_util::stream::SplitStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tokio::sync::mpsc::{Receiver, Sender, channel};
use tokio::sync::{Mutex, OwnedMutexGuard, Semaphore};
use tokio::time::{MissedTickBehavior, interval, sleep, timeout};

/// Time between two looks for what has changed: 30 a second.
const LOOK: Duration = Duration::from_micros(33_333);
/// Time after which a page that says nothing, not even that it is there, is gone.
const SILENCE: Duration = Duration::from_secs(10);
/// Orders a second, of stops and of all others.
const ORDERS_PER_S: f64 = 50.0;
/// Messages a second of any kind; who sends more is not listened to so often.
const MESSAGES_PER_S: f64 = 200.0;
/// Bytes a second, the longest message twice at once.
const BYTES_PER_S: f64 = (2 << 20) as f64;
const BYTES: f64 = (9 << 20) as f64;
/// Answers that may wait for a page.
const ANSWERS: usize = 16;
/// Orders of a page under way at once.
const UNDER_WAY: usize = 32;

/// Serves a page until it goes.
pub async fn converse(socket: WebSocket, source: Arc<dyn Source>, desk: Arc<Desk>, visit: Visit) {
    let (sink, stream) = socket.split();
    let (answers, waiting) = channel(ANSWERS);
    let (mut mouth, ear) = (Mouth::new(sink), Ear::new(desk, answers));
    let too_big = tokio::select! {
        () = tell(&mut mouth, source, waiting) => false,
        too_big = ear.hear(stream, &visit) => too_big,
        () = visit.end.notified() => false,
    };
    if too_big {
        mouth.too_big(MAX_MESSAGE).await;
    }
}

/// Tells what changes, and the answers first.
async fn tell(mouth: &mut Mouth, source: Arc<dyn Source>, mut answers: Receiver<Utf8Bytes>) {
    let mut seen = Seen::default();
    let mut look = interval(LOOK);
    look.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        let messages = tokio::select! {
            biased;
            answer = answers.recv() => match answer {
                Some(answer) => vec![answer],
                None => return,
            },
            _ = look.tick() => source.live().unseen(&mut seen),
        };
        for message in messages {
            if mouth.say(Message::Text(message)).await.is_none() {
                return;
            }
        }
        if mouth.ping().await.is_none() {
            return;
        }
    }
}

/// What listens to a page.
struct Ear {
    desk: Arc<Desk>,
    answers: Sender<Utf8Bytes>,
    orders: Rate,
    stops: Rate,
    messages: Rate,
    bytes: Rate,
    under_way: Arc<Semaphore>,
    /// One slow order at a time.
    turn: Arc<Mutex<()>>,
    /// The newest of them: what ends it early, and whether it may be.
    newest: (Arc<AtomicBool>, bool),
}

impl Ear {
    fn new(desk: Arc<Desk>, answers: Sender<Utf8Bytes>) -> Self {
        Self {
            desk,
            answers,
            orders: Rate::new(ORDERS_PER_S, ORDERS_PER_S),
            stops: Rate::new(ORDERS_PER_S, ORDERS_PER_S),
            messages: Rate::new(MESSAGES_PER_S, MESSAGES_PER_S),
            bytes: Rate::new(BYTES_PER_S, BYTES),
            under_way: Arc::new(Semaphore::new(UNDER_WAY)),
            turn: Arc::default(),
            newest: (Arc::default(), true),
        }
    }

    /// Until the page goes; true if it is not listened to any more because of a message that is too long.
    async fn hear(mut self, mut stream: SplitStream<WebSocket>, visit: &Visit) -> bool {
        while let Ok(Some(heard)) = timeout(SILENCE, stream.next()).await {
            let message = match heard {
                Ok(message) => message,
                Err(error) => return is_too_big(&error),
            };
            let now = Instant::now();
            let length = match &message {
                Message::Text(text) => text.len(),
                Message::Binary(bytes) | Message::Ping(bytes) | Message::Pong(bytes) => bytes.len(),
                Message::Close(_) => return false,
            };
            let wait = self.bytes.owe(length as f64, now).max(self.messages.owe(1.0, now));
            match message {
                Message::Text(text) => self.take(text, visit).await,
                Message::Binary(_) => {
                    self.answer(None, Answer::refused("binary frames say nothing here; JSON does")).await;
                }
                _ => {}
            }
            if !wait.is_zero() {
                sleep(wait).await;
            }
        }
        false
    }

    async fn answer(&self, id: Option<u64>, answer: Answer) {
        // A page that is gone needs none.
        let _ = self.answers.send(answer.frame(id).into()).await;
    }

    async fn take(&mut self, text: Utf8Bytes, visit: &Visit) {
        let (id, order) = match self.desk.read(Text(text)).await {
            Ok(order) => order,
            Err((id, why)) => return self.answer(id, Answer::refused(why)).await,
        };
        let rate = if order.is_stop() { &mut self.stops } else { &mut self.orders };
        if !rate.take(Instant::now()) {
            let why = format!("too fast: {ORDERS_PER_S} orders a second at most");
            return self.answer(Some(id), Answer::refused(why)).await;
        }
        if !order.is_question() {
            visit.commands();
        }
        if let Err(why) = self.begin(id, order) {
            self.answer(Some(id), Answer::refused(why)).await;
        }
    }

    /// Has an order carried out; what comes of it is answered when it comes.
    fn begin(&mut self, id: u64, order: Order) -> Result<(), &'static str> {
        const BUSY: &str = "busy with the orders before; try again";
        let permit = if order.is_stop() {
            // Launch may be slow to answer; it is told all the same.
            None
        } else {
            Some(Arc::clone(&self.under_way).try_acquire_owned().map_err(|_| BUSY)?)
        };
        let cancelled = Arc::new(AtomicBool::new(false));
        let turn = if order.is_slow() { Some(self.turn_of(&order, &cancelled).ok_or(BUSY)?) } else { None };
        let (desk, answers) = (Arc::clone(&self.desk), self.answers.clone());
        tokio::spawn(async move {
            let held = match turn {
                Some(Turn::Now(held)) => Some(held),
                Some(Turn::Next(turn)) => Some(turn.lock_owned().await),
                None => None,
            };
            let answer = desk.carry_out(order, cancelled).await;
            drop(held);
            let _ = answers.send(answer.frame(Some(id)).into()).await;
            drop(permit);
        });
        Ok(())
    }

    /// The turn of a slow order: at once, or next if only a question is before it, which ends then.
    fn turn_of(&mut self, order: &Order, cancelled: &Arc<AtomicBool>) -> Option<Turn> {
        let turn = match Arc::clone(&self.turn).try_lock_owned() {
            Ok(held) => Turn::Now(held),
            Err(_) if self.newest.1 => {
                self.newest.0.store(true, Ordering::Relaxed);
                Turn::Next(Arc::clone(&self.turn))
            }
            Err(_) => return None,
        };
        self.newest = (Arc::clone(cancelled), order.is_question());
        Some(turn)
    }
}

/// When a slow order is carried out.
enum Turn {
    Now(OwnedMutexGuard<()>),
    Next(Arc<Mutex<()>>),
}

impl Drop for Ear {
    fn drop(&mut self) {
        // Nobody waits for it any more.
        if self.newest.1 {
            self.newest.0.store(true, Ordering::Relaxed);
        }
    }
}

/// A message's text, wherever it is read.
struct Text(Utf8Bytes);

impl AsRef<str> for Text {
    fn as_ref(&self) -> &str {
        self.0.as_str()
    }
}
