//! Traces for Chrome's and Perfetto's viewers: spans of the host's threads and passes of the device on one time line.
//!
//! The host's part is what `tracing` spans say. The device's part comes as `tracing` events of target [`DEVICE`], which the
//! `gpu` room sends for every submission that has finished while somebody listens ([`is_on`]); a pass has the name of its
//! debug label. [`Tracer`] is the layer that listens; [`Recording::json`] is what it heard.

mod json;

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock};
use std::time::Instant;

use serde_json::{Map, Value};
use tracing::field::{Field, Visit};
use tracing::span::{Attributes, Id};
use tracing::{Event, Level, Metadata, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::filter::{FilterExt as _, filter_fn};
use tracing_subscriber::layer::{Context, Filter};
use tracing_subscriber::registry::LookupSpan;

/// Target of events that tell what the device did; no log should print them.
pub const DEVICE: &str = "rebake::device";

/// Most slices that are kept, about 1 GiB of them.
const MOST: usize = 8 << 20;

/// Nanoseconds since the process first asked.
pub fn now() -> u64 {
    static START: OnceLock<Instant> = OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_nanos() as u64
}

/// Whether anybody listens to what the device does.
pub fn is_on() -> bool {
    tracing::enabled!(target: DEVICE, Level::TRACE)
}

/// Says that a submission was sent, from within the span that sent it.
pub(crate) fn sent(submission: u64) {
    tracing::trace!(target: DEVICE, sent = submission);
}

/// Says when a submission ran: nanoseconds as [`now`] counts them.
pub(crate) fn ran(submission: u64, begin: u64, end: u64) {
    tracing::trace!(target: DEVICE, submission, begin, end);
}

/// Says when a pass of a submission ran, and what the device counted in it: see [`PassCounts`].
pub(crate) fn passed(submission: u64, name: &str, begin: u64, end: u64, counts: PassCounts) {
    match counts {
        Some([vertices, clipped, fragments, compute]) => tracing::trace!(
            target: DEVICE, submission, pass = name, begin, end,
            "vertex shaders" = vertices, "primitives out of clipping" = clipped,
            "fragment shaders" = fragments, "compute shaders" = compute,
        ),
        None => tracing::trace!(target: DEVICE, submission, pass = name, begin, end),
    }
}

/// Pipeline statistics of a pass, where the device has them: invocations of vertex shaders, primitives that clipping put
/// out, invocations of fragment shaders, of compute shaders.
pub(crate) type PassCounts = Option<[u64; 4]>;

/// A slice of a track's time.
struct Slice {
    track: Track,
    name: String,
    begin: u64,
    end: u64,
    arguments: Map<String, Value>,
}

/// Where a slice lies.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Track {
    /// A thread of the host.
    Thread(u64),
    /// The device's queue.
    Device,
}

#[derive(Default)]
struct Heard {
    slices: Vec<Slice>,
    /// Slices there was no room for.
    lost: u64,
    /// Names of threads by number.
    threads: std::collections::BTreeMap<u64, String>,
    /// Submission, thread, time: from where it was sent.
    sent: Vec<(u64, u64, u64)>,
}

/// Listens to spans and to the device.
pub struct Tracer(Recording);

/// What a [`Tracer`] has heard. Clones share it.
#[derive(Clone, Default)]
pub struct Recording(Arc<Mutex<Heard>>);

/// What a span carries along.
struct Open {
    name: String,
    /// When it was last entered; spans are entered by one thread at a time.
    begin: u64,
    arguments: Map<String, Value>,
}

impl Recording {
    /// Nothing yet, and the layer that fills it: it hears of this library and program alone.
    pub fn new<S: Subscriber + for<'a> LookupSpan<'a>>() -> (Self, impl Layer<S>) {
        now();
        let recording = Self::default();
        let ours = filter_fn(|m: &Metadata| is_ours(m) && (m.is_span() || m.target() == DEVICE));
        (recording.clone(), Tracer(recording).with_filter(ours))
    }

    /// The trace as a JSON object, as Chrome's format has it. Spans that are still open are not in it.
    pub fn json(&self) -> Vec<u8> {
        json::write(&self.heard())
    }

    fn heard(&self) -> MutexGuard<'_, Heard> {
        self.0.lock().unwrap_or_else(|e| e.into_inner())
    }

    fn note(&self, slice: Slice) {
        let heard = &mut *self.heard();
        if let Track::Thread(thread) = slice.track {
            heard.threads.entry(thread).or_insert_with(thread_name);
        }
        if heard.slices.len() < MOST {
            heard.slices.push(slice);
        } else {
            heard.lost += 1;
        }
    }
}

/// `filter`, without what the device says: for logs.
pub fn without_device<S: 'static>(filter: impl Filter<S> + 'static) -> impl Filter<S> {
    filter.and(filter_fn(|m: &Metadata| m.target() != DEVICE))
}

fn is_ours(metadata: &Metadata) -> bool {
    let name = metadata.target().split("::").next();
    matches!(name, Some("rebake" | "viewer"))
}

