//! What goes wrong around a run: it is killed, or the disk is full. Nothing that was written before is lost, nothing is half-written, and
//! what goes on comes to the same bits.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::time::Duration;

use crate::common::prelude::*;
use crate::common::program::on_device;
use photonmill::engine::saved::SavedRun;

const SMALL: &str = "--size 8x8 --photons 500 --caustic-photons 300 --block 1 -q";

/// Kills a run at moments spread over its length, goes on from its checkpoint each time, and at last lets it end. (That a file is whole
/// or not there is what a full disk shows: it takes little time to write one.)
fn killed_runs_go_on(moments: u32) {
    let place = Place::new();
    let line = |more: &str| on_device(&format!("render cornell-spheres {SMALL} --rounds 96 {more}"));
    let began = Instant::now();
    place.succeed(&format!("render cornell-spheres {SMALL} --rounds 96 -o whole.exr --checkpoint c.pms --every 1ms"));
    let length = began.elapsed();
    std::fs::remove_file(place.at("c.pms")).unwrap();
    let mut rounds_before = 0;
    for moment in 1..=moments {
        let resume = if place.at("c.pms").exists() { "--resume c.pms" } else { "" };
        let mut child =
            place.command(&line(&format!("-o a.exr --checkpoint c.pms --every 1ms {resume}"))).stdout(Stdio::null()).spawn().unwrap();
        // Golden sections of the length, so that moments are near to one another nowhere.
        let share = f64::from(moment) * 0.618_033_988_749_895 % 1.0;
        std::thread::sleep(Duration::from_secs_f64(length.as_secs_f64() * share));
        child.kill().unwrap();
        child.wait().unwrap();
        if let Ok(bytes) = std::fs::read(place.at("c.pms")) {
            let saved = SavedRun::from_bytes(&bytes).unwrap_or_else(|fault| panic!("after {share:.2} of the run: {fault}"));
            assert!(saved.done.count() >= rounds_before, "{} blocks, and {rounds_before} before", saved.done.count());
            rounds_before = saved.done.count();
        }
        if let Ok(bytes) = std::fs::read(place.at("a.exr")) {
            assert!(bytes == std::fs::read(place.at("whole.exr")).unwrap(), "after {share:.2} of the run: another picture");
        }
    }
    assert!(rounds_before > 0, "nothing was saved before a run was killed");
    place.succeed(&format!("render cornell-spheres {SMALL} --rounds 96 -o a.exr --checkpoint c.pms --resume c.pms"));
    assert!(std::fs::read(place.at("a.exr")).unwrap() == std::fs::read(place.at("whole.exr")).unwrap(), "another picture at the end");
}

#[test]
fn killed_runs_go_on_to_the_same_bits() {
    if device().is_some() {
        killed_runs_go_on(6);
    }
}

#[test]
#[ignore = "minutes: 100 moments"]
fn runs_killed_at_100_moments_go_on_to_the_same_bits() {
    if device().is_some() {
        killed_runs_go_on(100);
    }
}

/// Each signal that asks a run to end leaves a checkpoint from which it goes on.
#[test]
fn runs_that_signals_end_go_on_to_the_same_bits() {
    let Some(_) = device() else { return };
    let place = Place::new();
    // More rounds than any device does before it is told, and no more than may have other units.
    let line = |rounds: u32, more: &str| format!("render cornell-spheres {SMALL} --rounds {rounds} {more}");
    let mut done = 0;
    for (signal, code) in [("INT", 130), ("TERM", 143), ("HUP", 129)] {
        let resume = if done > 0 { "--resume c.pms" } else { "" };
        let line = line(65_536, &format!("-o a.exr --checkpoint c.pms --every 1h --progress json {resume}")).replace(" -q ", " ");
        let mut child = place.shell(&on_device(&format!("exec env --default-signal=INT,TERM,HUP photonmill {line}")));
        let mut child = child.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map_while(Result::ok);
        assert!(lines.any(|line| line.contains("\"photons\"")), "SIG{signal}: no progress");
        assert!(Command::new("kill").args([&format!("-{signal}"), &child.id().to_string()]).status().unwrap().success());
        let rest: Vec<String> = lines.collect();
        assert_eq!(child.wait().unwrap().code(), Some(code), "SIG{signal}: {rest:?}");
        let saved = SavedRun::from_bytes(&std::fs::read(place.at("c.pms")).unwrap()).unwrap();
        assert!(saved.done.count() > done && saved.missing() > 0, "SIG{signal}: {:?}", saved.done);
        done = saved.done.count();
    }
    place.succeed(&line(done + 20, "-o a.exr --resume c.pms"));
    place.succeed(&line(done + 20, "-o whole.exr"));
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

const LONG: &str = "--size 12x12 --photons 1500 --caustic-photons 800 --block 1 -q --rounds 40";

/// Has a run hand commands over after every block, also on a device that could do all of it at once.
const STEP_BY_STEP: &str = "--checkpoint c.pms --every 1ms";

/// Runs to the end without a fault, and says how often it submits work, which depends on the device.
fn submissions_of(place: &Place, line: &str) -> u64 {
    place.succeed(&format!("{line} -o whole.exr --json whole.json {STEP_BY_STEP}"));
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(place.at("whole.json")).unwrap()).unwrap();
    report["submissions"].as_u64().unwrap()
}

