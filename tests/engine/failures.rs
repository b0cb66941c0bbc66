//! What goes wrong around a run: it is killed, or the disk is full. Nothing that was written before is lost, nothing is half-written, and
//! what goes on comes to the same bits.

use std::process::Command;

use crate::common::prelude::*;
use crate::common::program::on_device;
use photonmill::engine::run::saved::SavedRun;

/// A radius that is given needs no trial.
const SMALL: &str = "--size 8x8 --photons 500 --caustic-photons 300 --radius 0.05 --block 1 -q";

/// Ends a run by one signal after another, so many of them KILL, goes on from its checkpoint each time, and at last lets it end. (That a
/// file is whole or not there is what a full disk shows: it takes little time to write one.)
#[test]
fn ended_runs_go_on_to_the_same_bits() {
    let Some(_) = device() else { return };
    let (signals, kills) = of_run::<(&[_], _)>((&[("INT", 130)], 1), (&[("INT", 130), ("TERM", 143), ("HUP", 129)], 100));
    let place = Place::new();
    // More rounds than any device does before it is reported, and no more than may have other units.
    let line = |rounds: u32, more: &str| on_device(&format!("render cornell {SMALL} --rounds {rounds} {more}"));
    let asked = signals.iter().map(|(signal, code)| (*signal, Some(*code), "1h"));
    let (mut done, mut done_when_asked) = (0, 0);
    for (number, (signal, code, every)) in asked.chain(std::iter::repeat_n(("KILL", None, "1ms"), kills)).enumerate() {
        let resume = if done > 0 { "--resume c.pms" } else { "" };
        let line = line(65_536, &format!("-o a.exr --checkpoint c.pms --every {every} {resume}")).replace(" -q ", " --progress json ");
        let mut run = place.start(&line);
        // Some blocks later each time.
        (0..=(number * 3 + 6) % 17).for_each(|_| _ = run.line_with("\"photons\""));
        run.signal(signal);
        let (ended_with, rest, _) = run.end();
        assert_eq!(ended_with, code, "SIG{signal}: {rest:?}");
        let saved = SavedRun::from_bytes(&std::fs::read(place.at("c.pms")).unwrap()).unwrap();
        assert!(saved.done.count() >= done && saved.missing() > 0, "SIG{signal}: {:?}", saved.done);
        assert!(saved.done.count() > done || code.is_none(), "SIG{signal}: nothing was saved");
        done = saved.done.count();
        done_when_asked = if code.is_some() { done } else { done_when_asked };
    }
    assert!(done > done_when_asked, "nothing was saved before a run was killed");
    let end = |more: &str| assert!(place.run(&line(done + 20, more)).status.success(), "{more}");
    end("-o a.exr --checkpoint c.pms --resume c.pms");
    end("-o whole.exr");
    assert!(std::fs::read(place.at("a.exr")).unwrap() == std::fs::read(place.at("whole.exr")).unwrap(), "another picture");
}

/// No file grows beyond four kilobytes, as on a disk that is full: a picture is that small, and a checkpoint or a map is not.
#[test]
fn a_full_disk_costs_nothing_that_was_there() {
    let Some(_) = device() else { return };
    let place = Place::new();
    let full = |line: &str| place.shell(&on_device(&format!("ulimit -f 4; exec photonmill {line}"))).output().unwrap();
    place.succeed(&format!("render cornell {SMALL} --rounds 4 -o a.png --checkpoint c.pms"));
    let before = std::fs::read(place.at("c.pms")).unwrap();
    let output = full(&format!("render cornell {SMALL} --rounds 8 -o b.png --checkpoint c.pms --resume c.pms"));
    let stderr = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    let last = stderr.lines().last().unwrap_or_default();
    assert!(last.starts_with("photonmill: --checkpoint c.pms: cannot be written") && stderr.lines().count() == 1, "{stderr}");
    assert!(std::fs::read(place.at("c.pms")).unwrap() == before, "the checkpoint that was there is another one");
    // The results are there all the same.
    assert!(place.at("b.png").exists() && text(&output.stdout).contains("noise"), "{}", text(&output.stdout));

    let names = place.names();
    let output = full("map cornell -o m.pm --photons 500 --rounds 4 -q");
    let stderr = text(&output.stderr);
    assert_eq!((output.status.code(), stderr.lines().count()), (Some(2), 1), "{stderr}");
    assert!(stderr.starts_with("photonmill: -o m.pm: cannot be written"), "{stderr}");
    assert_eq!(place.names(), names, "a part of a file is left");
}

