//! The files of a bake: what each is called and what it holds.

use std::collections::{HashMap, HashSet};
use std::f32::consts::PI;

use glam::Vec3;
use serde_json::json;

use super::document::{self, Geometry, Kind};
use super::names::{
    self, ENDINGS, ERROR, GEOMETRY, IRRADIANCE, LIGHTMAP, LIGHTMAP_SCENE, Names, PAGE_ENDINGS, RADIANCE, RADIANCE_SCENE, texture_name,
};
use super::original::{self, Extended};
use super::pages::Pages;
use super::{Layout, Map, MeshLightmap, Object};
use crate::engine::error::bound::ErrorSource;
use crate::error::{Error, Result};
use crate::output::colour;
use crate::output::destination::{Folder, write_all};
use crate::output::exr_file;
use crate::scene::gltf::source::{Beside, File, binary_file};
use crate::scene::gltf::writer::Writer;
use crate::scene::material::TextureUse;
use crate::scene::{Material, Scene};

/// A file that was written, and what it is for.
pub(crate) struct Written {
    pub name: String,
    pub purpose: String,
}

/// Writes all files of a built-in scene's bake, or none. `exposure` multiplies radiance (and irradiance / pi) in every
/// PNG and in the scenes; EXR files hold values untouched. `maps` are all of [`Layout::maps`].
pub(crate) fn write(folder: &Folder, scene: &Scene, layout: &Layout, maps: &[Map], exposure: f32) -> Result<()> {
    let names = Names::new(scene, layout);
    let geometry = Geometry::new(scene, layout);
    let intensities: HashMap<usize, f32> =
        maps.iter().flat_map(|map| layout.objects[map.object].meshes.iter().map(|mesh| (*mesh, ceiling(map) * exposure))).collect();
    let pictures = maps.iter().flat_map(|map| {
        let stem = names.stem(map.object);
        let object = &layout.objects[map.object];
        // Encoded only when it is their turn: pictures of a large scene need not lie in memory together.
        let encode = move |ending: &str| match ending {
            IRRADIANCE => colour::exr(map.width, map.height, &map.irradiance),
            ERROR => error_exr((map.width, map.height), &map.error, &map.unseen, map.source),
            LIGHTMAP => {
                let ceiling = ceiling(map);
                colour::linear_png(map.width, map.height, map.irradiance.iter().map(|value| *value / ceiling))
            }
            RADIANCE => radiance_png(scene, layout, object, map, exposure),
            _ => colour::png(map.width, map.height, map.irradiance.iter().map(|value| *value * (exposure / PI))),
        };
        ENDINGS.into_iter().map(move |ending| (format!("{stem}{ending}"), encode(ending)))
    });
    let documents = [(RADIANCE_SCENE, Kind::Radiance), (LIGHTMAP_SCENE, Kind::Lightmap)].into_iter().map(|(name, kind)| {
        let document = document::document(scene, layout, &geometry, &names, kind, |mesh| intensities[&mesh]);
        (name.to_owned(), serde_json::to_vec_pretty(&document).expect("a document is plain data"))
    });
    let files = pictures.chain(textures(scene)).chain([(GEOMETRY.to_owned(), geometry.file.bytes.clone())]).chain(documents);
    write_all(files.map(|(name, content)| (folder.file(&name), content)))
}

/// Names and contents of the files of a scene's textures.
fn textures<'a>(scene: &'a Scene) -> impl Iterator<Item = (String, Vec<u8>)> + 'a {
    document::textures_used(scene).into_iter().map(|index| (texture_name(index), colour::texture_png(&scene.textures[index])))
}

/// Names of the files of a built-in scene's bake.
pub(crate) fn names(scene: &Scene, layout: &Layout) -> Vec<String> {
    let names = Names::new(scene, layout);
    let pictures = (0..layout.objects.len()).flat_map(|object| ENDINGS.map(|ending| format!("{}{ending}", names.stem(object))));
    let textures = document::textures_used(scene).into_iter().map(texture_name);
    pictures.chain(textures).chain([GEOMETRY, RADIANCE_SCENE, LIGHTMAP_SCENE].map(str::to_owned)).collect()
}

/// The user's file with lightmap coordinates, ready to be written with the light. What is wrong with the file is found here, before
/// there is light.
pub(crate) struct IntoFile<'a> {
    file: &'a File,
    scene: &'a Scene,
    layout: &'a Layout,
    pages: &'a Pages,
    extended: Extended,
    beside: Vec<Beside>,
    /// Its name, which the copy has too.
    name: String,
    /// Of what the file needs beside it, unless it goes into its binary part.
    buffer_name: String,
    preview_name: String,
    /// Of the pages.
    pictures: Vec<String>,
    errors: Vec<String>,
    pub warnings: Vec<String>,
}

