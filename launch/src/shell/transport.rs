//! The wires over iceoryx2. Nothing outside this file knows how messages travel.
//!
//! Launch creates and holds every service before a worker starts; workers only open. A service
//! carries the layout hash of its messages as an attribute, so that two builds whose messages differ
//! in more than size are refused, with both sides named.

#![allow(unsafe_code)]

mod bare;
mod janitor;
mod sweeper;

pub use bare::{BareInput, BareOutput};
pub use hilare_interfaces::export::{layout_value, service_of};
pub use janitor::Janitor;
pub use sweeper::Sweeper;

use crate::private;
use crate::whole::write_whole;
use hilare_interfaces::export::LAYOUT;
use hilare_interfaces::layout::WireMessage;
use hilare_interfaces::wires::{WIRES, Wire};
use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::*;
use iceoryx2::service::attribute::{AttributeKey, AttributeValue};
use iceoryx2::service::builder::publish_subscribe::PublishSubscribeOpenError;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory as PubSub;
use std::any::Any;
use std::fmt;
use std::path::Path as FsPath;

type Ipc = ipc::Service;

/// Processes that may take part: workers, launch, observers.
const MAX_NODES: usize = 128;
/// Readers a wire of the relay may have beside those of the table.
const MAX_OBSERVERS: usize = 64;
/// Name of the iceoryx2 configuration in a robot's runtime directory.
pub const CONFIG_FILE: &str = "iceoryx2.toml";

/// Any failure of the transport: one line with the wire, the cause, the cure where one is known.
#[derive(Debug)]
pub struct TransportError(String);

impl fmt::Display for TransportError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for TransportError {}

impl From<TransportError> for String {
    fn from(error: TransportError) -> Self {
        error.0
    }
}

fn failed(what: impl fmt::Display, cause: impl fmt::Debug) -> TransportError {
    TransportError(format!("{what}: {cause:?}"))
}

/// A wire message as iceoryx2 wants to see it.
#[repr(transparent)]
#[derive(Clone, Copy, Debug)]
struct OnWire<T>(T);

impl<T: WireMessage> Default for OnWire<T> {
    fn default() -> Self {
        Self(T::ZERO)
    }
}

// SAFETY: WireMessage promises repr(C), no padding, no pointers, any bit pattern valid; the name is
// versioned and the same in every language.
unsafe impl<T: WireMessage + fmt::Debug> ZeroCopySend for OnWire<T> {
    unsafe fn type_name() -> &'static str {
        T::NAME
    }
}

/// Beginning of the names of a robot's files in shared memory. Robot names have no dots, so none is
/// the beginning of another's.
pub fn shm_prefix(robot: &str) -> String {
    format!("hilare.{}.{robot}.", private::euid())
}

/// Launch: writes the domain's configuration into the runtime directory.
pub fn write_config(runtime_dir: &FsPath, robot: &str) -> Result<(), TransportError> {
    let mut config = Config::default();
    let root = runtime_dir.join("iceoryx2");
    let root = Path::new(root.as_os_str().as_encoded_bytes()).map_err(|e| failed(root.display(), e))?;
    config.global.set_root_path(&root);
    // Launch does that; who starts or leaves shall not wait for it.
    config.global.node.cleanup_dead_nodes_on_creation = false;
    config.global.node.cleanup_dead_nodes_on_destruction = false;
    config.global.prefix =
        FileName::new(shm_prefix(robot).as_bytes()).map_err(|e| failed("robot name", e))?;
    let text = toml::to_string(&config).map_err(|e| failed("iceoryx2 configuration", e))?;
    let file = runtime_dir.join(CONFIG_FILE);
    // Of a file that is still empty iceoryx2 would make its defaults: another domain than this one.
    write_whole(&file, text.as_bytes()).map_err(|e| TransportError(e.to_string()))
}

/// A process's place in a robot's domain.
pub struct Domain {
    node: Node<Ipc>,
}

impl Domain {
    /// Joins the domain whose configuration lies in `runtime_dir`. Once a process.
    pub fn join(runtime_dir: &FsPath, name: &str) -> Result<Self, TransportError> {
        set_log_level(LogLevel::Error);
        let file = runtime_dir.join(CONFIG_FILE);
        let path =
            FilePath::new(file.as_os_str().as_encoded_bytes()).map_err(|e| failed(file.display(), e))?;
        // The global configuration: a prefix on the node builder alone leaves dead nodes behind.
        let config = Config::setup_global_config_from_file(&path).map_err(|e| failed(file.display(), e))?;
        let node = NodeBuilder::new()
            .name(&name.try_into().map_err(|e| failed(name, e))?)
            .config(config)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<Ipc>()
            .map_err(|e| failed("shared memory", e))?;
        Ok(Self { node })
    }

