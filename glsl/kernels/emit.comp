// Photons as lights emit them.
// Dispatched by src/engine/WORLD/trace.rs once a chunk, in the paper's box once a light and chunk. One thread = one photon.
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_scalar_block_layout : require

#include "world/WORLD/emit_kernel.glsl"

void main()
{
    uint index = invocation_index();
    if (index < photon_count()) {
        write_photon(index);
    }
}
