use super::*;
use crate::foxglove::Channel;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;

struct Open;

impl Gate for Open {
    fn admit(&self, _: SocketAddr, _: SocketAddr, verdict: Verdict) {
        verdict(true);
    }

    fn lets_in(&self, origin: &str) -> bool {
        origin == "https://app.foxglove.dev"
    }
}

fn begin() -> (SocketAddr, Arc<Feed>) {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("its address");
    let channel = Channel {
        topic: "/odom".to_owned(),
        encoding: "cdr",
        schema_name: "nav_msgs/msg/Odometry".to_owned(),
        schema: "float64 x\n".to_owned(),
        schema_encoding: "ros2msg",
    };
    let feed = Arc::new(Feed::new("mule".to_owned(), vec![channel]));
    let served = Arc::clone(&feed);
    std::thread::spawn(move || serve(listener, served, Arc::new(Open)));
    (address, feed)
}

/// Asks for a WebSocket; the stream after the answer's head, and the answer.
fn knock(address: SocketAddr, headers: &str) -> (TcpStream, String) {
    let mut stream = TcpStream::connect(address).expect("a connection");
    stream.set_read_timeout(Some(Duration::from_secs(30))).expect("a time-out");
    let head = format!(
        "GET / HTTP/1.1\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
         Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n{headers}\r\n"
    );
    stream.write_all(head.as_bytes()).expect("it is taken");
    let (mut answer, mut byte) = (Vec::new(), [0]);
    while !answer.ends_with(b"\r\n\r\n") && stream.read(&mut byte).is_ok_and(|read| read == 1) {
        answer.push(byte[0]);
    }
    (stream, String::from_utf8_lossy(&answer).into_owned())
}

/// A short frame, masked with nothing.
fn frame(text: &str) -> Vec<u8> {
    [&[0x81, 0xfe][..], &(text.len() as u16).to_be_bytes(), &[0; 4], text.as_bytes()].concat()
}

/// The payload of the next frame that is no ping.
fn next(stream: &mut TcpStream) -> Vec<u8> {
    loop {
        let mut head = [0; 2];
        stream.read_exact(&mut head).expect("a frame");
        let mut length = [0; 8];
        let length = match head[1] {
            126 => {
                stream.read_exact(&mut length[6..]).expect("its length");
                u64::from_be_bytes(length)
            }
            127 => {
                stream.read_exact(&mut length).expect("its length");
                u64::from_be_bytes(length)
            }
            short => u64::from(short),
        };
        let mut payload = vec![0; usize::try_from(length).expect("a length")];
        stream.read_exact(&mut payload).expect("its payload");
        if head[0] & 0x0f != 9 {
            return payload;
        }
    }
}

const SDK: &str = "Sec-WebSocket-Protocol: other, foxglove.websocket.v1, foxglove.sdk.v1\r\n";

#[test]
fn who_may_look_is_told_who_it_is_and_what_there_is_and_the_rest_is_answered() {
    let (address, feed) = begin();
    let host = format!("Host: {address}\r\n");
    for (headers, status) in [
        (format!("{host}{SDK}Origin: http://evil.example\r\n"), "403"),
        (format!("{host}{SDK}Origin: null\r\n"), "403"),
        (format!("{host}{SDK}Origin: http://{address}\r\n"), "403"),
        (format!("Host: evil.example\r\n{SDK}"), "403"),
        (SDK.to_owned(), "403"),
        (host.clone(), "400"),
        (format!("{host}Sec-WebSocket-Protocol: foxglove.sdk.v10\r\n"), "400"),
    ] {
        let (_, answer) = knock(address, &headers);
        assert!(answer.starts_with(&format!("HTTP/1.1 {status} ")), "{headers}{answer}");
    }
    for (headers, chosen) in [
        (format!("{host}{SDK}"), "foxglove.sdk.v1"),
        (format!("Host: localhost\r\n{SDK}Origin: https://app.foxglove.dev\r\n"), "foxglove.sdk.v1"),
        (format!("{host}Sec-WebSocket-Protocol: foxglove.websocket.v1\r\n"), "foxglove.websocket.v1"),
    ] {
        let (mut stream, answer) = knock(address, &headers);
        let told = format!("sec-websocket-protocol: {chosen}\r\n");
        assert!(answer.starts_with("HTTP/1.1 101 ") && answer.contains(&told), "{headers}{answer}");
        for op in ["serverInfo", "advertise"] {
            let text = String::from_utf8(next(&mut stream)).expect("text");
            assert!(text.contains(&format!("\"op\":\"{op}\"")), "{text}");
        }
        let subscribe = r#"{"op":"subscribe","subscriptions":[{"id":5,"channelId":0}]}"#;
        stream.write_all(&frame(subscribe)).expect("it is taken");
        assert!(feed.publish(0, 1, &[42]));
        assert_eq!(next(&mut stream), [1, 5, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 42]);
        stream.write_all(&frame(r#"{"op":"advertise","channels":[]}"#)).expect("it is taken");
        let text = String::from_utf8(next(&mut stream)).expect("text");
        assert!(text.contains("this is a view to look at"), "{text}");
    }
}

#[test]
fn who_comes_with_a_browser_is_told_what_this_is() {
    let (address, _) = begin();
    let mut stream = TcpStream::connect(address).expect("a connection");
    let request = format!("GET / HTTP/1.1\r\nHost: {address}\r\n\r\n");
    stream.write_all(request.as_bytes()).expect("it is taken");
    let mut answer = String::new();
    stream.read_to_string(&mut answer).expect("an answer");
    assert!(answer.starts_with("HTTP/1.1 426 ") && answer.contains(&format!("ws://{address}/")), "{answer}");
}

#[test]
fn where_there_are_too_many_the_oldest_goes() {
    let (address, _) = begin();
    let headers = format!("Host: {address}\r\n{SDK}");
    let mut viewers: Vec<TcpStream> = Vec::new();
    for _ in 0..=MAX_VIEWERS {
        let (mut stream, answer) = knock(address, &headers);
        assert!(answer.starts_with("HTTP/1.1 101 "), "{answer}");
        next(&mut stream);
        viewers.push(stream);
    }
    let mut rest = Vec::new();
    let ended = viewers[0].read_to_end(&mut rest);
    assert!(ended.is_ok() || ended.is_err_and(|error| error.kind() == io::ErrorKind::ConnectionReset));
    // The newest is there.
    let last = &mut viewers[MAX_VIEWERS];
    last.write_all(&frame("garbage")).expect("it is taken");
    next(last);
    assert!(String::from_utf8_lossy(&next(last)).contains("\"level\":2"));
}
