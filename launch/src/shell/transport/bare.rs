//! iceoryx2 as its book has it, without anything of ours: publish, notify; wait for the event, receive. What
//! [`crate::latency`] holds our wires against.

use super::{Domain, Ipc, OnWire, TransportError, failed};
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::Pose;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::ServiceName;
use iceoryx2::service::port_factory::{event, publish_subscribe};
use std::time::Duration;

type Wire = publish_subscribe::PortFactory<Ipc, OnWire<Pose>, ()>;
type Event = event::PortFactory<Ipc>;

/// The sending end.
pub struct BareOutput {
    publisher: Publisher<Ipc, OnWire<Pose>, ()>,
    notifier: Notifier<Ipc>,
}

/// The receiving end.
pub struct BareInput {
    subscriber: Subscriber<Ipc, OnWire<Pose>, ()>,
    listener: Listener<Ipc>,
}

impl Domain {
    fn bare(&self, name: &str) -> Result<(Wire, Event), TransportError> {
        let name = format!("bare/{name}");
        let name: ServiceName = name.as_str().try_into().map_err(|e| failed(name.clone(), e))?;
        let builder = || self.node.service_builder(&name);
        let wire = builder().publish_subscribe::<OnWire<Pose>>().open_or_create();
        // What a listener looks through grows with the greatest id.
        let event = builder().event().event_id_max_value(1).open_or_create();
        Ok((wire.map_err(|e| failed(name, e))?, event.map_err(|e| failed(name, e))?))
    }

    /// The sending end of a service that either end makes.
    pub fn bare_output(&self, name: &str) -> Result<BareOutput, TransportError> {
        let (wire, event) = self.bare(name)?;
        Ok(BareOutput {
            publisher: wire.publisher_builder().create().map_err(|e| failed(name, e))?,
            notifier: event.notifier_builder().create().map_err(|e| failed(name, e))?,
        })
    }

    /// The receiving end.
    pub fn bare_input(&self, name: &str) -> Result<BareInput, TransportError> {
        let (wire, event) = self.bare(name)?;
        Ok(BareInput {
            subscriber: wire.subscriber_builder().create().map_err(|e| failed(name, e))?,
            listener: event.listener_builder().create().map_err(|e| failed(name, e))?,
        })
    }
}

impl BareOutput {
    /// Sends a message and wakes its reader.
    pub fn send(&self) {
        if let Ok(sample) = self.publisher.loan_uninit() {
            let _ = sample.write_payload(OnWire(Pose::ZERO)).send();
        }
        let _ = self.notifier.notify();
    }
}

impl BareInput {
    /// Sleeps until a message is there, or `limit` is over; true if one was.
    pub fn wait(&self, limit: Duration) -> bool {
        let _ = self.listener.timed_wait(|_| {}, limit);
        std::iter::from_fn(|| self.subscriber.receive().ok().flatten()).count() > 0
    }
}