/// Has a run hand commands over after every block, also on a device that could do all of it at once.
const STEP_BY_STEP: &str = "--checkpoint c.pms --every 1ms";
/// A submission amid the rounds: a run of [`Faulty`]'s scene takes some 90 to 300.
const MIDWAY: u32 = 60;

/// Runs of one line, with planted faults.
struct Faulty {
    place: Place,
    line: String,
}

impl Faulty {
    fn new(line: &str) -> Faulty {
        let place = Place::new();
        place.succeed(&format!("{line} -o whole.exr {STEP_BY_STEP}"));
        std::fs::remove_file(place.at("c.pms")).unwrap();
        Faulty { place, line: line.to_owned() }
    }

    /// Exit code and stderr of a run that writes `a.exr`.
    fn run(&self, faults: &str, more: &str) -> (Option<i32>, String) {
        let mut command = self.place.command(&format!("{} -o a.exr {more}", self.line));
        let output = command.env("PHOTONMILL_FAULTS", faults).output().unwrap();
        (output.status.code(), text(&output.stderr))
    }

    fn assert_whole(&self, what: &str) {
        let picture = |name: &str| std::fs::read(self.place.at(name)).unwrap();
        assert!(picture("a.exr") == picture("whole.exr"), "{what}: another picture");
        std::fs::remove_file(self.place.at("a.exr")).unwrap();
    }

    /// A run with faults ends well, and says of each how it goes on, in any order.
    fn assert_goes_on(&self, faults: &str, more: &str, said: &[&str]) {
        let (code, stderr) = self.run(faults, &format!("{more} {STEP_BY_STEP}"));
        let mut lines: Vec<&str> = stderr.lines().collect();
        for said in said {
            let place = lines.iter().position(|line| line.starts_with("photonmill: warning: ") && line.contains(said));
            lines.remove(place.unwrap_or_else(|| panic!("{faults}: {stderr}")));
        }
        assert!(code == Some(0) && lines.is_empty(), "{faults}: {stderr}");
        self.assert_whole(faults);
    }

    /// A run with faults ends with one line of its own.
    fn assert_ends(&self, faults: &str, more: &str, start: &str) {
        let (code, stderr) = self.run(faults, more);
        assert_eq!((code, stderr.lines().count()), (Some(1), 1), "{faults}: {stderr}");
        assert!(stderr.starts_with(start) && !self.place.at("a.exr").exists(), "{faults}: {stderr}");
    }
}

const ANEW: &str = "was opened anew, and the run goes on: vk";
const SMALLER: &str = "goes on in smaller pieces, with";

