// The order in which neighbouring invocations take pixels: blocks of 64 x 64, and in them tiles of 8 x 4, so that the rays and
// lookups of a subgroup and of its neighbours lie close together in both directions.

// A tile of a rectangle that is taken tile after tile: at the right and at the bottom they may be smaller.
struct Tile {
    uvec2 corner;
    uvec2 size;
    uint place; // within it
};

Tile tile_at(uint place, uvec2 size, uvec2 tile_size)
{
    uint band = place / (tile_size.y * size.x);
    uint rows = min(tile_size.y, size.y - tile_size.y * band);
    uint within = place - tile_size.y * band * size.x;
    uint number = within / (tile_size.x * rows);
    uint columns = min(tile_size.x, size.x - tile_size.x * number);
    return Tile(tile_size * uvec2(number, band), uvec2(columns, rows), within - tile_size.x * rows * number);
}

// Pixel at `place` in that order; all places below width * height are all pixels.
uint pixel_in_tiles(uint place, uint width, uint height)
{
    Tile block = tile_at(place, uvec2(width, height), uvec2(64));
    Tile tile = tile_at(block.place, block.size, uvec2(8, 4));
    uvec2 pixel = block.corner + tile.corner + uvec2(tile.place % tile.size.x, tile.place / tile.size.x);
    return pixel.y * width + pixel.x;
}

// The same of visible points: sets of one per pixel, set after set. Receivers have an order of their own: their width is 0; and so have extra
// samples.
uint point_in_tiles(uint place, uint width, uint height, uint pixel_count)
{
    if (width == 0 || place >= even_points(pixel_count)) {
        return place;
    }
    uint pixel = place % pixel_count;
    return place - pixel + pixel_in_tiles(pixel, width, height);
}
