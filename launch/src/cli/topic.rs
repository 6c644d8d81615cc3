//! `hilare topic`: what the relay repeats. It joins the relay's wires only, so looking costs the robot nothing.

use super::operate::{RobotArgs, choose};
use super::{VerbResult, print, refused};
use crate::manager::Failure;
use crate::manager::robot_dir::{Living, living_robots};
use crate::shell::realtime;
use crate::shell::transport::{Domain, layout_value, service_of};
use crate::topic::fields::{in_words, pick, to_json, to_text};
use crate::topic::rates::{Counter, Rates};
use crate::topic::{Message, Source, Topic};
use clap::{Args, Subcommand};
use hilare_interfaces::export::rate;
use hilare_interfaces::wires::Rate;
use serde_json::{Value, json};
use std::io::{self, Write};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Time between two looks at a wire.
const LOOK: Duration = Duration::from_millis(5);
/// Time between two looks whether the robot is still up.
const LIFE: Duration = Duration::from_millis(500);
/// Time a wire that always carries something may be mute before that is said.
const PATIENCE: Duration = Duration::from_secs(2);

/// Options of `hilare topic`.
#[derive(Args)]
pub struct TopicArgs {
    #[command(subcommand)]
    verb: TopicVerb,
}

#[derive(Subcommand)]
enum TopicVerb {
    /// List the wires one can look at
    #[command(after_help = "Example: hilare topic list --json\nExit codes: 0 done, 2 wrong use.")]
    List {
        /// Answer in JSON
        #[arg(long)]
        json: bool,
    },
    /// Say what a wire carries, who writes and who reads it
    #[command(after_help = "Example: hilare topic info pose\nExit codes: 0 done, 2 wrong use.")]
    Info {
        /// Name of the wire
        topic: String,
        /// Answer in JSON
        #[arg(long)]
        json: bool,
    },
    /// Print messages as they come
    #[command(
        after_help = "Examples:\n  hilare topic echo pose\n  hilare topic echo reference --field current.x_m --count 1\n  \
        hilare topic echo steps --all --json > steps.jsonl\nExit codes: 0 done, 1 the robot went down before --count were there, 2 wrong use."
    )]
    Echo(EchoArgs),
    /// Measure how often messages come
    #[command(
        after_help = "Examples:\n  hilare topic hz pose\n  hilare topic hz command --seconds 2 --json\n\
        Exit codes: 0 done, 1 the robot went down before --seconds were over, 2 wrong use."
    )]
    Hz(HzArgs),
}

/// Options of `hilare topic echo`.
#[derive(Args)]
struct EchoArgs {
    /// Name of the wire
    topic: String,
    /// End after so many messages
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    count: Option<u64>,
    /// Messages a second at most: the newest, the others are passed over
    #[arg(long, value_name = "HZ", default_value_t = 10.0, allow_negative_numbers = true)]
    rate: f64,
    /// Every message
    #[arg(long, conflicts_with = "rate")]
    all: bool,
    /// Only this of a message, e.g. x_m or current.x_m (repeatable)
    #[arg(long = "field", value_name = "PATH")]
    fields: Vec<String>,
    #[command(flatten)]
    robot: RobotArgs,
}

/// Options of `hilare topic hz`.
#[derive(Args)]
struct HzArgs {
    /// Name of the wire
    topic: String,
    /// End after so long; otherwise a line a second until Ctrl-C
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    seconds: Option<f64>,
    #[command(flatten)]
    robot: RobotArgs,
}

/// Lists, describes, prints, counts.
pub fn topic(args: &TopicArgs) -> VerbResult {
    match &args.verb {
        TopicVerb::List { json } => list(*json),
        TopicVerb::Info { topic, json } => info(&named(topic)?, *json),
        TopicVerb::Echo(args) => echo(args),
        TopicVerb::Hz(args) => hz(args),
    }
}

fn named(name: &str) -> Result<Topic, Failure> {
    let names = || Topic::all().map(|topic| topic.name).collect::<Vec<_>>().join(", ");
    Topic::named(name).ok_or_else(|| refused(format!("no topic {name:?}: there are {}", names())))
}

fn about(topic: &Topic) -> Value {
    let roles =
        |wire: &hilare_interfaces::wires::Wire| wire.to.iter().map(|reader| reader.role.name()).collect();
    let (watchers, readers): (Vec<_>, Vec<_>) = (roles(topic.wire), roles(topic.origin));
    json!({
        "name": topic.name,
        "message": topic.wire.message.name,
        "element": topic.wire.element.map(|element| element.name),
        "service": service_of(topic.wire),
        "layout": layout_value(topic.wire),
        "from": topic.origin.from.iter().map(|role| role.name()).collect::<Vec<_>>(),
        "to": readers,
        "watched_by": watchers,
        "rate": rate(topic.wire),
        "buffer": topic.wire.buffer,
        "history": topic.wire.history,
        "doc": topic.wire.doc,
    })
}

