//! One viewer's WebSocket: it is told what it has subscribed to, as fast as it takes it.

use super::feed::{Feed, Seen};
use super::protocol::{Level, Request, Subscription, advertise, message_data, parse, server_info, status};
use super::server::MAX_MESSAGE;
use crate::mouth::{Mouth, is_too_big};
use crate::orders::Rate;
use axum::extract::ws::{Message, WebSocket};
use futures_util::StreamExt;
use futures_util::stream::SplitStream;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::mpsc::{Receiver, Sender, channel};
use tokio::time::{MissedTickBehavior, interval, sleep, timeout};

/// Time between two looks for what has come: 30 a second.
const LOOK: Duration = Duration::from_micros(33_333);
/// Time after which a viewer that says nothing, not even that it is there, is gone.
const SILENCE: Duration = Duration::from_secs(10);
/// Messages and bytes a second, and at once; who sends more is not listened to so often.
const MESSAGES_PER_S: f64 = 100.0;
const BYTES_PER_S: f64 = (256 << 10) as f64;
/// Words that may wait for a viewer.
const WORDS: usize = 16;

/// What a viewer follows: its numbers for channels.
#[derive(Default)]
struct Followed {
    ids: Vec<u32>,
    seen: Vec<Seen>,
}

impl Followed {
    fn add(&mut self, Subscription { id, channel_id }: Subscription, channels: usize) -> Result<(), String> {
        let channel = usize::try_from(channel_id).ok().filter(|channel| *channel < channels);
        let channel = channel.ok_or_else(|| format!("there is no channel {channel_id}"))?;
        if self.ids.contains(&id) {
            return Err(format!("subscription {id} is there already"));
        }
        // So there are never more of them than channels.
        if self.seen.iter().any(|seen| seen.channel == channel) {
            return Err(format!("channel {channel} is subscribed to already"));
        }
        self.ids.push(id);
        self.seen.push(Seen::nothing_of(channel));
        Ok(())
    }

    fn remove(&mut self, id: u32) -> Result<(), String> {
        let place = self.ids.iter().position(|known| *known == id);
        let place = place.ok_or_else(|| format!("there is no subscription {id}"))?;
        self.ids.swap_remove(place);
        self.seen.swap_remove(place);
        Ok(())
    }

    /// What has not been told, ready to send.
    fn news(&mut self, feed: &Feed) -> Vec<Vec<u8>> {
        let messages = feed.unseen(&mut self.seen);
        let framed = messages.iter().filter_map(|message| {
            let place = self.seen.iter().position(|seen| seen.channel == message.channel)?;
            Some(message_data(self.ids[place], message))
        });
        framed.collect()
    }
}

fn lock(followed: &Mutex<Followed>) -> MutexGuard<'_, Followed> {
    followed.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Serves a viewer until it goes.
pub async fn converse(socket: WebSocket, feed: Arc<Feed>, session: Arc<str>) {
    let (sink, stream) = socket.split();
    let mut mouth = Mouth::new(sink);
    for greeting in [server_info(&feed.name, &session), advertise(feed.channels())] {
        if mouth.say(Message::Text(greeting.into())).await.is_none() {
            return;
        }
    }
    let followed = Mutex::default();
    let (words, waiting) = channel(WORDS);
    let too_big = tokio::select! {
        () = tell(&mut mouth, &feed, &followed, waiting) => false,
        too_big = hear(stream, &feed, &followed, words) => too_big,
    };
    if too_big {
        mouth.too_big(MAX_MESSAGE).await;
    }
}

/// Tells what comes, and words first.
async fn tell(mouth: &mut Mouth, feed: &Feed, followed: &Mutex<Followed>, mut words: Receiver<String>) {
    let mut look = interval(LOOK);
    look.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tokio::select! {
            biased;
            word = words.recv() => {
                let Some(word) = word else { return };
                if mouth.say(Message::Text(word.into())).await.is_none() {
                    return;
                }
            }
            _ = look.tick() => {
                let news = lock(followed).news(feed);
                for message in news {
                    if mouth.say(Message::Binary(message.into())).await.is_none() {
                        return;
                    }
                }
            }
        }
        if mouth.ping().await.is_none() {
            return;
        }
    }
}

/// Hears what a viewer asks for; what cannot be is answered. True if it ends because of a message that is too long.
async fn hear(
    mut stream: SplitStream<WebSocket>,
    feed: &Feed,
    followed: &Mutex<Followed>,
    words: Sender<String>,
) -> bool {
    let (mut messages, mut bytes) =
        (Rate::new(MESSAGES_PER_S, MESSAGES_PER_S), Rate::new(BYTES_PER_S, BYTES_PER_S));
    while let Ok(Some(heard)) = timeout(SILENCE, stream.next()).await {
        let message = match heard {
            Ok(message) => message,
            Err(error) => return is_too_big(&error),
        };
        let now = Instant::now();
        let (length, wrong) = match &message {
            Message::Text(text) => (text.len(), take(text.as_str(), feed, followed)),
            Message::Binary(bytes) => {
                (bytes.len(), vec!["this is a view to look at; it takes no binary messages".to_owned()])
            }
            Message::Ping(bytes) | Message::Pong(bytes) => (bytes.len(), Vec::new()),
            Message::Close(_) => return false,
        };
        for why in wrong {
            // A viewer that does not take its words is not listened to meanwhile.
            if words.send(status(Level::Error, &why)).await.is_err() {
                return false;
            }
        }
        let wait = bytes.owe(length as f64, now).max(messages.owe(1.0, now));
        if !wait.is_zero() {
            sleep(wait).await;
        }
    }
    false
}

/// Does what a text asks for; what is wrong with it.
fn take(text: &str, feed: &Feed, followed: &Mutex<Followed>) -> Vec<String> {
    let channels = feed.channels().len();
    let mut followed = lock(followed);
    let wrong: Vec<String> = match parse(text) {
        Ok(Request::Subscribe { subscriptions }) => {
            subscriptions.into_iter().filter_map(|wanted| followed.add(wanted, channels).err()).collect()
        }
        Ok(Request::Unsubscribe { subscription_ids }) => {
            subscription_ids.into_iter().filter_map(|id| followed.remove(id).err()).collect()
        }
        Err(why) => vec![why],
    };
    // One word is enough to know that something is wrong.
    wrong.into_iter().take(1).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_channel_is_followed_once_and_under_one_number() {
        let mut followed = Followed::default();
        let mut add = |id, channel_id| followed.add(Subscription { id, channel_id }, 3);
        assert_eq!(add(10, 0), Ok(()));
        assert_eq!(add(11, 2), Ok(()));
        assert!(add(10, 1).is_err_and(|why| why.contains("subscription 10 is there already")));
        assert!(add(12, 2).is_err_and(|why| why.contains("channel 2 is subscribed to already")));
        assert!(add(12, 3).is_err_and(|why| why.contains("no channel 3")));
        assert!(add(12, u64::MAX).is_err());
        assert!(followed.remove(12).is_err());
        assert_eq!(followed.remove(10), Ok(()));
        assert_eq!((followed.ids, followed.seen), (vec![11], vec![Seen::nothing_of(2)]));
    }
}
