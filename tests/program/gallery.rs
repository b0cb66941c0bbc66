//! `photonmill gallery`: its pictures, their commands and its page.

use crate::common::prelude::*;

#[test]
#[ignore = "a minute on a software device"]
fn the_gallery_has_its_pictures_and_a_page_that_loads_nothing() {
    if no_gpu() {
        return;
    }
    let place = Place::new();
    place.succeed("gallery -o g --size 24 --error 50% --time 2s");
    let page = place.text("g/index.html");
    assert!(page.len() < 3_000_000 && !page.contains("http") && !page.contains("Incomplete"), "{} bytes", page.len());
    assert_eq!(page.matches("data:image/jpeg;base64,").count(), 14);
    assert_eq!(page.matches(", error at most ").count(), 11);
    for name in ["caustic", "error", "without-caustics", "sunlit-room", "dispersion", "lightmaps/floor"] {
        assert!(place.path().join(format!("g/{name}.png")).is_file(), "{name}");
    }
    // A command on the page makes the picture beside it.
    let (_, rest) = page.split_once("<code>photonmill ").unwrap();
    let (command, _) = rest.split_once("</code>").unwrap();
    assert!(command.starts_with("render cornell-spheres "), "{command}");
    place.succeed(command);
    assert_eq!(place.pixels("caustic.png"), place.pixels("g/caustic.png"));
}
