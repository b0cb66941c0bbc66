// The part of a sky's picture that a pixel looks at. Where it has a peak that takes up little of the pixel, as a sun does, the rays of the
// pixel may all miss it. So each ray is joined by one that the table of the sky chooses among the cells in the pixel's window, and what both
// may find weighs by the density of both together (the balance heuristic, Veach 1997, section 9.2). Expects world/scene/sky.glsl.

// A direction is left to the pixel's own rays unless the table chooses it so many times as often.
const float PEAK = 4.0;
// Of light samples that the table of a sky chooses (Table::share in src/scene/sky_table.rs): skies with less have no peaks.
const float LEAST_PEAK_SHARE = 0.5;

struct SkyWindow {
    bool is_there;
    // Column and row of its cells.
    uvec2 first;
    uvec2 last;
    // The camera: where on its lens, how far off the plane that it sees sharply (1 without a lens), and its axes.
    vec3 start;
    float focus;
    vec3 forward;
    vec3 right;
    vec3 up;
    // In pixels.
    vec2 size;
    vec2 middle;
    float footprint;
};

// Set by kernels/camera_paths.comp alone.
SkyWindow window = SkyWindow(false, uvec2(0), uvec2(0), vec3(0.0), 1.0, vec3(0.0), vec3(0.0), vec3(0.0), vec2(1.0), vec2(0.0), 1.0);

float share_of_range(uint shares, uint first, uint last)
{
    return share_word(shares + last) - (first == 0 ? 0.0 : share_word(shares + first - 1));
}

// Density with which the table chooses a direction among the window's cells, 1/sr.
float window_density(Emitter sky, vec3 wi)
{
    TextureInfo table = textures[sky.triangle + 1];
    uvec2 cell = cell_at_place(table, place_in_sky(sky, wi));
    if (any(lessThan(cell, window.first)) || any(greaterThan(cell, window.last))) {
        return 0.0;
    }
    uint cells = first_cell_of(table, cell.y);
    float of_row = divide(share_at(table.first_texel, cell.y), share_of_range(table.first_texel, window.first.y, window.last.y));
    float of_cell = divide(share_at(cells, cell.x), share_of_range(cells, window.first.x, window.last.x));
    return divide(of_row * of_cell, solid_angle_of_cells(table, cell.y));
}

// Density of the pixel's rays, 1/sr, as filter_offsets() places them.
float pixel_density(vec3 wi)
{
    float ahead = dot(wi, window.forward);
    if (ahead <= 0.0) {
        return 0.0;
    }
    // To the plane that is seen sharply.
    float reach = divide(window.focus, ahead);
    vec3 way = divide(reach * wi + window.start, window.focus);
    vec2 picture = vec2(divide(dot(way, window.right), dot(window.right, window.right)), divide(dot(way, window.up), dot(window.up, window.up)));
    vec2 place = 0.5 * vec2(1.0 + picture.x, 1.0 - picture.y) * window.size;
    vec2 offset = divide(place - window.middle, window.footprint);
    float area = divide(4.0 * norm(window.right) * norm(window.up) * window.focus * window.focus * window.footprint * window.footprint,
                        window.size.x * window.size.y);
    return divide(filter_density(offset) * reach * reach, ahead * area);
}

// What the pixel's own rays count of the sky in a direction that they share with the window's.
float share_of_rays(Emitter sky, vec3 wi)
{
    float by_rays = pixel_density(wi), by_window = window_density(sky, wi);
    return by_window > PEAK * by_rays ? divide(by_rays, by_rays + by_window) : 1.0;
}
