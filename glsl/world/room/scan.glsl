// What builder/scan.glsl leaves for builder/scan_move.glsl beside the path, in which is all else of a photon.

layout(set = 1, binding = 6, scalar) buffer Weights { float weights[]; };

void leave_photon(uint index, bool stored, Photon photon)
{
    if (HAS_PHONG) {
        weights[index] = photon.weight;
    }
}

bool has_photon(uint index)
{
    return has_path(index);
}

Photon left_photon(uint index)
{
    PhotonState path = incoming_path(index);
    float weight = 1.0;
    if (HAS_PHONG) {
        weight = weights[index];
    }
    return Photon(path.position, path.wall, path.flux, weight, path.photon, push.bounce);
}