/// Planted faults, and what the run says of each: how it goes on. THIRD stands for that part of what a run submits, and ALL for all of it, which is
/// less than it submits with a fault.
fn assert_goes_on<'a>(line: &str, cases: impl IntoIterator<Item = (&'a str, &'a [&'a str])>) {
    let place = Place::new();
    let picture = |name: &str| std::fs::read(place.at(name)).unwrap();
    let submissions = submissions_of(&place, line);
    for (faults, said) in cases {
        let faults = &faults.replace("THIRD", &(submissions / 3).to_string()).replace("ALL", &submissions.to_string());
        let output =
            place.command(&on_device(&format!("{line} -o a.exr {STEP_BY_STEP}"))).env("PHOTONMILL_FAULTS", faults).output().unwrap();
        let stderr = text(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{faults}: {stderr}");
        let lines: Vec<&str> = stderr.lines().collect();
        let is_said = lines.len() == said.len() && lines.iter().zip(said).all(|(line, said)| line.contains(said));
        assert!(is_said && lines.iter().all(|line| line.starts_with("photonmill: warning: ")), "{faults}: {stderr}");
        assert!(picture("a.exr") == picture("whole.exr"), "{faults}: another picture");
        std::fs::remove_file(place.at("a.exr")).unwrap();
    }
}

const ANEW: &str = "was opened anew, and the run goes on: vk";
const SMALLER: &str = "goes on in smaller pieces, with";

/// A device that is lost or whose memory is full goes on to the same bits: in the trial, in the first round, in later ones, and twice.
#[test]
fn a_device_that_fails_goes_on_to_the_same_bits() {
    let Some(_) = device() else { return };
    let scene: [(&str, &[&str]); 6] = [
        ("vkQueueSubmit2@6=lost", &[ANEW]),
        ("vkWaitForFences@15=lost", &[ANEW]),
        ("vkQueueSubmit2@THIRD=lost,vkQueueSubmit2@ALL=lost", &[ANEW, ANEW]),
        ("vkAllocateMemory@60=device-memory", &[SMALLER]),
        ("vkAllocateMemory@20=device-memory,vkQueueSubmit2@THIRD=lost", &[SMALLER, ANEW]),
        ("vkCreateComputePipelines@4=host-memory", &[SMALLER]),
    ];
    assert_goes_on(&format!("render cornell-spheres {LONG}"), scene);
    let of_box: [(&str, &[&str]); 3] = [
        ("vkQueueSubmit2@6=lost", &[ANEW]),
        ("vkAllocateMemory@20=device-memory", &[SMALLER]),
        ("vkCreateBuffer@20=host-memory,vkQueueSubmit2@6=lost", &[SMALLER, ANEW]),
    ];
    assert_goes_on("--rounds 30 --photons 800 --rng philox --mesh 8 -q", of_box);
}

/// What a device that is lost for good had done is in the checkpoint, and one line says so.
#[test]
fn a_device_that_is_lost_for_good_leaves_a_checkpoint() {
    let Some(_) = device() else { return };
    let place = Place::new();
    let line = format!("render cornell-spheres {LONG}");
    let nearly_all = submissions_of(&place, &line) - 1;
    std::fs::remove_file(place.at("c.pms")).unwrap();
    let kept = on_device(&format!("{line} -o a.exr {STEP_BY_STEP}"));
    let output = place.command(&kept).env("PHOTONMILL_FAULTS", format!("vkQueueSubmit2@{nearly_all}+=lost")).output().unwrap();
    let stderr = text(&output.stderr);
    assert_eq!((output.status.code(), stderr.lines().count()), (Some(1), 1), "{stderr}");
    assert!(stderr.starts_with("photonmill: vk") && stderr.contains("the device was lost"), "{stderr}");
    assert!(!place.at("a.exr").exists(), "a picture of less than all");
    let saved = SavedRun::from_bytes(&std::fs::read(place.at("c.pms")).unwrap()).unwrap();
    assert!(!saved.done.is_empty() && saved.missing() > 0, "{:?}", saved.done);
    place.succeed(&format!("{line} -o a.exr --resume c.pms"));
    assert!(std::fs::read(place.at("a.exr")).unwrap() == std::fs::read(place.at("whole.exr")).unwrap(), "another picture");
    // Not a line of Rust's own, and no file, where it is lost before anything is done.
    let names = place.names();
    for faults in ["vkCreateDevice@1=lost", "vkQueueSubmit2@1=lost", "vkAllocateMemory@1+=device-memory", "vkQueueSubmit2@12+=lost"] {
        let output = place.command(&on_device(&format!("{line} -o b.exr"))).env("PHOTONMILL_FAULTS", faults).output().unwrap();
        let stderr = text(&output.stderr);
        assert_eq!((output.status.code(), stderr.lines().count()), (Some(1), 1), "{faults}: {stderr}");
        assert!(stderr.starts_with("photonmill: ") && place.names() == names, "{faults}: {stderr}");
    }
}

/// One of two devices may be lost, opened anew, or have too little memory.
#[test]
fn one_of_several_devices_that_fails_goes_on() {
    let Some(_) = device() else { return };
    let number = std::env::var("PHOTONMILL_DEVICE").map_or(0, |_| device().unwrap().facts().index);
    let place = Place::new();
    let half = submissions_of(&place, &format!("render cornell-spheres {LONG}")) / 2;
    for (faults, said) in [(format!("vkQueueSubmit2@{half}=lost"), [ANEW]), ("vkAllocateMemory@150=device-memory".into(), [SMALLER])] {
        let line = format!("render cornell-spheres {LONG} -o a.exr --devices {number},{number} {STEP_BY_STEP}");
        let output = place.command(&line).env("PHOTONMILL_FAULTS", &faults).output().unwrap();
        let stderr = text(&output.stderr);
        assert!(output.status.success() && stderr.lines().count() == said.len() && stderr.contains(said[0]), "{faults}: {stderr}");
        assert!(std::fs::read(place.at("a.exr")).unwrap() == std::fs::read(place.at("whole.exr")).unwrap(), "{faults}: another picture");
    }
}

/// Photons for a file go on behind the last whole round.
#[test]
fn a_map_goes_on_behind_its_last_whole_round() {
    let Some(_) = device() else { return };
    let place = Place::new();
    let line = "map cornell-spheres --photons 900 --caustic-photons 500 --rounds 30 -q";
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
    let Some(_) = device() else { return };
    let place = Place::new();
    let line = "render cornell-spheres --size 24x24 --photons 60000 --caustic-photons 30000 --rounds 2 --block 1 -q";
    place.succeed(&format!("{line} -o whole.exr"));
    let bytes = |name: &str| -> f64 { place.json(name)["plan"]["bytes"].as_f64().unwrap() };
    let chunk = |name: &str| place.json(name)["plan"]["maps"][0]["chunk_photons"].as_u64().unwrap();
    place.succeed(&format!("{line} -o a.exr --json whole.json"));
    for limit in ["40M", "20MiB", "12582912"] {
        place.succeed(&format!("{line} -o a.exr --json a.json --memory {limit}"));
        assert!(std::fs::read(place.at("a.exr")).unwrap() == std::fs::read(place.at("whole.exr")).unwrap(), "{limit}: another picture");
        let most = limit.trim_end_matches("MiB").trim_end_matches('M').parse::<f64>().unwrap();
        let most = if most > 1e6 { most } else { most * 1048576.0 };
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

/// Nothing that is read, and nothing that is no file, is lost to an output; what is asked for and cannot be had is told of.
#[test]
fn inputs_and_pipes_stay_what_they_are() {
    let Some(_) = device() else { return };
    let place = Place::new();
    place.succeed(&format!("render cornell {SMALL} --rounds 2 --shard 1/2 -o s.png --checkpoint 1.pms"));
    place.succeed(&format!("render cornell {SMALL} --rounds 2 --shard 2/2 -o s.png --checkpoint 2.pms"));
    place.succeed("map cornell --photons 500 --rounds 2 -q -o m.pm");
    std::fs::write(place.at("p.csv"), "0.5 0.1 0.5 0 1 0\n").unwrap();
    assert!(Command::new("mkfifo").arg(place.at("pipe")).status().unwrap().success());
    let read = "it is also read";
    let no_file = "it is no file that could be replaced as a whole; name a file";
    for (line, expected) in [
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
    ] {
        if line.contains("pipe.ply") {
            std::fs::rename(place.at("pipe"), place.at("pipe.ply")).unwrap();
        }
        let refusal = place.refusal(&line).unwrap_or_else(|why| panic!("{line}: {why}"));
        assert!(refusal.contains(expected), "{line}: {refusal}");
        if line.contains("pipe.ply") {
            std::fs::rename(place.at("pipe.ply"), place.at("pipe")).unwrap();
        }
    }
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
    let refusal = place.refusal(&format!("render cornell {SMALL} -o y.exr --devices 0,99")).unwrap();
    assert!(refusal.starts_with("photonmill: --devices 0,99: there is no device 99;"), "{refusal}");
    // Numbers in a device's name are not its number.
    for number in ["15", "99"] {
        let output = place.run(&format!("render cornell {SMALL} -o y.exr --device {number}"));
        assert_eq!(output.status.code(), Some(2), "{}", text(&output.stderr));
    }
    for faults in ["x", "vkQueueSubmit2@", "vkQueueSubmit2@20=foo", "vkQueueSubmit2@0=lost", ","] {
        let output = place.command(&on_device("render cornell -o y.exr")).env("PHOTONMILL_FAULTS", faults).output().unwrap();
        let stderr = text(&output.stderr);
        assert_eq!((output.status.code(), stderr.lines().count()), (Some(2), 1), "{faults}: {stderr}");
        assert!(stderr.starts_with("photonmill: PHOTONMILL_FAULTS ") && stderr.contains("must be CALL@N=FAULT"), "{faults}: {stderr}");
    }
}