fn list(json: bool) -> VerbResult {
    if json {
        let all: Vec<Value> = Topic::all().map(|topic| about(&topic)).collect();
        print(&format!("{}\n", serde_json::to_string_pretty(&all).unwrap_or_default()));
        return Ok(ExitCode::SUCCESS);
    }
    for topic in Topic::all() {
        let wire = topic.wire;
        print(&format!("{:<10} {:<22} {:<20} {}\n", topic.name, wire.message.name, rate(wire), wire.doc));
    }
    Ok(ExitCode::SUCCESS)
}

fn info(topic: &Topic, json: bool) -> VerbResult {
    let about = about(topic);
    let fields = |layout: hilare_interfaces::layout::Layout| {
        let fields = layout.fields.iter().map(|field| {
            json!({"name": field.name, "type": field.type_name, "len": field.len, "doc": plain(field.doc)})
        });
        fields.collect::<Vec<_>>()
    };
    if json {
        let mut about = about;
        about["fields"] = fields(topic.wire.message).into();
        print(&format!("{}\n", serde_json::to_string_pretty(&about).unwrap_or_default()));
        return Ok(ExitCode::SUCCESS);
    }
    let list = |key: &str| {
        let names: Vec<&str> =
            about[key].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
        names.join(", ")
    };
    let wire = topic.wire;
    let watchers = [list("watched_by"), "whoever wants to look".to_owned()];
    let watchers: Vec<String> = watchers.into_iter().filter(|names| !names.is_empty()).collect();
    let mut text = format!(
        "{}: {}\n  from      {}\n  to        {}\n  repeated  by the relay on {}, for {}\n  rate      {}\n  \
         message   {}, {} bytes, layout {}\n",
        topic.name,
        wire.doc,
        list("from"),
        list("to"),
        service_of(wire),
        watchers.join(", "),
        rate(wire),
        wire.message.name,
        wire.message.size,
        layout_value(wire)
    );
    for layout in std::iter::once(wire.message).chain(wire.element) {
        text.push_str(&format!("  {}\n", layout.ident));
        for field in layout.fields {
            let len = if field.len > 1 { format!("[{}]", field.len) } else { String::new() };
            let kind = format!("{}{len}", field.nested.map_or(field.type_name, |nested| nested.ident));
            text.push_str(&format!("    {:<24} {kind:<14} {}\n", field.name, plain(field.doc)));
        }
    }
    print(&text);
    Ok(ExitCode::SUCCESS)
}

/// Documentation in a line, without its marks.
fn plain(doc: &str) -> String {
    let text = doc.replace("[`", "").replace("`]", "").replace('`', "");
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// A wire that is read until enough is seen, Ctrl-C, or the robot goes down.
struct Look {
    robot: Living,
    source: Box<dyn Source>,
    // After the source: the ports go before the node.
    _domain: Domain,
    told_to_end: Arc<AtomicBool>,
    asked: Instant,
    /// Until when nothing has to have come from a wire that carries something all the time.
    patience: Option<Instant>,
}

/// How a look ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    Enough,
    Told,
    RobotDown,
}

impl Look {
    fn at(topic: &Topic, robot: Option<&String>) -> Result<Self, Failure> {
        let robot = choose(robot)?;
        let told_to_end = Arc::new(AtomicBool::new(false));
        for signal in [libc::SIGINT, libc::SIGTERM] {
            // So that the node is taken down in good order.
            signal_hook::flag::register(signal, Arc::clone(&told_to_end))
                .map_err(|e| Failure::Fault(e.to_string()))?;
        }
        realtime::leave_the_control_path();
        let dir = robot.socket.parent().unwrap_or(robot.socket.as_path());
        let domain = Domain::join(dir, "topic").map_err(refused)?;
        let source = topic.open(&domain).map_err(refused)?;
        let regular = matches!(topic.wire.rate, Rate::EveryTick | Rate::EveryPeriod);
        Ok(Self {
            robot,
            source,
            _domain: domain,
            told_to_end,
            asked: Instant::now(),
            patience: regular.then(|| Instant::now() + PATIENCE),
        })
    }

    /// Looks again and again; `see` says whether it has seen enough.
    fn until(&mut self, mut see: impl FnMut(&mut dyn Iterator<Item = Message>) -> bool) -> End {
        loop {
            if self.told_to_end.load(Ordering::Relaxed) {
                return End::Told;
            }
            let mut some = false;
            let mut messages = std::iter::from_fn(|| self.source.next()).inspect(|_| some = true);
            if see(&mut messages) {
                return End::Enough;
            }
            drop(messages);
            self.tell_if_mute(some);
            if self.asked.elapsed() > LIFE {
                self.asked = Instant::now();
                if !living_robots().contains(&self.robot) {
                    return End::RobotDown;
                }
            }
            sleep(LOOK);
        }
    }