/// A small number for the calling thread.
fn thread_number() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(1);
    thread_local! {
        static NUMBER: u64 = NEXT.fetch_add(1, Ordering::Relaxed);
    }
    NUMBER.with(|n| *n)
}

fn thread_name() -> String {
    match (std::thread::current().name(), rayon::current_thread_index()) {
        (Some(name), _) => name.to_owned(),
        (None, Some(worker)) => format!("worker {worker}"),
        (None, None) => format!("thread {}", thread_number()),
    }
}

impl<S: Subscriber + for<'a> LookupSpan<'a>> Layer<S> for Tracer {
    fn on_new_span(&self, attributes: &Attributes<'_>, id: &Id, context: Context<'_, S>) {
        if let Some(span) = context.span(id) {
            let mut fields = Fields::default();
            attributes.record(&mut fields);
            // A span whose name is known only when it runs.
            let name = match fields.0.remove("name") {
                Some(Value::String(name)) => name,
                _ => attributes.metadata().name().to_owned(),
            };
            span.extensions_mut().insert(Open {
                name,
                begin: 0,
                arguments: fields.0,
            });
        }
    }

    fn on_enter(&self, id: &Id, context: Context<'_, S>) {
        if let Some(span) = context.span(id)
            && let Some(open) = span.extensions_mut().get_mut::<Open>()
        {
            open.begin = now();
        }
    }

    fn on_exit(&self, id: &Id, context: Context<'_, S>) {
        let end = now();
        if let Some(span) = context.span(id)
            && let Some(open) = span.extensions().get::<Open>()
        {
            self.0.note(Slice {
                track: Track::Thread(thread_number()),
                name: open.name.clone(),
                begin: open.begin,
                end,
                arguments: open.arguments.clone(),
            });
        }
    }

    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let mut fields = Fields::default();
        event.record(&mut fields);
        let mut fields = fields.0;
        let mut take = |name: &str| fields.remove(name).and_then(|v| v.as_u64());
        if let Some(submission) = take("sent") {
            let from = (submission, thread_number(), now());
            self.0.heard().sent.push(from);
        } else if let (Some(begin), Some(end)) = (take("begin"), take("end")) {
            let name = match fields.remove("pass") {
                Some(Value::String(pass)) => pass,
                _ => "submission".into(),
            };
            self.0.note(Slice {
                track: Track::Device,
                name,
                begin,
                end,
                arguments: fields,
            });
        }
    }
}

/// What a span or an event says beside its name.
#[derive(Default)]
struct Fields(Map<String, Value>);

impl Visit for Fields {
    fn record_debug(&mut self, field: &Field, value: &dyn std::fmt::Debug) {
        let value = format!("{value:?}");
        self.0.insert(field.name().into(), value.into());
    }

    fn record_str(&mut self, field: &Field, value: &str) {
        self.0.insert(field.name().into(), value.into());
    }

    fn record_u64(&mut self, field: &Field, value: u64) {
        self.0.insert(field.name().into(), value.into());
    }

    fn record_i64(&mut self, field: &Field, value: i64) {
        self.0.insert(field.name().into(), value.into());
    }

    fn record_f64(&mut self, field: &Field, value: f64) {
        self.0.insert(field.name().into(), value.into());
    }

    fn record_bool(&mut self, field: &Field, value: bool) {
        self.0.insert(field.name().into(), value.into());
    }
}

#[cfg(test)]
mod tests {
    use tracing_subscriber::prelude::*;

    use super::*;

    #[test]
    fn spans_and_passes_become_slices_of_their_tracks() {
        let (recording, layer) = Recording::new();
        let subscriber = tracing_subscriber::registry().with(layer);
        tracing::subscriber::with_default(subscriber, || {
            assert!(is_on());
            let outer = tracing::debug_span!("outer", lights = 3u64).entered();
            tracing::debug_span!("stage", name = "inner").in_scope(|| sent(1));
            drop(outer);
            tracing::debug_span!(target: "others", "not ours").in_scope(|| ());
            tracing::info!("a line of the log");
            ran(1, 10, 90);
            passed(1, "place", 20, 80, Some([0, 0, 0, 64]));
        });
        assert!(!is_on());
        let trace: Value = serde_json::from_slice(&recording.json()).unwrap();
        let events = trace["traceEvents"].as_array().unwrap();
        let slices: Vec<&Value> = events.iter().filter(|e| e["ph"] == "X").collect();
        let names: Vec<_> = slices.iter().map(|e| e["name"].as_str().unwrap()).collect();
        assert_eq!(names, ["outer", "inner", "submission", "place"]);
        assert_eq!(slices[0]["args"]["lights"], 3);
        assert_eq!(slices[3]["args"]["compute shaders"], 64);
        assert_eq!(
            (&slices[3]["ts"], &slices[3]["dur"]),
            (&0.02.into(), &0.06.into())
        );
        assert_eq!(slices[0]["tid"], slices[1]["tid"]);
        assert_ne!(slices[0]["pid"], slices[2]["pid"]);
        // An arrow leads from the span that sent the submission to it.
        let arrow = |ph: &str| events.iter().filter(|e| e["ph"] == ph).count();
        assert_eq!((arrow("s"), arrow("f")), (1, 1));
    }
}