/// A device that is lost or whose memory is full goes on to the same bits, in the trial as in any round. What one that is lost for good had
/// done is in the checkpoint.
#[test]
fn a_device_that_fails_goes_on_to_the_same_bits() {
    let all = is_long_run();
    let Some(gpu) = device() else { return };
    // A GPU does several rounds in the millisecond between two checkpoints; two of them wait for no checkpoint, and submit seldom.
    let (rounds, midway_of_two) = if gpu.facts().kind == "cpu" { (40, MIDWAY) } else { (400, MIDWAY / 3) };
    let scene = Faulty::new(&format!("render cornell --size 8x8 --photons 1500 --block 1 -q --rounds {rounds}"));
    let alone = &on_device("");
    if all {
        scene.assert_goes_on(&format!("vkQueueSubmit2@6=lost,vkWaitForFences@15=lost,vkQueueSubmit2@{MIDWAY}=lost"), alone, &[ANEW; 3]);
        let memory = "vkAllocateMemory@20=device-memory,vkAllocateMemory@60=device-memory,vkCreateComputePipelines@4=host-memory";
        scene.assert_goes_on(&format!("{memory},vkQueueSubmit2@{MIDWAY}=lost"), alone, &[SMALLER, SMALLER, SMALLER, ANEW]);
    }
    // One of two devices, too.
    let number = std::env::var("PHOTONMILL_DEVICE").map_or(0, |_| gpu.facts().index);
    let one_of_two = format!("vkQueueSubmit2@{midway_of_two}=lost,vkAllocateMemory@90=device-memory");
    scene.assert_goes_on(&one_of_two, &format!("--devices {number},{number}"), &[ANEW, SMALLER]);
    let of_box = Faulty::new("--rounds 30 --photons 800 --rng philox --mesh 8 -q");
    of_box.assert_goes_on("vkCreateBuffer@20=host-memory,vkQueueSubmit2@6=lost", alone, &[SMALLER, ANEW]);

    std::fs::remove_file(scene.place.at("c.pms")).unwrap();
    scene.assert_ends(&format!("vkQueueSubmit2@{MIDWAY}+=lost"), &format!("{alone} {STEP_BY_STEP}"), "photonmill: vk");
    let saved = SavedRun::from_bytes(&std::fs::read(scene.place.at("c.pms")).unwrap()).unwrap();
    assert!(!saved.done.is_empty() && saved.missing() > 0, "{:?}", saved.done);
    assert_eq!(scene.run("", &format!("{alone} --resume c.pms")), (Some(0), String::new()));
    scene.assert_whole("gone on from the checkpoint");
    // Not a line of Rust's own, and no file, where it is lost before anything is done.
    let names = scene.place.names();
    let early = ["vkCreateDevice@1=lost", "vkAllocateMemory@1+=device-memory", "vkQueueSubmit2@12+=lost"];
    for faults in early.into_iter().take(if all { 3 } else { 2 }) {
        scene.assert_ends(faults, alone, "photonmill: ");
        assert_eq!(scene.place.names(), names, "{faults}");
    }
}

/// Photons for a file go on behind the last whole round.
#[test]
fn a_map_goes_on_behind_its_last_whole_round() {
    let Some(_) = device() else { return };
    let place = Place::new();
    let line = "map cornell --photons 900 --rounds 30 -q";
    place.succeed(&format!("{line} -o whole.pm"));
    let make = |faults: &str| place.command(&on_device(&format!("{line} -o a.pm"))).env("PHOTONMILL_FAULTS", faults).output().unwrap();
    let output = make("vkQueueSubmit2@70=lost");
    assert!(output.status.success() && text(&output.stderr).contains(ANEW), "{}", text(&output.stderr));
    assert!(std::fs::read(place.at("a.pm")).unwrap() == std::fs::read(place.at("whole.pm")).unwrap(), "other photons");
    let output = make("vkQueueSubmit2@70+=lost");
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    place.succeed("map info a.pm --json a.json");
    let rounds = place.json("a.json")["rounds"].as_u64().unwrap();
    assert!((1..30).contains(&rounds), "{rounds} rounds");
}

/// What --memory allows is never exceeded: smaller pieces, and the same bits; too little is refused by what is needed.
#[test]
fn memory_is_kept_to() {
    let limits = of_run::<&[_]>(&[("12MiB", 12 << 20)], &[("12MiB", 12 << 20), ("20MiB", 20 << 20), ("12582912", 12 << 20)]);
    let Some(_) = device() else { return };
    let place = Place::new();
    let line = "render cornell --size 24x24 --photons 60000 --rounds 2 --block 1 -q";
    place.succeed(&format!("{line} -o whole.exr --json whole.json"));
    let bytes = |name: &str| place.json(name)["plan"]["bytes"].as_u64().unwrap();
    let chunk = |name: &str| place.json(name)["plan"]["maps"][0]["chunk_photons"].as_u64().unwrap();
    for &(limit, most) in limits {
        place.succeed(&format!("{line} -o a.exr --json a.json --memory {limit}"));
        assert!(std::fs::read(place.at("a.exr")).unwrap() == std::fs::read(place.at("whole.exr")).unwrap(), "{limit}: another picture");
        assert!(bytes("a.json") <= most && bytes("whole.json") > most, "{limit}: {}, {}", bytes("a.json"), bytes("whole.json"));
        assert!(chunk("a.json") < chunk("whole.json"));
    }
    place.assert_refused([
        (on_device("render cornell-spheres --size 1000x1000 -q -o b.exr --memory 8M"), ["--memory 8M", "MiB of device memory"].as_slice()),
        (on_device(&format!("{line} -o b.exr --memory 1023K")), ["--memory 1023K", "from 1M to"].as_slice()),
        (on_device(&format!("{line} -o b.exr --memory lots")), ["--memory lots", "512M"].as_slice()),
        (on_device(&format!("{line} -o b.exr --memory -1G")), ["--memory", "512M"].as_slice()),
        ("--variant cpu --memory 1G -o b.png".to_owned(), ["--memory", "--variant cpu"].as_slice()),
    ]);
}

