//! The program as a user starts it: a command line in a folder of its own, and what it leaves there.

use std::io::{BufRead, BufReader, Lines, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, Command, Output, Stdio};
use std::sync::LazyLock;
use std::sync::mpsc::{self, Sender};
use std::time::Duration;

use serde_json::Value;

use super::{no_gpu, work};

/// A file of this build, in whose folder that of the tests' own program is.
pub fn built(name: &str) -> PathBuf {
    let tests = std::env::current_exe().expect("a program knows where it is");
    tests.ancestors().nth(2).expect("it lies in a folder of the build").join(name)
}

/// The program, as a path.
pub fn program() -> &'static str {
    static PROGRAM: LazyLock<String> = LazyLock::new(|| {
        let path = built(&format!("photonmill{}", std::env::consts::EXE_SUFFIX));
        assert!(
            path.is_file(),
            "the program is not built: {} is not there; `tools/test` builds it, and so does `cargo test`",
            path.display()
        );
        path.into_os_string().into_string().expect("the path is text")
    });
    &PROGRAM
}

/// What has not happened by then does not happen, however busy the machine.
pub const PATIENCE: Duration = Duration::from_secs(600);

/// A folder of its own in which the program runs.
pub struct Place(tempfile::TempDir);

/// A run that goes on until a signal ends it, or the end of its test.
pub struct Running {
    child: Child,
    lines: Lines<BufReader<ChildStderr>>,
    /// Kills what hangs; ends when this is dropped.
    _guard: Sender<()>,
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Running {
    /// The next line on stderr that holds a word.
    #[track_caller]
    pub fn line_with(&mut self, word: &str) -> String {
        let found = self.lines.by_ref().map_while(Result::ok).find(|line| line.contains(word));
        found.unwrap_or_else(|| panic!("the run ends without a line with {word}"))
    }

    pub fn signal(&self, name: &str) {
        assert!(Command::new("kill").args([&format!("-{name}"), &self.child.id().to_string()]).status().unwrap().success());
    }

    /// Its exit code, what else it says on stderr, and all of stdout.
    pub fn end(mut self) -> (Option<i32>, Vec<String>, String) {
        let rest = self.lines.by_ref().map_while(Result::ok).collect();
        let mut stdout = String::new();
        self.child.stdout.take().expect("it is piped").read_to_string(&mut stdout).unwrap();
        (self.child.wait().unwrap().code(), rest, stdout)
    }
}

/// The words of a command line, of which '...' is one.
fn words(line: &str) -> Vec<&str> {
    let parts = line.split('\'').enumerate();
    parts.flat_map(|(k, part)| if k % 2 == 1 { vec![part] } else { part.split_whitespace().collect() }).collect()
}

/// A command line on the device under test, if it uses one and names none.
pub fn on_device(line: &str) -> String {
    let has_none = ["compare", "denoise", "devices", "info", "map export", "map info", "merge"].iter().any(|name| line.starts_with(name));
    let device = std::env::var("PHOTONMILL_DEVICE").ok().filter(|_| !has_none && !line.contains("--device"));
    device.map_or(line.to_owned(), |device| format!("{line} --device '{device}'"))
}

/// The same under the validation layer.
pub fn validated(line: &str) -> String {
    on_device(if no_gpu() { line.to_owned() } else { format!("{line} --validate") }.as_str())
}

impl Place {
    pub fn new() -> Place {
        Place(tempfile::tempdir().unwrap())
    }

    pub fn path(&self) -> &Path {
        self.0.path()
    }

    pub fn at(&self, name: &str) -> PathBuf {
        self.path().join(name)
    }

    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        std::fs::write(self.at(name), content).unwrap();
    }

    pub fn command(&self, line: &str) -> Command {
        self.prepared(Command::new(program()), line)
    }

    fn prepared(&self, mut command: Command, line: &str) -> Command {
        work::of_program();
        // `tools/test` takes lavapipe's threads away; a user has them, and the order of additions then differs from run to run.
        command.env_remove("LP_NUM_THREADS").current_dir(self.path()).args(words(line)).stdin(Stdio::null());
        command
    }

    /// Starts a run that a signal is to end.
    pub fn start(&self, line: &str) -> Running {
        let mut command = Command::new("env");
        // The program leaves alone what it was started to ignore, and tests that nohup or a script's & starts ignore some signals.
        command.args(["--default-signal=INT,TERM,HUP", program()]);
        let mut child = self.prepared(command, line).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("env is there");
        let (guard, ended) = mpsc::channel();
        let id = child.id().to_string();
        std::thread::spawn(move || {
            if ended.recv_timeout(PATIENCE) == Err(mpsc::RecvTimeoutError::Timeout) {
                let _ = Command::new("kill").args(["-KILL", &id]).status();
            }
        });
        let lines = BufReader::new(child.stderr.take().expect("it is piped")).lines();
        Running { child, lines, _guard: guard }
    }

    pub fn run(&self, line: &str) -> Output {
        self.command(line).output().expect("the program starts")
    }

