//! The GPU layer as its users see it, on any device, with the validation layer on where it is installed.

use std::io::Write;
use std::sync::{Mutex, OnceLock};

use rebake::gpu::{Address, Gpu, GpuError, GpuOptions, Memory, Shader, Stage, devices};

/// `glsl/list_args.comp`: turns the fourth word of each record into workgroup counts in the first three, and adds it and the
/// fifth to the totals of records that `counted` names.
const LIST_ARGS: Shader = Shader {
    name: "list_args",
    spirv: include_bytes!(concat!(env!("OUT_DIR"), "/list_args.comp.spv")),
    push_bytes: 24,
    local_size: [8, 1, 1],
};

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct ListArgs {
    heads: Address,
    totals: Address,
    count: u32,
    counted: u32,
}

/// Everything that was logged in this process.
fn log() -> &'static Mutex<Vec<u8>> {
    struct Log(Mutex<Vec<u8>>);
    impl Write for &Log {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            self.0.lock().expect("no test panics in here").write(bytes)
        }

        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }
    static LOG: OnceLock<&'static Log> = OnceLock::new();
    let log = LOG.get_or_init(|| {
        let log: &'static Log = Box::leak(Box::new(Log(Mutex::default())));
        tracing_subscriber::fmt().with_writer(move || log).init();
        log
    });
    &log.0
}

fn open() -> Gpu {
    log();
    let open = |validate| {
        Gpu::new(&GpuOptions {
            device: None,
            validate,
        })
    };
    match open(true) {
        Err(GpuError::NoValidation) => open(false),
        opened => opened,
    }
    .expect("a Vulkan device (tools/setup.sh installs lavapipe)")
}

/// Numbers that no other place holds.
fn numbers(count: usize, seed: u32) -> Vec<u32> {
    (0..count as u32)
        .map(|i| (i ^ seed).wrapping_mul(2654435761))
        .collect()
}

#[test]
fn what_is_written_is_read() {
    let gpu = open();
    // More than the upload ring holds, and no multiple of anything.
    let data = numbers(5_000_001, 1);
    let buffer = gpu.buffer_with("long", &data).unwrap();
    assert_eq!(buffer.size(), 20_000_004);
    assert!(buffer.read::<u32>(0..data.len()).unwrap() == data);
    assert_eq!(
        buffer.read::<u32>(4_999_990..5_000_001).unwrap(),
        data[4_999_990..]
    );
    buffer.write(40, &[7u8, 8, 9]).unwrap();
    assert_eq!(buffer.read::<u8>(40..43).unwrap(), [7, 8, 9]);
    assert_eq!(buffer.read::<u32>(11..13).unwrap(), data[11..13]);
    assert!(buffer.read::<u32>(3..3).unwrap().is_empty());
    gpu.buffer_with::<u32>("empty", &[]).unwrap();
    assert!(gpu.peak_bytes() >= 20_000_004);
}

/// A recording that waits keeps what was uploaded into it, however much others upload meanwhile.
#[test]
fn uploads_of_an_open_recording_stay_whole() {
    let gpu = open();
    let first = gpu.buffer("first", 4000, Memory::Device).unwrap();
    let data = numbers(1000, 2);
    let mut waiting = gpu.commands().unwrap();
    waiting.upload(&first, 0, &data).unwrap();
    let noise = numbers(6_000_000, 3);
    let other = gpu.buffer_with("other", &noise).unwrap();
    waiting.submit().unwrap().wait().unwrap();
    assert!(first.read::<u32>(0..1000).unwrap() == data);
    assert!(other.read::<u32>(0..6_000_000).unwrap() == noise);
}

/// One recording may upload more than the ring holds.
#[test]
fn a_recording_takes_any_number_of_uploads() {
    let gpu = open();
    let data = numbers(6_000_000, 4);
    let buffer = gpu.buffer("long", 24_000_000, Memory::Device).unwrap();
    let mut cmd = gpu.commands().unwrap();
    for (i, part) in data.chunks(500_000).enumerate() {
        cmd.upload(&buffer, i as u64 * 2_000_000, part).unwrap();
    }
    cmd.submit().unwrap().wait().unwrap();
    assert!(buffer.read::<u32>(0..6_000_000).unwrap() == data);
}

#[test]
fn fills_and_copies_hit_their_ranges() {
    let gpu = open();
    let from = gpu.buffer_with("from", &numbers(64, 5)).unwrap();
    let to = gpu.buffer("to", 256, Memory::Device).unwrap();
    let mut cmd = gpu.commands().unwrap();
    cmd.fill(&to, 0, 256, 7);
    cmd.barrier(Stage::Transfer, Stage::Transfer);
    cmd.fill(&to, 16, 8, 9);
    cmd.copy(&from, 40, &to, 80, 12);
    cmd.submit().unwrap().wait().unwrap();
    let mut expected = [7; 64];
    expected[4..6].fill(9);
    expected[20..23].copy_from_slice(&numbers(64, 5)[10..13]);
    assert_eq!(to.read::<u32>(0..64).unwrap(), expected);
}

