//! Texts of `--help`: the built-in scenes, and examples for each command.
//!
//! Options stand under the same headings in all commands, in this order: Output, Scene, When to stop, Measurements, Photons,
//! Light transport, Density estimate, Implementation, Checks, Messages, Device. clap prints headings in the order in which
//! the structs' fields first name them; a heading of a whole struct goes on after it, until the next one.

use crate::scene::built_in;

/// Printed where no argument is given.
pub(super) const START: &str = "\
photonmill: photon mapping on any Vulkan GPU

Three commands to start with:
  photonmill render cornell-spheres -o picture.png    render a built-in scene
  photonmill render scene.glb -o picture.png          render your own scene (glTF, from Blender for example)
  photonmill --variant atomic                         light the box of the paper and write open-box.png

`photonmill --help` lists all commands and options.";

pub(super) fn scene() -> String {
    format!("glTF file (.gltf or .glb), or a built-in scene: {}", built_in::names().join(", "))
}

pub(super) const MAIN: &str = "\
Examples:
  photonmill --preset modified
      The paper's modified implementation: 5000 photons, 15 bounces; writes open-box.png
  photonmill --variant persistent --photons 1048576 -o box.exr
      A million photons by the persistent builder
  photonmill --error 1% --json report.json
      As many rounds as an error of 1 % takes, with a report
  photonmill render scene.glb -o picture.png
      A scene of your own";

pub(super) const RENDER: &str = "\
Examples:
  photonmill render cornell-spheres -o picture.png
      A built-in scene
  photonmill render scene.glb -o picture.exr --size 1920 --error 2%
      Your own scene, 1920 pixels wide, until the error is at most 2 %
  photonmill render scene.glb -o picture.png --camera Camera.001 --time 1m --error-image error.exr
      Another camera, one minute, and the standard error of each pixel";

pub(super) const REPEAT: &str = "\
Examples:
  photonmill repeat picture.exr
      Renders it again; exit code 1 if a single bit of its values differs
  photonmill repeat picture.png --scene moved/scene.glb -o again.png
      The same where the scene has moved, and writes what comes out";

pub(super) const BAKE: &str = "\
Examples:
  photonmill bake scene.glb -o baked
      Lightmaps of all surfaces, and your file with coordinates for them
  photonmill bake scene.glb -o baked --texels-per-metre 64 --error 5%
      A finer lightmap, until the error is at most 5 %
  photonmill bake scene.glb -o baked --atlas 2048 --preview
      All lightmaps in pictures of 2048 x 2048 texels, and a copy for viewers";

pub(super) const PROBE: &str = "\
Examples:
  echo '0.5 0.01 0.5 0 1 0' | photonmill probe cornell --points - -o -
      Irradiance at one point above the floor, on standard output
  photonmill probe scene.glb --points points.txt -o irradiance.csv --error 1%
      Irradiance at the points of a file, until the error is at most 1 %";

pub(super) const MERGE: &str = "\
Examples:
  photonmill render scene.glb --rounds 256 --shard 1/2 --checkpoint one.pms
  photonmill render scene.glb --rounds 256 --shard 2/2 --checkpoint two.pms
  photonmill merge one.pms two.pms -o picture.exr
      A run in two parts, which two machines may do";

pub(super) const MAP: &str = "\
Examples:
  photonmill map scene.glb -o map.pm --rounds 64
      The photons of 64 independent rounds
  photonmill render scene.glb --map map.pm --camera Camera.001 -o picture.png
      A picture from them, with another camera
  photonmill map info map.pm
      What the file holds
  photonmill map export map.pm -o photons.ply --rounds 1
      The photons of its first round for Blender, MeshLab or Open3D";

pub(super) const PLAN: &str = "\
Examples:
  photonmill plan scene.glb
      The effects that rendering this scene would simulate, and the memory that it needs
  photonmill plan cornell --size 1920x1080 --json plan.json
      The same as JSON";

pub(super) const INFO: &str = "\
Examples:
  photonmill info scene.glb
      Meshes, textures, lights, what became of every material, and what is not simulated
  photonmill info scene.glb --json info.json
      The same as JSON";

pub(super) const COMPARE: &str = "\
Examples:
  photonmill compare picture.exr reference.exr
      RMSE, relMSE, bias, the largest deviation and FLIP
  photonmill compare picture.exr reference.exr --errors-a error.exr -o z.png --show z
      Also z-scores, whether the pictures agree within the errors, and where they do not
  photonmill compare picture.png expected.png --fail-above 1%
      For scripts: exit code 1 if the RMSE is above 1 % of the reference's mean

Without --fail-above the exit code is 0 however far apart the pictures are.";

pub(super) const DEVICES: &str = "\
Examples:
  photonmill devices
      All Vulkan devices; their number or name is what --device takes
  photonmill devices --json devices.json
      The same as JSON";

pub(super) const SELFCHECK: &str = "\
Examples:
  photonmill selfcheck
      Checks the default device
  photonmill selfcheck --device 1 --json selfcheck.json
      Checks another device; the report is JSON";

pub(super) const COMPLETIONS: &str = "\
Examples:
  photonmill completions bash > ~/.local/share/bash-completion/completions/photonmill
      For bash, with the package bash-completion
  photonmill completions zsh > ~/.zfunc/_photonmill
      For zsh, where ~/.zfunc is in fpath
  photonmill completions fish > ~/.config/fish/completions/photonmill.fish
      For fish";

pub(super) const MAN: &str = "\
Examples:
  photonmill man ~/.local/share/man/man1
      Writes a page for each command; then: man photonmill-render
  photonmill man | man -l -
      Shows the first page";