    /// Launch, before any worker joins: somebody who frees those that wait for the dead. `priority` as in
    /// [`Sweeper`].
    pub fn sweeper(&self, priority: Option<u64>) -> std::io::Result<Sweeper> {
        Sweeper::start(self.node.config().global.prefix.to_string(), priority)
    }

    /// Launch, when its ports are open: somebody to tidy up.
    pub fn into_janitor(self) -> std::io::Result<Janitor> {
        Janitor::start(self.node)
    }

    /// Launch: creates every service and holds them, before any worker joins.
    pub fn create_services(&self) -> Result<HeldServices, TransportError> {
        use hilare_interfaces::messages as m;
        use hilare_interfaces::wires::{self as w, watch};
        // iceoryx2 opens its counter of nodes to everybody, by fchmod, whatever the umask.
        private::close_shm_to_others(&self.node.config().global.prefix.to_string())
            .map_err(TransportError)?;
        Ok(HeldServices {
            _services: [
                Box::new(self.create::<m::Answer>(&w::ANSWER)?),
                Box::new(self.create::<m::Reference>(&w::REFERENCE)?),
                Box::new(self.create::<m::Command>(&w::COMMAND)?),
                Box::new(self.create::<m::Authority>(&w::AUTHORITY)?),
                Box::new(self.create::<m::Steps>(&w::STEPS)?),
                Box::new(self.create::<m::Wheels>(&w::WHEELS)?),
                Box::new(self.create::<m::PoseFix>(&w::FIX)?),
                Box::new(self.create::<m::Pose>(&w::POSE)?),
                Box::new(self.create::<m::Truth>(&w::TRUTH)?),
                Box::new(self.create::<m::Health>(&w::HEALTH)?),
                Box::new(self.create_slice::<m::GoalHeader, m::Waypoint>(&w::GOAL)?),
                Box::new(self.create_slice::<m::PathHeader, m::Waypoint>(&w::PATH)?),
                Box::new(self.create_slice::<m::GoalHeader, m::Waypoint>(&watch::GOAL)?),
                Box::new(self.create::<m::Answer>(&watch::ANSWER)?),
                Box::new(self.create_slice::<m::PathHeader, m::Waypoint>(&watch::PATH)?),
                Box::new(self.create::<m::Reference>(&watch::REFERENCE)?),
                Box::new(self.create::<m::Command>(&watch::COMMAND)?),
                Box::new(self.create::<m::Authority>(&watch::AUTHORITY)?),
                Box::new(self.create::<m::Steps>(&watch::STEPS)?),
                Box::new(self.create::<m::Wheels>(&watch::WHEELS)?),
                Box::new(self.create::<m::PoseFix>(&watch::FIX)?),
                Box::new(self.create::<m::Pose>(&watch::POSE)?),
                Box::new(self.create::<m::Truth>(&watch::TRUTH)?),
                Box::new(self.create::<m::Health>(&watch::HEALTH)?),
                Box::new(self.create::<m::Journal>(&watch::JOURNAL)?),
            ],
        })
    }

    fn service_name(wire: &Wire) -> Result<ServiceName, TransportError> {
        let name = service_of(wire);
        name.as_str().try_into().map_err(|e| failed(name.clone(), e))
    }

    fn create<T: WireMessage + fmt::Debug>(&self, wire: &Wire) -> Result<Service<T>, TransportError> {
        debug_assert_eq!(wire.message.name, T::NAME);
        self.node
            .service_builder(&Self::service_name(wire)?)
            .publish_subscribe::<OnWire<T>>()
            .enable_safe_overflow(true)
            .subscriber_max_buffer_size(wire.buffer)
            .subscriber_max_borrowed_samples(2)
            .history_size(wire.history)
            .max_publishers(max_publishers(wire))
            .max_subscribers(max_subscribers(wire))
            .max_nodes(MAX_NODES)
            .create_with_attributes(&layout_attribute(wire)?)
            .map_err(|cause| no_room(wire, cause))
    }

    fn create_slice<H: WireMessage + fmt::Debug, T: WireMessage + fmt::Debug>(
        &self,
        wire: &Wire,
    ) -> Result<SliceService<H, T>, TransportError> {
        debug_assert_eq!((wire.message, wire.element), (H::LAYOUT, Some(T::LAYOUT)));
        self.node
            .service_builder(&Self::service_name(wire)?)
            .publish_subscribe::<[OnWire<T>]>()
            .user_header::<OnWire<H>>()
            .enable_safe_overflow(true)
            .subscriber_max_buffer_size(wire.buffer)
            .subscriber_max_borrowed_samples(2)
            .history_size(wire.history)
            .max_publishers(max_publishers(wire))
            .max_subscribers(max_subscribers(wire))
            .max_nodes(MAX_NODES)
            .create_with_attributes(&layout_attribute(wire)?)
            .map_err(|cause| no_room(wire, cause))
    }

