//! A viewer in a window on a virtual X display, and hands for its keyboard and mouse.

use std::io::Read as _;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// How long anything may take on a busy machine.
const PATIENCE: Duration = Duration::from_secs(90);

/// A virtual display.
pub struct Display {
    server: Child,
    name: String,
}

impl Display {
    pub fn new() -> Self {
        let mut server = Command::new("Xvfb")
            .args([
                "-displayfd",
                "1",
                "-screen",
                "0",
                "1280x720x24",
                "-noreset",
                "-nolisten",
                "tcp",
            ])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("Xvfb starts: apt-get install xvfb xdotool (tools/test does)");
        let mut number = String::new();
        let mut out = server.stdout.take().expect("piped");
        let mut byte = [0];
        while out
            .read(&mut byte)
            .expect("Xvfb writes its display's number")
            == 1
            && byte[0] != b'\n'
        {
            number.push(byte[0].into());
        }
        assert!(!number.is_empty(), "Xvfb found no free display");
        Self {
            server,
            name: format!(":{number}"),
        }
    }

    /// Runs xdotool; what it prints.
    pub fn tool(&self, args: &[&str]) -> String {
        let out = Command::new("xdotool")
            .args(args)
            .env("DISPLAY", &self.name)
            .output()
            .expect("xdotool starts: apt-get install xvfb xdotool (tools/test does)");
        String::from_utf8_lossy(&out.stdout).trim().to_owned()
    }

    pub fn click(&self, x: i32, y: i32) {
        self.tool(&["mousemove", &x.to_string(), &y.to_string()]);
        pause();
        self.tool(&["click", "1"]);
        pause();
    }

    pub fn key(&self, key: &str) {
        self.tool(&["key", key]);
        pause();
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        let _ended = self.server.kill();
        let _reaped = self.server.wait();
    }
}

/// Gives the window the time to take in what was done.
pub fn pause() {
    std::thread::sleep(Duration::from_millis(400));
}

/// Waits until `done` gives something.
pub fn until<T>(what: &str, mut done: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(found) = done() {
            return found;
        }
        assert!(start.elapsed() < PATIENCE, "waited too long for {what}");
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// A viewer on a display.
pub struct Viewer {
    child: Child,
    window: String,
}

impl Viewer {
    /// The Cornell box, roughly.
    pub fn open(display: &Display, folder: &Path, more: &[&str]) -> Self {
        Self::open_at(display, folder, "draft", more)
    }

    pub fn open_at(display: &Display, folder: &Path, quality: &str, more: &[&str]) -> Self {
        let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/cornell.gltf");
        Self::open_scene(display, &scene, folder, quality, more)
    }

    pub fn open_scene(
        display: &Display,
        scene: &Path,
        folder: &Path,
        quality: &str,
        more: &[&str],
    ) -> Self {
        let child = Command::new(env!("CARGO_BIN_EXE_viewer"))
            .arg(scene)
            .args(["--quality", quality, "--validate", "-o"])
            .arg(folder)
            .args(more)
            .env("DISPLAY", &display.name)
            .env_remove("WAYLAND_DISPLAY")
            .stderr(Stdio::piped())
            .spawn()
            .expect("the viewer starts");
        let window = until("a window", || {
            let found = display.tool(&["search", "--name", "rebake viewer"]);
            found.lines().next().map(str::to_owned)
        });
        display.tool(&["windowfocus", &window]);
        Self { child, window }
    }

    /// What the window's title says.
    pub fn title(&self, display: &Display) -> String {
        display.tool(&["getwindowname", &self.window])
    }

    /// Takes the window away from it.
    pub fn take_away(&self, display: &Display) {
        display.tool(&["windowclose", &self.window]);
    }

    /// Waits until the title names what is selected.
    pub fn wait_selected(&self, display: &Display, name: &str) {
        until(name, || {
            let title = self.title(display);
            title.contains(&format!(" - {name} - ")).then_some(())
        });
    }

    pub fn wait_converged(&self, display: &Display) {
        // Twice: what was asked just now has been taken in by the second look.
        for _ in 0..2 {
            pause();
            until("the light", || {
                let title = self.title(display);
                title.contains(" - converged - ").then_some(())
            });
        }
    }

    /// Waits for the end, which has to be a good one, and silent.
    pub fn close(mut self) {
        until("the end", || {
            self.child.try_wait().expect("it can be waited for")
        });
        let mut said = String::new();
        let stderr = self.child.stderr.as_mut().expect("piped");
        stderr.read_to_string(&mut said).expect("text");
        assert_eq!(said, "");
        assert!(self.child.wait().expect("waited for").success());
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        // Only if a check has failed is it still there.
        let _ended = self.child.kill();
        let _reaped = self.child.wait();
    }
}
