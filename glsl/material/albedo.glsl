// Directional albedos, interpolated in a table (src/scene/albedo.rs).

layout(set = 0, binding = 20, scalar) readonly buffer Albedos { vec2 albedos[]; };

const uint ALBEDO_MEANS = ALBEDO_ROUGHNESSES * ALBEDO_COSINES;
const uint ALBEDO_PAIRS = ALBEDO_MEANS + ALBEDO_ROUGHNESSES;
const uint ALBEDO_SHEEN = ALBEDO_PAIRS + 2 * ALBEDO_ROUGHNESSES * ALBEDO_ROUGHNESSES;

vec2 between(vec2 a, vec2 b, float share)
{
    return a + share * (b - a);
}

// A row of the table, and how far it is to the next one.
struct Row {
    uint row;
    float share;
};

Row row_of(float alpha)
{
    float place = sqrt(clamp(alpha, 0.0, 1.0)) * float(ALBEDO_ROUGHNESSES - 1);
    uint row = min(uint(place), ALBEDO_ROUGHNESSES - 2);
    return Row(row, place - float(row));
}

vec2 albedo_of(uint first, float alpha, float cosine)
{
    Row row = row_of(alpha);
    float place = sqrt(clamp(cosine, 0.0, 1.0)) * float(ALBEDO_COSINES - 1);
    uint column = min(uint(place), ALBEDO_COSINES - 2);
    float share = place - float(column);
    uint at = first + row.row * ALBEDO_COSINES + column;
    vec2 low = between(albedos[at], albedos[at + 1], share);
    vec2 high = between(albedos[at + ALBEDO_COSINES], albedos[at + ALBEDO_COSINES + 1], share);
    return between(low, high, row.share);
}

// (A, B) of the guide's page on materials.
vec2 ggx_albedo(float alpha, float cosine)
{
    return albedo_of(0, alpha, cosine);
}

float sheen_albedo(float alpha, float cosine)
{
    return albedo_of(ALBEDO_SHEEN, alpha, cosine).x;
}

// Means of (A, B) over the hemisphere.
vec2 mean_albedo(float alpha)
{
    Row row = row_of(alpha);
    return between(albedos[ALBEDO_MEANS + row.row], albedos[ALBEDO_MEANS + row.row + 1], row.share);
}

// Means of the products (A A', A B'), or with `is_second` (B A', B B').
vec2 mean_products(float alpha, float other, bool is_second)
{
    Row row = row_of(alpha), column = row_of(other);
    uint at = ALBEDO_PAIRS + 2 * (row.row * ALBEDO_ROUGHNESSES + column.row) + uint(is_second);
    vec2 low = between(albedos[at], albedos[at + 2], column.share);
    at += 2 * ALBEDO_ROUGHNESSES;
    vec2 high = between(albedos[at], albedos[at + 2], column.share);
    return between(low, high, row.share);
}
