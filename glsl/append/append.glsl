// Contract of the ways to store a survivor; slots.glsl, and compact.glsl with atomic.glsl, ballot.glsl or
// group.glsl, define
//
//   uint incoming_count(uint bounce)
//       number of entries of `paths` that this bounce has to look at;
//   bool append_survivor(uint index, Photon photon, Path path, bool alive)
//       called once by every invocation in uniform control flow, dead lanes too. Stores the photon
//       in the photon map and its path among the outgoing ones when `alive`. Returns whether both
//       were stored; false for a live photon means that the photon map was full, nothing was
//       written, and the caller counts it as dropped.
//
// counters[0] is the length of the photon map, counters[1 + k] the number of paths entering bounce k.
// The first runs on when the map is full: readers take the smaller of counter and capacity.

layout(set = 1, binding = 3, scalar) buffer Counters { uint counters[]; };
