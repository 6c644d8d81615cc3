//! iceoryx2 publish-subscribe, woken by iceoryx2's own event or by a futex beside it.

use super::{Driver, Place, now, responder_ready};
use crate::Result;
use crate::messages::{Command, Pose, answer};
use crate::page::Bell;
use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::*;
use std::fmt::Debug;
use std::path::Path as FsPath;
use std::time::Duration;

type Ipc = ipc::Service;

/// Longest sleep of hilare's workers on a doorbell.
const MAX_WAIT: Duration = Duration::from_millis(50);
/// Messages a subscriber keeps; one is on its way at a time.
const BUFFER: usize = 4;

/// The conductor: where iceoryx2 puts what it makes, so that it can be taken away. Its files in shared memory
/// begin with `prefix`.
pub fn write_config(directory: &FsPath, prefix: &str) -> Result<()> {
    let root = directory.join("iceoryx2");
    let text = format!("[global]\nroot-path = {root:?}\nprefix = {prefix:?}\n");
    Ok(std::fs::write(directory.join("iceoryx2.toml"), text)?)
}

fn failed(what: &str, error: impl Debug) -> crate::Error {
    format!("iceoryx2 {what}: {error:?}").into()
}

fn node(place: &Place) -> Result<Node<Ipc>> {
    set_log_level(LogLevel::Error);
    let file = place.directory.join("iceoryx2.toml");
    let path = FilePath::new(file.as_os_str().as_encoded_bytes()).map_err(|e| failed("path", e))?;
    let config = Config::setup_global_config_from_file(&path).map_err(|e| failed("configuration", e))?;
    let node = NodeBuilder::new().config(config).signal_handling_mode(SignalHandlingMode::Disabled);
    node.create::<Ipc>().map_err(|e| failed("node", e))
}

fn name(place: &Place, of: &str) -> Result<ServiceName> {
    format!("{}/{of}", place.peer).as_str().try_into().map_err(|e| failed("name", e))
}

/// A publisher of one message and a subscriber of the other.
struct Ports<Out: Debug + ZeroCopySend + 'static, In: Debug + ZeroCopySend + 'static> {
    publisher: Publisher<Ipc, Out, ()>,
    subscriber: Subscriber<Ipc, In, ()>,
    node: Node<Ipc>,
}

impl<Out: Debug + Copy + ZeroCopySend + 'static, In: Debug + Copy + ZeroCopySend + 'static> Ports<Out, In> {
    fn open(place: &Place, out: &str, into: &str) -> Result<Self> {
        let node = node(place)?;
        let service = node.service_builder(&name(place, out)?).publish_subscribe::<Out>();
        let service = service.enable_safe_overflow(true).subscriber_max_buffer_size(BUFFER);
        let service = service.open_or_create().map_err(|e| failed(out, e))?;
        let publisher = service.publisher_builder().create().map_err(|e| failed(out, e))?;
        let service = node.service_builder(&name(place, into)?).publish_subscribe::<In>();
        let service = service.enable_safe_overflow(true).subscriber_max_buffer_size(BUFFER);
        let service = service.open_or_create().map_err(|e| failed(into, e))?;
        let subscriber = service.subscriber_builder().create().map_err(|e| failed(into, e))?;
        Ok(Self { publisher, subscriber, node })
    }

    fn send(&self, message: &Out) -> Result<()> {
        let sample = self.publisher.loan_uninit().map_err(|e| failed("loan", e))?;
        sample.write_payload(*message).send().map_err(|e| failed("send", e))?;
        Ok(())
    }

    fn receive(&self) -> Result<Option<In>> {
        let sample = self.subscriber.receive().map_err(|e| failed("receive", e))?;
        Ok(sample.map(|sample| *sample.payload()))
    }

    /// Connects to what the other side has opened, so that the first message does not have to.
    fn connect(&self) -> Result<()> {
        self.publisher.update_connections().map_err(|e| failed("connect", e))?;
        self.subscriber.update_connections().map_err(|e| failed("connect", e))
    }

    fn notifier(&self, place: &Place, of: &str) -> Result<Notifier<Ipc>> {
        let service = self.node.service_builder(&name(place, of)?).event().event_id_max_value(1);
        let service = service.open_or_create().map_err(|e| failed(of, e))?;
        service.notifier_builder().create().map_err(|e| failed(of, e))
    }

    fn listener(&self, place: &Place, of: &str) -> Result<Listener<Ipc>> {
        let service = self.node.service_builder(&name(place, of)?).event().event_id_max_value(1);
        let service = service.open_or_create().map_err(|e| failed(of, e))?;
        service.listener_builder().create().map_err(|e| failed(of, e))
    }

    /// Sleeps on a bell until there is a message, as hilare's workers do.
    fn await_on(&self, bell: &Bell) -> Result<In> {
        loop {
            let seen = bell.rung();
            if let Some(message) = self.receive()? {
                return Ok(message);
            }
            bell.wait(seen, Some(MAX_WAIT));
        }
    }

    /// Sleeps on an event until there is a message.
    fn await_event(&self, listener: &Listener<Ipc>) -> Result<In> {
        loop {
            if let Some(message) = self.receive()? {
                return Ok(message);
            }
            listener.blocking_wait(|_| ()).map_err(|e| failed("wait", e))?;
        }
    }
}

struct WithBell {
    ports: Ports<Pose, Command>,
    place: Place,
}

pub fn bell_driver(place: &Place) -> Result<Box<dyn Driver>> {
    let ports = Ports::open(place, "pose", "command")?;
    ports.connect()?;
    Ok(Box::new(WithBell { ports, place: place.clone() }))
}

impl Driver for WithBell {
    fn send(&mut self, pose: &Pose) -> Result<()> {
        self.ports.send(pose)?;
        self.place.page.pose_bell().ring();
        Ok(())
    }

    fn command(&mut self) -> Result<(Command, u64)> {
        Ok((self.ports.await_on(self.place.page.command_bell())?, now()))
    }
}

pub fn bell_respond(place: &Place) -> Result<()> {
    let ports = Ports::<Command, Pose>::open(place, "command", "pose")?;
    responder_ready(place);
    loop {
        let pose = ports.await_on(place.page.pose_bell())?;
        ports.send(&answer(&pose, now()))?;
        place.page.command_bell().ring();
    }
}

struct WithEvent {
    ports: Ports<Pose, Command>,
    notifier: Notifier<Ipc>,
    listener: Listener<Ipc>,
}

pub fn event_driver(place: &Place) -> Result<Box<dyn Driver>> {
    let ports = Ports::open(place, "pose", "command")?;
    let listener = ports.listener(place, "command-event")?;
    let notifier = ports.notifier(place, "pose-event")?;
    ports.connect()?;
    Ok(Box::new(WithEvent { ports, notifier, listener }))
}

impl Driver for WithEvent {
    fn send(&mut self, pose: &Pose) -> Result<()> {
        self.ports.send(pose)?;
        self.notifier.notify().map_err(|e| failed("notify", e))?;
        Ok(())
    }

    fn command(&mut self) -> Result<(Command, u64)> {
        Ok((self.ports.await_event(&self.listener)?, now()))
    }
}

pub fn event_respond(place: &Place) -> Result<()> {
    let ports = Ports::<Command, Pose>::open(place, "command", "pose")?;
    let listener = ports.listener(place, "pose-event")?;
    let notifier = ports.notifier(place, "command-event")?;
    responder_ready(place);
    loop {
        let pose = ports.await_event(&listener)?;
        ports.send(&answer(&pose, now()))?;
        notifier.notify().map_err(|e| failed("notify", e))?;
    }
}
