// The order in which neighbouring invocations take pixels: tiles of 8 x 4, so that a subgroup's rays and lookups lie close
// together in both directions. A picture's last rows and columns, where no tile fits, are taken as they are.

// Pixel at `place` in that order; all places below width * height are all pixels.
uint pixel_in_tiles(uint place, uint width, uint height)
{
    uint band = place / (4 * width);
    uint rows = min(4, height - 4 * band);
    uint within = place - 4 * band * width;
    uint tile = within / (8 * rows);
    uint columns = min(8, width - 8 * tile);
    uint in_tile = within - 8 * rows * tile;
    return (4 * band + in_tile / columns) * width + 8 * tile + in_tile % columns;
}

// The same of visible points: sets of one a pixel, set after set. Receivers have an order of their own: their width is 0.
uint point_in_tiles(uint place, uint width, uint height, uint pixel_count)
{
    uint pixel = place % pixel_count;
    return width == 0 ? place : place - pixel + pixel_in_tiles(pixel, width, height);
}
