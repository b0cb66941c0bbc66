// The sky as a pixel sees it straight, by the table of its picture (world/scene/sky_window.glsl). Expects the camera's chain.

// Cells of the table that lie where most of the pixel's rays go. Only how much noise is left depends on them.
void open_window(Emitter sky)
{
    TextureInfo table = textures[sky.triangle + 1];
    vec2 pixel = vec2(divide(1.0, window.size.x), divide(1.0, window.size.y));
    vec2 reach = window.footprint * pixel;
    if (FILTER == FILTER_BOX) {
        reach *= 0.5;
    }
    vec2 middle = window.middle * pixel;
    vec2 low = vec2(1.0), high = vec2(-1.0);
    vec2 centre = vec2(0.0);
    for (uint k = 0; k < 5; k++) {
        // The middle first, then the corners.
        vec2 corner = k == 0 ? vec2(0.0) : vec2((k & 1u) != 0 ? 1.0 : -1.0, k > 2 ? 1.0 : -1.0);
        vec2 at = middle + corner * reach;
        vec3 way = window.focus * (window.forward + (2.0 * at.x - 1.0) * window.right + (1.0 - 2.0 * at.y) * window.up) - window.start;
        vec2 place = place_in_sky(sky, normalize(way));
        centre = k == 0 ? place : centre;
        vec2 off = place - centre;
        off.x -= roundEven(off.x);
        low = min(low, off);
        high = max(high, off);
    }
    bool has_pole = high.x - low.x > 0.25;
    low += centre;
    high += centre;
    if (has_pole) {
        low.y = centre.y < 0.5 ? 0.0 : low.y;
        high.y = centre.y < 0.5 ? high.y : 1.0;
    }
    // Beyond the picture's left or right edge: all columns.
    bool is_whole = has_pole || low.x < 0.0 || high.x >= 1.0;
    window.first = cell_at_place(table, vec2(is_whole ? 0.0 : low.x, low.y));
    window.last = cell_at_place(table, vec2(is_whole ? 1.0 : high.x, high.y));
}

// One of the cumulative shares from `first` to `last`. Shares are whole multiples of 2^-24, and so is what chooses: each is as likely as its
// own says.
uint pick_within(uint shares, uint count, uint first, uint last, float u)
{
    float before = first == 0 ? 0.0 : share_word(shares + first - 1);
    float units = 16777216.0 * share_of_range(shares, first, last);
    float at = before + floor(u * units) * (1.0 / 16777216.0);
    return pick_share(shares, count, at);
}

// What is left of light along a direction that surfaces let pass straight: of paths that go_on.comp would go on with, nothing, as these
// count all that they meet.
vec3 passed_straight(vec3 position, vec3 direction)
{
    vec3 share = vec3(1.0);
    for (uint sheet = 0; sheet < CHAIN_STEPS; sheet++) {
        Hit hit = closest_hit(position, direction);
        if (hit.triangle == NONE) {
            return share;
        }
        Surface surface = surface_at(hit, -direction);
        vec3 passing = vec3(0.0);
        if (HAS_LAYERS && surface.kind == SURFACE_LAYERED) {
            passing = vec3(surface.scatters ? 0.0 : 1.0);
            if (HAS_PASSING) {
                passing = surface.scatters ? lobes_of(surface, -direction, index_ratio(surface, chain.media, 1)).passing : passing;
            }
        }
        share *= passing;
        if (largest(share) == 0.0) {
            return share;
        }
        position = offset_origin(surface.position, surface.error, surface.ng, direction);
    }
    return vec3(0.0);
}

// Adds what the window's ray finds to a path that has only started; from then on its own ray leaves that to it.
void see_peaks_of_sky(Emitter sky, vec3 eye, Draws draws, uint pixel, uint number)
{
    TextureInfo table = textures[sky.triangle + 1];
    vec3 u = stratified_at(number, pixel, WINDOW_BLOCK, draws), v = stratified_at(number, pixel, WINDOW_BLOCK + 1, draws);
    uint row = pick_within(table.first_texel, table.height, window.first.y, window.last.y, u.x);
    uint column = pick_within(first_cell_of(table, row), table.width, window.first.x, window.last.x, u.y);
    vec3 wi = direction_in_cell(sky, table, column, row, v.xy);
    float by_rays = pixel_density(wi), by_window = window_density(sky, wi);
    if (by_rays > 0.0 && by_window > PEAK * by_rays) {
        vec3 passed = passed_straight(eye, wi);
        add_emission(passed * sky_radiance(sky, wi) * divide(by_rays, by_rays + by_window));
    }
}
