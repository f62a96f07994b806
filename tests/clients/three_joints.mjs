// Load a BVH file with three.js' BVHLoader and print where its joints are, as JSON.
//   node three_joints.mjs FOLDER_WITH_NODE_MODULES IN.bvh
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { pathToFileURL } from "node:url";

const [folder, source] = process.argv.slice(2);
const from = createRequire(`${folder}/`);
const THREE = await import(pathToFileURL(from.resolve("three").replace("three.cjs", "three.module.js")));
const { BVHLoader } = await import(pathToFileURL(from.resolve("three/examples/jsm/loaders/BVHLoader.js")));

const { skeleton, clip } = new BVHLoader().parse(readFileSync(source, "utf8"));
const [root] = skeleton.bones;
const mixer = new THREE.AnimationMixer(root);
mixer.clipAction(clip).setLoop(THREE.LoopOnce).play().clampWhenFinished = true;
const bones = skeleton.bones.filter((bone) => bone.name !== "ENDSITE");
const times = clip.tracks[0].times;
const joints = Array.from(times, (time) => {
  mixer.setTime(time);
  root.updateMatrixWorld(true);
  return bones.map((bone) => new THREE.Vector3().setFromMatrixPosition(bone.matrixWorld).toArray());
});
console.log(JSON.stringify({ names: bones.map((bone) => bone.name), times: Array.from(times), joints }));