/// Nothing that is read, and nothing that is no file, is lost to an output; what is asked for and cannot be had is reported.
#[test]
fn inputs_and_pipes_stay_what_they_are() {
    let Some(_) = device() else { return };
    let place = Place::new();
    place.succeed(&format!("render cornell {SMALL} --rounds 2 --shard 1/2 -o s.png --checkpoint 1.pms"));
    place.succeed(&format!("render cornell {SMALL} --rounds 2 --shard 2/2 -o s.png --checkpoint 2.pms"));
    place.succeed("map cornell --photons 500 --rounds 2 -q -o m.pm");
    std::fs::write(place.at("p.csv"), "0.5 0.1 0.5 0 1 0\n").unwrap();
    assert!(Command::new("mkfifo").args([place.at("pipe"), place.at("pipe.ply")]).status().unwrap().success());
    let read = "it is also read";
    let no_file = "it is no file that could be replaced as a whole; name a file";
    let refused = [
        ("render cornell --size 8x8 --map m.pm -o y.exr --checkpoint m.pm".into(), read),
        ("render cornell --size 8x8 --map m.pm -o y.exr --json ./m.pm".into(), read),
        (format!("render cornell {SMALL} -o 1.exr --resume 1.pms --trace 1.pms"), read),
        ("probe cornell --points p.csv -o p.csv".into(), read),
        ("probe cornell --points p.csv -o q.csv --checkpoint p.csv".into(), read),
        ("map info m.pm --json m.pm".into(), read),
        ("merge 1.pms 2.pms --checkpoint 2.pms".into(), read),
        ("map cornell -o pipe".into(), no_file),
        ("map export m.pm -o pipe.ply".into(), no_file),
        (format!("render cornell {SMALL} -o y.exr --checkpoint pipe"), no_file),
        ("merge 1.pms 2.pms --checkpoint pipe".into(), no_file),
        (format!("bake cornell {} -o d --checkpoint d", SMALL.replace("--size 8x8 ", "")), "--checkpoint writes it too"),
    ];
    place.assert_refused(refused.map(|(line, word)| (line, [word])));
    let (_, stderr) = place.succeed("render cornell --size 8x8 --samples 1 --photons 4000000 --time 1ms -q -o y.exr --checkpoint none.pms");
    assert!(stderr.contains("warning: --checkpoint none.pms: is not written, as no block of rounds was done"), "{stderr}");
    place.succeed("merge 1.pms 2.pms -o both.exr --checkpoint both.pms");
    let (_, stderr) = place.succeed(&format!("render cornell {SMALL} --rounds 1 -o y.exr --resume both.pms"));
    assert!(stderr.contains("--rounds 1 is less than the 2 rounds of --resume, all of which are kept"), "{stderr}");
}

#[test]
fn devices_and_faults_that_there_are_not_are_refused() {
    let Some(_) = device() else { return };
    let place = Place::new();
    // Numbers in a device's name are not its number.
    let absent = [("--devices 0,99", "--devices 0,99: there is no device 99;"), ("--device 15", "15"), ("--device 99", "99")];
    place.assert_refused(absent.map(|(device, word)| (format!("render cornell {SMALL} -o y.exr {device}"), [word])));
    for faults in ["x", "vkQueueSubmit2@", "vkQueueSubmit2@20=foo", "vkQueueSubmit2@0=lost", ","] {
        let output = place.command(&on_device("render cornell -o y.exr")).env("PHOTONMILL_FAULTS", faults).output().unwrap();
        let stderr = text(&output.stderr);
        assert_eq!((output.status.code(), stderr.lines().count()), (Some(2), 1), "{faults}: {stderr}");
        assert!(stderr.starts_with("photonmill: PHOTONMILL_FAULTS ") && stderr.contains("must be CALL@N=FAULT"), "{faults}: {stderr}");
    }
}
