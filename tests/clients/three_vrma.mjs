// Load a VRM animation with @pixiv/three-vrm-animation and print its humanoid tracks, as JSON.
//   node three_vrma.mjs FOLDER_WITH_NODE_MODULES IN.vrma
// `above` holds the nearest bone over each bone, `places` where bones stand at rest: what an avatar needs to play it.
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { pathToFileURL } from "node:url";

const [folder, source] = process.argv.slice(2);
const from = createRequire(`${folder}/`);
const THREE = await import(pathToFileURL(from.resolve("three").replace("three.cjs", "three.module.js")));
const { GLTFLoader } = await import(pathToFileURL(from.resolve("three/examples/jsm/loaders/GLTFLoader.js")));
const vrm = pathToFileURL(from.resolve("@pixiv/three-vrm-animation").replace(/\.cjs$/, ".module.js"));
const { VRMAnimationLoaderPlugin } = await import(vrm);

globalThis.self ??= globalThis;
const data = readFileSync(source);
const loader = new GLTFLoader();
loader.register((parser) => new VRMAnimationLoaderPlugin(parser));
const gltf = await loader.parseAsync(data.buffer.slice(data.byteOffset, data.byteOffset + data.length), "");
const [animation] = gltf.userData.vrmAnimations;
const { rotation, translation } = animation.humanoidTracks;
const values = (tracks) => Object.fromEntries([...tracks].map(([bone, track]) => [bone, Array.from(track.values)]));

gltf.scene.updateMatrixWorld(true);
const { humanBones } = gltf.parser.json.extensions.VRMC_vrm_animation.humanoid;
const nodes = new Map();
for (const [bone, { node }] of Object.entries(humanBones)) nodes.set(await gltf.parser.getDependency("node", node), bone);
const above = {}, places = {};
for (const [node, bone] of nodes) {
  let parent = node.parent;
  while (parent && !nodes.has(parent)) parent = parent.parent;
  above[bone] = parent ? nodes.get(parent) : null;
  places[bone] = new THREE.Vector3().setFromMatrixPosition(node.matrixWorld).toArray();
}
console.log(JSON.stringify({
  rest: animation.restHipsPosition.toArray(),
  duration: animation.duration,
  rotation: values(rotation),
  translation: values(translation),
  times: Array.from(rotation.get("hips").times),
  above,
  places,
}));
