#![doc = include_str!("links.md")]
#![doc = include_str!("README.md")]
// Each page is Markdown that reads as it stands, too: at its end it says which file each link means. Of two definitions
// of a link the first one counts, so that `links.md` sends rustdoc's readers to modules instead, and `charts.md`
// (written by `build.rs`) to the pictures themselves, since rustdoc keeps no files beside its pages.

#[doc = include_str!("links.md")]
#[doc = include_str!("paper.md")]
pub mod paper {}

#[doc = include_str!("links.md")]
#[doc = include_str!(concat!(env!("OUT_DIR"), "/charts.md"))]
#[doc = include_str!("view.md")]
pub mod view {}

#[doc = include_str!("links.md")]
#[doc = include_str!(concat!(env!("OUT_DIR"), "/charts.md"))]
#[doc = include_str!("scenes.md")]
pub mod scenes {}

#[doc = include_str!("links.md")]
#[doc = include_str!("materials.md")]
pub mod materials {}

#[doc = include_str!("links.md")]
#[doc = include_str!("accuracy.md")]
pub mod accuracy {}

#[doc = include_str!("links.md")]
#[doc = include_str!(concat!(env!("OUT_DIR"), "/charts.md"))]
#[doc = include_str!("study.md")]
pub mod study {}

#[doc = include_str!("links.md")]
#[doc = include_str!(concat!(env!("OUT_DIR"), "/charts.md"))]
#[doc = include_str!("performance.md")]
pub mod performance {}

#[doc = include_str!("links.md")]
#[doc = include_str!("hard_cases.md")]
pub mod hard_cases {}

#[doc = include_str!("links.md")]
#[doc = include_str!("scale.md")]
pub mod scale {}

#[doc = include_str!("links.md")]
#[doc = include_str!("python.md")]
pub mod python {}

#[doc = include_str!("links.md")]
#[doc = include_str!("formats.md")]
pub mod formats {}

#[doc = include_str!("links.md")]
#[doc = include_str!("architecture.md")]
pub mod architecture {}
