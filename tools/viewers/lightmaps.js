// Shows what `photonmill bake` wrote in three.js: the example of the guide.
import * as THREE from "three";
import { EXRLoader } from "three/addons/loaders/EXRLoader.js";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";

/** The scene of a baked file in a folder, its lightmaps on its materials. */
export async function load(folder, name) {
  const gltf = await new GLTFLoader().loadAsync(`${folder}/${name}`);
  const pictures = new Map();
  const lit = [];
  gltf.scene.traverse((node) => node.userData.photonmill_lightmap && lit.push(node));
  for (const node of lit) {
    // Of EXT_mesh_gpu_instancing: three.js draws all instances with one material, which has one lightmap.
    if (Array.isArray(node.userData.photonmill_lightmap)) {
      throw new Error(`node '${node.name}' has a lightmap for each of its instances, and this loader shows one a node: make the instances nodes of their own and bake again`);
    }
    const { irradiance, texCoord, offset, scale } = node.userData.photonmill_lightmap;
    if (!pictures.has(irradiance)) {
      pictures.set(irradiance, await new EXRLoader().setDataType(THREE.FloatType).loadAsync(`${folder}/${irradiance}`));
    }
    const map = pictures.get(irradiance).clone();
    map.channel = texCoord;
    // glTF counts v from above, this loader from below.
    map.repeat.set(scale[0], -scale[1]);
    map.offset.set(offset[0], 1 - offset[1]);
    // A node of several primitives is a group.
    for (const mesh of node.isMesh ? [node] : node.children.filter((child) => child.isMesh)) {
      mesh.material = mesh.material.clone();
      mesh.material.lightMap = map;
    }
  }
  // Their light is in the maps.
  gltf.scene.traverse((node) => node.isLight && (node.visible = false));
  return gltf;
}
