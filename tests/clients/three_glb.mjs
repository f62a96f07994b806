// Load a glb file with three.js' GLTFLoader and print where its joints are, as JSON.
//   node three_glb.mjs FOLDER_WITH_NODE_MODULES IN.glb
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { pathToFileURL } from "node:url";

const [folder, source] = process.argv.slice(2);
const from = createRequire(`${folder}/`);
const THREE = await import(pathToFileURL(from.resolve("three").replace("three.cjs", "three.module.js")));
const { GLTFLoader } = await import(pathToFileURL(from.resolve("three/examples/jsm/loaders/GLTFLoader.js")));

globalThis.self ??= globalThis; // the loader asks the browser for createImageBitmap
const data = readFileSync(source);
const gltf = await new GLTFLoader().parseAsync(data.buffer.slice(data.byteOffset, data.byteOffset + data.length), "");
const bones = [];
gltf.scene.traverse((node) => node.isBone && bones.push(node));
const [clip] = gltf.animations;
const mixer = new THREE.AnimationMixer(gltf.scene);
mixer.clipAction(clip).setLoop(THREE.LoopOnce).play().clampWhenFinished = true;
const times = clip.tracks[0].times;
const place = (bone) => new THREE.Vector3().setFromMatrixPosition(bone.matrixWorld).toArray();
const joints = Array.from(times, (time) => {
  mixer.setTime(time);
  gltf.scene.updateMatrixWorld(true);
  return bones.map(place);
});
console.log(JSON.stringify({ names: bones.map((bone) => bone.name), times: Array.from(times), joints, extras: gltf.asset.extras }));
