// The radius of a density estimate, by the point: each has a class for each map, and each class has half the radius of the one
// before it. src/engine/scene/radius_class.rs finds them in the first round.

// The class in the global map in bits 0 to 7, and in the caustic map in bits 8 to 15.
layout(set = 1, binding = 11, scalar) buffer RadiusClasses { uint radius_classes[]; };

const uint GLOBAL_CLASS = 0;
const uint CAUSTIC_CLASS = 8;

// `map` is GLOBAL_CLASS or CAUSTIC_CLASS.
uint radius_class(uint point, uint map)
{
    return (radius_classes[point] >> map) & 0xffu;
}

// `widest` is that of class 0.
float radius_of_class(float widest, uint own_class)
{
    float least = uintBitsToFloat((127u - LEAST_RADIUS_BITS) << 23);
    return max(widest * uintBitsToFloat((127u - own_class) << 23), least);
}