impl<'a> IntoFile<'a> {
    pub(crate) fn new(folder: &Folder, file: &'a File, scene: &'a Scene, layout: &'a Layout, pages: &'a Pages) -> Result<IntoFile<'a>> {
        let [name, stem] =
            [file.path.file_name(), file.path.file_stem()].map(|part| part.unwrap_or_default().to_string_lossy().into_owned());
        let target = folder.path().join(&name);
        if matches!((target.canonicalize(), file.path.canonicalize()), (Ok(target), Ok(own)) if target == own) {
            let allowed = format!("holds the scene itself ({name}), which is never overwritten; name another folder");
            return Err(Error::setting("-o", folder.path().display(), allowed));
        }
        let beside = file.beside();
        let mut taken: HashSet<String> = beside.iter().map(|beside| beside.name.to_lowercase()).chain([name.to_lowercase()]).collect();
        let mut one = |ending: &str, extension: &str| {
            let wanted = format!("{stem}_{ending}");
            let name = names::stems([wanted.as_str()].into_iter(), &[extension], taken.clone()).remove(0) + extension;
            taken.insert(name.to_lowercase());
            name
        };
        let (preview_name, buffer_name) = (one("preview", ".glb"), one("lightmap", ".bin"));
        let are_alone =
            pages.sizes.len() == layout.objects.len() && pages.places.iter().enumerate().all(|(object, place)| place.page == object);
        let wanted = (0..pages.sizes.len()).map(|page| if are_alone { layout.objects[page].name.as_str() } else { "lightmap" });
        let stems = names::stems(wanted, &PAGE_ENDINGS, taken);
        let [pictures, errors] = PAGE_ENDINGS.map(|ending| stems.iter().map(|stem| format!("{stem}{ending}")).collect::<Vec<String>>());
        let extended = original::extended(file, scene, layout, pages, &pictures, &errors)?;
        let lost = beside.iter().filter_map(|beside| beside.content.as_ref().err());
        let lost = lost.map(|reason| format!("a file that the scene names {reason}: it is not copied"));
        let warnings = extended.warnings.iter().cloned().chain(lost).collect();
        Ok(IntoFile { file, scene, layout, pages, extended, beside, name, buffer_name, preview_name, pictures, errors, warnings })
    }

    /// Names of the files that may be written.
    pub(crate) fn names(&self, has_preview: bool) -> Vec<String> {
        let beside = self.beside.iter().map(|beside| &beside.name);
        let own = [&self.name, &self.buffer_name].into_iter().chain(has_preview.then_some(&self.preview_name));
        own.chain(beside).chain(&self.pictures).chain(&self.errors).cloned().collect()
    }

    /// Writes everything, or nothing. With `preview_exposure` also a copy for viewers that shows the radiance times that.
    pub(crate) fn write(self, folder: &Folder, maps: &[Map], preview_exposure: Option<f32>) -> Result<Vec<Written>> {
        let mut written = Vec::new();
        let mut say = |name: &str, purpose: String| written.push(Written { name: name.to_owned(), purpose });
        let mut files = Vec::new();
        // The new coordinates belong to single vertices, which compression would number anew.
        let unpacked = if self.file.is_unpacked { " its meshes no longer compressed," } else { "" };
        for (own, content) in original::files(self.file, &self.extended, &self.name, &self.buffer_name) {
            let purpose = match own == self.name {
                true => format!("your file,{unpacked} with lightmap coordinates; extras of nodes name the lightmap ({})", original::KEY),
                false => "the coordinates that were added to your file".to_owned(),
            };
            say(&own, purpose);
            files.push((own, content));
        }
        for (name, content) in self.beside.into_iter().filter_map(|beside| Some((beside.name, beside.content.ok()?))) {
            say(&name, "a copy of what your file needs".to_owned());
            files.push((name, content));
        }
        for (page, (picture, error)) in self.pictures.iter().zip(&self.errors).enumerate() {
            let objects: Vec<&Object> = self
                .pages
                .places
                .iter()
                .zip(&self.layout.objects)
                .filter(|(place, _)| place.page == page)
                .map(|(_, object)| object)
                .collect();
            let of = match objects[..] {
                [object] => format!("'{}'", object.name),
                _ => format!("{} objects", objects.len()),
            };
            say(picture, format!("irradiance of {of}, W/m2, linear: for engines"));
            say(error, "its standard error, W/m2; in the layer unseen the most that light which was not met may add".to_owned());
        }
        let preview = preview_exposure.map(|exposure| {
            say(&self.preview_name, "shows the baked light in any viewer; not for engines".to_owned());
            (self.preview_name.clone(), preview(self.scene, self.layout, maps, exposure))
        });
        let of_pages = self.pages.pictures(maps);
        let source = maps.first().map(|map| map.source).unwrap_or_default();
        let exrs = of_pages.iter().zip(self.pictures.iter().zip(&self.errors)).flat_map(|(page, (picture, error))| {
            let irradiance = colour::exr(page.width, page.height, &page.irradiance);
            [(picture.clone(), irradiance), (error.clone(), error_exr((page.width, page.height), &page.error, &page.unseen, source))]
        });
        write_all(files.into_iter().chain(exrs).chain(preview).map(|(name, content)| (folder.file(&name), content)))?;
        Ok(written)
    }
}

