//! Pictures that hold the maps: one per object, or pages of one size that objects share.

use glam::{DVec2, Vec3};
use guillotiere::{AtlasAllocator, size2};

use super::unwrap::PADDING;
use super::{Layout, MAX_SIDE, Map, Object};

/// More objects than that share pages unless the user says otherwise.
pub(crate) const MOST_PICTURES: usize = 8;
/// Smallest page, texels.
pub const MIN_PAGE: u32 = 64;

/// How maps are packed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Atlas {
    /// Each object has a picture.
    Off,
    /// Pages of this width and height, texels.
    Size(u32),
    /// `Off` for up to [`MOST_PICTURES`] objects, else one page, or several of [`MAX_SIDE`].
    Auto,
}

/// Which part of which page is whose map.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Pages {
    /// Width and height of each page, texels.
    pub sizes: Vec<[u32; 2]>,
    /// One an object.
    pub places: Vec<Place>,
    /// Free texels around maps, filled from them.
    margins: Vec<u32>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Place {
    pub page: usize,
    /// The map's first texel.
    pub x: u32,
    pub y: u32,
}

/// What the texels of a page hold.
pub(crate) struct PageTexels {
    pub width: u32,
    pub height: u32,
    pub irradiance: Vec<Vec3>,
    pub error: Vec<Vec3>,
    pub unseen: Vec<Vec3>,
}

impl Atlas {
    /// Longest side of a map that every page can hold.
    pub fn max_side(self) -> u32 {
        match self {
            Atlas::Off => MAX_SIDE,
            Atlas::Size(size) => size - 2 * PADDING,
            Atlas::Auto => MAX_SIDE - 2 * PADDING,
        }
    }
}

impl Pages {
    pub(crate) fn new(layout: &Layout, atlas: Atlas) -> Pages {
        let objects = &layout.objects;
        match atlas {
            Atlas::Size(size) => Pages::packed(objects, size),
            Atlas::Auto if objects.len() > MOST_PICTURES => {
                let mut size = MIN_PAGE;
                loop {
                    let needed: u64 = objects.iter().map(|object| u64::from(object.width) * u64::from(object.height)).sum();
                    let fits = objects.iter().all(|object| object.width.max(object.height) + 2 * PADDING <= size);
                    if size == MAX_SIDE {
                        return Pages::packed(objects, size);
                    }
                    if fits && needed <= u64::from(size) * u64::from(size) {
                        let pages = Pages::packed(objects, size);
                        if pages.sizes.len() == 1 {
                            return pages;
                        }
                    }
                    size *= 2;
                }
            }
            Atlas::Off | Atlas::Auto => Pages {
                sizes: objects.iter().map(|object| [object.width, object.height]).collect(),
                places: (0..objects.len()).map(|page| Place { page, x: 0, y: 0 }).collect(),
                margins: vec![0; objects.len()],
            },
        }
    }

    /// On as few pages as are found: the largest maps first, each on the first page that has room for it.
    fn packed(objects: &[Object], size: u32) -> Pages {
        // New charts have their free texels; those of a file may reach to the border of the map.
        let margins: Vec<u32> = objects.iter().map(|object| if object.set.is_some() { PADDING } else { 0 }).collect();
        let mut order: Vec<usize> = (0..objects.len()).collect();
        order.sort_by_key(|object| std::cmp::Reverse(objects[*object].width.max(objects[*object].height)));
        let mut pages: Vec<AtlasAllocator> = Vec::new();
        let mut places = vec![Place { page: 0, x: 0, y: 0 }; objects.len()];
        for object in order {
            let margin = margins[object];
            let wanted = size2((objects[object].width + 2 * margin) as i32, (objects[object].height + 2 * margin) as i32);
            let allocated = pages.iter_mut().enumerate().find_map(|(page, allocator)| Some((page, allocator.allocate(wanted)?)));
            let (page, found) = allocated.unwrap_or_else(|| {
                let mut allocator = AtlasAllocator::new(size2(size as i32, size as i32));
                let found = allocator.allocate(wanted).expect("no map is larger than a page");
                pages.push(allocator);
                (pages.len() - 1, found)
            });
            let corner = found.rectangle.min;
            places[object] = Place { page, x: corner.x as u32 + margin, y: corner.y as u32 + margin };
        }
        Pages { sizes: vec![[size; 2]; pages.len()], places, margins }
    }

    /// What takes coordinates of an object's set to those of its page: offset + scale * uv.
    pub(crate) fn transform(&self, layout: &Layout, object: usize) -> (DVec2, DVec2) {
        let Place { page, x, y } = self.places[object];
        let Object { width, height, offset, scale, .. } = layout.objects[object];
        let [page_width, page_height] = self.sizes[page].map(f64::from);
        let (size, page_size) = (DVec2::new(width.into(), height.into()), DVec2::new(page_width, page_height));
        ((DVec2::new(x.into(), y.into()) + offset * size) / page_size, scale * size / page_size)
    }

    /// The pages with the maps' values. What belongs to no map is black.
    pub(crate) fn pictures(&self, maps: &[Map]) -> Vec<PageTexels> {
        let blank = |[width, height]: &[u32; 2]| {
            let black = vec![Vec3::ZERO; *width as usize * *height as usize];
            PageTexels { width: *width, height: *height, irradiance: black.clone(), error: black.clone(), unseen: black }
        };
        let mut pictures: Vec<PageTexels> = self.sizes.iter().map(blank).collect();
        for map in maps {
            let Place { page, x, y } = self.places[map.object];
            let margin = self.margins[map.object];
            let picture = &mut pictures[page];
            for row in 0..map.height + 2 * margin {
                for column in 0..map.width + 2 * margin {
                    let of_map = |place: u32, side: u32| place.saturating_sub(margin).min(side - 1) as usize;
                    let from = of_map(row, map.height) * map.width as usize + of_map(column, map.width);
                    let to = (y - margin + row) as usize * picture.width as usize + (x - margin + column) as usize;
                    picture.irradiance[to] = map.irradiance[from];
                    (picture.error[to], picture.unseen[to]) = (map.error[from], map.unseen[from]);
                }
            }
        }
        pictures
    }
}
