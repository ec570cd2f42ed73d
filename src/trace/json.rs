//! A recording as Chrome's trace format: <https://docs.google.com/document/d/1CvAClvFfyA5R-PhYUmn5OOQtYMH4h6I0nSsKchNAySU>.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::{Heard, Slice, Track};

/// The processes that viewers show: threads of the host, the queue of the device.
const HOST: u64 = 1;
const DEVICE: u64 = 2;

fn microseconds(nanoseconds: u64) -> f64 {
    nanoseconds as f64 / 1e3
}

fn place(track: Track) -> (u64, u64) {
    match track {
        Track::Thread(thread) => (HOST, thread),
        Track::Device => (DEVICE, 1),
    }
}

/// What the viewers name a process (`process_name`) or a thread (`thread_name`).
fn name(kind: &str, pid: u64, tid: u64, name: &str) -> Value {
    json!({ "ph": "M", "name": kind, "pid": pid, "tid": tid, "args": { "name": name } })
}

pub(super) fn write(heard: &Heard) -> Vec<u8> {
    let mut events = vec![
        name("process_name", HOST, 0, "host"),
        name("process_name", DEVICE, 0, "device"),
        name("thread_name", DEVICE, 1, "queue"),
    ];
    let threads = heard.threads.iter();
    events.extend(threads.map(|(&tid, text)| name("thread_name", HOST, tid, text)));
    // Outer slices before what lies in them.
    let mut slices: Vec<&Slice> = heard.slices.iter().collect();
    slices.sort_by_key(|s| (s.track, s.begin, std::cmp::Reverse(s.end)));
    let mut began = BTreeMap::new();
    for slice in slices {
        let (pid, tid) = place(slice.track);
        let kind = match (slice.track, slice.arguments.get("submission")) {
            (Track::Thread(_), _) => "span",
            (Track::Device, Some(number)) if slice.name == "submission" => {
                began.insert(number.as_u64().unwrap_or_default(), slice.begin);
                "submission"
            }
            (Track::Device, _) => "pass",
        };
        events.push(json!({
            "ph": "X", "cat": kind, "name": slice.name, "pid": pid, "tid": tid,
            "ts": microseconds(slice.begin), "dur": microseconds(slice.end.saturating_sub(slice.begin)),
            "args": slice.arguments,
        }));
    }
    // Arrows from where a submission was sent to where it ran.
    for &(submission, thread, at) in &heard.sent {
        if let Some(&begin) = began.get(&submission) {
            let end = |ph: &str, (pid, tid): (u64, u64), at: u64| {
                json!({ "ph": ph, "bp": "e", "cat": "submission", "name": "submission", "id": submission,
                    "pid": pid, "tid": tid, "ts": microseconds(at) })
            };
            events.push(end("s", place(Track::Thread(thread)), at));
            events.push(end("f", place(Track::Device), begin));
        }
    }
    let mut trace = json!({ "displayTimeUnit": "ms", "traceEvents": events });
    if heard.lost > 0 {
        trace["otherData"] = json!({ "slices left out for want of room": heard.lost });
    }
    trace.to_string().into_bytes()
}
