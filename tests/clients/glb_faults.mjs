// Check a glb file with Khronos' glTF validator and print its messages, as JSON.
//   node glb_faults.mjs FOLDER_WITH_NODE_MODULES IN.glb
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";

const [folder, source] = process.argv.slice(2);
const { validateBytes } = createRequire(`${folder}/`)("gltf-validator");
const { issues } = await validateBytes(new Uint8Array(readFileSync(source)));
console.log(JSON.stringify(issues.messages));