    fn open<T: WireMessage + fmt::Debug>(&self, wire: &Wire) -> Result<Service<T>, TransportError> {
        self.node
            .service_builder(&Self::service_name(wire)?)
            .publish_subscribe::<OnWire<T>>()
            .open_with_attributes(&layout_requirement(wire)?)
            .map_err(|cause| open_failed(wire, cause))
    }

    fn open_slice<H: WireMessage + fmt::Debug, T: WireMessage + fmt::Debug>(
        &self,
        wire: &Wire,
    ) -> Result<SliceService<H, T>, TransportError> {
        self.node
            .service_builder(&Self::service_name(wire)?)
            .publish_subscribe::<[OnWire<T>]>()
            .user_header::<OnWire<H>>()
            .open_with_attributes(&layout_requirement(wire)?)
            .map_err(|cause| open_failed(wire, cause))
    }

    /// The writing end of a wire.
    pub fn output<T: WireMessage + fmt::Debug>(&self, wire: &Wire) -> Result<Output<T>, TransportError> {
        let publisher = self.open::<T>(wire)?.publisher_builder().create();
        Ok(Output { publisher: publisher.map_err(|e| no_room(wire, e))? })
    }

    /// The reading end of a wire.
    pub fn input<T: WireMessage + fmt::Debug>(&self, wire: &Wire) -> Result<Input<T>, TransportError> {
        self.input_of(wire, wire.buffer)
    }

    /// A reading end that only wants the newest message.
    pub fn newest<T: WireMessage + fmt::Debug>(&self, wire: &Wire) -> Result<Input<T>, TransportError> {
        self.input_of(wire, 1)
    }

    /// A reading end behind which fewer messages wait than the wire has room for.
    pub fn input_of<T: WireMessage + fmt::Debug>(
        &self,
        wire: &Wire,
        buffer: usize,
    ) -> Result<Input<T>, TransportError> {
        let subscriber = self.open::<T>(wire)?.subscriber_builder().buffer_size(buffer).create();
        Ok(Input { subscriber: subscriber.map_err(|e| no_room(wire, e))? })
    }

    /// The writing end of a wire with waypoints.
    pub fn slice_output<H: WireMessage + fmt::Debug, T: WireMessage + fmt::Debug>(
        &self,
        wire: &Wire,
    ) -> Result<SliceOutput<H, T>, TransportError> {
        // Long paths are rare: begin small and grow, rather than hold room for the longest.
        let publisher = self
            .open_slice::<H, T>(wire)?
            .publisher_builder()
            .initial_max_slice_len(64)
            .allocation_strategy(AllocationStrategy::PowerOfTwo)
            .create();
        Ok(SliceOutput { publisher: publisher.map_err(|e| no_room(wire, e))? })
    }

    /// The reading end of a wire with waypoints.
    pub fn slice_input<H: WireMessage + fmt::Debug, T: WireMessage + fmt::Debug>(
        &self,
        wire: &Wire,
    ) -> Result<SliceInput<H, T>, TransportError> {
        let subscriber = self.open_slice::<H, T>(wire)?.subscriber_builder().create();
        Ok(SliceInput { subscriber: subscriber.map_err(|e| no_room(wire, e))? })
    }
}

/// Writers a wire may have.
pub const fn max_publishers(wire: &Wire) -> usize {
    // One a writer, and as many again for successors of those that died unannounced; controllers there
    // are up to four at once: in charge, standby, on trial, leaving.
    2 * wire.from.len() + 8
}

fn max_subscribers(wire: &Wire) -> usize {
    wire.to.len() + if wire.is_watch() { MAX_OBSERVERS } else { 8 }
}

fn layout_attribute(wire: &Wire) -> Result<AttributeSpecifier, TransportError> {
    let key: AttributeKey = LAYOUT.try_into().map_err(|e| failed(LAYOUT, e))?;
    let value: AttributeValue = layout_value(wire).as_str().try_into().map_err(|e| failed(LAYOUT, e))?;
    AttributeSpecifier::new().define(&key, &value).map_err(|e| failed(LAYOUT, e))
}

fn layout_requirement(wire: &Wire) -> Result<AttributeVerifier, TransportError> {
    let key: AttributeKey = LAYOUT.try_into().map_err(|e| failed(LAYOUT, e))?;
    let value: AttributeValue = layout_value(wire).as_str().try_into().map_err(|e| failed(LAYOUT, e))?;
    AttributeVerifier::new().require(&key, &value).map_err(|e| failed(LAYOUT, e))
}