#[test]
fn dispatches_compute_and_scopes_are_timed() {
    let gpu = open();
    let pipeline = gpu.pipeline(LIST_ARGS, &[]).unwrap();
    let lengths = [1u32, 32_768, 32_769, 70_000, 0, 5, 6, 7, 8, 9];
    let heads: Vec<[u32; 5]> = lengths.iter().map(|&n| [99, 99, 99, n, 2 * n]).collect();
    let buffer = gpu.buffer_with("heads", &heads).unwrap();
    let totals = gpu.buffer_with("totals", &[[100i64; 2]; 10]).unwrap();
    let mut cmd = gpu.commands().unwrap();
    // All but the last by a direct dispatch; two workgroups.
    let push = ListArgs {
        heads: buffer.address(),
        totals: totals.address(),
        count: 9,
        counted: 0b1010,
    };
    cmd.scope("direct", |cmd| cmd.dispatch(&pipeline, &push, [9, 1, 1]));
    cmd.barrier(Stage::Compute, Stage::Indirect);
    // The last by as many workgroups as the first head now says: one.
    let push = ListArgs {
        heads: buffer.address_at(9 * 20),
        totals: totals.address_at(9 * 16),
        count: 1,
        counted: 0,
    };
    cmd.scope("indirect", |cmd| {
        cmd.scope("inner", |cmd| {
            cmd.dispatch_indirect(&pipeline, &push, &buffer, 0)
        });
    });
    let ticket = cmd.submit().unwrap();
    ticket.wait().unwrap();
    assert!(ticket.is_done().unwrap());

    let found = buffer.read::<[u32; 5]>(0..10).unwrap();
    let row = 32_768;
    for (head, &n) in found.iter().zip(&lengths) {
        assert_eq!(*head, [n.min(row), n.div_ceil(row), 1, n, 2 * n]);
    }
    let mut expected = [[100; 2]; 10];
    expected[1] = [100 + 32_768, 100 + 65_536];
    expected[3] = [100 + 70_000, 100 + 140_000];
    assert_eq!(totals.read::<[i64; 2]>(0..10).unwrap(), expected);
    let timings = gpu.timings();
    let names: Vec<_> = timings.iter().map(|t| t.name).collect();
    assert_eq!(names, ["direct", "indirect", "inner"]);
    assert!(
        timings
            .iter()
            .all(|t| t.calls == 1 && t.ms >= 0.0 && t.ms < 60_000.0)
    );
    assert!(timings[1].ms >= timings[2].ms);
}

/// Resources may go in any order, before their work is sent, with recordings left open, and after the last handle on
/// the device: nothing leaks and the validation layer, which looks at the end, has nothing to say.
#[test]
fn teardown_is_silent_in_any_order() {
    let gpu = open();
    let result = gpu.buffer("result", 16, Memory::Device).unwrap();
    let mut cmd = gpu.commands().unwrap();
    {
        let pipeline = gpu.pipeline(LIST_ARGS, &[]).unwrap();
        let heads = gpu
            .buffer_with("heads", &[[0u32, 0, 0, 40_000, 0]])
            .unwrap();
        let push = ListArgs {
            heads: heads.address(),
            totals: heads.address(),
            count: 1,
            counted: 0,
        };
        cmd.dispatch(&pipeline, &push, [1, 1, 1]);
        cmd.barrier(Stage::Compute, Stage::Transfer);
        cmd.copy(&heads, 0, &result, 0, 16);
    }
    // Somebody else's submissions must not free what `cmd` still needs.
    gpu.buffer_with("other", &[1u32]).unwrap();
    let mut abandoned = gpu.commands().unwrap();
    abandoned.upload(&result, 0, &[5u32; 4]).unwrap();
    drop(abandoned);
    let ticket = cmd.submit().unwrap();
    ticket.wait().unwrap();
    assert_eq!(result.read::<u32>(0..4).unwrap(), [32_768, 2, 1, 40_000]);

    // Not waited for.
    let mut cmd = gpu.commands().unwrap();
    cmd.fill(&result, 0, 16, 0);
    drop(cmd.submit().unwrap());
    gpu.check_validation().unwrap();
    drop((ticket, gpu));
    drop(result);
    let said = String::from_utf8_lossy(&log().lock().unwrap()).into_owned();
    assert!(
        !said.contains("validation:") && !said.contains("freeing"),
        "{said}"
    );
}

#[test]
fn devices_are_listed_and_chosen_by_index_or_name() {
    let all = devices().unwrap();
    let usable = all
        .iter()
        .find(|d| d.missing.is_empty())
        .expect("a device that can bake");
    assert!(
        all.iter()
            .enumerate()
            .all(|(i, d)| d.index == i && !d.name.is_empty() && d.memory > 0)
    );
    let chosen = |device: &str| {
        let device = Some(device.to_owned());
        Gpu::new(&GpuOptions {
            device,
            validate: false,
        })
    };
    assert_eq!(
        chosen(&usable.index.to_string()).unwrap().info().index,
        usable.index
    );
    assert_eq!(
        chosen(&usable.name.to_uppercase()).unwrap().info().name,
        usable.name
    );
    for wanted in ["no such device", "99"] {
        let error = chosen(wanted).err().expect("there is none").to_string();
        assert!(
            error.contains(wanted) && error.contains("rebake devices"),
            "{error}"
        );
    }
}

#[test]
fn a_buffer_that_does_not_fit_is_named() {
    // Without the layer, which would speak up before the driver does.
    let gpu = Gpu::new(&GpuOptions::default()).unwrap();
    let error = gpu
        .buffer("whale", 1 << 50, Memory::Device)
        .err()
        .expect("a petabyte is too much");
    assert!(
        matches!(&error, GpuError::OutOfMemory { name, bytes, .. } if name == "whale" && *bytes == 1 << 50)
    );
    // The device is still there.
    let buffer = gpu.buffer_with("minnow", &[1u32, 2]).unwrap();
    assert_eq!(buffer.read::<u32>(0..2).unwrap(), [1, 2]);
}
