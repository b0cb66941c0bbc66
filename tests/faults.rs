//! What goes wrong around a run: it is killed, or the disk is full. Nothing that was written before is lost, nothing is half-written, and
//! what goes on comes to the same bits.

use std::process::Stdio;
use std::time::Duration;

use crate::common::prelude::*;
use crate::common::program::on_device;
use photonmill::engine::saved::SavedRun;

const SMALL: &str = "--size 8x8 --photons 500 --caustic-photons 300 --block 1 -q";

/// Kills a run at moments spread over its length, goes on from its checkpoint each time, and at last lets it end.
fn killed_runs_go_on(moments: u32) {
    let place = Place::new();
    let line = |rounds: u32, more: &str| on_device(&format!("render cornell-spheres {SMALL} --rounds {rounds} {more}"));
    let began = Instant::now();
    place.succeed(&format!("render cornell-spheres {SMALL} --rounds 96 -o whole.exr"));
    let length = began.elapsed();
    let mut rounds_before = 0;
    for moment in 1..=moments {
        let resume = if place.at("c.pms").exists() { "--resume c.pms" } else { "" };
        let mut child =
            place.command(&line(96, &format!("-o a.exr --checkpoint c.pms --every 1ms {resume}"))).stdout(Stdio::null()).spawn().unwrap();
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

/// No file grows beyond two kilobytes, as on a disk that is full: a picture is that small, and a checkpoint or a map is not.
#[test]
fn a_full_disk_costs_nothing_that_was_there() {
    let Some(_) = device() else { return };
    let place = Place::new();
    let full = |line: &str| place.shell(&on_device(&format!("ulimit -f 2; exec photonmill {line}"))).output().unwrap();
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