    /// What a run on the device under test says on stdout and stderr; it must end well.
    #[track_caller]
    pub fn succeed(&self, line: &str) -> (String, String) {
        self.said(&on_device(line))
    }

    /// The one line by which the program refuses a command line, with exit code 2, nothing on stdout and no new file; or what
    /// it does instead.
    pub fn refusal(&self, line: &str) -> Result<String, String> {
        let before = self.names();
        let output = self.run(line);
        let stderr = text(&output.stderr);
        let fault = if output.status.code() != Some(2) {
            format!("ends with {:?}", output.status.code())
        } else if stderr.trim_end().lines().count() != 1 || !stderr.starts_with("photonmill: ") {
            "is not one line".to_owned()
        } else if !output.stdout.is_empty() || self.names() != before {
            "left something behind".to_owned()
        } else {
            return Ok(stderr);
        };
        Err(format!("{line} {fault}: {}", stderr.lines().take(4).collect::<Vec<_>>().join(" | ")))
    }

    /// Fails unless each line is refused, and the refusal names its words.
    #[track_caller]
    pub fn assert_refused<'a>(&self, cases: impl IntoIterator<Item = (impl AsRef<str>, impl AsRef<[&'a str]>)>) {
        let fault = |line: &str, named: &[&str]| {
            let refusal = match self.refusal(line) {
                Ok(refusal) => refusal,
                Err(fault) => return Some(fault),
            };
            let word = named.iter().find(|word| !refusal.contains(**word))?;
            Some(format!("{line} must name {word:?}: {refusal}"))
        };
        let faults: Vec<String> = cases.into_iter().filter_map(|(line, named)| fault(line.as_ref(), named.as_ref())).collect();
        assert!(faults.is_empty(), "{}", faults.join("\n"));
    }

    /// A loader that knows no driver is a machine without a device.
    pub fn run_without_vulkan(&self, line: &str) -> Output {
        without_vulkan(&mut self.command(line)).output().expect("the program starts")
    }

    /// A line of a shell, in which the program is called photonmill.
    pub fn shell(&self, line: &str) -> Command {
        let mut command = Command::new("bash");
        command.args(["-c", &line.replace("photonmill", program())]).current_dir(self.path()).stdin(Stdio::null());
        command
    }

    /// Whether a line whose reader goes away or whose disk is full ends so, with so many lines on stderr.
    #[track_caller]
    pub fn assert_shell(&self, line: &str, code: i32, complaints: usize) {
        let output = self.shell(&format!("set -o pipefail; {line}")).output().unwrap();
        let stderr = text(&output.stderr);
        assert_eq!((output.status.code(), stderr.lines().count()), (Some(code), complaints), "{line}: {stderr}");
    }

    pub fn text(&self, name: &str) -> String {
        std::fs::read_to_string(self.at(name)).unwrap()
    }

    pub fn json(&self, name: &str) -> Value {
        serde_json::from_str(&self.text(name)).expect("it is JSON")
    }

    pub fn picture(&self, name: &str) -> image::DynamicImage {
        image::open(self.at(name)).unwrap()
    }

    /// Values of an .exr, three a pixel.
    pub fn pixels(&self, name: &str) -> Vec<f32> {
        self.picture(name).into_rgb32f().into_raw()
    }

    /// What lies in the folder, sorted.
    pub fn names(&self) -> Vec<String> {
        entries(self.path())
    }

    /// Fails unless a line's last option is refused with each of these values, as they were typed, by what is allowed. A comma and a space
    /// stand between values.
    #[track_caller]
    pub fn assert_values_refused(&self, cases: &[(&str, &str, &str)]) {
        for (line, values, allowed) in cases {
            let option = line.rsplit(' ').next().unwrap_or_default();
            for typed in values.split(", ") {
                let refusal = self.refusal(&format!("{line} '{typed}'")).unwrap();
                let is_named = refusal.starts_with(&format!("photonmill: {option} {typed}: "));
                assert!(is_named && refusal.contains(*allowed), "{line} {typed} must name {allowed:?}: {refusal}");
            }
        }
    }

    /// What a run says on stdout and stderr, with no device added to its options; it must end well.
    #[track_caller]
    pub fn said(&self, line: &str) -> (String, String) {
        let output = self.run(line);
        assert!(output.status.success(), "{line}: {}", text(&output.stderr));
        (text(&output.stdout), text(&output.stderr))
    }
}

/// What lies in a folder, sorted.
pub fn entries(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

pub fn without_vulkan(command: &mut Command) -> &mut Command {
    command.env("VK_DRIVER_FILES", "/nonexistent").env("VK_ICD_FILENAMES", "/nonexistent")
}

pub fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Fails unless a text has all of these words.
#[track_caller]
pub fn assert_says<'a>(text: &str, words: impl IntoIterator<Item = &'a str>) {
    let missing: Vec<&str> = words.into_iter().filter(|word| !text.contains(*word)).collect();
    assert!(missing.is_empty(), "{missing:?} is not in\n{text}");
}
