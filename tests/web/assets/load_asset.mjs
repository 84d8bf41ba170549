// Modules of the page for tests without a browser. The files are ES modules named .js, which Node.js takes
// as such in a folder whose package.json says so.

import { cpSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";

const folder = mkdtempSync(join(tmpdir(), "abbe-page-"));
process.on("exit", () => rmSync(folder, { recursive: true, force: true }));
cpSync(fileURLToPath(new URL("../../../daemon/web/assets", import.meta.url)), folder, { recursive: true });
writeFileSync(join(folder, "package.json"), '{"type":"module"}');

/** The module `name` of daemon/web/assets, one that needs no document. */
export const loadAsset = (name) => import(pathToFileURL(join(folder, name)));
