//! What is said between a viewer and a server that only publishes.
//!
//! Foxglove WebSocket protocol, `github.com/foxglove/ws-protocol`, docs/spec.md: text is JSON with an `op`, binary
//! begins with an opcode. `foxglove.sdk.v1` is the same under the name of the Foxglove SDK.

use super::feed::{Channel, Message};
use serde::Deserialize;
use serde_json::json;

/// Names of the protocol, the one that is preferred first: that of today's Foxglove and Lichtblick, and that of
/// older ones.
pub const SUBPROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
/// Opcode of a message.
const MESSAGE_DATA: u8 = 1;

/// How grave a word to a viewer is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// It goes on with less.
    Warning = 1,
    /// Something was asked for that is not done.
    Error = 2,
}

/// Who this is; nothing is offered but to look. Another `session` than before tells a viewer to forget what it has.
pub fn server_info(name: &str, session: &str) -> String {
    json!({ "op": "serverInfo", "name": name, "capabilities": [], "metadata": {}, "sessionId": session })
        .to_string()
}

/// Which channels there are; their ids are their places.
pub fn advertise(channels: &[Channel]) -> String {
    let told = |(id, channel): (usize, &Channel)| {
        json!({
            "id": id, "topic": channel.topic, "encoding": channel.encoding,
            "schemaName": channel.schema_name, "schema": channel.schema, "schemaEncoding": channel.schema_encoding,
        })
    };
    let channels: Vec<_> = channels.iter().enumerate().map(told).collect();
    json!({ "op": "advertise", "channels": channels }).to_string()
}

/// A word to whoever reads the viewer's list of problems.
pub fn status(level: Level, message: &str) -> String {
    json!({ "op": "status", "level": level as u8, "message": message }).to_string()
}

/// A message, for the subscription a viewer has named.
pub fn message_data(subscription: u32, message: &Message) -> Vec<u8> {
    let head = [&[MESSAGE_DATA][..], &subscription.to_le_bytes(), &message.time_ns.to_le_bytes()];
    [&head.concat()[..], &message.bytes].concat()
}

/// A subscription a viewer asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Subscription {
    /// The viewer's own number for it.
    pub id: u32,
    /// Which channel.
    pub channel_id: u64,
}

/// What a viewer may ask for.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
pub enum Request {
    /// To be told of channels.
    Subscribe {
        /// Of which.
        subscriptions: Vec<Subscription>,
    },
    /// No longer.
    Unsubscribe {
        /// Numbers of the subscriptions.
        subscription_ids: Vec<u32>,
    },
}

/// What a text asks for, or what is wrong with it.
pub fn parse(text: &str) -> Result<Request, String> {
    #[derive(Deserialize)]
    struct Op {
        op: String,
    }
    serde_json::from_str(text).map_err(|error| match serde_json::from_str::<Op>(text) {
        Ok(Op { op }) if !["subscribe", "unsubscribe"].contains(&&*op) => {
            let op: String = op.chars().filter(|c| !c.is_control()).take(32).collect();
            format!("{op}: this is a view to look at; it takes subscribe and unsubscribe")
        }
        _ => format!("no message of the Foxglove WebSocket protocol: {error}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    #[test]
    fn messages_are_laid_out_as_the_specification_has_them() {
        let message =
            Message { channel: 7, number: 1, time_ns: 0x0102_0304_0506_0708, bytes: vec![0xAA, 0xBB] };
        let bytes = message_data(0x1122_3344, &message);
        assert_eq!(bytes, [1, 0x44, 0x33, 0x22, 0x11, 8, 7, 6, 5, 4, 3, 2, 1, 0xAA, 0xBB]);
        let channel = Channel {
            topic: "/odom".to_owned(),
            encoding: "cdr",
            schema_name: "nav_msgs/msg/Odometry".to_owned(),
            schema: "x \"y\"\n".to_owned(),
            schema_encoding: "ros2msg",
        };
        let told: Value = serde_json::from_str(&advertise(&[channel.clone(), channel])).expect("JSON");
        assert_eq!((&told["op"], &told["channels"][1]["id"]), (&"advertise".into(), &1.into()));
        assert_eq!(told["channels"][1]["schema"], "x \"y\"\n");
        let info: Value = serde_json::from_str(&server_info("mule", "7")).expect("JSON");
        assert_eq!((&info["op"], &info["sessionId"]), (&"serverInfo".into(), &"7".into()));
        assert_eq!(info["capabilities"], Value::Array(Vec::new()), "nothing can be done here");
        let word: Value = serde_json::from_str(&status(Level::Error, "no")).expect("JSON");
        assert_eq!((&word["op"], &word["level"]), (&"status".into(), &2.into()));
    }

    #[test]
    fn requests_are_read_and_everything_else_is_answered() {
        let subscribe = r#"{"op":"subscribe","subscriptions":[{"id":3,"channelId":1}],"more":0}"#;
        let wanted = Request::Subscribe { subscriptions: vec![Subscription { id: 3, channel_id: 1 }] };
        assert_eq!(parse(subscribe), Ok(wanted));
        let gone = Request::Unsubscribe { subscription_ids: vec![3] };
        assert_eq!(parse(r#"{"op":"unsubscribe","subscriptionIds":[3]}"#), Ok(gone));
        for (text, said) in [
            (r#"{"op":"advertise","channels":[]}"#, "advertise: this is a view to look at"),
            (r#"{"op":"setParameters","parameters":[]}"#, "setParameters: this is a view"),
            (r#"{"op":"subscribe","subscriptions":[{"id":-1,"channelId":1}]}"#, "no message of the Foxglove"),
            (r#"{"op":"subscribe"}"#, "missing field"),
            ("garbage", "no message of the Foxglove"),
            ("", "no message of the Foxglove"),
            ("[]", "no message of the Foxglove"),
        ] {
            let why = parse(text).expect_err(text);
            assert!(why.contains(said) && !why.contains('\n'), "{text}: {why}");
        }
    }
}