    /// Whoever looks too early shall not take the robot for broken.
    fn tell_if_mute(&mut self, some: bool) {
        if some {
            self.patience = None;
        } else if self.patience.take_if(|until| Instant::now() > *until).is_some() {
            let why = "nothing has come yet; a robot ticks once it is armed (hilare arm), and not every robot has every wire";
            let _ = writeln!(io::stderr(), "hilare: {why}");
        }
    }

    fn went_down(&self) -> Failure {
        Failure::Fault(format!("robot {:?} went down", self.robot.robot))
    }
}

fn echo(args: &EchoArgs) -> VerbResult {
    let topic = named(&args.topic)?;
    if !(args.rate > 0.0 && args.rate <= 1000.0) {
        return Err(refused(format!("--rate {}: above 0 and at most 1000 are wanted", args.rate)));
    }
    let known = to_json(&topic.nothing());
    for path in &args.fields {
        if !path.starts_with("elements") && pick(&known, path).is_none() {
            let names: Vec<&str> = topic.wire.message.fields.iter().map(|field| field.name).collect();
            return Err(refused(format!("--field {path}: {} has {}", topic.name, names.join(", "))));
        }
    }
    let mut look = Look::at(&topic, args.robot.robot.as_ref())?;
    let between = Duration::from_secs_f64(1.0 / args.rate);
    let (mut due, mut shown) = (Instant::now(), 0);
    let enough = |shown: u64| args.count.is_some_and(|count| shown >= count);
    let end = look.until(|messages| {
        if args.all {
            for message in messages {
                shown += 1;
                if !show(&message, args) || enough(shown) {
                    return true;
                }
            }
        } else if Instant::now() >= due
            && let Some(message) = messages.last()
        {
            due += between.max(due.elapsed());
            shown += 1;
            return !show(&message, args) || enough(shown);
        }
        false
    });
    match end {
        End::RobotDown if args.count.is_some() => Err(look.went_down()),
        _ => Ok(ExitCode::SUCCESS),
    }
}

/// False if nobody reads any more.
fn show(message: &Message, args: &EchoArgs) -> bool {
    let line = match (&args.fields[..], args.robot.json) {
        ([], true) => to_json(message).to_string(),
        ([], false) => to_text(message),
        (paths, json) => {
            let value = to_json(message);
            let picked =
                paths.iter().map(|path| (path.clone(), pick(&value, path).cloned().unwrap_or(Value::Null)));
            if json {
                Value::Object(picked.collect()).to_string()
            } else {
                picked.map(|(_, value)| in_words(&value)).collect::<Vec<_>>().join("  ")
            }
        }
    };
    print(&format!("{line}\n"))
}

fn hz(args: &HzArgs) -> VerbResult {
    let topic = named(&args.topic)?;
    if let Some(seconds) = args.seconds
        && !(seconds > 0.0 && seconds <= 86_400.0)
    {
        return Err(refused(format!("--seconds {seconds}: above 0 and at most 86400 are wanted")));
    }
    let mut look = Look::at(&topic, args.robot.robot.as_ref())?;
    let (began, mut counter, mut turn) = (Instant::now(), Counter::new(), Counter::new());
    let end = look.until(|messages| {
        for message in messages {
            let tick = message.tick();
            counter.count(tick);
            turn.count(tick);
        }
        if args.seconds.is_none() && turn.rates().seconds >= 1.0 {
            let heard = tell(&turn.rates(), args.robot.json);
            turn = Counter::new();
            return !heard;
        }
        args.seconds.is_some_and(|seconds| began.elapsed().as_secs_f64() >= seconds)
    });
    if args.seconds.is_some() && end != End::RobotDown {
        tell(&counter.rates(), args.robot.json);
    }
    match end {
        End::RobotDown if args.seconds.is_some() => Err(look.went_down()),
        _ => Ok(ExitCode::SUCCESS),
    }
}

/// False if nobody reads any more.
fn tell(rates: &Rates, json: bool) -> bool {
    if json {
        return print(&format!("{}\n", serde_json::to_string(rates).unwrap_or_default()));
    }
    let of_ticks = rates.hz_of_ticks.map_or(String::new(), |hz| {
        format!(", {hz:.1} Hz of the robot's time, at most {} ticks apart", rates.gap_max_ticks)
    });
    print(&format!("{:.1} Hz: {} messages in {:.2} s{of_ticks}\n", rates.hz, rates.messages, rates.seconds))
}
