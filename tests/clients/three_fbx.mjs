// Load an FBX file with three.js' FBXLoader and print where its joints are, as JSON, in the unit of the file.
//   node three_fbx.mjs FOLDER_WITH_NODE_MODULES IN.fbx
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { pathToFileURL } from "node:url";

const [folder, source] = process.argv.slice(2);
const from = createRequire(`${folder}/`);
globalThis.window ??= globalThis; // the loader makes a TextureLoader
globalThis.self ??= globalThis;
const THREE = await import(pathToFileURL(from.resolve("three").replace("three.cjs", "three.module.js")));
const { FBXLoader } = await import(pathToFileURL(from.resolve("three/examples/jsm/loaders/FBXLoader.js")));

const data = readFileSync(source);
const scene = new FBXLoader().parse(data.buffer.slice(data.byteOffset, data.byteOffset + data.length), "");
const bones = [];
scene.traverse((node) => node.isBone && bones.push(node));
const place = (bone) => new THREE.Vector3().setFromMatrixPosition(bone.matrixWorld).toArray();
scene.updateMatrixWorld(true);
const rest = bones.map(place);
const [clip] = scene.animations;
const mixer = new THREE.AnimationMixer(scene);
mixer.clipAction(clip).setLoop(THREE.LoopOnce).play().clampWhenFinished = true;
const times = Array.from(clip.tracks.reduce((a, b) => (b.times.length > a.times.length ? b : a)).times);
const joints = times.map((time) => {
  mixer.setTime(time);
  scene.updateMatrixWorld(true);
  return bones.map(place);
});
const meshes = [];
scene.traverse((node) => node.isSkinnedMesh && meshes.push(node.skeleton.bones.length));
console.log(JSON.stringify({ names: bones.map((bone) => bone.name), rest, times, joints, meshes }));
