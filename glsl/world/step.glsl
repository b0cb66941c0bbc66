// What became of a path at the next surface: step_path() of each world says it. `photon` is to be stored if `stored`, whatever
// became of its path. Expects the world's Photon.

struct Step {
    bool escaped;
    bool absorbed;
    bool stored;
    bool alive;
    Photon photon;
};