/// Standard errors, and in a layer what may be unseen.
fn error_exr(size: (u32, u32), errors: &[Vec3], unseen: &[Vec3], source: ErrorSource) -> Vec<u8> {
    let layer = |name: &str, values: &[Vec3]| exr_file::channels(name, ["R", "G", "B"], values.iter().copied());
    exr_file::encode_errors(size, [layer("", errors), layer("unseen", unseen)].into_iter().flatten().collect(), source)
}

/// A copy of a scene that shows the baked light in any viewer, as one `.glb` file.
pub(crate) fn preview(scene: &Scene, layout: &Layout, maps: &[Map], exposure: f32) -> Vec<u8> {
    let names = Names::new(scene, layout);
    let geometry = Geometry::new(scene, layout);
    let json = document::document(scene, layout, &geometry, &names, Kind::Radiance, |_| 1.0);
    let mut pictures: HashMap<String, Vec<u8>> = textures(scene).collect();
    for map in maps {
        let object = &layout.objects[map.object];
        pictures.insert(names.radiance(object.meshes[0]), radiance_png(scene, layout, object, map, exposure));
    }
    let mut file = Writer { json, bytes: geometry.file.bytes, ..Writer::default() };
    for image in 0..file.json["images"].as_array().map_or(0, Vec::len) {
        let picture = file.json["images"][image]["uri"].as_str().and_then(|name| pictures.get(name)).expect("every picture is there");
        let view = file.view(picture, None, None);
        file.json["images"][image] = json!({"bufferView": view, "mimeType": "image/png"});
    }
    file.json["buffers"] = json!([{"byteLength": file.bytes.len()}]);
    binary_file(&file.json, &file.bytes, &[])
}

/// What leaves the front of an object's texels, times the exposure, as sRGB.
fn radiance_png(scene: &Scene, layout: &Layout, object: &Object, map: &Map, exposure: f32) -> Vec<u8> {
    let values: Vec<Vec3> = object.meshes.iter().flat_map(|mesh| radiance(scene, layout.part(*mesh), map)).collect();
    colour::png(map.width, map.height, object.spread(&values).into_iter().map(|value| value * exposure))
}

/// Irradiance that is white in the map's linear PNG: the brightest, but for the brightest thousandth
/// of its texels. So a few caustic texels do not leave the rest a handful of 8-bit steps.
fn ceiling(map: &Map) -> f32 {
    let mut values: Vec<f32> =
        map.irradiance.iter().map(|value| value.max_element()).filter(|value| *value > 0.0 && value.is_finite()).collect();
    if values.is_empty() {
        return 1.0;
    }
    let place = values.len() - 1 - values.len() / 1000;
    *values.select_nth_unstable_by(place, f32::total_cmp).1
}

/// What leaves the front of every covered texel, W/m2/sr: irradiance by the base colour, and the emission.
/// For a glossy surface that is the mean over all directions.
fn radiance(scene: &Scene, lightmap: &MeshLightmap, map: &Map) -> Vec<Vec3> {
    let Material { base_colour, base_colour_texture, emission, emission_texture, .. } = scene.materials[lightmap.mesh.material];
    let radiance = lightmap.texels.iter().map(|texel| {
        let irradiance = map.irradiance[(texel.y * map.width + texel.x) as usize];
        let of_points = texel.points.iter().map(|point| {
            let colour = |texture: Option<TextureUse>| match texture {
                Some(used) => scene.textures[used.texture].sample(used.transform.apply(point.uv(&lightmap.mesh, used.uv_set))).truncate(),
                None => Vec3::ONE,
            };
            base_colour * point.colour(&lightmap.mesh).as_vec3() * colour(base_colour_texture) * irradiance / PI
                + emission * colour(emission_texture)
        });
        of_points.sum::<Vec3>() / texel.points.len() as f32
    });
    radiance.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_few_bright_texels_do_not_set_the_scale() {
        let mut irradiance = vec![Vec3::splat(2.0); 4000];
        irradiance[7] = Vec3::splat(500.0);
        let map =
            Map { object: 0, width: 40, height: 100, error: Vec::new(), unseen: Vec::new(), source: ErrorSource::default(), irradiance };
        assert_eq!(ceiling(&map), 2.0);
        assert_eq!(ceiling(&Map { irradiance: vec![Vec3::ZERO; 4], ..map.clone() }), 1.0);
        assert_eq!(ceiling(&Map { irradiance: vec![Vec3::new(0.5, 3.0, 0.0)], ..map }), 3.0);
    }
}
