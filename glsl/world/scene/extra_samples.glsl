// The samples that pixels of some tiles have on top. Of each pixel the first one and how many; then of no pixel the most that one has; then
// the pixel of each (src/plan/extra_samples.rs).
layout(set = 1, binding = 22, scalar) readonly buffer ExtraSamples { uint extra_samples[]; };

uint samples_of(uint pixel)
{
    return work.extra_samples == 0 ? work.samples : work.samples + extra_samples[2 * pixel + 1];
}

uint most_samples(uint pixel_count)
{
    return work.extra_samples == 0 ? work.samples : extra_samples[2 * pixel_count];
}

uint pixel_of_extra(uint extra, uint pixel_count)
{
    return extra_samples[2 * pixel_count + 2 + extra];
}

uint pixel_of_point(uint place, uint pixel_count)
{
    uint even = even_points(pixel_count);
    return place < even ? place % pixel_count : pixel_of_extra((place - even) % work.extra_samples, pixel_count);
}

// Where sample `number` of a pixel stands.
uint place_of_sample(uint pixel, uint number, uint pixel_count)
{
    if (number < work.samples) {
        return work.samples * pixel + number;
    }
    return work.samples * pixel_count + extra_samples[2 * pixel] + number - work.samples;
}

Sample even_sample(uint pixel, uint number)
{
    return Sample(work.samples * pixel + number, pixel, number, samples_of(pixel));
}

Sample extra_sample(uint extra, uint pixel_count)
{
    uint pixel = pixel_of_extra(extra, pixel_count);
    uint number = work.samples + extra - extra_samples[2 * pixel];
    return Sample(work.samples * pixel_count + extra, pixel, number, samples_of(pixel));
}
