use super::*;
use crate::message::State;
use crate::presence::MAX_PAGES;
use serde_json::{Value, json};
use std::net::TcpStream;

const PATIENCE: Duration = Duration::from_secs(30);
const PING: u8 = 9;
const PONG: u8 = 10;

/// A page of the test: frames by hand, so that what no browser would send can be sent.
struct Client {
    stream: TcpStream,
    answers_pings: bool,
}

impl Client {
    /// Asks for a WebSocket; the answer's head if there is none.
    fn ask(address: SocketAddr, target: &str, headers: &str) -> Result<Self, String> {
        let mut stream = TcpStream::connect(address).expect("a connection");
        stream.set_read_timeout(Some(PATIENCE)).expect("a time-out");
        let head = format!(
            "GET {target} HTTP/1.1\r\nHost: {address}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
             Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n{headers}\r\n"
        );
        let _ = stream.write_all(head.as_bytes());
        let mut answer = Vec::new();
        let mut byte = [0];
        while !answer.ends_with(b"\r\n\r\n") && stream.read(&mut byte).is_ok_and(|read| read == 1) {
            answer.push(byte[0]);
        }
        let answer = String::from_utf8_lossy(&answer).into_owned();
        if answer.starts_with("HTTP/1.1 101 ") {
            Ok(Self { stream, answers_pings: true })
        } else {
            Err(answer)
        }
    }

    fn open(address: SocketAddr) -> Self {
        Self::ask(address, "/ws", &format!("Origin: http://{address}\r\n")).expect("a WebSocket")
    }

    fn send(&mut self, opcode: u8, payload: &[u8]) -> io::Result<()> {
        let mut frame = vec![0x80 | opcode];
        match payload.len() {
            length @ 0..126 => frame.push(0x80 | length as u8),
            length @ 126..65_536 => {
                frame.push(0x80 | 126);
                frame.extend((length as u16).to_be_bytes());
            }
            length => {
                frame.push(0x80 | 127);
                frame.extend((length as u64).to_be_bytes());
            }
        }
        // Masked with nothing.
        frame.extend([0; 4]);
        frame.extend(payload);
        self.stream.write_all(&frame)
    }

    fn order(&mut self, order: &Value) {
        self.send(1, order.to_string().as_bytes()).expect("it is taken");
    }

    /// The next frame; `None` at the end.
    fn frame(&mut self) -> Option<(u8, Vec<u8>)> {
        let mut head = [0; 2];
        self.stream.read_exact(&mut head).ok()?;
        let mut bytes = |count: usize| {
            let mut bytes = vec![0; count];
            self.stream.read_exact(&mut bytes).ok().map(|()| bytes)
        };
        let length = match head[1] {
            126 => bytes(2)?.iter().fold(0, |length, byte| length << 8 | *byte as usize),
            127 => bytes(8)?.iter().fold(0, |length, byte| length << 8 | *byte as usize),
            short => short as usize,
        };
        let (opcode, payload) = (head[0] & 0xf, bytes(length)?);
        if opcode == PING && self.answers_pings {
            self.send(PONG, &payload).ok()?;
        }
        Some((opcode, payload))
    }

    /// The next message of a type.
    fn next(&mut self, kind: &str) -> Value {
        loop {
            let (opcode, payload) = self.frame().unwrap_or_else(|| panic!("the end instead of {kind}"));
            if opcode == 1 {
                let message: Value = serde_json::from_slice(&payload).expect("JSON");
                if message["type"] == kind {
                    return message;
                }
            }
        }
    }

    fn answer_to(&mut self, id: impl Into<Value>) -> Value {
        let id = id.into();
        loop {
            let answer = self.next("answer");
            if answer["id"] == id {
                return answer;
            }
        }
    }
}

fn page() -> (SocketAddr, Arc<Counted>) {
    let (address, source) = started(false);
    source.live.set_hello(&json!({ "robot": "mule" }));
    (address, source)
}

