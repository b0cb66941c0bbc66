// Which light a shadow ray asks: first a cluster of them, by what clusters did at points of a trial round about (plan::light_choice),
// then one of its lights, by power over squared distance (scene::light_tree).

// A node of the tree of lights (`scene::light_tree`): those within a sphere.
struct LightNode {
    vec3 centre;
    float radius_squared;
    // Share of all lights' power.
    float power;
    // Of its children, which lie side by side, the first; of a leaf `LIGHT_LEAF` and its emitter.
    uint child;
};

// A node of the tree of regions, in each of which shadow rays choose lights alike (`plan::light_choice`).
struct LightRegion {
    // 0 to 2: a coordinate of the position, 3 to 5: of the normal; `NONE`: a leaf.
    uint axis;
    float split;
    // Of what lies below `split`, after which comes what lies above; of a leaf its number.
    uint next;
};

layout(set = 0, binding = 10, scalar) readonly buffer LightNodes { LightNode light_nodes[]; };
layout(set = 0, binding = 11, scalar) readonly buffer LightRegions { LightRegion light_regions[]; };
// The number of clusters, as bits; then two rows of cumulative shares a region: of the clusters that the trial saw there, and of the
// others. Those of a row that has none are all 0.
layout(set = 0, binding = 12, scalar) readonly buffer LightShares { float light_shares[]; };

// A light, and the probability of this choice.
struct ChosenLight {
    uint emitter;
    float probability;
};

uint cluster_count()
{
    return floatBitsToUint(light_shares[0]);
}

// Where a row of a place's region begins.
uint row_of_shares(vec3 position, vec3 normal, bool is_seen)
{
    LightRegion region = light_regions[0];
    while (region.axis != NONE) {
        float at = region.axis < 3 ? position[region.axis] : normal[region.axis - 3];
        region = light_regions[region.next + uint(at >= region.split)];
    }
    return 1 + (2 * region.next + uint(!is_seen)) * cluster_count();
}

bool is_empty(uint row)
{
    return light_shares[row + cluster_count() - 1] == 0.0;
}

// No light is rarer than so at any node of the tree: what is far may be all that is in sight.
const float LEAST_SHARE = 1.0 / 64.0;

float light_importance(LightNode node, vec3 position)
{
    vec3 way = node.centre - position;
    return divide(node.power, max(max(dot(way, way), node.radius_squared), 1e-12));
}

// A light of a cluster, which was chosen with `probability`; `word` is random.
ChosenLight choose_within(uint cluster, float probability, vec3 position, uint word)
{
    ChosenLight chosen = ChosenLight(light_nodes[cluster].child, probability);
    while ((chosen.emitter & LIGHT_LEAF) == 0) {
        LightNode left = light_nodes[chosen.emitter];
        LightNode right = light_nodes[chosen.emitter + 1];
        float importance = light_importance(left, position);
        float share = divide(importance, importance + light_importance(right, position));
        // In steps that a random number has, so that the probability is that of the choice.
        share = clamp(roundEven(65536.0 * share) * (1.0 / 65536.0), LEAST_SHARE, 1.0 - LEAST_SHARE);
        word = mix32(word + 1);
        bool is_left = unit_float(word >> 8) < share;
        chosen.probability *= is_left ? share : 1.0 - share;
        chosen.emitter = is_left ? left.child : right.child;
    }
    chosen.emitter &= ~LIGHT_LEAF;
    return chosen;
}

// A light by the shares of a row; u and `word` are random.
ChosenLight choose_light(uint row, vec3 position, float u, uint word)
{
    uint low = 0;
    uint high = cluster_count() - 1;
    while (low < high) {
        uint middle = (low + high) / 2;
        if (light_shares[row + middle] > u) {
            high = middle;
        } else {
            low = middle + 1;
        }
    }
    float before = low == 0 ? 0.0 : light_shares[row + low - 1];
    return choose_within(low, light_shares[row + low] - before, position, word);
}