/// iceoryx2 does not say what it has run out of.
fn no_room(wire: &Wire, cause: impl fmt::Debug) -> TransportError {
    TransportError(format!(
        "wire {}: cannot be set up ({cause:?}); is /dev/shm full, or are too few open files allowed (ulimit -n)? \
         hilare doctor tells",
        wire.name
    ))
}

fn open_failed(wire: &Wire, cause: PublishSubscribeOpenError) -> TransportError {
    match cause {
        PublishSubscribeOpenError::IncompatibleAttributes
        | PublishSubscribeOpenError::IncompatibleTypes
        | PublishSubscribeOpenError::VersionMismatch => TransportError(format!(
            "wire {}: this program speaks {} with layout {}, launch another one; use the same build for both",
            wire.name,
            wire.message.name,
            layout_value(wire)
        )),
        PublishSubscribeOpenError::DoesNotExist => TransportError(format!(
            "wire {}: no such service; launch creates it: is the robot up? (hilare status)",
            wire.name
        )),
        other => no_room(wire, other),
    }
}

type Service<T> = PubSub<Ipc, OnWire<T>, ()>;
type SliceService<H, T> = PubSub<Ipc, [OnWire<T>], OnWire<H>>;

/// Every service of the domain, alive as long as this is; as many as the table has wires.
pub struct HeldServices {
    _services: [Box<dyn Any>; WIRES.len()],
}

/// The writing end of a wire.
pub struct Output<T: WireMessage + fmt::Debug> {
    publisher: Publisher<Ipc, OnWire<T>, ()>,
}

impl<T: WireMessage + fmt::Debug> Output<T> {
    /// Publishes a message; never blocks, a slow reader loses its oldest. False if it could not be
    /// sent.
    pub fn send(&self, message: &T) -> bool {
        let Ok(sample) = self.publisher.loan_uninit() else { return false };
        sample.write_payload(OnWire(*message)).send().is_ok()
    }

    /// Connects to the readers there are, so that the first message does not have to.
    pub fn connect(&self) {
        let _ = self.publisher.update_connections();
    }
}

/// The reading end of a wire.
pub struct Input<T: WireMessage + fmt::Debug> {
    subscriber: Subscriber<Ipc, OnWire<T>, ()>,
}

impl<T: WireMessage + fmt::Debug> Input<T> {
    /// The oldest message not yet read.
    pub fn next(&self) -> Option<T> {
        self.subscriber.receive().ok().flatten().map(|sample| sample.payload().0)
    }

    /// The newest message, passing over the others.
    pub fn last(&self) -> Option<T> {
        std::iter::from_fn(|| self.next()).last()
    }

    /// Connects to the writers there are.
    pub fn connect(&self) {
        let _ = self.subscriber.update_connections();
    }
}

/// The writing end of a wire with waypoints.
pub struct SliceOutput<H: WireMessage + fmt::Debug, T: WireMessage + fmt::Debug> {
    publisher: Publisher<Ipc, [OnWire<T>], OnWire<H>>,
}

impl<H: WireMessage + fmt::Debug, T: WireMessage + fmt::Debug> SliceOutput<H, T> {
    /// Publishes header and elements. False if it could not be sent.
    pub fn send(&self, header: &H, elements: impl ExactSizeIterator<Item = T>) -> bool {
        let Ok(mut sample) = self.publisher.loan_slice_uninit(elements.len()) else { return false };
        *sample.user_header_mut() = OnWire(*header);
        let mut elements = elements;
        sample.write_from_fn(|_| OnWire(elements.next().unwrap_or(T::ZERO))).send().is_ok()
    }

    /// Connects to the readers there are; those that came late get the history.
    pub fn connect(&self) {
        let _ = self.publisher.update_connections();
    }
}

/// The reading end of a wire with waypoints.
pub struct SliceInput<H: WireMessage + fmt::Debug, T: WireMessage + fmt::Debug> {
    subscriber: Subscriber<Ipc, [OnWire<T>], OnWire<H>>,
}

impl<H: WireMessage + fmt::Debug, T: WireMessage + fmt::Debug> SliceInput<H, T> {
    /// True if there is a message not yet read.
    pub fn waiting(&self) -> bool {
        self.subscriber.has_samples().unwrap_or(false)
    }

    /// Gives the oldest message not yet read to `read`, in place.
    pub fn next<R>(&self, read: impl FnOnce(&H, &[T]) -> R) -> Option<R> {
        let sample = self.subscriber.receive().ok().flatten()?;
        let elements = sample.payload();
        // SAFETY: OnWire<T> is repr(transparent) over T, so the slices have the same layout.
        let elements = unsafe { std::slice::from_raw_parts(elements.as_ptr().cast::<T>(), elements.len()) };
        Some(read(&sample.user_header().0, elements))
    }

    /// Connects to the writers there are.
    pub fn connect(&self) {
        let _ = self.subscriber.update_connections();
    }
}