#[test]
fn a_page_is_told_what_changes_and_its_orders_are_carried_out() {
    let (address, source) = page();
    let mut client = Client::open(address);
    assert_eq!(client.next("hello")["robot"], "mule");
    source.live.set_state(State { tick: 7, ..State::default() });
    assert_eq!(client.next("state")["tick"], 7);
    client.order(&json!({ "id": 1, "do": "arm" }));
    assert_eq!(client.answer_to(1), json!({ "type": "answer", "id": 1, "ok": true, "message": "Arm" }));
    for (opcode, text, said) in [
        (1, "", "EOF"),
        (1, "\u{0}garbage", "expected value"),
        (1, "{\"id\":1,\"do\":\"swap\"", "EOF"),
        (2, "{\"id\":1,\"do\":\"stop\"}", "binary frames say nothing"),
    ] {
        client.send(opcode, text.as_bytes()).expect("it is taken");
        let answer = client.answer_to(Value::Null);
        assert!(answer["ok"] == false && answer["message"].as_str().expect("why").contains(said), "{answer}");
    }
    client.order(&json!({ "id": 5, "do": "dance" }));
    assert_eq!(client.answer_to(5)["ok"], false);
    // What is no text at all ends it.
    client.send(1, &[0xff, 0xfe]).expect("it is taken");
    while let Some((opcode, _)) = client.frame() {
        assert_ne!(opcode, 2);
    }
    assert_eq!(*source.orders.lock().expect("orders"), [Order::Arm]);
}

#[test]
fn a_newer_question_ends_the_older_and_a_stop_waits_for_neither() {
    let (address, source) = page();
    let (mut client, mut other) = (Client::open(address), Client::open(address));
    let predict = |id: u64| json!({ "id": id, "do": "predict", "waypoints": [[0, 0, 0, 0], [1, 0, 0, 0]] });
    // This one never ends by itself, and holds the place of all questions.
    other.order(&predict(1));
    (1..=4).for_each(|id| client.order(&predict(id)));
    for id in 1..=3 {
        let answer = client.answer_to(id);
        assert_eq!((&answer["ok"], &answer["message"]), (&json!(false), &json!("overtaken by a newer one")));
    }
    client.order(&json!({ "id": 9, "do": "stop" }));
    assert_eq!(client.answer_to(9)["ok"], true);
    // What the robot is to do is not kept waiting by a question either.
    client.order(&json!({ "id": 10, "do": "goal", "x_m": 1, "y_m": 2 }));
    assert_eq!(client.answer_to(4)["message"], "overtaken by a newer one");
    assert_eq!(client.answer_to(10)["ok"], true);
    // Who has gone asks nothing any more.
    drop(other);
    client.order(&predict(11));
    let began = Instant::now();
    while source.orders.lock().expect("orders").iter().filter(|order| order.is_question()).count() < 2 {
        assert!(began.elapsed() < PATIENCE, "it has its turn once the other is gone");
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn no_other_site_and_no_stranger_speaks_to_the_robot() {
    let (address, source) = page();
    for (host, origin, status) in [
        (address.to_string(), "http://evil.example".to_owned(), "403"),
        (address.to_string(), "null".to_owned(), "403"),
        (address.to_string(), format!("http://localhost:{}", address.port()), "403"),
        ("evil.example".to_owned(), "http://evil.example".to_owned(), "403"),
    ] {
        for request in [
            format!(
                "GET /ws HTTP/1.1\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nHost: {host}\r\nOrigin: {origin}\r\n\r\n"
            ),
            format!(
                "POST /api/stop HTTP/1.1\r\nHost: {host}\r\nOrigin: {origin}\r\nContent-Type: application/json\r\nContent-Length: 2\r\n\r\n{{}}"
            ),
            format!("GET /metrics HTTP/1.1\r\nHost: {host}\r\nOrigin: {origin}\r\n\r\n"),
        ] {
            let got = answer(address, &request);
            assert!(got.starts_with(&format!("HTTP/1.1 {status} ")), "{request}{got}");
        }
    }
    assert!(source.orders.lock().expect("orders").is_empty());
    let post = |path: &str, kind: &str, body: &str| {
        let length = body.len();
        answer(
            address,
            format!(
                "POST {path} HTTP/1.1\r\nHost: {address}\r\nOrigin: http://{address}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\n\r\n{body}"
            ),
        )
    };
    assert!(post("/api/stop", "text/plain", "{}").starts_with("HTTP/1.1 400 "));
    assert!(post("/api/stop", "application/json", "{\"now\":1}").starts_with("HTTP/1.1 400 "));
    assert!(post("/api/stop", "application/json", &"x".repeat(1 << 20)).starts_with("HTTP/1.1 413 "));
    assert!(source.orders.lock().expect("orders").is_empty());
    let stopped = post("/api/stop", "application/json", "{}");
    assert!(stopped.starts_with("HTTP/1.1 200 ") && stopped.ends_with("\"type\":\"answer\"}"), "{stopped}");
    assert!(post("/api/estop", "application/json; charset=utf-8", "{}").starts_with("HTTP/1.1 200 "));
    assert_eq!(*source.orders.lock().expect("orders"), [Order::Stop, Order::Estop]);

    let (closed, _) = begin(Counted { admits_nobody: true, ..Counted::default() }, Rules::default());
    for path in ["/", "/metrics", "/ws"] {
        assert!(get(closed, path, "Host: localhost\r\n").starts_with("HTTP/1.1 403 "), "{path}");
    }
}

#[test]
fn where_a_token_is_wanted_nothing_but_the_files_is_had_without() {
    let rules = Rules { token: Some("5ec7e7".to_owned()), ..Rules::default() };
    let (address, source) = begin(Counted::default(), rules);
    source.live.set_hello(&json!({}));
    assert!(get(address, "/", "Host: localhost\r\n").starts_with("HTTP/1.1 200 "));
    for (path, header) in [
        ("/metrics", ""),
        ("/metrics?token=", ""),
        ("/metrics?token=5ec7e", ""),
        ("/metrics?x=5ec7e7", ""),
        ("/metrics", "Authorization: Bearer 5ec7e8\r\n"),
    ] {
        let got = get(address, path, &format!("Host: localhost\r\n{header}"));
        assert!(got.starts_with("HTTP/1.1 401 ") && !got.contains("5ec7"), "{path} {header}: {got}");
    }
    assert!(get(address, "/metrics?token=5ec7e7", "Host: localhost\r\n").starts_with("HTTP/1.1 200 "));
    let bearer = "Host: localhost\r\nAuthorization: Bearer 5ec7e7\r\n";
    assert!(get(address, "/metrics", bearer).starts_with("HTTP/1.1 200 "));
    assert!(Client::ask(address, "/ws", "").err().expect("refused").starts_with("HTTP/1.1 401 "));
    assert!(Client::ask(address, "/ws?a=b&token=5ec7e7", "").is_ok());
    // A browser is told no words of a WebSocket that is refused: here it is.
    let refused = get(address, "/api/entry?token=5ec7e", "Host: localhost\r\n");
    assert!(
        refused.starts_with("HTTP/1.1 401 ") && refused.contains("hilare: the token is wanted"),
        "{refused}"
    );
    let entry = get(address, "/api/entry?token=5ec7e7", "Host: localhost\r\n");
    assert!(entry.starts_with("HTTP/1.1 204 "), "{entry}");
}

#[test]
fn hostile_pages_keep_neither_a_page_from_its_robot_nor_a_stop_from_its_way() {
    let (address, source) = page();
    let mut good = Client::open(address);
    good.order(&json!({ "id": 1, "do": "arm" }));
    assert_eq!(good.answer_to(1)["ok"], true);
    let path: Vec<[f64; 4]> = vec![[0.123_456_789; 4]; 20_000];
    source.live.set_path(1, &path);
    // Slow readers, half-open ones, and garbage, three times as many as there is room for.
    let mut crowd = Vec::new();
    let garbage = vec![b'x'; 1 << 20];
    for n in 0..100 {
        let mut client = Client::open(address);
        client.stream.set_write_timeout(Some(Duration::from_millis(100))).expect("a time-out");
        match n % 4 {
            0 => drop(client.send(1, &garbage)),
            1 => drop(client.send(2, &garbage)),
            2 => drop(client.stream.write_all(&[0x81, 0xff, 0, 0, 0, 0, 0xff])),
            _ => (0..500)
                .for_each(|id| drop(client.send(1, json!({ "id": id, "do": "arm" }).to_string().as_bytes()))),
        }
        crowd.push(client);
        if n % 10 == 0 {
            good.order(&json!({ "id": 100 + n, "do": "stop" }));
            assert_eq!(good.answer_to(100 + n)["ok"], true, "beside {n}");
        }
    }
    assert!(crowd.len() > 3 * MAX_PAGES);
    source.live.set_state(State { tick: 9, ..State::default() });
    assert_eq!(good.next("state")["tick"], 9);
    // A message longer than any order is the end of its sender.
    let mut long = Client::open(address);
    let _ = long.stream.write_all(&[0x81, 0xff, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0]);
    while long.frame().is_some() {}
    drop(crowd);
    good.order(&json!({ "id": 2, "do": "stop" }));
    assert_eq!(good.answer_to(2)["ok"], true);
}

#[test]
fn who_orders_too_fast_is_told_so_and_can_stop_all_the_same() {
    let (address, source) = page();
    let mut client = Client::open(address);
    (0..150).for_each(|id| client.order(&json!({ "id": id, "do": "reset" })));
    client.order(&json!({ "id": 999, "do": "stop" }));
    let (mut done, mut refused) = (0, 0);
    loop {
        let answer = client.next("answer");
        match answer["message"].as_str().expect("a message") {
            "Reset" => done += 1,
            "Stop" => break,
            why => {
                assert!(why.contains("too fast") || why.contains("busy"), "{why}");
                refused += 1;
            }
        }
    }
    assert!(done <= 100 && refused >= 50, "{done} done, {refused} refused");
    assert!(source.orders.lock().expect("orders").contains(&Order::Stop));
}

#[test]
fn who_says_nothing_any_more_is_gone() {
    let (address, _) = page();
    // It does not even answer a ping.
    let mut dead = Client::open(address);
    dead.answers_pings = false;
    let began = Instant::now();
    while dead.frame().is_some() {
        assert!(began.elapsed() < PATIENCE, "it is still spoken to");
    }
}

#[test]
fn an_armed_robot_stops_when_its_last_page_is_lost_if_that_is_wanted() {
    let rules = |stop_when_lost| Rules { stop_when_lost, ..Rules::default() };
    let armed = |rules| {
        let (address, source) = begin(Counted::default(), rules);
        source.live.set_hello(&json!({}));
        source.live.set_state(State { mode: "armed".to_owned(), ..State::default() });
        (address, source)
    };
    let orders = |source: &Counted| source.orders.lock().expect("orders").clone();
    let ((stops, source), (goes_on, other)) = (armed(rules(true)), armed(rules(false)));
    for address in [stops, goes_on] {
        let mut client = Client::open(address);
        client.order(&json!({ "id": 1, "do": "arm" }));
        assert_eq!(client.answer_to(1)["ok"], true);
    }
    let began = Instant::now();
    while orders(&source).len() < 2 {
        assert!(began.elapsed() < PATIENCE, "nobody stops it");
        std::thread::sleep(Duration::from_millis(10));
    }
    assert_eq!(orders(&source), [Order::Arm, Order::Stop]);
    assert_eq!(orders(&other), [Order::Arm]);
}
